// Snippet: what is constant over a frame.

// One pipeline for each kind of light: a point light has another direction in every fragment.
override POINT_LIGHT: bool;

struct Frame {
    clip_from_world: mat4x4f,
    // xyz: unit vector towards the light, or the light's position (POINT_LIGHT), world space.
    light: vec4f,
    // Where the camera stands, world space.
    eye: vec4f,
}

// A copy of the model. Its vertices are in unit space.
struct Instance {
    clip_from_unit: mat4x4f,
    world_from_unit: mat4x4f,
    // As the frame's, in the unit space of this instance.
    light: vec4f,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> instances: array<Instance>;

// Vector from p (unit space of the instance) towards the light; length 1 or the distance.
fn towards_light(instance: u32, p: vec3f) -> vec3f {
    if POINT_LIGHT {
        return instances[instance].light.xyz - p;
    }
    return instances[instance].light.xyz;
}
