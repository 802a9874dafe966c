// Pass: silhouette points (Sen, Cammarano, Hanrahan 2003). Every texel that an edge of the silhouette crosses keeps one
// point of it; where several edges do, the one that is nearest to the light there.
//
// Texel k spans k to k + 1; its corners are the centres of texels k and k + 1 of the depth map.

struct SilhouetteEdge {
    // Ends. xy: in texels from the upper left corner of the map of points; z: depth as in the depth map.
    a: vec4f,
    b: vec4f,
}

@group(0) @binding(0) var<storage, read> edges: array<SilhouetteEdge>;
@group(0) @binding(1) var depth_map: texture_depth_2d;

// The rasteriser moves corners by up to this share of a texel: 4 bits behind the point at least.
const SNAP: f32 = 0.0625;

struct Widened {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) edge: u32,
}

// An edge as two triangles that hold the centre of every texel which it crosses: all points within half a texel of it,
// along both axes.
@vertex
fn vs_edge(@builtin(vertex_index) vertex: u32) -> Widened {
    let number = vertex / 6u;
    let corner = vertex % 6u;
    let edge = edges[number];
    let at_b = corner == 1u || corner == 2u || corner == 4u;
    let left = corner == 2u || corner == 4u || corner == 5u;
    let way = edge.b.xy - edge.a.xy;
    let size = length(way);
    var along = vec2f(1.0, 0.0);
    if size > 0.0 {
        along = way / size;
    }
    let half_width = 0.5 * (abs(along.x) + abs(along.y)) + SNAP;
    let normal = vec2f(-along.y, along.x);
    let p = select(edge.a.xy, edge.b.xy, at_b)
        + half_width * (select(-1.0, 1.0, at_b) * along + select(-1.0, 1.0, left) * normal);
    let ndc = 2.0 * p / vec2f(textureDimensions(depth_map)) - 1.0;
    return Widened(vec4f(ndc.x, -ndc.y, 0.5, 1.0), number);
}

struct Point {
    @builtin(frag_depth) depth: f32,
    @location(0) in_texel: vec4f,
}

// Where between a and b a function is zero that is f and g there; outside 0..1 if it is nowhere.
fn crossing(f: f32, g: f32) -> f32 {
    if f == g {
        return -1.0;
    }
    return f / (f - g);
}

fn is_inside(p: vec2f) -> bool {
    return all(p >= vec2f(0.0)) && all(p <= vec2f(1.0));
}

// Where along the edge its point lies, in a texel that spans 0..1; negative if the edge misses the texel. An end inside
// is the point. An edge without one that enters and leaves the texel crosses a diagonal, or both: then their middle.
fn point_along(a: vec2f, b: vec2f) -> f32 {
    if is_inside(a) {
        return 0.0;
    }
    if is_inside(b) {
        return 1.0;
    }
    let rising = crossing(a.y - a.x, b.y - b.x);
    let falling = crossing(a.x + a.y - 1.0, b.x + b.y - 1.0);
    let on_rising = rising >= 0.0 && rising <= 1.0 && is_inside(mix(a, b, rising));
    let on_falling = falling >= 0.0 && falling <= 1.0 && is_inside(mix(a, b, falling));
    if on_rising && on_falling {
        return 0.5 * (rising + falling);
    }
    if on_rising {
        return rising;
    }
    return select(-1.0, falling, on_falling);
}

@fragment
fn fs_point(@builtin(position) position: vec4f, @location(0) @interpolate(flat) number: u32) -> Point {
    let corner = vec2i(position.xy);
    let edge = edges[number];
    let along = point_along(edge.a.xy - vec2f(corner), edge.b.xy - vec2f(corner));
    let p = mix(edge.a.xyz, edge.b.xyz, along);
    // Behind all that the light sees at the four corners: hidden.
    let last = vec2i(textureDimensions(depth_map)) - 1;
    let farthest = max(
        max(textureLoad(depth_map, corner, 0), textureLoad(depth_map, min(corner + vec2i(1, 0), last), 0)),
        max(
            textureLoad(depth_map, min(corner + vec2i(0, 1), last), 0),
            textureLoad(depth_map, min(corner + vec2i(1, 1), last), 0),
        ),
    );
    if along < 0.0 || p.z > farthest {
        discard;
    }
    return Point(clamp(p.z, 0.0, 1.0), vec4f(p.xy - vec2f(corner), 0.0, 1.0));
}
