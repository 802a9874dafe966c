//! The CPU twin of the shader against the formula, evaluated directly in f64.

mod scenes;

use glam::{DVec3, Vec3};
use scenes::unit_vector;
use shadowfit_solver::{
    plane::{ActiveLists, BakedPlane, BakedSet, Encoding, OPAQUE, OccluderTexture, SDF_BORDER, ShadowPlane, Side},
    sampling::uniform,
    shade::{EDGE_ON, crossing, crossing_point_light, plane_rows, sample, visibility, visibility_point_light},
};

/// A random parallelogram in the unit ball whose edges are 0.2 to 1 long and at least 25 degrees apart.
fn random_plane(seed: u64) -> ShadowPlane {
    for k in 0.. {
        let edge = |j: u64| unit_vector(seed, 10 * k + j) * (0.2 + 0.8 * uniform(seed, 100 + 10 * k + j) as f32);
        let (u, v) = (edge(1), edge(2));
        if u.normalize().cross(v.normalize()).length() > 0.42 {
            return ShadowPlane { origin: edge(3), u, v };
        }
    }
    unreachable!("random edges are seldom parallel")
}

/// `(a, b, s)` by the formula of the module header.
fn exact(plane: &ShadowPlane, l: Vec3, p: Vec3) -> (f64, f64, f64) {
    let (o, u, v) = (plane.origin.as_dvec3(), plane.u.as_dvec3(), plane.v.as_dvec3());
    let (l, p) = (l.as_dvec3(), p.as_dvec3());
    let big_n = u.cross(v);
    let n = big_n.normalize();
    let s = n.dot(o - p) / n.dot(l);
    let q = p + s * l;
    let a = (q - o).dot(v.cross(big_n)) / big_n.length_squared();
    let b = (q - o).dot(big_n.cross(u)) / big_n.length_squared();
    (a, b, s)
}

fn full_texture(plane: ShadowPlane, side: Side) -> BakedPlane {
    let texture = OccluderTexture { width: 3, height: 3, encoding: Encoding::Coverage, texels: vec![255; 9] };
    BakedPlane { plane, texture, tint: OPAQUE, side, bias: 1e-3 }
}

