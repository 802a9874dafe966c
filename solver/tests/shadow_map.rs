//! The reference shadow map: scenes with a known answer.

mod scenes;

use scenes::{KNOT_TUBE, PLATE_SCENE, Sampling, closed, knot, plate_over_ground, receivers};
use shadowfit_solver::{
    lights::LightDomain,
    mesh::{Mesh, MeshError},
    metrics::Metrics,
    receivers::Receivers,
    shadow_map::{EquivalentSize, equivalent_size, interpolated, measure},
    visibility::{Pairs, trace},
};

const SAMPLING: Sampling = Sampling { domain: LightDomain::Hemisphere, receivers: 8_000, lights: 60, seed: 5 };

/// Receivers and their pairs.
fn held_out(mesh: &Mesh, domain: LightDomain) -> (Receivers, Pairs) {
    let receivers = receivers(mesh, SAMPLING.receivers, SAMPLING.seed);
    let lights = domain.directions(SAMPLING.lights, SAMPLING.seed);
    let pairs = trace(mesh, &receivers, &lights, domain.solid_angle());
    (receivers, pairs)
}

/// Errors of the sizes in turn.
fn curve<const N: usize>(mesh: &Mesh, sizes: [usize; N]) -> [Metrics; N] {
    let (receivers, pairs) = held_out(mesh, SAMPLING.domain);
    sizes.map(|size| measure(mesh, &receivers, &pairs, size))
}

#[test]
fn a_plate_is_wrong_along_its_outline_only() -> Result<(), MeshError> {
    let mesh = Mesh::new(&plate_over_ground())?;
    let sizes = [32, 64, 128, 256, 512];
    let curve = curve(&mesh, sizes);
    for (size, metrics) in sizes.iter().zip(curve) {
        // The nearest texel moves the outline by a quarter of a texel on average and half a texel at most; the map is
        // at most as wide as the ground's diagonal. Perimeter over area of the plate is 4 / side.
        let [ground, plate, _] = PLATE_SCENE;
        let texel = 2.0 * ground * 2f64.sqrt() / *size as f64;
        let bound = 0.5 * texel * 4.0 / (2.0 * plate);
        assert!(metrics.shadow_error > 0.0 && metrics.shadow_error < bound, "{size}: {metrics:?}, bound {bound}");
    }
    // Twice the texels, half the outline: 16 times from 32 to 512, less what the sampling of the outline scatters.
    let fall = curve[0].shadow_error / curve[4].shadow_error;
    assert!((10.0..25.0).contains(&fall), "{fall}");
    Ok(())
}

#[test]
fn a_curved_body_has_no_acne() {
    let mesh = closed(&knot(160, 24));
    let (receivers, pairs) = held_out(&mesh, LightDomain::Sphere);
    let lit = pairs.total_weight - pairs.shadow_weight;
    for size in [64, 256, 1024] {
        let metrics = measure(&mesh, &receivers, &pairs, size);
        // False shadow lies beside outlines, a quarter of a texel wide on average and on one side of them. The tube's
        // two outlines run along all of it, the map is as wide as the knot (2 x 3.45 m); acne would cover the tube.
        let share = metrics.false_ * pairs.shadow_weight / lit;
        let texel = 2.0 * (3.0 + KNOT_TUBE) / size as f64;
        assert!(
            share < 0.25 * texel * 2.0 / (2.0 * KNOT_TUBE),
            "{size}: {share} of the lit surface is in false shadow, {metrics:?}"
        );
    }
}

#[test]
fn a_size_is_interpolated_between_those_measured() {
    let curve = || [(64, 0.16), (128, 0.08), (256, 0.02)];
    let texels = |error| match interpolated(curve(), error) {
        EquivalentSize::Texels(texels) => texels,
        other => panic!("{error}: {other:?}"),
    };
    assert_eq!(interpolated(curve(), 0.17), EquivalentSize::BelowAll);
    assert_eq!(interpolated(curve(), 0.01), EquivalentSize::AboveAll);
    assert!((texels(0.08) - 128.0).abs() < 1e-9);
    // Half-way down in the logarithm is half-way in the logarithm of the size.
    assert!((texels(0.04) - 128.0 * 2f64.sqrt()).abs() < 1e-9);
    // Exactly the smallest size is no better than it.
    assert_eq!(interpolated(curve(), 0.16), EquivalentSize::BelowAll);
    // An error of zero at the finer size.
    assert_eq!(interpolated([(64, 0.1), (128, 0.0)], 0.05), EquivalentSize::Texels(64.0));
    assert_eq!(interpolated([(64, 0.1), (128, 0.0)], 0.0), EquivalentSize::Texels(128.0));
}

#[test]
fn a_map_is_as_good_as_itself() -> Result<(), MeshError> {
    let mesh = Mesh::new(&plate_over_ground())?;
    let (receivers, pairs) = held_out(&mesh, SAMPLING.domain);
    let error = measure(&mesh, &receivers, &pairs, 128).shadow_error;
    match equivalent_size(&mesh, &receivers, &pairs, error) {
        EquivalentSize::Texels(texels) => assert!((texels - 128.0).abs() < 1e-6, "{texels}"),
        other => panic!("{other:?}"),
    }
    Ok(())
}
