// Snippet: the plane lookup, twin of solver/src/shade.rs, name for name (Coleman 2006, eq. 2-8, rearranged).

// |n.l| below which a plane casts nothing; shade::EDGE_ON.
override EDGE_ON: f32;

// The value from which a distance field blocks; plane::SDF_BORDER.
override SDF_BORDER: f32;

// Sections of an instance; an empty one for triangles that belong to none stands behind them.
override SECTIONS: u32;

// Texels of `casting`: an instance's, and those of a row of the texture.
override INSTANCE_TEXELS: u32;
override ROW_TEXELS: u32;

// What a distance field rises by from texel to texel; plane::SDF_PER_TEXEL.
override SDF_PER_TEXEL: f32;

// Least spread of a soft edge; shade::MIN_SPREAD.
override MIN_SPREAD: f32;

// Texels of a plane: 4, and one more where some plane lets light pass where it blocks. Without, visibility is one
// number.
override PLANE_TEXELS: u32;
override TINTED: bool = PLANE_TEXELS > 4u;

// Where an occluder texture lies in the atlas.
struct OccluderSlot {
    // x, y, width, height in texels.
    region: vec4f,
    layer: u32,
    channel: u32,
    // 0: coverage, 1: a distance field.
    encoding: u32,
}

// A plane that casts under this light. Directional light: the three rows of shade::PlaneRows, affine in the
// receiver. Point light: a and b are the edges' duals, affine in the crossing point, and s is the plane's equation
// (n, -n.o).
struct CastingPlane {
    a: vec4f,
    b: vec4f,
    s: vec4f,
    slot: OccluderSlot,
    bias: f32,
    // 0: receivers on both sides, 1: in front, 2: behind. Only point lights ask.
    side: u32,
    // How fast edges soften with the distance from the plane; only lights of some size ask.
    softening: f32,
}

// Texture coordinates of a crossing; `casts` is false where the ray misses the rectangle.
struct Crossing {
    ab: vec2f,
    casts: bool,
}

// What each instance reads under this light, INSTANCE_TEXELS each: a texel a section, where its planes start and
// end; then the planes, PLANE_TEXELS each, section by section.
@group(2) @binding(0) var casting: texture_2d<u32>;
@group(2) @binding(1) var occluders: texture_2d_array<f32>;
@group(2) @binding(2) var occluder_sampler: sampler;

// Texel number `i` of `casting`.
fn casting_texel(i: u32) -> vec4u {
    return textureLoad(casting, vec2u(i % ROW_TEXELS, i / ROW_TEXELS), 0);
}

fn slot_of(texel: vec4u) -> OccluderSlot {
    let region = vec4f(vec4u(texel.x & 0xffffu, texel.x >> 16u, texel.y & 0xffffu, texel.y >> 16u));
    return OccluderSlot(region, (texel.z & 0xffffu) >> 5u, (texel.z >> 3u) & 3u, (texel.z >> 2u) & 1u);
}

fn casting_plane(i: u32) -> CastingPlane {
    let slot = casting_texel(i + 3u);
    return CastingPlane(
        bitcast<vec4f>(casting_texel(i)),
        bitcast<vec4f>(casting_texel(i + 1u)),
        bitcast<vec4f>(casting_texel(i + 2u)),
        slot_of(slot),
        bitcast<f32>(slot.w),
        slot.z & 3u,
        // As many of its bits as fit: the upper half.
        bitcast<f32>(slot.z & 0xffff0000u),
    );
}

fn on_rectangle(ab: vec2f) -> bool {
    return all(ab >= vec2f(0.0)) && all(ab <= vec2f(1.0));
}

// Where the ray from p towards a directional light crosses the plane beyond its bias.
fn crossing(plane: CastingPlane, p: vec3f) -> Crossing {
    let p1 = vec4f(p, 1.0);
    let ab = vec2f(dot(plane.a, p1), dot(plane.b, p1));
    let s = dot(plane.s, p1);
    return Crossing(ab, s > plane.bias && on_rectangle(ab));
}

// The same for a point light at c: between p and c, beyond the bias, not edge-on; signs first, then the division.
fn crossing_point_light(plane: CastingPlane, c: vec3f, p: vec3f) -> Crossing {
    let to_light = c - p;
    let n_dot_d = dot(plane.s.xyz, to_light);
    let height = -dot(plane.s, vec4f(p, 1.0));
    let distance = length(to_light);
    let served = plane.side == 0u || (plane.side == 1u && n_dot_d < 0.0) || (plane.side == 2u && n_dot_d > 0.0);
    let ahead = height * n_dot_d > 0.0 && abs(height) < abs(n_dot_d);
    if !(served && ahead && abs(n_dot_d) >= EDGE_ON * distance) {
        return Crossing(vec2f(0.0), false);
    }
    let s = height / n_dot_d;
    let q1 = vec4f(p + s * to_light, 1.0);
    let ab = vec2f(dot(plane.a, q1), dot(plane.b, q1));
    return Crossing(ab, s * distance > plane.bias && on_rectangle(ab));
}

