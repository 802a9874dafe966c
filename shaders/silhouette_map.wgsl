// Technique: a shadow silhouette map (Sen, Cammarano, Hanrahan 2003): four depth tests at the corners of a texel of the
// map of points, and where they disagree, the one in whose skewed quadrant the fragment lies.

@group(2) @binding(1) var depth_map: texture_depth_2d_array;
// Where in its texel (0 to 1) the silhouette passes; the centre where none does. Texel k lies between the centres of
// texels k and k + 1 of the depth map.
@group(2) @binding(2) var points: texture_2d_array<f32>;

// The neighbours of a texel clockwise (v down), and the corners between each and the next.
const NEIGHBOURS = array<vec2i, 4>(vec2i(0, -1), vec2i(1, 0), vec2i(0, 1), vec2i(-1, 0));
const CORNERS = array<vec2i, 4>(vec2i(1, 0), vec2i(1, 1), vec2i(0, 1), vec2i(0, 0));

fn turn(a: vec2f, b: vec2f) -> f32 {
    return a.x * b.y - a.y * b.x;
}

// Does `v` lie between two directions, clockwise from the first? They may be more than half a turn apart.
fn is_between(first: vec2f, second: vec2f, v: vec2f) -> bool {
    if turn(first, second) >= 0.0 {
        return turn(first, v) >= 0.0 && turn(v, second) >= 0.0;
    }
    return !(turn(second, v) > 0.0 && turn(v, first) > 0.0);
}

// The silhouette point of a texel, in texels of the map.
fn silhouette_point(texel: vec2i, face: u32) -> vec2f {
    let last = vec2i(textureDimensions(points)) - 1;
    return vec2f(texel) + textureLoad(points, clamp(texel, vec2i(0), last), face, 0).xy;
}

// Does the light reach the fragment's plane there? None is nearer to the light, nor at the fragment.
fn is_lit(texel: vec2i, view: InView, slope: vec2f) -> bool {
    let at = (vec2f(texel) + 0.5) / vec2f(textureDimensions(depth_map));
    // Receivers beyond the last caster are as far as can be.
    let depth = clamp(view.depth + min(dot(slope, at - view.uv), 0.0), 0.0, 1.0);
    return depth <= textureLoad(depth_map, texel, view.face, 0);
}

// Which of the texel's corners has its quadrant around p: it is bounded by the lines from the texel's point to the
// points of its neighbours.
fn quadrant_of(texel: vec2i, face: u32, p: vec2f) -> u32 {
    let middle = silhouette_point(texel, face);
    var bound = silhouette_point(texel + NEIGHBOURS[0], face) - middle;
    for (var i = 0u; i < 3u; i++) {
        let next = silhouette_point(texel + NEIGHBOURS[i + 1u], face) - middle;
        if is_between(bound, next, p - middle) {
            return i;
        }
        bound = next;
    }
    return 3u;
}

fn predicted_visibility(surface: Surface) -> vec3f {
    let view = in_light_view(surface);
    if !view.inside {
        return vec3f(1.0);
    }
    let size = textureDimensions(depth_map).x;
    let p = view.uv * f32(size) - 0.5;
    let texel = clamp(vec2i(floor(p)), vec2i(0), vec2i(i32(size) - 2));
    let slope = plane_slope(surface, view);
    var lit: array<bool, 4>;
    var count = 0u;
    for (var i = 0u; i < 4u; i++) {
        lit[i] = is_lit(texel + CORNERS[i], view, slope);
        count += u32(lit[i]);
    }
    if count == 0u || count == 4u {
        return vec3f(f32(count / 4u));
    }
    return vec3f(f32(lit[quadrant_of(texel, view.face, p)]));
}
