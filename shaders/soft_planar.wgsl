// Technique: soft shadow on a flat receiver, averaged over samples of the light (Herf and Heckbert 1996).

// Samples of the light.
override SAMPLES: f32;

// How many samples are blocked.
@group(2) @binding(0) var blocked: texture_2d<f32>;
@group(2) @binding(1) var blocked_sampler: sampler;
// Rows 0 and 1: coordinates on the receiver.
@group(2) @binding(2) var<uniform> texture_from_world: mat4x4f;

fn predicted_visibility(surface: Surface) -> vec3f {
    let world = instances[surface.instance].world_from_unit * vec4f(surface.p, 1.0);
    let uv = (texture_from_world * world).xy;
    return vec3f(1.0 - textureSampleLevel(blocked, blocked_sampler, uv, 0.0).r / SAMPLES);
}