// The bilinear value at ab in 0..1, taps clamped to the region.
fn value(slot: OccluderSlot, ab: vec2f) -> f32 {
    let size = slot.region.zw;
    let texel = slot.region.xy + clamp(ab * size, vec2f(0.5), size - 0.5);
    let uv = texel / vec2f(textureDimensions(occluders));
    return textureSampleLevel(occluders, occluder_sampler, uv, slot.layer, 0.0)[slot.channel];
}

// How much of the light is blocked, 0..1: the value; of a distance field, whether that reaches its border.
fn sample(slot: OccluderSlot, ab: vec2f) -> f32 {
    let value = value(slot, ab);
    return select(value, f32(value >= SDF_BORDER), slot.encoding == 1u);
}

// The same with soft edges, `spread` to each side in units of a field's value, at any ab: beyond the centres of the
// outermost texels, and beyond the rectangle, a field goes on falling. The outermost texels are open: nothing is left
// of them where the field has fallen by the spread.
fn sample_soft(slot: OccluderSlot, ab: vec2f, spread: f32) -> f32 {
    if slot.encoding == 0u {
        return select(0.0, value(slot, ab), on_rectangle(ab));
    }
    let at = ab * slot.region.zw;
    let beyond = distance(at, clamp(at, vec2f(0.5), slot.region.zw - 0.5)) * SDF_PER_TEXEL;
    if !(beyond < spread) {
        return 0.0;
    }
    return smoothstep(SDF_BORDER - spread, SDF_BORDER + spread, value(slot, ab) - beyond);
}

// Spread of the edges at distance s from the plane.
fn spread(softening: f32, s: f32) -> f32 {
    return clamp(softening * s, MIN_SPREAD, SDF_BORDER);
}

// Share of a light that stands above the horizon of the surface itself; `sine` is that of the light's angular radius.
fn horizon(n_dot_l: f32, sine: f32) -> f32 {
    return smoothstep(-sine, sine, n_dot_l);
}

// The planes that a section of an instance reads: where they start and end in `casting`.
fn list_of(instance: u32, section: u32) -> vec2u {
    let first = instance * INSTANCE_TEXELS;
    let list = casting_texel(first + min(section, SECTIONS));
    return vec2u(list.x, list.y);
}

// What the plane at texel `i` leaves of the light v, per colour, where its texture blocks the share `blocked`.
fn dimmed(v: vec3f, i: u32, blocked: f32) -> vec3f {
    if TINTED {
        // The share of each linear colour that it takes, one byte each.
        return v * (1.0 - blocked * unpack4x8unorm(casting_texel(i + 4u).x).rgb);
    }
    return vec3f(v.x * (1.0 - blocked));
}

// Is something left of the light v?
fn is_left(v: vec3f) -> bool {
    return select(v.x > 0.0, any(v > vec3f(0.0)), TINTED);
}

// Predicted visibility, per colour, of a receiver at p that reads `list`, under a directional light: left as soon as
// nothing is left.
fn visibility(list: vec2u, p: vec3f) -> vec3f {
    var v = vec3f(1.0);
    for (var i = list.x; i < list.y && is_left(v); i += PLANE_TEXELS) {
        let plane = casting_plane(i);
        let hit = crossing(plane, p);
        if hit.casts {
            v = dimmed(v, i, sample(plane.slot, hit.ab));
        }
    }
    return v;
}

// The same with soft edges.
fn visibility_soft(list: vec2u, p: vec3f) -> vec3f {
    var v = vec3f(1.0);
    for (var i = list.x; i < list.y && is_left(v); i += PLANE_TEXELS) {
        let plane = casting_plane(i);
        let p1 = vec4f(p, 1.0);
        let s = dot(plane.s, p1);
        if s > plane.bias {
            let ab = vec2f(dot(plane.a, p1), dot(plane.b, p1));
            v = dimmed(v, i, sample_soft(plane.slot, ab, spread(plane.softening, s)));
        }
    }
    return v;
}

// The same as `visibility` under a point light at c.
fn visibility_point_light(list: vec2u, c: vec3f, p: vec3f) -> vec3f {
    var v = vec3f(1.0);
    for (var i = list.x; i < list.y && is_left(v); i += PLANE_TEXELS) {
        let plane = casting_plane(i);
        let hit = crossing_point_light(plane, c, p);
        if hit.casts {
            v = dimmed(v, i, sample(plane.slot, hit.ab));
        }
    }
    return v;
}
