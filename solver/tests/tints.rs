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

/// A fit of at most `planes` planes, its held-out error, and that of the same planes where all of them are opaque.
fn fitted(mesh: &Mesh, planes: usize) -> (BakedSet, f64, f64) {
    let domain = LightDomain::Sphere;
    let sampling = |receivers, lights, seed| Sampling { domain, receivers, lights, seed };
    let set = fit(mesh, &pairs(mesh, &sampling(3_000, 256, 1)), &fit_options(domain, planes, 1)).1;
    let held_out = pairs(mesh, &sampling(4_000, 101, 2));
    let error = measured(&set, &held_out);
    let mut opaque = set.clone();
    opaque.planes.iter_mut().for_each(|plane| plane.tint = OPAQUE);
    println!("{error:?} {:?}", set.planes.iter().map(|plane| plane.tint).collect::<Vec<_>>());
    (set, error.shadow_error, measured(&opaque, &held_out).shadow_error)
}

/// What a pane takes, in 255ths.
fn tint(share: Vec3) -> [u8; 3] {
    (255.0 * (1.0 - share)).round().to_array().map(|x| x as u8)
}

#[test]
fn panes_and_plates_get_planes_of_their_own_tints() {
    let square = [0.8, 0.8];
    let window =
        [([0.0, 0.0], [1.0, 0.2]), ([0.0, 0.8], [1.0, 0.2]), ([0.0, 0.2], [0.2, 0.6]), ([0.8, 0.2], [0.2, 0.6])];
    let bars = window.map(|([x, z], size)| (level([x - 0.5, 0.5, z - 0.5], size), NOTHING));
    let scenes = [
        ("alone", vec![(level([-0.9, 0.5, -0.4], square), RED)], vec![RED], [3, 3]),
        (
            "beside a plate",
            vec![(level([-0.9, 0.5, -0.4], square), RED), (level([0.1, 0.7, -0.4], square), NOTHING)],
            vec![RED, NOTHING],
            [4, 4],
        ),
        (
            "side by side",
            vec![(level([-0.8, 0.5, -0.4], square), RED), (level([0.0, 0.5, -0.4], square), BLUE)],
            vec![RED, BLUE],
            [4, 4],
        ),
        (
            "behind",
            vec![(level([-0.5, 0.4, -0.4], square), RED), (level([-0.3, 0.7, -0.3], square), BLUE)],
            vec![RED, BLUE],
            [4, 4],
        ),
        (
            "in a frame",
            [vec![(level([-0.3, 0.5, -0.3], [0.6, 0.6]), RED)], bars.to_vec()].concat(),
            vec![RED, NOTHING],
            [4, 4],
        ),
    ];
    for (name, panes, shares, [most, _]) in scenes {
        let (set, error, opaque) = fitted(&over_ground(&panes), most);
        println!("{name}: {error:.4} opaque {opaque:.4} planes {} {shares:?}", set.planes.len());
    }
}
