// Pass: the model with shadow planes whose coordinates are interpolated from the vertices. Under a directional light they
// are affine in the receiver, so that is exact; edges are hard.

// Most planes of a list; vertex_coordinates of Rust refuses longer ones.
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
    var coordinates: array<vec3f, MOST>;
    var slots: array<vec3u, MOST>;
    var count = 0u;
    for (var i = list.x; i < list.y && count < MOST; i += PLANE_TEXELS) {
        let slot = casting_texel(i + 3u);
        let plane = casting_plane(i);
        coordinates[count] = vec3f(dot(plane.a, p1), dot(plane.b, p1), dot(plane.s, p1) - plane.bias);
        slots[count] = slot.xyz;
        count++;
    }
    return Shadowed(
        surface.clip, surface.p, surface.geometric_normal, surface.shading_normal, surface.uv,
        vec3u(surface.material, instance, count),
        coordinates[0], coordinates[1], coordinates[2], coordinates[3],
        slots[0], slots[1], slots[2], slots[3],
    );
}

fn surface_of_shadowed(shadowed: Shadowed) -> Surface {
    return Surface(
        shadowed.clip, shadowed.p, shadowed.geometric_normal, shadowed.shading_normal, shadowed.uv,
        shadowed.numbers.x, 0u, shadowed.numbers.y, 0.0,
    );
}

// As `visibility` of planes.wgsl.
fn visibility_of(shadowed: Shadowed) -> f32 {
    let coordinates = array(shadowed.coordinates_0, shadowed.coordinates_1, shadowed.coordinates_2, shadowed.coordinates_3);
    let slots = array(shadowed.slot_0, shadowed.slot_1, shadowed.slot_2, shadowed.slot_3);
    var v = 1.0;
    for (var i = 0u; i < shadowed.numbers.z && v > 0.0; i++) {
        if coordinates[i].z > 0.0 && on_rectangle(coordinates[i].xy) {
            v *= 1.0 - sample(slot_of(vec4u(slots[i], 0u)), coordinates[i].xy);
        }
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
