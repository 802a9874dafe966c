// Pass: the depth of the casters as a light sees them. Depth alone; a fragment stage looks for holes.

// One caster pass: what the light's matrix makes of an instance.
@group(2) @binding(0) var<storage, read> clip_from_unit: array<mat4x4f>;

struct Depth {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec2f,
    @location(1) @interpolate(flat) material: u32,
}

@vertex
fn vs_depth(vertex: Vertex, @builtin(instance_index) instance: u32) -> Depth {
    return Depth(clip_from_unit[instance] * vec4f(vertex.p, 1.0), vertex.uv, vertex.material);
}

@fragment
fn fs_depth(depth: Depth) {
    if is_hole_at(depth.material, depth.uv) {
        discard;
    }
}
