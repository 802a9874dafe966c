//! Ray origins, degenerate input and cut-outs: what must never make a false shadow or lose a true one.

mod scenes;

use glam::{DQuat, DVec3, Vec2, Vec3};
use scenes::{Triangles, closed, cuboid, mapped, quad, receivers, soup, sphere, unit_vector};
use shadowfit_solver::{
    mesh::{Cutout, Mesh, MeshError, Sides, Soup},
    receivers::Receivers,
    sampling::uniform,
};
use std::sync::Arc;

fn turned(triangles: &Triangles) -> Triangles {
    let turn = DQuat::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 0.7);
    mapped(triangles, |p| turn * p)
}

/// A direction above the surface at receiver `i`: any, or grazing with n.l between 1e-6 and 1.
fn light_above(normal: Vec3, i: u64) -> Option<Vec3> {
    let any = unit_vector(61, i);
    let light = if i.is_multiple_of(2) {
        any
    } else {
        let cosine = 10f32.powf(-6.0 * uniform(62, i) as f32);
        (any.reject_from_normalized(normal).normalize() + normal * cosine).normalize()
    };
    let cosine = normal.dot(light);
    (cosine >= 1e-6).then_some(light)
}

/// How many of 100,000 (receiver, light) pairs are blocked, and the smallest n.l among all.
fn blocked_pairs(mesh: &Mesh, receivers: &Receivers) -> (usize, f32) {
    let (mut blocked, mut seen, mut least) = (0, 0, f32::INFINITY);
    for i in 0.. {
        let at = (i % receivers.points.len() as u64) as usize;
        let Some(light) = light_above(receivers.normals[at], i) else { continue };
        least = least.min(receivers.normals[at].dot(light));
        blocked += usize::from(mesh.is_blocked(receivers.origins[at], light));
        seen += 1;
        if seen == 100_000 {
            break;
        }
    }
    (blocked, least)
}

#[test]
fn convex_bodies_never_shadow_themselves() {
    let brick = cuboid(DVec3::ZERO, DVec3::new(1.0, 0.6, 0.3), 4);
    let far = |body: &Triangles| mapped(body, |p| p + DVec3::new(1e5, -3e4, 2e5));
    for (name, body) in [
        ("sphere", sphere(4)),
        ("box", brick.clone()),
        ("turned box", turned(&brick)),
        ("far sphere", far(&sphere(4))),
        ("far turned box", far(&turned(&brick))),
        ("flat box", turned(&cuboid(DVec3::ZERO, DVec3::new(1.0, 1e-3, 1.0), 4))),
        ("rod 1e4 : 1", turned(&cuboid(DVec3::ZERO, DVec3::new(1.0, 1e-4, 1e-4), 1))),
    ] {
        let mesh = closed(&body);
        let (blocked, least) = blocked_pairs(&mesh, &receivers(&mesh, 10_000, 7));
        assert_eq!(blocked, 0, "{name}");
        assert!(least < 2e-6, "{name}: grazing light was not tried, n.l >= {least}");
    }
}

#[test]
fn coplanar_and_doubled_shells_do_not_shadow_each_other() {
    // Two overlapping plates in one plane, cut differently, all seen from above.
    let low = quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0);
    let over = quad(DVec3::new(-0.7, 0.0, -0.3), DVec3::new(0.2, 0.0, 1.0), DVec3::new(1.1, 0.0, -0.1));
    let plates: Triangles = low.into_iter().chain(over).collect();
    for (name, body) in [("level", plates.clone()), ("turned", turned(&plates))] {
        let mesh = Mesh::new(&soup(&[(&body, Sides::Both)])).unwrap();
        let (blocked, _) = blocked_pairs(&mesh, &receivers(&mesh, 10_000, 7));
        assert_eq!(blocked, 0, "{name} coplanar plates");
    }
    // A shell and the same shell inside out: the inner one is hidden, the outer one lit.
    let shell = turned(&sphere(3));
    let inside_out: Triangles = shell.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let mesh = Mesh::new(&soup(&[(&shell, Sides::Front), (&inside_out, Sides::Front)])).unwrap();
    assert_eq!((mesh.triangle_count(), mesh.duplicates), (2 * shell.len(), 0));
    let receivers = receivers(&mesh, 10_000, 7);
    assert!(
        receivers.points.iter().zip(&receivers.normals).all(|(p, n)| p.dot(*n) > 0.0),
        "an inner receiver was kept"
    );
    assert_eq!(blocked_pairs(&mesh, &receivers).0, 0, "doubled shell");
}

/// Does the segment from `p` in direction `l` enter the axis-aligned box grown by `margin`?
fn enters(p: DVec3, l: DVec3, low: DVec3, high: DVec3, margin: f64) -> bool {
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let (a, b) = (low[axis] - margin - p[axis], high[axis] + margin - p[axis]);
        if l[axis] == 0.0 {
            if a > 0.0 || b < 0.0 {
                return false;
            }
        } else {
            let (t0, t1) = (a / l[axis], b / l[axis]);
            (near, far) = (near.max(t0.min(t1)), far.min(t0.max(t1)));
        }
    }
    near < far
}

