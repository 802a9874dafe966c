// Pass: the model, lit, with its shadows as `predicted_visibility` of the technique's snippet has them.

@vertex
fn vs_surface(vertex: Vertex, @builtin(instance_index) instance: u32) -> Surface {
    return surface_of(vertex, instance);
}

@fragment
fn fs_shaded(surface: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    if is_hole(surface) {
        discard;
    }
    let n_dot_l = lambert(surface, select(-1.0, 1.0, front));
    var direct = vec3f(0.0);
    if n_dot_l > 0.0 {
        direct = n_dot_l * predicted_visibility(surface);
    }
    return vec4f(lit_color(surface, direct), 1.0);
}

// R: the visibility where the side faces the light, mean of its channels; G: does it face the light; B: 1.
@fragment
fn fs_mask(surface: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    if is_hole(surface) {
        discard;
    }
    if !faces_light(surface, select(-1.0, 1.0, front)) {
        return vec4f(0.0, 0.0, 1.0, 1.0);
    }
    return vec4f(dot(predicted_visibility(surface), vec3f(1.0 / 3.0)), 1.0, 1.0, 1.0);
}