#[test]
fn rows_follow_the_formula() {
    let mut worst = 0.0f64;
    for i in 0..2_000 {
        let (plane, l) = (random_plane(i), unit_vector(81, i));
        let n_dot_l = plane.normal().dot(l);
        let Some(rows) = plane_rows(&plane, Side::Both, l) else {
            assert!(n_dot_l.abs() < EDGE_ON, "plane {i} casts nothing at n.l = {n_dot_l}");
            continue;
        };
        for k in 0..10 {
            let p = unit_vector(82, 10 * i + k) * uniform(83, 10 * i + k) as f32;
            let (a, b, s) = exact(&plane, l, p);
            let found = [rows.a, rows.b, rows.s].map(|row| f64::from(row.dot(p.extend(1.0))));
            // n.l is off by 1e-7, which scales the crossing's distance by 1e-7/n.l; offsets in the plane are
            // measured in edges down to 0.2 sin 25 degrees.
            let tolerance = 3e-6 * (1.0 + a.abs().max(b.abs()).max(s.abs())) / f64::from(n_dot_l.abs());
            let error = (found[0] - a).abs().max((found[1] - b).abs()).max((found[2] - s).abs());
            assert!(error < tolerance, "plane {i}: {found:?} not {a}, {b}, {s} at n.l = {n_dot_l}");
            worst = worst.max(error / tolerance);
            let inside = s > 1e-3 && (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
            let near_border = [a, b, a - 1.0, b - 1.0, s - 1e-3].iter().any(|x| x.abs() < tolerance);
            if !near_border {
                assert_eq!(crossing(&rows, 1e-3, p).is_some(), inside, "plane {i}: {a}, {b}, {s}");
            }
        }
    }
    // The bound is not idle: what occurs comes near it.
    assert!(worst > 0.05, "largest error is {worst:e} of the tolerance");
}

#[test]
fn edge_on_and_broken_planes_cast_nothing() {
    let plane = ShadowPlane { origin: Vec3::new(-0.5, 0.0, -0.5), u: Vec3::Z, v: Vec3::X };
    assert!(plane.normal().distance(Vec3::Y) < 1e-7);
    for sign in [1.0, -1.0] {
        let at = |n_dot_l: f32| Vec3::new((1.0 - n_dot_l * n_dot_l).sqrt(), sign * n_dot_l, 0.0);
        for n_dot_l in [0.0, 1e-30, 1e-7, 0.9 * EDGE_ON] {
            assert_eq!(plane_rows(&plane, Side::Both, at(n_dot_l)), None, "n.l = {n_dot_l}");
        }
        assert!(plane_rows(&plane, Side::Both, at(1.1 * EDGE_ON)).is_some());
    }
    let nan = Vec3::new(0.0, f32::NAN, 0.0);
    let broken = [
        ShadowPlane { origin: nan, ..plane },
        ShadowPlane { u: nan, ..plane },
        ShadowPlane { v: nan, ..plane },
        ShadowPlane { v: plane.u, ..plane },
        ShadowPlane { u: Vec3::ZERO, ..plane },
        ShadowPlane { u: Vec3::splat(f32::INFINITY), ..plane },
    ];
    let (l, p) = (Vec3::Y, Vec3::new(0.0, -0.5, 0.0));
    for (k, plane) in broken.into_iter().enumerate() {
        let baked = [full_texture(plane, Side::Both)];
        let rows = [plane_rows(&plane, Side::Both, l)];
        assert_eq!(visibility(&baked, &rows, &[0], p).x, 1.0, "broken plane {k}");
        assert_eq!(visibility_point_light(&baked, &[0], p + l, p).x, 1.0, "broken plane {k}, point light");
    }
    // The sound plane does block there, and a broken light or receiver is lit.
    let baked = [full_texture(plane, Side::Both)];
    assert_eq!(visibility(&baked, &[plane_rows(&plane, Side::Both, l)], &[0], p).x, 0.0);
    assert_eq!(visibility(&baked, &[plane_rows(&plane, Side::Both, nan)], &[0], p).x, 1.0);
    assert_eq!(visibility(&baked, &[plane_rows(&plane, Side::Both, l)], &[0], nan).x, 1.0);
    assert_eq!(visibility_point_light(&baked, &[0], nan, p).x, 1.0);
}

#[test]
fn sides_and_bias_choose_the_receivers() {
    let plane = ShadowPlane { origin: Vec3::new(-0.5, 0.0, -0.5), u: Vec3::Z, v: Vec3::X };
    // (receiver height, light): in front of the normal +Y the light must be below.
    for (y, light, both, front, back) in [
        (0.5, -Vec3::Y, 0.0, 0.0, 1.0),
        (-0.5, Vec3::Y, 0.0, 1.0, 0.0),
        (0.5, Vec3::Y, 1.0, 1.0, 1.0),
        (-0.5, -Vec3::Y, 1.0, 1.0, 1.0),
        // Nearer than the bias of 1e-3, just beyond it, and on the plane itself.
        (9e-4, -Vec3::Y, 1.0, 1.0, 1.0),
        (1.1e-3, -Vec3::Y, 0.0, 0.0, 1.0),
        (0.0, -Vec3::Y, 1.0, 1.0, 1.0),
    ] {
        let p = Vec3::new(0.1, y, -0.2);
        for (side, expected) in [(Side::Both, both), (Side::Front, front), (Side::Back, back)] {
            let baked = [full_texture(plane, side)];
            let rows = [plane_rows(&plane, side, light)];
            assert_eq!(visibility(&baked, &rows, &[0], p).x, expected, "{side:?} y = {y} light {light}");
            assert_eq!(
                visibility_point_light(&baked, &[0], p + light * 5.0, p).x,
                expected,
                "{side:?} y = {y} point light"
            );
        }
    }
}

#[test]
fn far_point_lights_become_directional() {
    let distance = 1e4;
    let (mut crossed, mut differing) = (0, 0);
    for i in 0..4_000 {
        let baked = full_texture(random_plane(i), Side::Both);
        let (l, p) = (unit_vector(91, i), unit_vector(92, i) * uniform(93, i) as f32);
        let rows = plane_rows(&baked.plane, Side::Both, l);
        let directional = rows.and_then(|rows| crossing(&rows, baked.bias, p));
        let point = crossing_point_light(&baked, l * distance, p);
        match (directional, point) {
            (Some((a, b)), Some((c, d))) => {
                crossed += 1;
                // The light's direction differs by 1/distance; measured in edges of 0.2 sin 25 at n.l down to 0.002.
                let tolerance = (20.0 / distance + 1e-4) / baked.plane.normal().dot(l).abs();
                assert!((a - c).abs() < tolerance && (b - d).abs() < tolerance, "{i}: {a}, {b} and {c}, {d}");
            }
            (None, None) => {}
            _ => differing += 1,
        }
    }
    // Only crossings within about 1e-3 of the border or of the bias may differ.
    assert!(crossed > 100 && differing <= 4, "{crossed} crossed, {differing} differ");
}

#[test]
fn point_lights_follow_the_formula() {
    let mut crossed = 0;
    for i in 0..4_000 {
        let baked = full_texture(random_plane(i), Side::Both);
        let (c, p) = (unit_vector(94, i) * 1.2, unit_vector(95, i) * uniform(96, i) as f32);
        let to_light = (c - p).as_dvec3();
        let (a, b, s) = exact(&baked.plane, (c - p).normalize(), p);
        let n_dot_l = f64::from(baked.plane.normal().dot((c - p).normalize()).abs());
        let tolerance = 2e-5 / n_dot_l;
        let length = to_light.length();
        let borders = [a, b, a - 1.0, b - 1.0, s - 1e-3, s - length];
        if borders.iter().any(|x| x.abs() < tolerance) || n_dot_l < 2.0 * f64::from(EDGE_ON) {
            continue;
        }
        let inside = s > 1e-3 && s < length && (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
        let found = crossing_point_light(&baked, c, p);
        assert_eq!(found.is_some(), inside, "{i}: {a}, {b}, {s} of {length}");
        if let Some((fa, fb)) = found {
            crossed += 1;
            assert!((f64::from(fa) - a).abs() < tolerance && (f64::from(fb) - b).abs() < tolerance, "{i}");
        }
    }
    assert!(crossed > 100, "{crossed} crossed");
}

#[test]
fn samples_are_exact_at_centres_and_linear_between() {
    let (width, height) = (5, 3);
    let texels: Vec<u8> = (0..15).map(|i| (i * 53 % 256) as u8).collect();
    let texture = OccluderTexture { width, height, encoding: Encoding::Coverage, texels };
    let texel = |x: usize, y: usize| f32::from(texture.texels[y * width + x]) / 255.0;
    let centre = |x: f32, n: usize| (x + 0.5) / n as f32;
    for y in 0..height {
        for x in 0..width {
            let at = |dx: f32, dy: f32| sample(&texture, centre(x as f32 + dx, width), centre(y as f32 + dy, height));
            // Rounding of a and b: a few eps of 5 texels.
            assert!((at(0.0, 0.0) - texel(x, y)).abs() < 2e-6, "centre {x} {y}");
            let (right, below) = ((x + 1).min(width - 1), (y + 1).min(height - 1));
            assert!((at(0.5, 0.0) - 0.5 * (texel(x, y) + texel(right, y))).abs() < 2e-6, "right of {x} {y}");
            let four = texel(x, y) + texel(right, y) + texel(x, below) + texel(right, below);
            assert!((at(0.5, 0.5) - 0.25 * four).abs() < 2e-6, "corner of {x} {y}");
        }
    }
    // Clamped within half a texel of the border.
    assert_eq!(sample(&texture, 0.0, 0.0), texel(0, 0));
    assert_eq!(sample(&texture, 1.0, 1.0), texel(4, 2));
    assert_eq!(sample(&texture, 0.05, 1.0), texel(0, 2));
}

#[test]
fn planes_multiply() {
    let plane = ShadowPlane { origin: Vec3::new(-0.5, 0.0, -0.5), u: Vec3::Z, v: Vec3::X };
    let level = |value: u8, y: f32| {
        let mut baked = full_texture(ShadowPlane { origin: plane.origin + Vec3::Y * y, ..plane }, Side::Both);
        baked.texture.texels.fill(value);
        baked
    };
    let planes = [level(51, 0.0), level(102, 0.3), level(255, 0.6)];
    let l = DVec3::new(0.1, 1.0, 0.05).normalize().as_vec3();
    let rows: Vec<_> = planes.iter().map(|b| plane_rows(&b.plane, b.side, l)).collect();
    for (y, expected) in [(-0.2, 0.0), (0.1, 0.0), (0.7, 1.0)] {
        assert!((visibility(&planes, &rows, &[0, 1, 2], Vec3::Y * y).x - expected).abs() < 1e-6, "y = {y}");
    }
    let v = visibility(&planes, &rows, &[0, 1], Vec3::Y * -0.2).x;
    assert!((v - 0.8 * 0.6).abs() < 1e-6, "{v}");
    assert!((visibility_point_light(&planes, &[1, 0], l * 3.0, Vec3::Y * -0.2).x - 0.8 * 0.6).abs() < 1e-6);
}

/// A distance field is read as coverage and cut at its border, so it has no grey.
#[test]
fn a_distance_field_is_cut_at_its_border() {
    let texels: Vec<u8> = (0..15).map(|i| (i * 53 % 256) as u8).collect();
    let coverage = OccluderTexture { width: 5, height: 3, encoding: Encoding::Coverage, texels };
    let field = OccluderTexture { encoding: Encoding::Sdf, ..coverage.clone() };
    for i in 0..2_000 {
        let (a, b) = (uniform(71, i) as f32, uniform(72, i) as f32);
        let expected = f32::from(u8::from(sample(&coverage, a, b) >= SDF_BORDER));
        assert_eq!(sample(&field, a, b), expected, "{a}, {b}");
    }
    for (texel, open) in [(0, true), (127, true), (128, false), (255, false)] {
        assert_eq!(field.is_open(texel), open, "{texel}");
        let flat = OccluderTexture { texels: vec![texel; 15], ..field.clone() };
        assert_eq!(sample(&flat, 0.3, 0.6), f32::from(u8::from(!open)), "{texel}");
    }
}

#[test]
fn the_direction_nearest_to_the_light_picks_the_lists() {
    let lists = |first: u32| vec![vec![first], vec![]];
    let set = BakedSet { sections: vec![vec![0, 1, 2], vec![2]], ..BakedSet::default() };
    assert_eq!(set.lists(Vec3::Y), &set.sections);
    let directions = vec![Vec3::X, Vec3::Y, Vec3::X];
    let active = Some(ActiveLists { directions, lists: vec![lists(0), lists(1), lists(2)] });
    let set = BakedSet { active, ..set };
    assert_eq!(set.lists(Vec3::new(0.8, 0.6, 0.0)), &lists(0), "of two equal ones the first");
    assert_eq!(set.lists(Vec3::new(0.6, 0.8, 0.0)), &lists(1));
    assert_eq!(set.lists(Vec3::NEG_X), &lists(1));
}
