//! Lights and receivers: equal solid angles, equal areas, exposure, seeds.

mod scenes;

use glam::{DMat3, DVec3, Vec3};
use scenes::{closed, cuboid, mapped, quad, receivers, soup, sphere, unit_vector};
use shadowfit_solver::{
    lights::{LightDomain, angles, direction},
    mesh::{Mesh, Sides},
    receivers::{ReceiverOptions, sample},
    sampling::{barycentric, cosine_hemisphere, r2, uniform},
};
use std::collections::{BTreeMap, BTreeSet};

fn bits(v: Vec3) -> [u32; 3] {
    v.to_array().map(f32::to_bits)
}

fn cone(azimuth_deg: f32, elevation_deg: f32, half_deg: f32) -> LightDomain {
    let axis = direction(azimuth_deg.to_radians(), elevation_deg.to_radians());
    LightDomain::Cone { axis, half_angle_rad: half_deg.to_radians() }
}

/// Axis and cosine of the half angle.
fn extent(domain: LightDomain) -> (Vec3, f32) {
    match domain {
        LightDomain::Sphere => (Vec3::Y, -1.0),
        LightDomain::Hemisphere => (Vec3::Y, 0.0),
        LightDomain::Cone { axis, half_angle_rad } => (axis, half_angle_rad.cos()),
    }
}

fn domains() -> [LightDomain; 6] {
    [
        LightDomain::Sphere,
        LightDomain::Hemisphere,
        cone(0.0, 90.0, 30.0),
        cone(135.0, 20.0, 5.0),
        cone(-90.0, -90.0, 60.0),
        cone(10.0, 0.0, 180.0),
    ]
}

#[test]
fn lights_are_unit_vectors_in_their_domain() {
    for domain in domains() {
        let (axis, cos_half) = extent(domain);
        for (count, seed) in [(1, 0), (7, 1), (512, 2)] {
            let lights = domain.directions(count, seed);
            assert_eq!(lights.len(), count);
            for l in lights {
                assert!((l.length() - 1.0).abs() < 1e-6, "{domain:?}: {l} has length {}", l.length());
                // Rounding of the rotation: a few 1e-7.
                assert!(l.dot(axis) >= cos_half - 1e-6, "{domain:?}: {l} is outside");
                assert!(l.to_array().iter().all(|c| c.to_bits() != (-0.0f32).to_bits()), "{l} has a -0.0");
            }
        }
    }
}

#[test]
fn lights_have_equal_solid_angles() {
    let count = 2_000;
    for domain in domains() {
        let (axis, cos_half) = extent(domain);
        let lights = domain.directions(count, 9);
        let exact = std::f64::consts::TAU * (1.0 - f64::from(cos_half));
        assert!((domain.solid_angle() - exact).abs() < 1e-5, "{domain:?}");
        // First moment: the mean lies on the axis at (1 + cos h)/2. One light moves it by 1/count; the spiral's
        // ends leave a few of them unbalanced.
        let mean = lights.iter().map(|l| l.as_dvec3()).sum::<DVec3>() / count as f64;
        let expected = axis.as_dvec3() * (0.5 * (1.0 + f64::from(cos_half)));
        assert!(mean.distance(expected) < 5.0 / count as f64, "{domain:?}: mean {mean}, not {expected}");
        // Random caps inside hold their share: discrepancy of a Fibonacci lattice, about count^-3/4 = 0.3 %.
        for i in 0..100 {
            let cap_axis = unit_vector(5, i);
            let cos_cap = 0.5f32;
            let angle = cap_axis.dot(axis).clamp(-1.0, 1.0).acos() + cos_cap.acos();
            if cos_half > -0.999_99 && angle > cos_half.acos() {
                continue;
            }
            let share = lights.iter().filter(|l| l.dot(cap_axis) > cos_cap).count() as f64 / count as f64;
            let expected = std::f64::consts::TAU * 0.5 / exact;
            assert!((share - expected).abs() < 0.006, "{domain:?}: cap at {cap_axis} holds {share}, not {expected}");
        }
    }
    // Second moments of the sphere: a third each, nothing across.
    let lights = LightDomain::Sphere.directions(count, 3);
    let outer =
        lights.iter().map(|l| l.as_dvec3()).fold(DMat3::ZERO, |m, l| m + DMat3::from_cols(l * l.x, l * l.y, l * l.z));
    let error = outer * (1.0 / count as f64) - DMat3::from_diagonal(DVec3::splat(1.0 / 3.0));
    assert!(error.to_cols_array().iter().all(|e| e.abs() < 5.0 / count as f64), "{error}");
}

