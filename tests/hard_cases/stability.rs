//! The cases of `reports/baseline/hard_cases.md`, those that are quick: what makes them hard must not matter, a light
//! that moves a little must change little, seeds must agree.

use crate::{
    cases,
    double::difference,
    fit::{Fitted, Settings, fit, receivers},
    sweep::{Kind, across_borders, largest, through_planes},
};
use glam::Vec3;
use shadowfit_solver::lights::{LightDomain, direction};

/// What another choice among planes of nearly the same gain changes: two standard deviations of twenty seeds.
const OTHER_CHOICE: f64 = 0.02;

fn plain() -> Fitted {
    fit(&cases::plain(), &Settings::default())
}

#[test]
fn what_does_not_change_the_shadow_does_not_change_the_error() {
    let expected = plain().error();
    assert!(expected < 0.2, "the plain scene: {expected}");
    for case in cases::like_plain() {
        let error = fit(&case.soup, &Settings::default()).error();
        assert!((error - expected).abs() < OTHER_CHOICE, "{} ({}): {error}, plain {expected}", case.name, case.attacks);
    }
}

/// Lights of nearly one direction, in the ground and just above it.
#[test]
fn grazing_lights_are_fitted_too() {
    for elevation_deg in [0.0f32, 0.01, 0.1, 2.0] {
        let axis = direction(0.4, elevation_deg.to_radians());
        let domain = LightDomain::Cone { axis, half_angle_rad: 0.02 };
        let error = fit(&cases::plain(), &Settings { domain, ..Settings::default() }).error();
        // One direction is easier than all.
        assert!(error < 0.15, "{elevation_deg} degrees: {error}");
    }
}

#[test]
fn a_light_that_moves_a_little_changes_little() {
    let plain = plain();
    let receivers = receivers(&plain.mesh, 1_500, 31);
    let jumps = [across_borders(&plain, &receivers, 8), through_planes(&plain, &receivers, 8)].concat();
    for (kind, tolerance) in [
        // A frame turns the light by 1.7e-4: the crossing with a plane just above `EDGE_ON` moves by a twelfth of its
        // distance, all other shadows by less than a texel.
        (Kind::Plain, 0.015),
        // What a plane casts that is nearly edge-on: a strip.
        (Kind::EdgeOn, 0.015),
        // Other planes stand for the same shadow: both lists' errors may show at once, and on the worst border they do.
        (Kind::Border, 0.12),
    ] {
        let (jump, count) = largest(&jumps, kind);
        let jump = jump.unwrap_or_else(|| panic!("no step of kind {kind:?} in {}", jumps.len()));
        assert!(jump.excess() < tolerance, "{kind:?}: the largest of {count} is {jump:?}");
        // The triangle inequality: no jump is larger than what is wrong on either side. A sweep that breaks it is
        // measured wrongly; receivers that turn away between two frames are the rounding.
        assert!(jump.predicted <= jump.traced + jump.errors[0] + jump.errors[1] + 1e-3, "{jump:?}");
    }
}

#[test]
fn f32_is_enough_for_the_run_time_formula() {
    let plain = plain();
    let (pairs, section_of) = plain.held_out();
    // Crossings within rounding (1e-6 of a rectangle) of a border: a pair or two of 300,000.
    let different = difference(&plain.set, &pairs, &section_of);
    assert!(different < 5e-5, "{different}");
}

#[test]
fn seeds_agree() {
    let error = |seed| fit(&cases::plain(), &Settings { seed, ..Settings::default() }).error();
    let errors: Vec<f64> = (0..4).map(error).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    // Three of the standard deviations of twenty seeds, which may be 5 % of their mean at most.
    assert!(errors.iter().all(|error| (error - mean).abs() < 0.15 * mean), "{errors:?}");
}

#[test]
fn few_receivers_are_a_bad_fit_and_no_panic() {
    let mut last = f64::INFINITY;
    for (count, most) in [(1, 1.5), (10, 1.5), (100, 1.2), (2_000, 0.6)] {
        let settings = Settings { receivers: Some(count), max_lookups: 8, ..Settings::default() };
        let error = fit(&cases::plain(), &settings).error();
        assert!(error.is_finite() && error < most, "{count} receivers: {error}");
        last = error;
    }
    assert!(last < 0.6, "{last}");
}

#[test]
fn shapes_without_order_are_fitted() {
    let random = fit(&cases::random_soup(400), &Settings::default());
    assert!(random.error() < 0.5, "{}", random.error());
    let flat = fit(&cases::one_triangle(), &Settings::default());
    assert_eq!((flat.set.planes.len(), flat.error()), (0, 0.0));
    let overhead = LightDomain::Cone { axis: Vec3::Y, half_angle_rad: 0.2 };
    let dark = fit(&cases::all_in_shadow(), &Settings { domain: overhead, ..Settings::default() });
    assert!(dark.error() < 2e-3, "{}", dark.error());
}
