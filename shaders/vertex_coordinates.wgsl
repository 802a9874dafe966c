// Pass: the model with shadow planes whose coordinates are interpolated from the vertices. Under a directional light they
// are affine in the receiver, so that is exact; edges are hard.

// Most planes of a list; MOST_AT_VERTICES of occluder_planes.rs.
const MOST: u32 = 4;

struct Shadowed {
    @builtin(position) @invariant clip: vec4f,
    @location(0) @interpolate(perspective, centroid) p: vec3f,
    @location(1) @interpolate(flat) geometric_normal: vec3f,
    @location(2) @interpolate(perspective, centroid) shading_normal: vec3f,
    @location(3) @interpolate(perspective, centroid) uv: vec2f,
    // Material, instance, planes.
    @location(4) @interpolate(flat) numbers: vec3u,
    // (a, b, s - bias) of each plane; nobody reads those beyond the number of planes.
    @location(5) @interpolate(perspective, centroid) coordinates_0: vec3f,
    @location(6) @interpolate(perspective, centroid) coordinates_1: vec3f,
    @location(7) @interpolate(perspective, centroid) coordinates_2: vec3f,
    @location(8) @interpolate(perspective, centroid) coordinates_3: vec3f,
    // The last texel of each, without its bias.
    @location(9) @interpolate(flat) slot_0: vec3u,
    @location(10) @interpolate(flat) slot_1: vec3u,
    @location(11) @interpolate(flat) slot_2: vec3u,
    @location(12) @interpolate(flat) slot_3: vec3u,
}

@vertex
fn vs_coordinates(vertex: Vertex, @builtin(instance_index) instance: u32) -> Shadowed {
    let surface = surface_of(vertex, instance);
    let list = list_of(instance, vertex.section);
    let p1 = vec4f(vertex.p, 1.0);
    var out: Shadowed;
    out.clip = surface.clip;
    out.p = surface.p;
    out.geometric_normal = surface.geometric_normal;
    out.shading_normal = surface.shading_normal;
    out.uv = surface.uv;
    var count = 0u;
    // The newest plane comes first, and the others move on: an index that differs by lane is slow in software.
    for (var i = list.x; i < list.y && count < MOST; i += PLANE_TEXELS) {
        let plane = casting_plane(i);
        out.coordinates_3 = out.coordinates_2;
        out.coordinates_2 = out.coordinates_1;
        out.coordinates_1 = out.coordinates_0;
        out.coordinates_0 = vec3f(dot(plane.a, p1), dot(plane.b, p1), dot(plane.s, p1) - plane.bias);
        out.slot_3 = out.slot_2;
        out.slot_2 = out.slot_1;
        out.slot_1 = out.slot_0;
        out.slot_0 = casting_texel(i + 3u).xyz;
        count++;
    }
    out.numbers = vec3u(surface.material, instance, count);
    return out;
}

fn surface_of_shadowed(shadowed: Shadowed) -> Surface {
    return Surface(
        shadowed.clip, shadowed.p, shadowed.geometric_normal, shadowed.shading_normal, shadowed.uv,
        shadowed.numbers.x, 0u, shadowed.numbers.y, 0.0,
    );
}

// As `visibility` of planes.wgsl.
fn visibility_of(shadowed: Shadowed) -> f32 {
    var rest = shadowed;
    var v = 1.0;
    for (var i = 0u; i < shadowed.numbers.z && v > 0.0; i++) {
        let c = rest.coordinates_0;
        if c.z > 0.0 && on_rectangle(c.xy) {
            v *= 1.0 - sample(slot_of(vec4u(rest.slot_0, 0u)), c.xy);
        }
        rest.coordinates_0 = rest.coordinates_1;
        rest.coordinates_1 = rest.coordinates_2;
        rest.coordinates_2 = rest.coordinates_3;
        rest.slot_0 = rest.slot_1;
        rest.slot_1 = rest.slot_2;
        rest.slot_2 = rest.slot_3;
    }
    return v;
}

// As fs_shaded and fs_mask of forward.wgsl.
@fragment
fn fs_coordinates_shaded(shadowed: Shadowed, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let surface = surface_of_shadowed(shadowed);
    if is_hole(surface) {
        discard;
    }
    var direct = lambert(surface, select(-1.0, 1.0, front));
    if direct > 0.0 {
        direct *= visibility_of(shadowed);
    }
    return vec4f(lit_color(surface, vec3f(direct)), 1.0);
}

@fragment
fn fs_coordinates_mask(shadowed: Shadowed, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let surface = surface_of_shadowed(shadowed);
    if is_hole(surface) {
        discard;
    }
    if !faces_light(surface, select(-1.0, 1.0, front)) {
        return vec4f(0.0, 0.0, 1.0, 1.0);
    }
    return vec4f(visibility_of(shadowed), 1.0, 1.0, 1.0);
}