#[test]
fn seeds_repeat_and_do_not_share_directions() {
    for domain in domains() {
        let set = |seed| domain.directions(256, seed).into_iter().map(bits).collect::<BTreeSet<_>>();
        assert_eq!(domain.directions(256, 4), domain.directions(256, 4));
        let sets: Vec<_> = (0..8).map(set).collect();
        let all: BTreeSet<_> = sets.iter().flatten().collect();
        assert_eq!(all.len(), 8 * 256, "{domain:?}: two seeds share a direction");
    }
}

#[test]
fn domains_parse_or_say_why_not() {
    assert_eq!("sphere".parse(), Ok(LightDomain::Sphere));
    assert_eq!("hemisphere".parse(), Ok(LightDomain::Hemisphere));
    assert_eq!("cone:135, 20, 5".parse(), Ok(cone(135.0, 20.0, 5.0)));
    assert_eq!("cone:-400,-90,180".parse(), Ok(cone(-400.0, -90.0, 180.0)));
    for text in [
        "",
        "Sphere",
        "sphere ",
        "cone",
        "cone:",
        "cone:1,2",
        "cone:1,2,3,4",
        "cone:a,2,3",
        "cone:0,91,10",
        "cone:0,0,0",
        "cone:0,0,-5",
        "cone:0,0,181",
        "cone:nan,0,10",
        "cone:0,nan,10",
        "cone:0,0,nan",
        "cone:inf,0,10",
        "cone:0,0,inf",
    ] {
        let error = text.parse::<LightDomain>().expect_err(text);
        assert!(error.to_string().contains(&format!("'{text}'")), "{error}");
    }
}

#[test]
fn directions_and_angles_are_inverse() {
    assert!(direction(0.0, 0.0).distance(Vec3::Z) < 1e-7);
    assert!(direction(90f32.to_radians(), 0.0).distance(Vec3::X) < 1e-7);
    assert!(direction(0.3, 90f32.to_radians()).distance(Vec3::Y) < 1e-7);
    for i in 0..1_000 {
        let d = unit_vector(8, i);
        let (azimuth, elevation) = angles(d);
        // asin loses half the digits near the poles: sqrt(f32 eps) = 3.5e-4.
        assert!(direction(azimuth, elevation).distance(d) < 5e-4, "{d}");
    }
    assert!(angles(Vec3::new(0.0, 1.000_000_1, 0.0)).1.is_finite());
}

#[test]
fn triangle_and_hemisphere_samples_are_uniform() {
    let count = 4_096u64;
    let (mut corner_weights, mut cosines) = (Vec3::ZERO, 0.0);
    let normal = Vec3::new(0.36, -0.48, 0.8);
    for i in 0..count {
        let b = barycentric(r2(3, i));
        assert!(b.min_element() >= 0.0 && (b.element_sum() - 1.0).abs() < 1e-6, "{b}");
        corner_weights += b / count as f32;
        let d = cosine_hemisphere(normal, r2(4, i));
        assert!(d.dot(normal) >= -1e-6 && (d.length() - 1.0).abs() < 1e-6, "{d}");
        cosines += f64::from(d.dot(normal)) / count as f64;
    }
    // R2's error is about log(n)/n = 0.2 %; means are 1/3 per corner and 2/3 for the cosine-weighted cosine.
    assert!((corner_weights - 1.0 / 3.0).abs().max_element() < 2e-3, "{corner_weights}");
    assert!((cosines - 2.0 / 3.0).abs() < 2e-3, "{cosines}");
}

#[test]
fn receivers_are_proportional_to_area() {
    // An ellipsoid: triangles of many sizes, none hidden, each with its own normal.
    let mesh = closed(&mapped(&sphere(3), |p| p * DVec3::new(1.0, 0.37, 0.61)));
    let count = 20_000;
    let receivers = receivers(&mesh, count, 5);
    assert_eq!(receivers.points.len(), count, "nothing of a convex body is hidden");
    let total: f64 = mesh.areas.iter().map(|&a| f64::from(a)).sum();
    let mut found: BTreeMap<[u32; 3], (f64, f64)> = BTreeMap::new();
    for (normal, &area) in mesh.normals.iter().zip(&mesh.areas) {
        found.entry(bits(*normal)).or_default().0 += f64::from(area) / total * count as f64;
    }
    for normal in &receivers.normals {
        found.get_mut(&bits(*normal)).expect("the normal of a triangle").1 += 1.0;
    }
    assert_eq!(found.len(), mesh.triangle_count(), "normals tell the triangles apart");
    for (expected, count) in found.values() {
        // One receiver per equal share of the running area: whole shares are exact, the two at the ends may differ.
        assert!((count - expected).abs() < 2.0, "{count} receivers where {expected} belong");
    }
    let weight: f64 = receivers.weights.iter().map(|&w| f64::from(w)).sum();
    // Exposure of a convex body is 1 everywhere.
    assert!((weight / total - 1.0).abs() < 1e-5, "exposures average {}", weight / total);
    for (p, origin) in receivers.points.iter().zip(&receivers.origins) {
        assert!(p.distance(*origin) < 1e-5);
    }
}

