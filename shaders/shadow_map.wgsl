// Technique: a shadow map (Williams 1978), filtered by comparison before averaging (Reeves, Salesin, Cook 1987).

// Texels along a side of the filter's kernel: 1 nearest, 2 bilinear, n the mean of (n - 1)^2 bilinear taps.
override KERNEL: u32;

@group(2) @binding(1) var map: texture_depth_2d_array;
// Linear, but nearest where the kernel is 1.
@group(2) @binding(2) var map_sampler: sampler_comparison;

// Share of the kernel's texels that are not nearer to the light than `depth`.
fn lit_share(uv: vec2f, face: u32, depth: f32) -> f32 {
    if KERNEL <= 2u {
        return textureSampleCompareLevel(map, map_sampler, uv, face, depth);
    }
    let texel = 1.0 / vec2f(textureDimensions(map));
    let first = -0.5 * f32(KERNEL - 2u);
    var sum = 0.0;
    for (var y = 0u; y < KERNEL - 1u; y++) {
        for (var x = 0u; x < KERNEL - 1u; x++) {
            let at = uv + (first + vec2f(f32(x), f32(y))) * texel;
            sum += textureSampleCompareLevel(map, map_sampler, at, face, depth);
        }
    }
    return sum / f32((KERNEL - 1u) * (KERNEL - 1u));
}

fn predicted_visibility(surface: Surface) -> vec3f {
    let view = in_light_view(surface);
    if !view.inside {
        return vec3f(1.0);
    }
    // Receivers beyond the last caster are as far as can be.
    return vec3f(lit_share(view.uv, view.face, min(view.depth, 1.0)));
}
