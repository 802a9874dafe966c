// Technique: shadow planes with occluder textures (Coleman 2006).

// Sine of a directional light's angular radius; 0: hard edges.
override LIGHT_SINE: f32;

fn predicted_visibility(surface: Surface) -> vec3f {
    let list = list_of(surface.instance, surface.section);
    let light = instances[surface.instance].light.xyz;
    if POINT_LIGHT {
        return visibility_point_light(list, light, surface.p);
    }
    if LIGHT_SINE > 0.0 {
        // Visibility is asked for only where the side that is drawn faces the light.
        let n_dot_l = abs(dot(surface.geometric_normal, light));
        return horizon(n_dot_l, LIGHT_SINE) * visibility_soft(list, surface.p);
    }
    return visibility(list, surface.p);
}
