// Snippet: where a fragment lies in the maps of a light.

// Sine of the angle between two directions of a plane in the map below which the plane is taken to be edge-on: f32 rounds
// the depth's slope away from there on.
const EDGE_ON_AREA: f32 = 1e-5;

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
    // Is it before the view, within the map's sides, and beyond its nearest depth? Elsewhere nothing casts.
    inside: bool,
}

// The row of light_clip_from_unit for a fragment in a face.
fn light_matrix(instance: u32, face: u32) -> mat4x4f {
    return light_clip_from_unit[select(instance, 6u * instance + face, POINT_LIGHT)];
}

fn in_light_view(surface: Surface) -> InView {
    let instance = instances[surface.instance];
    var face = 0u;
    if POINT_LIGHT {
        face = face_of((instance.world_from_unit * vec4f(surface.p - instance.light.xyz, 0.0)).xyz);
    }
    let clip = light_matrix(surface.instance, face) * vec4f(surface.p, 1.0);
    let ndc = clip.xyz / clip.w;
    let uv = vec2f(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y);
    let inside = clip.w > 0.0 && all(uv >= vec2f(0.0)) && all(uv <= vec2f(1.0)) && ndc.z >= 0.0;
    return InView(uv, ndc.z, face, inside);
}

// How the depth of a fragment's plane changes along u and v; 0 where the light sees the plane edge-on.
fn plane_slope(surface: Surface, view: InView) -> vec2f {
    let n = surface.geometric_normal;
    let axis = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(n.x) > 0.5);
    let tangent = normalize(cross(n, axis));
    let a = ndc_change(surface, view, tangent);
    let b = ndc_change(surface, view, cross(n, tangent));
    let area = a.x * b.y - a.y * b.x;
    let is_seen = abs(area) > EDGE_ON_AREA * length(a.xy) * length(b.xy);
    let slope = vec2f(a.z * b.y - b.z * a.y, a.x * b.z - b.x * a.z) / select(1.0, area, is_seen);
    return select(vec2f(0.0), slope * vec2f(2.0, -2.0), is_seen);
}

// What a step in unit space changes in normalised device coordinates, up to a positive factor.
fn ndc_change(surface: Surface, view: InView, step: vec3f) -> vec3f {
    let matrix = light_matrix(surface.instance, view.face);
    let w = (matrix * vec4f(surface.p, 1.0)).w;
    let ndc = vec3f(2.0 * view.uv.x - 1.0, 1.0 - 2.0 * view.uv.y, view.depth);
    let change = matrix * vec4f(step, 0.0);
    return (change.xyz - ndc * change.w) / w;
}
