// Snippet: shadow volumes, from the lists of render/volume.rs to clip space.

// Vertices of a side: 6 under a point light; 3 under a directional one, whose extruded corners are all one point.
override SIDE_VERTICES: u32;
// Is the cap drawn the dark one, at infinity?
override IS_DARK: bool;

// Corner k of caster t is number 3 t + k; the last component is 1.
@group(1) @binding(0) var<storage, read> corners: array<vec4f>;
// Start and end (corners), instance, count.
@group(1) @binding(1) var<storage, read> sides: array<vec4u>;
// Caster, instance.
@group(1) @binding(2) var<storage, read> caps: array<vec2u>;

struct VolumeVertex {
    // Invariant: a light cap has the depth of the surface that it is.
    @builtin(position) @invariant clip: vec4f,
    @location(0) @interpolate(flat) caster: u32,
    // How often it counts.
    @location(1) @interpolate(flat) count: u32,
}

// Away from the light to infinity.
fn extruded(corner: vec4f, light: vec4f) -> vec4f {
    return vec4f(light.w * corner.xyz - light.xyz, 0.0);
}

// (end, start, extruded start), (end, extruded start, extruded end).
@vertex
fn vs_side(@builtin(vertex_index) vertex: u32) -> VolumeVertex {
    let side = sides[vertex / SIDE_VERTICES];
    let k = vertex % SIDE_VERTICES;
    let corner = corners[select(side.x, side.y, k == 0u || k == 3u || k == 5u)];
    let instance = instances[side.z];
    let is_extruded = k == 2u || k >= 4u;
    let p = select(corner, extruded(corner, instance.light), is_extruded);
    return VolumeVertex(instance.clip_from_unit * p, side.x / 3u, side.w);
}

@vertex
fn vs_cap(@builtin(vertex_index) vertex: u32) -> VolumeVertex {
    let cap = caps[vertex / 3u];
    let corner = corners[3u * cap.x + vertex % 3u];
    let instance = instances[cap.y];
    let p = select(corner, extruded(corner, instance.light), IS_DARK);
    return VolumeVertex(instance.clip_from_unit * p, cap.x, 1u);
}