#[test]
fn double_sided_plates_have_receivers_on_both_sides() {
    let plate = quad(DVec3::ZERO, DVec3::Z, DVec3::X);
    for (sides, below) in [(Sides::Front, 0), (Sides::Both, 500)] {
        let mesh = Mesh::new(&soup(&[(&plate, sides)])).unwrap();
        let receivers = receivers(&mesh, 1_000, 2);
        assert_eq!(receivers.normals.iter().filter(|n| n.y < 0.0).count(), below, "{sides:?}");
        assert_eq!(receivers.normals.len(), 1_000);
        let moved_out = |(p, (o, n)): (&Vec3, (&Vec3, &Vec3))| (*o - *p).dot(*n) > 0.0;
        assert!(receivers.points.iter().zip(receivers.origins.iter().zip(&receivers.normals)).all(moved_out));
    }
}

#[test]
fn hidden_surface_has_no_receivers_and_is_made_up_for() {
    let outer = cuboid(DVec3::ZERO, DVec3::ONE, 4);
    for (inner, sides) in [(0.5, Sides::Front), (0.9, Sides::Front), (0.9, Sides::Both)] {
        let inner = cuboid(DVec3::ZERO, DVec3::splat(inner), 4);
        let mesh = Mesh::new(&soup(&[(&outer, sides), (&inner, sides)])).unwrap();
        let receivers = receivers(&mesh, 3_000, 1);
        let half = mesh.corners.iter().flatten().fold(0.0f32, |m, p| m.max(p.x));
        for (p, n) in receivers.points.iter().zip(&receivers.normals) {
            assert!(p.abs().max_element() > 0.999 * half && p.dot(*n) > 0.0, "hidden receiver at {p}, normal {n}");
        }
        // A first draw that keeps 4/5 is enough; after a second one only the hidden share's noise is left.
        assert!((2_400..=3_300).contains(&receivers.points.len()), "{} receivers", receivers.points.len());
        let weight: f64 = receivers.weights.iter().map(|&w| f64::from(w)).sum();
        let area = 24.0 * f64::from(half * half);
        // Stratified by area in another order than the faces: well within 2 %.
        assert!((weight / area - 1.0).abs() < 0.02, "weight {weight}, visible area {area}");
    }
}

#[test]
fn exposure_of_a_half_open_corner_is_the_view_factor() {
    // A floor point at distance d from an infinite wall at right angles sees 1/2 (1 + ...) of the sky; a wall of
    // height h seen from a strip of floor at distance d hides (1 - d / sqrt(d^2 + h^2)) / 2 of it (2D view factor).
    let long = 200.0;
    let floor = quad(DVec3::new(0.0, 0.0, -long), DVec3::Z * 2.0 * long, DVec3::X * 2.0);
    let wall = quad(DVec3::new(0.0, 0.0, -long), DVec3::Y, DVec3::Z * 2.0 * long);
    let mesh = Mesh::new(&soup(&[(&floor, Sides::Front), (&wall, Sides::Front)])).unwrap();
    let receivers = sample(&mesh, &ReceiverOptions { count: 6_000, exposure_rays: 256, seed: 3 });
    let (mut traced, mut exact) = (0.0, 0.0);
    let total: f64 = mesh.areas.iter().map(|&a| f64::from(a)).sum();
    let share = total / receivers.points.len() as f64;
    for ((p, n), w) in receivers.points.iter().zip(&receivers.normals).zip(&receivers.weights) {
        let p = mesh.frame.model_from_unit(*p);
        if n.y > 0.5 && p.z.abs() < 0.8 * long {
            traced += f64::from(*w) / share;
            exact += 1.0 - 0.5 * (1.0 - p.x / (p.x * p.x + 1.0).sqrt());
        }
    }
    assert!(exact > 1_000.0 && (traced / exact - 1.0).abs() < 0.02, "traced {traced}, exact {exact}");
}

#[test]
fn receivers_repeat_with_the_seed_and_change_with_it() {
    let mesh = closed(&scenes::knot(48, 8));
    let one = receivers(&mesh, 2_000, 1);
    let again = receivers(&mesh, 2_000, 1);
    assert_eq!(
        (&one.points, &one.origins, &one.normals, &one.weights),
        (&again.points, &again.origins, &again.normals, &again.weights)
    );
    let points: BTreeSet<_> = one.points.iter().map(|p| bits(*p)).collect();
    let other = receivers(&mesh, 2_000, 2);
    assert_eq!(other.points.iter().filter(|p| points.contains(&bits(**p))).count(), 0);
    assert_ne!(uniform(1, 0).to_bits(), uniform(2, 0).to_bits());
}
