// Snippet: where a fragment lies in the maps of a light.

// The light's matrices, [instance][face]: one face, or the six of a cube around a point light.
@group(2) @binding(0) var<storage, read> light_clip_from_unit: array<mat4x4f>;

// The face of the cube that a direction from the light goes through: +x -x +y -y +z -z.
fn face_of(direction: vec3f) -> u32 {
    let size = abs(direction);
    if size.x >= size.y && size.x >= size.z {
        return select(1u, 0u, direction.x > 0.0);
    }
    if size.y >= size.z {
        return select(3u, 2u, direction.y > 0.0);
    }
    return select(5u, 4u, direction.z > 0.0);
}

struct InView {
    uv: vec2f,
    depth: f32,
    face: u32,
    // Is it within the map's sides, and beyond its nearest depth? Elsewhere nothing casts.
    inside: bool,
}

fn in_light_view(surface: Surface) -> InView {
    let instance = instances[surface.instance];
    var matrix = surface.instance;
    var face = 0u;
    if POINT_LIGHT {
        face = face_of((instance.world_from_unit * vec4f(surface.p - instance.light.xyz, 0.0)).xyz);
        matrix = 6u * surface.instance + face;
    }
    let clip = light_clip_from_unit[matrix] * vec4f(surface.p, 1.0);
    let ndc = clip.xyz / clip.w;
    let uv = vec2f(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y);
    let inside = all(uv >= vec2f(0.0)) && all(uv <= vec2f(1.0)) && ndc.z >= 0.0;
    return InView(uv, ndc.z, face, inside);
}
