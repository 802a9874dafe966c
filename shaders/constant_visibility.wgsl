// Technique: the same visibility everywhere: 1 draws no shadow at all, 0 ambient light alone.

override VISIBILITY: f32;

fn predicted_visibility(surface: Surface) -> vec3f {
    return vec3f(VISIBILITY);
}
