// Snippet: a fragment of the model, and its shading given what the technique says of the light.

// Do the images of these materials cut holes? A software rasteriser pays for the look-up in every fragment.
override HAS_HOLES: bool = true;

override AMBIENT: f32;
override DIFFUSE: f32;

struct Material {
    base_color: vec4f,
    // Alpha below this is a hole; negative: no cut-out.
    alpha_cutoff: f32,
    // 1: texture coordinates repeat along u, along v; 0: they clamp.
    repeat_u: u32,
    repeat_v: u32,
}

@group(1) @binding(0) var<storage, read> materials: array<Material>;
@group(1) @binding(1) var base_image: texture_2d<f32>;
@group(1) @binding(2) var base_sampler: sampler;

struct Vertex {
    @location(0) p: vec3f,
    @location(1) geometric_normal: vec3f,
    @location(2) shading_normal: vec3f,
    @location(3) uv: vec2f,
    @location(4) material: u32,
    @location(5) section: u32,
}

// Centroid: with several samples a pixel's centre may lie off the triangle.
struct Surface {
    @builtin(position) @invariant clip: vec4f,
    @location(0) @interpolate(perspective, centroid) p: vec3f,
    @location(1) @interpolate(flat) geometric_normal: vec3f,
    @location(2) @interpolate(perspective, centroid) shading_normal: vec3f,
    @location(3) @interpolate(perspective, centroid) uv: vec2f,
    @location(4) @interpolate(flat) material: u32,
    @location(5) @interpolate(flat) section: u32,
    @location(6) @interpolate(flat) instance: u32,
    // What the technique's own vertex stage puts here.
    @location(7) @interpolate(perspective, centroid) at_vertex: f32,
}

// Invariant: passes that compare with the depth of an earlier one meet the same.
fn surface_of(vertex: Vertex, instance: u32) -> Surface {
    return Surface(
        instances[instance].clip_from_unit * vec4f(vertex.p, 1.0),
        vertex.p,
        vertex.geometric_normal,
        vertex.shading_normal,
        vertex.uv,
        vertex.material,
        vertex.section,
        instance,
        0.0,
    );
}

// The opposite of Cutout::is_solid in solver/src/mesh.rs: nearest texel, so that holes are where the traced reference
// has them. By a load, since the GL backend allows an image one sampler.
fn is_hole_at(number: u32, uv: vec2f) -> bool {
    let material = materials[number];
    let repeat = vec2<bool>(material.repeat_u == 1u, material.repeat_v == 1u);
    let inside = select(clamp(uv, vec2f(0.0), vec2f(1.0)), fract(uv), repeat);
    let size = textureDimensions(base_image);
    let texel = min(vec2u(inside * vec2f(size)), size - 1u);
    return textureLoad(base_image, texel, 0).a * material.base_color.a < material.alpha_cutoff;
}

fn is_hole(surface: Surface) -> bool {
    return HAS_HOLES && is_hole_at(surface.material, surface.uv);
}

// Does the side of the surface that is drawn face the light?
fn faces_light(surface: Surface, side: f32) -> bool {
    return dot(side * surface.geometric_normal, towards_light(surface.instance, surface.p)) > 0.0;
}

// n.l of the shading normal where the side that is drawn faces the light, else 0. `side` is 1 for the front and -1 for
// the back.
fn lambert(surface: Surface, side: f32) -> f32 {
    if !faces_light(surface, side) {
        return 0.0;
    }
    let n = side * normalize(surface.shading_normal);
    return max(0.0, dot(n, normalize(towards_light(surface.instance, surface.p))));
}

// Linear colour under the ambient light and `direct`, the share of the direct light that arrives times n.l.
fn lit_color(surface: Surface, direct: vec3f) -> vec3f {
    let base = materials[surface.material].base_color.rgb
        * textureSampleLevel(base_image, base_sampler, surface.uv, 0.0).rgb;
    return base * (AMBIENT + DIFFUSE * direct);
}
