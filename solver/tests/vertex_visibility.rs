//! Harmonics against closed forms; visibility of vertices where the sky's shape is known.

mod scenes;

use glam::{DVec3, Vec3};
use scenes::{PLATE_SCENE, knot, plate_over_ground, quad, soup, unit_vector};
use shadowfit_solver::{
    harmonics::{COUNT, harmonics},
    lights::LightDomain,
    mesh::{Mesh, Sides},
    vertex_visibility::{SideVisibility, VertexSide, VisibilityOptions, precompute, sharpened},
};
use std::f64::consts::PI;

/// Directions of the quadratures. Cells have 6.3e-4 steradians and are 0.025 wide: 250 lie on the border of a half-space,
/// each wrong by up to half of itself in either sense, together about sqrt(250) * 0.3 * 6.3e-4.
const QUADRATURE: usize = 20_000;
const QUADRATURE_ERROR: f64 = 4e-3;

/// Coefficients of a function of direction.
fn projected(f: impl Fn(Vec3) -> f64) -> [f64; COUNT] {
    let directions = LightDomain::Sphere.directions(QUADRATURE, 3);
    let share = 4.0 * PI / QUADRATURE as f64;
    let mut sums = [0.0; COUNT];
    for direction in directions {
        let value = f(direction) * share;
        sums.iter_mut().zip(harmonics(direction)).for_each(|(sum, y)| *sum += value * f64::from(y));
    }
    sums
}

fn one(mesh: &Mesh, p_model: DVec3, normal: Vec3) -> SideVisibility {
    let side = VertexSide { p: mesh.frame.unit_from_model(p_model), normal };
    precompute(mesh, &[side], &VisibilityOptions { directions: 4096, seed: 1 }).distinct[0]
}

#[test]
fn harmonics_are_orthonormal() {
    for i in 0..COUNT {
        for (j, product) in projected(|d| f64::from(harmonics(d)[i])).into_iter().enumerate() {
            let expected = f64::from(u8::from(i == j));
            assert!((product - expected).abs() < QUADRATURE_ERROR, "{i} {j}: {product}");
        }
    }
}

/// The step over a half-space has the zonal coefficients sqrt(pi), sqrt(3 pi) / 2, 0, -sqrt(7 pi) / 8 about its axis; about
/// another axis n, by the addition theorem, each is times Y_lm(n) sqrt(4 pi / (2l + 1)).
#[test]
fn a_half_space_has_the_coefficients_of_the_closed_form() {
    let zonal = [PI.sqrt(), (3.0 * PI).sqrt() / 2.0, 0.0, -(7.0 * PI).sqrt() / 8.0];
    for axis in [Vec3::Z, Vec3::X, Vec3::NEG_Y, unit_vector(5, 0), unit_vector(5, 1)] {
        let found = projected(|d| f64::from(u8::from(d.dot(axis) > 0.0)));
        for (i, (found, y)) in found.iter().zip(harmonics(axis)).enumerate() {
            let band = (i as f64).sqrt() as usize;
            let expected = zonal[band] * f64::from(y) * (4.0 * PI / (2 * band + 1) as f64).sqrt();
            assert!((found - expected).abs() < QUADRATURE_ERROR, "{axis} {i}: {found}, expected {expected}");
        }
    }
}

#[test]
fn open_sides_see_everything_to_the_horizon() {
    let mesh = Mesh::new(&plate_over_ground()).expect("a scene");
    let top = one(&mesh, DVec3::new(0.1, PLATE_SCENE[2], -0.2), Vec3::Y);
    assert_eq!(top.accessibility, 1.0);
    assert!(top.bent_normal.distance(Vec3::Y) < 0.01, "{top:?}");
    for l in LightDomain::Hemisphere.directions(100, 2) {
        assert!((top.by_harmonics(l) - 1.0).abs() < 1e-5, "{l}: {}", top.by_harmonics(l));
        assert!(top.by_cone(l) > 0.49, "{l}: {}", top.by_cone(l));
    }
}

