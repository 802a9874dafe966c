//! Surfaces that are not those of a sound solid.

use crate::shapes::{Case, empty, moved, reversed, square, triangles_of};
use glam::DVec3;
use shadowfit::scene;

/// See `placement.rs`.
const OTHER_CHOICE: f64 = 0.02;

fn t_shape() -> Case {
    Case::new(triangles_of("t_shape.glb"))
}

fn plain_error() -> f64 {
    let error = t_shape().fit().0.held_out.shadow_error;
    assert!(error < 0.1, "the plain model: {error}");
    error
}

#[test]
fn zero_area_and_duplicate_triangles_change_nothing() {
    let plain = t_shape();
    let mut dirty = plain.clone();
    let [a, b, _] = plain.triangles[0];
    // Points, needles, and a whole second copy of the model, turned by one corner.
    dirty.triangles.extend([[a, a, a], [a, b, a], [a, b, a.lerp(b, 0.5)]]);
    dirty.triangles.extend(plain.triangles.iter().map(|[a, b, c]| [*b, *c, *a]));
    let (clean, (report, _)) = (plain.fit().0, dirty.fit());
    assert_eq!(report.triangles, plain.triangles.len());
    assert_eq!(report.held_out, clean.held_out, "the same triangles are left, so the same numbers come out");
    let count = |what| report.skipped.iter().find(|s| s.what == what).map(|s| s.count);
    assert_eq!(count("triangles without area"), Some(3), "{:?}", report.skipped);
    assert_eq!(count("duplicate triangles"), Some(plain.triangles.len()), "{:?}", report.skipped);
}

#[test]
fn coincident_shells_do_not_shadow_each_other() {
    let expected = plain_error();
    let plain = t_shape().triangles;
    for (name, second, double_sided) in [
        ("the same inside out", reversed(&plain), false),
        ("the same inside out, double-sided", reversed(&plain), true),
        ("double-sided alone", vec![], true),
    ] {
        let case = Case { double_sided, ..Case::new([plain.clone(), second].concat()) };
        let (report, _) = case.fit();
        let error = report.held_out.shadow_error;
        // The inner sides are hidden and weigh nothing: what remains is another sampling.
        assert!(error <= expected + OTHER_CHOICE, "{name}: {error}, one shell {expected}");
    }
}

#[test]
fn a_second_skin_hides_the_first() {
    let plain = t_shape().triangles;
    // 1 um outside a shell of 1.4 m: as doubled surfaces of real models lie, after quantisation.
    let skin = moved(&plain, |p| p + (p - DVec3::Y * 0.6) * 1e-6);
    let (report, _) = Case::new([plain, skin].concat()).fit();
    let (error, expected) = (report.held_out.shadow_error, plain_error());
    // Samples of the inner skin are seen by nobody but where rounding (6e-8 of the radius) lets a ray out.
    assert!(error <= expected + 2.0 * OTHER_CHOICE, "{error}, one shell {expected}");
}

#[test]
fn flat_models_have_no_self_shadow() {
    let triangle = vec![[DVec3::ZERO, DVec3::X, DVec3::Y]];
    for (name, case) in [
        ("one triangle", Case::new(triangle.clone())),
        ("one double-sided triangle", Case::new(triangle).double_sided()),
        ("a square", Case::new(square(1.0, 3.0))),
        ("a double-sided square", Case::new(square(1.0, 3.0)).double_sided()),
    ] {
        let (report, set) = case.fit();
        assert_eq!(set.planes.len(), 0, "{name}");
        assert_eq!((report.held_out.shadow_error, report.held_out.light_error), (0.0, 0.0), "{name}");
        assert!(report.held_out.receivers > 0, "{name}: nothing was measured");
    }
}

#[test]
fn a_model_that_nobody_sees_has_nothing_to_shadow() {
    // A closed box, drawn from its inside only.
    let (report, set) = Case::new(reversed(&triangles_of("box.glb"))).fit();
    assert_eq!((set.planes.len(), report.held_out.shadow_error), (0, 0.0));
    assert_eq!(report.held_out.receivers, 0, "a hidden surface was measured");
    let size = set.bounds.max - set.bounds.min;
    // The box of the model stands in: 1.2 x 0.7 x 0.9 m.
    assert!((size - DVec3::new(1.2, 0.7, 0.9)).abs().max_element() < 1e-6, "{size}");
}

#[test]
fn vertices_that_are_no_numbers_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for corner in [0, 40] {
            let mut case = t_shape();
            case.triangles.as_flattened_mut()[corner].y = bad;
            let (code, message) = case.refusal();
            assert_eq!(code, 3, "{message}");
            assert!(message.contains("case.glb"), "{message}");
        }
    }
}

#[test]
fn a_scene_without_triangles_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.glb");
    std::fs::write(&path, empty()).unwrap();
    let error = scene::load(&path).unwrap_err();
    assert_eq!(error.exit_code(), 3, "{error}");
    // Triangles, but none with an area.
    let (code, message) = Case::new(vec![[DVec3::X; 3]]).refusal();
    assert_eq!(code, 3, "{message}");
}