#[test]
fn lights_in_the_plane_of_a_face_are_decided_as_a_slab_test_does() {
    let floor = quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0);
    let (low, high) = (DVec3::new(-0.25, 0.0, -0.3), DVec3::new(0.2, 0.6, 0.35));
    let block = cuboid(0.5 * (low + high), 0.5 * (high - low), 3);
    let mesh = Mesh::new(&soup(&[(&floor, Sides::Front), (&block, Sides::Front)])).unwrap();
    let receivers = receivers(&mesh, 4_000, 3);
    let (mut blocked, mut undecided) = (0, 0);
    for k in 0..64 {
        // Directions within the planes x = const and z = const: parallel to two faces of the block.
        let (sin, cos) = (std::f32::consts::PI * (k as f32 + 0.5) / 64.0).sin_cos();
        for light in [Vec3::new(0.0, sin, cos), Vec3::new(cos, sin, 0.0), Vec3::new(-0.0, sin, -cos)] {
            for (p, (origin, normal)) in receivers.points.iter().zip(receivers.origins.iter().zip(&receivers.normals)) {
                if normal.dot(light) <= 0.0 || normal.y < 0.5 {
                    continue;
                }
                let p_model = mesh.frame.model_from_unit(*p);
                // The floor and the top of the block; 1e-5 is far above the rounding of either test.
                let l = light.as_dvec3();
                let expected = p_model.y < 0.3 && enters(p_model, l, low, high, 0.0);
                if p_model.y < 0.3 && enters(p_model, l, low, high, 1e-5) != enters(p_model, l, low, high, -1e-5) {
                    undecided += 1;
                } else {
                    assert_eq!(mesh.is_blocked(*origin, light), expected, "{p_model} {light}");
                    blocked += usize::from(expected);
                }
            }
        }
    }
    assert!(blocked > 10_000 && undecided < 200, "{blocked} blocked, {undecided} undecided");
}

#[test]
fn degenerate_and_duplicate_triangles_are_dropped_and_counted() {
    let body = sphere(1);
    let mut triangles = body.clone();
    let [a, b, c] = body[5];
    // Turned corners are the same triangle, swapped ones are its back; lines and points have no area.
    triangles.extend([[b, c, a], [a, b, c], [a, c, b], [a, a, b], [a, a, a], [a, b, a.lerp(b, 0.5)]]);
    let mesh = closed(&triangles);
    assert_eq!(mesh.duplicates, 2);
    assert_eq!(mesh.triangle_count() + mesh.zero_area, body.len() + 4);
    assert!(mesh.zero_area >= 2, "{} without area", mesh.zero_area);
    assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
    let mut source = mesh.source.clone();
    source.sort_unstable();
    assert!(source.windows(2).all(|w| w[0] < w[1]), "each kept triangle has its own source");
    for (i, &s) in mesh.source.iter().enumerate() {
        assert_eq!(mesh.corners[i][0], mesh.frame.unit_from_model(triangles[s as usize][0]));
    }
}

#[test]
fn broken_soups_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut body = sphere(1);
        body[17][2].y = bad;
        assert_eq!(Mesh::new(&soup(&[(&body, Sides::Front)])).unwrap_err(), MeshError::NotFinite { triangle: 17 });
    }
    let empty = |zero_area, total| MeshError::Empty { zero_area, total };
    assert_eq!(Mesh::new(&Soup::default()).unwrap_err(), empty(0, 0));
    let points = vec![[DVec3::ONE; 3]; 2];
    assert_eq!(Mesh::new(&soup(&[(&points, Sides::Front)])).unwrap_err(), empty(2, 2));
    let line = vec![[DVec3::ZERO, DVec3::X, DVec3::X * 2.0]];
    assert_eq!(Mesh::new(&soup(&[(&line, Sides::Front)])).unwrap_err(), empty(1, 1));
}

/// Two columns, one row: the left texel is a hole.
fn half_hole(repeat: bool) -> Cutout {
    Cutout { width: 2, height: 1, alpha: vec![127, 128], cutoff: 127.5, repeat: [repeat, repeat] }
}

#[test]
fn cutouts_repeat_or_clamp() {
    for (u, repeated, clamped) in
        [(0.25, false, false), (0.75, true, true), (1.25, false, true), (-0.25, true, false), (-7.75, false, false)]
    {
        let uv = Vec2::new(u, 3.5);
        assert_eq!(half_hole(true).is_solid(uv), repeated, "repeat at u = {u}");
        assert_eq!(half_hole(false).is_solid(uv), clamped, "clamp at u = {u}");
    }
    // The far edge belongs to the last texel.
    assert!(half_hole(false).is_solid(Vec2::ONE));
}

#[test]
fn holes_let_light_through_and_receive_nothing() {
    // A plate whose texture runs once along x: open for x < 0, solid for x > 0.
    let plate = quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0);
    let mut scene = soup(&[(&plate, Sides::Both)]);
    scene.cutouts = vec![Arc::new(half_hole(false))];
    scene.cutout = vec![Some(0); 2];
    scene.cutout_uv =
        plate.iter().map(|c| c.map(|p| Vec2::new(0.5 * (p.x + 1.0) as f32, 0.5 * (p.z + 1.0) as f32))).collect();
    let mesh = Mesh::new(&scene).unwrap();
    let side = mesh.corners.iter().flatten().fold(0.0f32, |m, p| m.max(p.x));
    for i in 0..10_000 {
        let p = Vec3::new(side * (2.0 * uniform(71, i) as f32 - 1.0), 0.0, side * (2.0 * uniform(72, i) as f32 - 1.0));
        let direction = unit_vector(73, i);
        // Grazing rays and those at the hole's edge are decided by rounding.
        if direction.y.abs() < 1e-2 || p.x.abs() < 1e-4 || p.abs().max_element() > side - 1e-4 {
            continue;
        }
        let origin = p - direction * 0.5;
        assert_eq!(mesh.is_blocked(origin, direction), p.x > 0.0, "ray {i} at {p}");
        let hit = mesh.nearest(origin, direction, |_, _| true);
        assert_eq!(hit.is_some(), p.x > 0.0, "ray {i} at {p}");
    }
    let receivers = receivers(&mesh, 2_000, 1);
    assert!(receivers.points.len() > 900 && receivers.points.iter().all(|p| p.x >= -1e-6));
}
