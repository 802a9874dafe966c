// Technique: the light that arrives through transparent casters, as the volumes have left it for each pixel.

// Does the map hold logarithms?
override HAS_LOGARITHMS: bool;

// Colours: what passes; the last component: opaque casters.
@group(2) @binding(0) var arriving: texture_2d<f32>;

fn predicted_visibility(surface: Surface) -> vec3f {
    let light = textureLoad(arriving, vec2u(surface.clip.xy), 0);
    if light.a > 0.5 {
        return vec3f(0.0);
    }
    return select(light.rgb, exp(light.rgb), HAS_LOGARITHMS);
}

// A transparent surface, to be blended by its alpha.
@fragment
fn fs_blended(surface: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let direct = lambert(surface, select(-1.0, 1.0, front)) * predicted_visibility(surface);
    let alpha = materials[surface.material].base_color.a
        * textureSampleLevel(base_image, base_sampler, surface.uv, 0.0).a;
    return vec4f(lit_color(surface, direct), alpha);
}
