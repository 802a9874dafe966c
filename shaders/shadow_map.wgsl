// Technique: a shadow map (Williams 1978), filtered by comparison before averaging (Reeves, Salesin, Cook 1987).

// Texels along a side of the filter's kernel: 1 nearest, 2 bilinear, n the mean of (n - 1)^2 bilinear taps.
override KERNEL: u32;

@group(2) @binding(1) var map: texture_depth_2d_array;
// Linear, but nearest where the kernel is 1.
@group(2) @binding(2) var map_sampler: sampler_comparison;

// Share of the kernel's texels in which the light reaches the fragment's plane: none is nearer to the light there, nor
// at the fragment.
fn lit_share(view: InView, slope: vec2f) -> f32 {
    let size = vec2f(textureDimensions(map));
    let taps = max(KERNEL, 2u) - 1u;
    // A tap is one texel, or the four around it.
    let width = select(1.0, 0.0, KERNEL == 1u);
    let nearest = dot(min(slope, vec2f(0.0)), vec2f(width)) / size.x;
    var sum = 0.0;
    for (var y = 0u; y < taps; y++) {
        for (var x = 0u; x < taps; x++) {
            let at = view.uv + (vec2f(f32(x), f32(y)) - 0.5 * f32(taps - 1u)) / size;
            let first = (floor(at * size - 0.5 * width) + 0.5) / size;
            let change = dot(slope, first - view.uv) + nearest;
            // Receivers beyond the last caster are as far as can be.
            let depth = clamp(view.depth + min(change, 0.0), 0.0, 1.0);
            sum += textureSampleCompareLevel(map, map_sampler, at, view.face, depth);
        }
    }
    return sum / f32(taps * taps);
}

fn predicted_visibility(surface: Surface) -> vec3f {
    let view = in_light_view(surface);
    if !view.inside {
        return vec3f(1.0);
    }
    return vec3f(lit_share(view, plane_slope(surface, view)));
}
