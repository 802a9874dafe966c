// Technique: shadow planes with occluder textures (Coleman 2006).

fn predicted_visibility(surface: Surface) -> vec3f {
    let list = list_of(surface.instance, surface.section);
    if POINT_LIGHT {
        return vec3f(visibility_point_light(list, instances[surface.instance].light.xyz, surface.p));
    }
    return vec3f(visibility(list, surface.p));
}
