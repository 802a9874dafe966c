//! Baselines: planes that a scene dictates, and what all methods promise.

mod scenes;

use glam::{DVec3, Vec3};
use scenes::{closed, cuboid, knot, quad, soup};
use shadowfit_solver::{
    baselines::{Baseline, BaselineOptions},
    mesh::{Mesh, MeshError, Sides},
    plane::ShadowPlane,
};

const OPTIONS: BaselineOptions = BaselineOptions { count: 6, seed: 3, tolerance: 0.05 };

/// How far a plane is from where it should be: the sine of the angle between normals, and the distance of `p`.
fn distance(plane: &ShadowPlane, normal: Vec3, p: Vec3) -> (f32, f32) {
    let n = plane.normal();
    (n.cross(normal).length(), n.dot(p - plane.origin).abs())
}

/// Two plates one above the other, four triangles each, unit space.
fn two_plates() -> Result<Mesh, MeshError> {
    let plate = |y: f64| {
        let at = |x: f64, z: f64| DVec3::new(x, y, z);
        let parts = [(-1.0, -1.0), (0.0, -1.0)].map(|(x, z)| quad(at(x, z), DVec3::Z * 2.0, DVec3::X));
        parts.concat()
    };
    Mesh::new(&soup(&[(&plate(0.0), Sides::Both), (&plate(0.8), Sides::Both)]))
}

#[test]
fn a_box_has_six_billboards() {
    let half = DVec3::new(1.0, 0.7, 0.5);
    let mesh = closed(&cuboid(DVec3::ZERO, half, 4));
    let planes = Baseline::Billboard.planes(&mesh, &OPTIONS);
    assert_eq!(planes.len(), 6);
    for face in 0..6 {
        let normal = [DVec3::X, DVec3::Y, DVec3::Z][face / 2] * if face % 2 == 0 { 1.0 } else { -1.0 };
        let middle = mesh.frame.unit_from_model(normal * half);
        // A billboard stands for what is within the tolerance; over a face of half size 0.7 that is a sine of 0.14.
        let is_there = |plane: &&ShadowPlane| {
            let (sine, offset) = distance(plane, normal.as_vec3(), middle);
            sine < 0.14 && offset <= OPTIONS.tolerance
        };
        assert_eq!(planes.iter().filter(is_there).count(), 1, "face {face}: {planes:?}");
    }
}

#[test]
fn parallel_plates_are_found() -> Result<(), MeshError> {
    let mesh = two_plates()?;
    for method in [Baseline::Billboard, Baseline::Stochastic, Baseline::KMeans] {
        let planes = method.planes(&mesh, &BaselineOptions { count: 2, ..OPTIONS });
        assert_eq!(planes.len(), 2, "{method:?}");
        for y in [0.0, 0.8] {
            let middle = mesh.frame.unit_from_model(DVec3::new(0.0, y, 0.0));
            // k-means fits by least squares, exactly; the others within their tolerance.
            let close = if method == Baseline::KMeans { 1e-5 } else { OPTIONS.tolerance };
            let is_there = |plane: &&ShadowPlane| {
                let (sine, offset) = distance(plane, Vec3::Y, middle);
                sine <= 2.0 * close && offset <= close
            };
            assert_eq!(planes.iter().filter(is_there).count(), 1, "{method:?} at {y}: {planes:?}");
        }
    }
    Ok(())
}

#[test]
fn stochastic_planes_pass_through_triangles_that_face_them() {
    let mesh = closed(&knot(60, 12));
    let planes = Baseline::Stochastic.planes(&mesh, &OPTIONS);
    assert_eq!(planes.len(), 6);
    for plane in planes {
        let n = plane.normal();
        let crosses = |(corners, normal): (&[Vec3; 3], &Vec3)| {
            let heights = corners.map(|p| n.dot(p - plane.origin));
            let [least, most] =
                [heights.iter().copied().fold(f32::MAX, f32::min), heights.iter().copied().fold(f32::MIN, f32::max)];
            // Tilted by the tolerance at most, and through a point of it.
            least <= 1e-5 && most >= -1e-5 && n.cross(*normal).length() <= OPTIONS.tolerance
        };
        assert!(mesh.corners.iter().zip(&mesh.normals).any(crosses), "{plane:?}");
    }
}

#[test]
fn axes_pass_through_the_centre_and_random_planes_through_the_model() {
    let mesh = closed(&knot(60, 12));
    let axes = Baseline::Axes.planes(&mesh, &OPTIONS);
    assert_eq!(axes.len(), 3);
    for (plane, axis) in axes.iter().zip([Vec3::X, Vec3::Y, Vec3::Z]) {
        let (sine, offset) = distance(plane, axis, Vec3::ZERO);
        assert!(sine < 1e-6 && offset < 1e-6, "{plane:?}");
    }
    for plane in Baseline::Random.planes(&mesh, &OPTIONS) {
        let heights = || mesh.corners.iter().flatten().map(|p| plane.normal().dot(*p - plane.origin));
        assert!(heights().any(|h| h <= 1e-5) && heights().any(|h| h >= -1e-5), "{plane:?}");
    }
}

#[test]
fn all_methods_keep_their_promises() -> Result<(), MeshError> {
    for (name, mesh) in [("knot", closed(&knot(60, 12))), ("plates", two_plates()?)] {
        for method in Baseline::ALL {
            let place = |count, seed| method.planes(&mesh, &BaselineOptions { count, seed, ..OPTIONS });
            let planes = place(6, 3);
            assert_eq!(planes, place(6, 3), "{name}, {method:?}: the same input, other planes");
            assert!(!planes.is_empty() && planes.len() <= 6, "{name}, {method:?}");
            assert!(planes.iter().all(|plane| plane.origin.is_finite() && plane.normal() != Vec3::ZERO));
            if method.is_nested() {
                assert_eq!(place(2, 3), planes[..2], "{name}, {method:?}: the first two of six");
            }
        }
        for method in [Baseline::Stochastic, Baseline::Random] {
            let place = |seed| method.planes(&mesh, &BaselineOptions { seed, ..OPTIONS });
            assert_ne!(place(1), place(2), "{name}, {method:?}");
        }
    }
    Ok(())
}
