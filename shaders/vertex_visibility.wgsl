// Technique: visibility precomputed at the vertices, twin of solver/src/vertex_visibility.rs, name for name (Sloan,
// Kautz, Snyder 2002; bent normals: Landis 2002). No work per light, no pass.

// Each side of a vertex has a bent normal instead of harmonics.
override BENT_NORMAL: bool;
// Half the width of the border between light and shadow, in units of the prediction.
override EDGE: f32;

// Of each side that differs: the coefficients of the 16 harmonics, four rows; or one of the bent normal and the cosine of
// its cone's half-angle.
@group(2) @binding(0) var<storage, read> rows: array<vec4f>;
// Of each vertex: the number of its front and of its back.
@group(2) @binding(1) var<storage, read> sides: array<vec2u>;

// The real spherical harmonics of the bands 0 to 3 in a direction (unit), times coefficients.
fn by_harmonics(side: u32, l: vec3f) -> f32 {
    let ll = l * l;
    let y = array(
        vec4f(0.2820948, 0.4886025 * l.yzx),
        vec4f(1.0925484 * l.x * l.y, 1.0925484 * l.y * l.z, 0.31539157 * (3.0 * ll.z - 1.0), 1.0925484 * l.x * l.z),
        vec4f(
            0.5462742 * (ll.x - ll.y),
            0.5900436 * l.y * (3.0 * ll.x - ll.y),
            2.8906114 * l.x * l.y * l.z,
            0.4570458 * l.y * (5.0 * ll.z - 1.0),
        ),
        vec4f(
            0.37317633 * l.z * (5.0 * ll.z - 3.0),
            0.4570458 * l.x * (5.0 * ll.z - 1.0),
            1.4453057 * l.z * (ll.x - ll.y),
            0.5900436 * l.x * (ll.x - 3.0 * ll.y),
        ),
    );
    let first = 4u * side;
    return dot(rows[first], y[0]) + dot(rows[first + 1u], y[1])
        + dot(rows[first + 2u], y[2]) + dot(rows[first + 3u], y[3]);
}

// Above 1/2 where l (unit) lies in the side's cone, below outside.
fn by_cone(side: u32, l: vec3f) -> f32 {
    return 0.5 + dot(rows[side].xyz, l) - rows[side].w;
}

// Visibility is asked for only where the side that is drawn faces the light: that side is the vertex's.
@vertex
fn vs_vertex_visibility(
    vertex: Vertex,
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) instance: u32,
) -> Surface {
    var surface = surface_of(vertex, instance);
    let to_light = towards_light(instance, vertex.p);
    let front = dot(vertex.geometric_normal, to_light) > 0.0;
    let side = select(sides[index].y, sides[index].x, front);
    let l = normalize(to_light);
    if BENT_NORMAL {
        surface.at_vertex = by_cone(side, l);
    } else {
        surface.at_vertex = by_harmonics(side, l);
    }
    return surface;
}

fn sharpened(prediction: f32) -> f32 {
    return clamp(0.5 + (prediction - 0.5) / (2.0 * EDGE), 0.0, 1.0);
}

fn predicted_visibility(surface: Surface) -> vec3f {
    return vec3f(sharpened(surface.at_vertex));
}
