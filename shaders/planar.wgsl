// Pass: casters flattened onto a plane (Blinn 1988). Where they fall is what counts: no colour.

@group(2) @binding(0) var<storage, read> flattened_from_unit: array<mat4x4f>;
// Its equation, world space, positive on the side of the light.
@group(2) @binding(1) var<uniform> receiver: vec4f;

// Everything that is linear in the caster's point is interpolated as that point is: the projection is one matrix.
struct Flattened {
    @builtin(position) clip: vec4f,
    // Of the caster over the receiver.
    @location(0) height: f32,
    @location(1) uv: vec2f,
    @location(2) @interpolate(flat) material: u32,
}

// Points beyond the light have a negative w there: the rasteriser clips them.
@vertex
fn vs_flattened(vertex: Vertex, @builtin(instance_index) instance: u32) -> Flattened {
    let p = vec4f(vertex.p, 1.0);
    let clip = frame.clip_from_world * (flattened_from_unit[instance] * p);
    let height = dot(receiver, instances[instance].world_from_unit * p);
    return Flattened(clip, height, vertex.uv, vertex.material);
}

// What lies on the receiver or behind it casts nothing there.
@fragment
fn fs_flattened(flattened: Flattened) {
    if flattened.height <= 0.0 || is_hole_at(flattened.material, flattened.uv) {
        discard;
    }
}
