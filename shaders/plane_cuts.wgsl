// Pass: the model with its shadows, and lines where the shadow planes cut it (mode `planes`). One instance.

// Half the width of a cut's line, pixels.
const CUT_PX: f32 = 1.2;

// Shaded, with a line in a plane's colour where that plane cuts the surface.
@fragment
fn fs_plane_cuts(surface: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let p_per_x = dpdx(surface.p);
    let p_per_y = dpdy(surface.p);
    if is_hole(surface) {
        discard;
    }
    let n_dot_l = lambert(surface, select(-1.0, 1.0, front));
    var color = lit_color(surface, n_dot_l * predicted_visibility(surface));
    let p1 = vec4f(surface.p, 1.0);
    for (var i = 0u; i < arrayLength(&rectangles); i++) {
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
