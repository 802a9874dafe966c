// Technique: a shadow map (Williams 1978), filtered by comparison before averaging (Reeves, Salesin, Cook 1987).

// Texels along a side of the filter's kernel: 1 nearest, 2 bilinear, n the mean of (n - 1)^2 bilinear taps.
override KERNEL: u32;

// The light's matrices, [instance][face]: one face, or the six of a cube around a point light.
@group(2) @binding(0) var<storage, read> light_clip_from_unit: array<mat4x4f>;
@group(2) @binding(1) var map: texture_depth_2d_array;
// Linear, but nearest where the kernel is 1.
@group(2) @binding(2) var map_sampler: sampler_comparison;

// The face of the cube that a direction from the light goes through: +x -x +y -y +z -z.
fn face_of(direction: vec3f) -> u32 {
    let size = abs(direction);
    if size.x >= size.y && size.x >= size.z {
        return select(1u, 0u, direction.x > 0.0);
    }
    if size.y >= size.z {
        return select(3u, 2u, direction.y > 0.0);
    }
    return select(5u, 4u, direction.z > 0.0);
}

// Share of the kernel's texels that are not nearer to the light than `depth`.
fn lit_share(uv: vec2f, face: u32, depth: f32) -> f32 {
    if KERNEL <= 2u {
        return textureSampleCompareLevel(map, map_sampler, uv, face, depth);
    }
    let texel = 1.0 / vec2f(textureDimensions(map));
    let first = -0.5 * f32(KERNEL - 2u);
    var sum = 0.0;
    for (var y = 0u; y < KERNEL - 1u; y++) {
        for (var x = 0u; x < KERNEL - 1u; x++) {
            let at = uv + (first + vec2f(f32(x), f32(y))) * texel;
            sum += textureSampleCompareLevel(map, map_sampler, at, face, depth);
        }
    }
    return sum / f32((KERNEL - 1u) * (KERNEL - 1u));
}

// Outside the map nothing casts.
fn predicted_visibility(surface: Surface) -> vec3f {
    let instance = instances[surface.instance];
    var matrix = surface.instance;
    var face = 0u;
    if POINT_LIGHT {
        face = face_of((instance.world_from_unit * vec4f(surface.p - instance.light.xyz, 0.0)).xyz);
        matrix = 6u * surface.instance + face;
    }
    let clip = light_clip_from_unit[matrix] * vec4f(surface.p, 1.0);
    let ndc = clip.xyz / clip.w;
    let uv = vec2f(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y);
    if any(uv < vec2f(0.0)) || any(uv > vec2f(1.0)) || ndc.z < 0.0 {
        return vec3f(1.0);
    }
    // Receivers beyond the last caster are as far as can be.
    return vec3f(lit_share(uv, face, min(ndc.z, 1.0)));
}
