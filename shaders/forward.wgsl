// Pass: the model, lit, with its self-shadows. One draw, no shadow map.

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
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(perspective, centroid) p: vec3f,
    @location(1) @interpolate(flat) geometric_normal: vec3f,
    @location(2) @interpolate(perspective, centroid) shading_normal: vec3f,
    @location(3) @interpolate(perspective, centroid) uv: vec2f,
    @location(4) @interpolate(flat) material: u32,
    @location(5) @interpolate(flat) section: u32,
}

@vertex
fn vs_surface(vertex: Vertex) -> Surface {
    let clip = frame.clip_from_unit * vec4f(vertex.p, 1.0);
    let section = min(vertex.section, frame.section_count);
    return Surface(
        clip,
        vertex.p,
        vertex.geometric_normal,
        vertex.shading_normal,
        vertex.uv,
        vertex.material,
        section,
    );
}

// The opposite of Cutout::is_solid in solver/src/mesh.rs: nearest texel, so that holes are where the traced reference
// has them. By a load, since the GL backend allows an image one sampler.
fn is_hole(surface: Surface) -> bool {
    let material = materials[surface.material];
    let repeat = vec2<bool>(material.repeat_u == 1u, material.repeat_v == 1u);
    let uv = select(clamp(surface.uv, vec2f(0.0), vec2f(1.0)), fract(surface.uv), repeat);
    let size = textureDimensions(base_image);
    let texel = min(vec2u(uv * vec2f(size)), size - 1u);
    return textureLoad(base_image, texel, 0).a * material.base_color.a < material.alpha_cutoff;
}

// Does the side of the surface that is drawn face the light?
fn faces_light(surface: Surface, side: f32) -> bool {
    return dot(side * surface.geometric_normal, towards_light(surface.p)) > 0.0;
}

fn predicted_visibility(surface: Surface) -> f32 {
    if POINT_LIGHT {
        return visibility_point_light(surface.section, frame.light.xyz, surface.p);
    }
    return visibility(surface.section, surface.p);
}

// Linear Lambert colour; `side` is 1 for the front and -1 for the back.
fn shade(surface: Surface, side: f32) -> vec3f {
    let base = materials[surface.material].base_color.rgb
        * textureSampleLevel(base_image, base_sampler, surface.uv, 0.0).rgb;
    let n = side * normalize(surface.shading_normal);
    let n_dot_l = dot(n, normalize(towards_light(surface.p)));
    var direct = 0.0;
    if n_dot_l > 0.0 && faces_light(surface, side) {
        direct = n_dot_l * predicted_visibility(surface);
    }
    return base * (AMBIENT + DIFFUSE * direct);
}

@fragment
fn fs_shaded(surface: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    if is_hole(surface) {
        discard;
    }
    return vec4f(shade(surface, select(-1.0, 1.0, front)), 1.0);
}

@fragment
fn fs_mask(surface: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    if is_hole(surface) {
        discard;
    }
    if !faces_light(surface, select(-1.0, 1.0, front)) {
        return vec4f(0.0, 0.0, 1.0, 1.0);
    }
    return vec4f(predicted_visibility(surface), 1.0, 1.0, 1.0);
}

// Half the width of a cut's line, pixels.
const CUT_PX: f32 = 1.2;

// Shaded, with a line in a plane's colour where that plane cuts the surface.
@fragment
fn fs_planes(surface: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let p_per_x = dpdx(surface.p);
    let p_per_y = dpdy(surface.p);
    if is_hole(surface) {
        discard;
    }
    let side = select(-1.0, 1.0, front);
    var color = shade(surface, side);
    let p1 = vec4f(surface.p, 1.0);
    for (var i = 0u; i < frame.rectangle_count; i++) {
        let ab = vec2f(dot(rectangles[i].a, p1), dot(rectangles[i].b, p1));
        // How fast the distance to the plane grows on the screen: lines of one width at any angle.
        let n = rectangles[i].plane.xyz;
        let per_px = length(vec2f(dot(n, p_per_x), dot(n, p_per_y)));
        if abs(dot(rectangles[i].plane, p1)) < CUT_PX * per_px && all(ab >= vec2f(0.0)) && all(ab <= vec2f(1.0)) {
            color = rectangles[i].color.rgb;
        }
    }
    return vec4f(color, 1.0);
}
