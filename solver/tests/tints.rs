//! Planes with tints: panes beside, behind and around other casters, on pairs that the fit did not see.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

mod scenes;

use glam::{DVec3, Vec3};
use scenes::{Sampling, Triangles, fit, fit_options, measured, pairs, quad, soup};
use shadowfit_solver::{
    lights::LightDomain,
    mesh::{Mesh, Sides},
    plane::{BakedSet, OPAQUE},
};

const RED: Vec3 = Vec3::new(0.4, 0.1, 0.2);
const BLUE: Vec3 = Vec3::new(0.1, 0.3, 0.7);
const NOTHING: Vec3 = Vec3::ZERO;

/// A level rectangle of the given corner and size, metres.
fn level([x, y, z]: [f64; 3], [width, depth]: [f64; 2]) -> Triangles {
    quad(DVec3::new(x, y, z), DVec3::Z * depth, DVec3::X * width)
}

/// Panes, each with what passes it, over opaque ground.
fn over_ground(panes: &[(Triangles, Vec3)]) -> Mesh {
    let ground = level([-1.5, 0.0, -1.5], [3.0, 3.0]);
    let parts: Vec<_> = panes.iter().map(|(pane, _)| (pane, Sides::Both)).chain([(&ground, Sides::Front)]).collect();
    let shares: Vec<Vec3> = panes.iter().flat_map(|(pane, share)| vec![*share; pane.len()]).collect();
    let transmittance = |triangle: usize| shares.get(triangle).copied().unwrap_or_default();
    Mesh::new(&soup(&parts)).unwrap().with_transmittance(transmittance)
}

/// A fit of at most `planes` planes before they are divided by tint, its held-out error, and that of the same planes where
/// all of them are opaque.
fn fitted(mesh: &Mesh, planes: usize) -> (BakedSet, [f64; 2]) {
    let domain = LightDomain::Sphere;
    let sampling = |receivers, lights, seed| Sampling { domain, receivers, lights, seed };
    let set = fit(mesh, &pairs(mesh, &sampling(3_000, 256, 1)), &fit_options(domain, planes, 1)).1;
    let held_out = pairs(mesh, &sampling(4_000, 101, 2));
    let mut opaque = set.clone();
    opaque.planes.iter_mut().for_each(|plane| plane.tint = OPAQUE);
    let errors = [&set, &opaque].map(|set| measured(set, &held_out).shadow_error);
    (set, errors)
}

/// Is a tint, in 255ths, what surfaces take that let these shares pass?
fn takes(tint: [u8; 3], share: Vec3) -> bool {
    let taken = (255.0 * (1.0 - share)).to_array();
    tint.iter().zip(taken).all(|(tint, taken)| (f32::from(*tint) - taken).abs() <= 1.0)
}

/// The bounds are a fifth above what was measured: held-out error, and that error as a share of what opaque planes have.
#[test]
fn panes_and_plates_get_planes_of_their_own_tints() {
    let red = |corner, size| (level(corner, size), RED);
    let (square, bar) = ([0.8, 0.8], |x, z, size| (level([x, 0.5, z], size), NOTHING));
    let pane = red([-0.9, 0.5, -0.4], square);
    let framed = vec![
        red([-0.3, 0.5, -0.3], [0.6, 0.6]),
        bar(-0.5, -0.5, [1.0, 0.2]),
        bar(-0.5, 0.3, [1.0, 0.2]),
        bar(-0.5, -0.3, [0.2, 0.6]),
        bar(0.3, -0.3, [0.2, 0.6]),
    ];
    let beside = vec![pane.clone(), (level([0.1, 0.7, -0.4], square), NOTHING)];
    let coplanar = vec![red([-0.8, 0.5, -0.4], square), (level([0.0, 0.5, -0.4], square), BLUE)];
    let behind = vec![red([-0.5, 0.4, -0.4], square), (level([-0.3, 0.7, -0.3], square), BLUE)];
    let scenes = [
        ("alone", vec![pane], 0.08),
        ("beside a plate", beside, 0.025),
        ("side by side", coplanar, 0.09),
        ("behind", behind, 0.018),
        ("in a frame", framed, 0.084),
    ];
    for (name, panes, bound) in scenes {
        let (set, [error, opaque]) = fitted(&over_ground(&panes), 4);
        assert!(error < bound && error < 0.6 * opaque, "{name}: {error:.4}, with opaque planes {opaque:.4}");
        for (_, share) in &panes {
            assert!(set.planes.iter().any(|plane| takes(plane.tint, *share)), "{name}: none of {share}");
        }
        assert!(set.planes.len() <= 6, "{name}: {} planes", set.planes.len());
    }
}

#[test]
fn the_error_counts_what_arrives() {
    let mesh = over_ground(&[(level([-0.4, 0.5, -0.4], [0.8, 0.8]), RED)]);
    let pairs = pairs(&mesh, &Sampling { domain: LightDomain::Hemisphere, receivers: 2_000, lights: 64, seed: 3 });
    // Without planes all that is missing is missed.
    let nothing = measured(&BakedSet::one_section(Vec::new()), &pairs);
    assert!((nothing.shadow_error - 1.0).abs() < 1e-5 && nothing.false_ == 0.0, "{nothing:?}");
    let blocked: f64 = pairs.lights.iter().flat_map(|light| &light.vote).map(|vote| f64::from(vote.max(0.0))).sum();
    let taken = f64::from(1.0 - RED.element_sum() / 3.0);
    assert!((pairs.shadow_weight / blocked - taken).abs() < 1e-4, "{} of {blocked}", pairs.shadow_weight);
}
