// Snippet: what is constant over a frame.

// One pipeline for each kind of light: a point light follows its ray in every fragment.
override POINT_LIGHT: bool;

struct Frame {
    clip_from_unit: mat4x4f,
    // xyz: unit vector towards the light, or the light's position in unit space (POINT_LIGHT).
    light: vec4f,
    // Planes in `rectangles`: all.
    rectangle_count: u32,
    // Sections in `lists`, without the empty one behind them.
    section_count: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;

// Vector from p (unit space) towards the light; length 1 or the distance.
fn towards_light(p: vec3f) -> vec3f {
    if POINT_LIGHT {
        return frame.light.xyz - p;
    }
    return frame.light.xyz;
}