/// Straight under the middle of a square plate of half size a at height a: the plate covers 4 asin(1/2) = 2 pi / 3 of the
/// 2 pi above, and its edges lie at 45 degrees.
#[test]
fn a_vertex_under_a_plate_sees_past_its_edges() {
    let mesh = Mesh::new(&plate_over_ground()).expect("a scene");
    let under = one(&mesh, DVec3::ZERO, Vec3::Y);
    assert!((under.accessibility - 2.0 / 3.0).abs() < 0.005, "{under:?}");
    assert!(under.bent_normal.distance(Vec3::Y) < 0.01, "{under:?}");
    for azimuth in 0..8u8 {
        let (sin, cos) = (f32::from(azimuth) * 0.7).sin_cos();
        let at = |degrees: f32| {
            let (s, c) = degrees.to_radians().sin_cos();
            under.by_harmonics(Vec3::new(s * sin, c, s * cos))
        };
        assert!(at(0.0) < 0.05 && at(25.0) < 0.3, "{azimuth}: {} {}", at(0.0), at(25.0));
        assert!(at(70.0) > 0.7 && at(80.0) > 0.8, "{azimuth}: {} {}", at(70.0), at(80.0));
    }
    // The sky's middle is what is blocked: a cone around it cannot say so.
    assert!(under.by_cone(Vec3::Y) > 0.5);
    // From the plate's other side only what passes beside the ground is open.
    let below = one(&mesh, DVec3::new(0.0, PLATE_SCENE[2], 0.0), Vec3::NEG_Y);
    let ground = 4.0 * (16.0f32 / 17.0).asin() / std::f32::consts::TAU;
    assert!((below.accessibility - (1.0 - ground)).abs() < 0.005, "{below:?}, ground {ground}");
}

/// Beside a wall without end half of the hemisphere is open. The fit above the horizon is at least as good there as the
/// half-space's expansion, whose mean square error is (2 pi - sum of squares of the closed form) / 4 pi, and the cone
/// bends by the mean of the open quarter sphere, 45 degrees.
#[test]
fn a_wall_hides_half_of_the_sky() {
    let far = 1e3;
    let ground = quad(DVec3::new(-far, 0.0, -far), DVec3::Z * 2.0 * far, DVec3::X * 2.0 * far);
    let wall = quad(DVec3::new(0.0, 0.0, -far), DVec3::Y * far, DVec3::Z * 2.0 * far);
    let mesh = Mesh::new(&soup(&[(&ground, Sides::Front), (&wall, Sides::Both)])).expect("a scene");
    let beside = one(&mesh, DVec3::new(0.1, 0.0, 0.0), Vec3::Y);
    assert!((beside.accessibility - 0.5).abs() < 0.005, "{beside:?}");
    assert!(beside.bent_normal.distance(Vec3::new(1.0, 1.0, 0.0).normalize()) < 0.01, "{beside:?}");
    let directions = LightDomain::Hemisphere.directions(4_000, 9);
    let squared = |l: &Vec3| f64::from(beside.by_harmonics(*l) - f32::from(u8::from(l.x > 0.0))).powi(2);
    let mean = directions.iter().map(squared).sum::<f64>() / directions.len() as f64;
    let closed_form = (2.0 - (1.0 + 3.0 / 4.0 + 7.0 / 64.0)) / 4.0;
    assert!(mean < closed_form + 1e-3, "{mean}, closed form {closed_form}");
    for l in directions.iter().filter(|l| l.x.abs() > 0.2) {
        let right = l.x > 0.0;
        assert_eq!(sharpened(beside.by_harmonics(*l), 1e-3) > 0.5, right, "{l}: {}", beside.by_harmonics(*l));
    }
}

#[test]
fn equal_sides_are_traced_once_and_alike_at_any_thread_count() {
    let mesh = Mesh::new(&soup(&[(&knot(40, 8), Sides::Both)])).expect("a knot");
    let corner = |triangle: usize, sign: f32| {
        let normal = mesh.normals[triangle] * sign;
        mesh.corners[triangle].map(|p| VertexSide { p, normal })
    };
    let sides: Vec<VertexSide> =
        (0..mesh.triangle_count()).flat_map(|t| [corner(t, 1.0), corner(t, -1.0), corner(t, 1.0)]).flatten().collect();
    let options = VisibilityOptions { directions: 128, seed: 1 };
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| precompute(&mesh, &sides, &options))
    };
    let found = run(1);
    assert_eq!(found, run(3));
    assert_eq!(found.index_of.len(), sides.len());
    assert!(found.distinct.len() * 3 <= sides.len() * 2, "{} of {}", found.distinct.len(), sides.len());
    for (side, index) in found.index_of.chunks_exact(9).map(|c| (c[0], c[6])) {
        assert_eq!(side, index);
    }
    let other = precompute(&mesh, &sides, &VisibilityOptions { seed: 2, ..options });
    assert_ne!(other, found);
}

#[test]
fn an_edge_of_a_half_clamps_and_a_narrow_one_decides() {
    for (x, clamped, decided) in
        [(-0.3, 0.0, 0.0), (0.25, 0.25, 0.0), (0.5, 0.5, 0.5), (0.7, 0.7, 1.0), (1.2, 1.0, 1.0)]
    {
        assert!((sharpened(x, 0.5) - clamped).abs() < 1e-6);
        assert!((sharpened(x, 1e-3) - decided).abs() < 1e-6);
    }
}
