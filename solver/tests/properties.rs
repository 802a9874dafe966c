//! What must hold for any model: the exact step descends, the frame and the threads do not matter, the metrics add up.

mod scenes;

use glam::{DQuat, DVec3, Vec3};
use scenes::{FitOptions, Sampling, fit, fit_options, knot, mapped, measured, pairs, soup};
use shadowfit_solver::{
    bake::{BakeOptions, bake},
    lights::LightDomain,
    mesh::{Mesh, Sides, Soup},
    metrics::Metrics,
    plane::{BakedPlane, Encoding, OccluderTexture, ShadowPlane, Side},
    receivers::{ReceiverOptions, Receivers, sample},
    rectangle::around_section,
    sampling::uniform,
    visibility::{LightPairs, Pairs, trace},
    votes::{BIAS, Mask, best_mask, score, uncovered},
};

const TRAINING: Sampling = Sampling { domain: LightDomain::Sphere, receivers: 2_500, lights: 96, seed: 1 };
const HELD_OUT: Sampling = Sampling { domain: LightDomain::Sphere, receivers: 3_000, lights: 80, seed: 77 };

fn knot_soup() -> Soup {
    soup(&[(&knot(64, 10), Sides::Front)])
}

/// A light search: these tests compare fits with each other, not with a target.
fn options(seed: u64) -> FitOptions {
    let mut options = fit_options(4, seed);
    options.candidates.directions = 48;
    options.candidates.surface_points = 64;
    options.selection.refine_steps = 5;
    options
}

fn fitted(soup: &Soup, seed: u64) -> (Vec<BakedPlane>, Metrics) {
    let mesh = Mesh::new(soup).expect("the scene has triangles");
    let (_, baked) = fit(&mesh, &pairs(&mesh, &Sampling { seed, ..TRAINING }), &options(seed));
    let metrics = measured(&baked, &pairs(&mesh, &HELD_OUT));
    (baked, metrics)
}

/// Share of the weight that a set of binary masks gets wrong, crossings looked up as the votes do it.
fn nearest_texel_error(pairs: &Pairs, masks: &[Mask]) -> f64 {
    let mut wrong = 0.0;
    for light in &pairs.lights {
        let mut covered = vec![0u8; light.len()];
        for mask in masks {
            mask.for_each_texel(light, |i, texel| covered[i] |= mask.blocked[texel]);
        }
        let is_wrong = |i: &usize| (covered[*i] == 1) != (light.vote[*i] > 0.0);
        wrong += (0..light.len()).filter(is_wrong).map(|i| f64::from(light.vote[i].abs())).sum::<f64>();
    }
    wrong / pairs.shadow_weight
}

/// A baked plane as the votes see it. Nothing is lost: the bake's coverage is binary.
fn mask_of(baked: &BakedPlane) -> Mask {
    let OccluderTexture { width, height, texels, .. } = &baked.texture;
    let mut mask = Mask::open(baked.plane, baked.side, baked.bias, *width, *height);
    for (blocked, texel) in mask.blocked.iter_mut().zip(texels) {
        assert!(matches!(texel, 0 | 255), "coverage {texel}");
        *blocked = texel / 255;
    }
    mask
}

/// Planes across the model, as a search would start from.
fn some_planes(mesh: &Mesh, count: u64) -> Vec<ShadowPlane> {
    let corners = || mesh.corners.iter().flatten();
    let low = corners().fold(Vec3::INFINITY, |m, p| m.min(*p));
    let high = corners().fold(Vec3::NEG_INFINITY, |m, p| m.max(*p));
    let plane = |k: u64| around_section(low, high, scenes::unit_vector(6, k), 0.4 * uniform(7, k) as f32 - 0.2);
    (0..count).map(|k| plane(k).expect("a plane near the centre cuts the box")).collect()
}

#[test]
fn exact_rebakes_never_raise_the_training_error() {
    let mesh = Mesh::new(&knot_soup()).unwrap();
    let training = pairs(&mesh, &TRAINING);
    let planes: Vec<Mask> =
        some_planes(&mesh, 6).into_iter().map(|p| Mask::open(p, Side::Both, BIAS, 64, 64)).collect();
    // Measured with the votes' own nearest-texel lookups: that is the objective of which the step is exact. The
    // shader's bilinear taps differ by half a texel, for which nothing is promised.
    let error = |rounds: usize| {
        let options = BakeOptions { texture_size: 48, rounds, smoothing: 0, ..options(1).bake };
        let masks: Vec<Mask> = bake(&training, &planes, &options).iter().map(mask_of).collect();
        nearest_texel_error(&training, &masks)
    };
    let errors: Vec<f64> = (1..=5).map(error).collect();
    assert!((nearest_texel_error(&training, &[]) - 1.0).abs() < 1e-9);
    assert!(errors[0] < 0.9, "{errors:?}");
    // Votes are summed in f32: a sum within 1e-6 of zero may be taken for the other sign.
    assert!(errors.windows(2).all(|e| e[1] <= e[0] + 1e-6), "{errors:?}");
    assert!(errors[4] < errors[0] - 1e-4, "later rounds changed nothing: {errors:?}");
}

/// Every receiver twice in a row, so that both folds are the same.
fn doubled(receivers: &Receivers) -> Receivers {
    let twice = |of: &[Vec3]| of.iter().flat_map(|x| [*x, *x]).collect::<Vec<_>>();
    Receivers {
        points: twice(&receivers.points),
        origins: twice(&receivers.origins),
        normals: twice(&receivers.normals),
        weights: receivers.weights.iter().flat_map(|w| [*w, *w]).collect(),
        triangles: receivers.triangles.iter().flat_map(|t| [*t, *t]).collect(),
    }
}

#[test]
fn a_score_is_the_drop_of_the_error_where_both_folds_agree() {
    let mesh = Mesh::new(&knot_soup()).unwrap();
    let receivers = doubled(&sample(&mesh, &ReceiverOptions { count: 1_500, exposure_rays: 16, seed: 2 }));
    let domain = LightDomain::Sphere;
    let pairs = trace(&mesh, &receivers, &domain.directions(48, 2), domain.solid_angle());
    let mut worthwhile = 0;
    for plane in some_planes(&mesh, 24) {
        let found = score(&pairs, &plane, BIAS, 32);
        let mask = best_mask(&pairs, &plane, found.side, BIAS, 32);
        let drop = (nearest_texel_error(&pairs, &[]) - nearest_texel_error(&pairs, &[mask])) * pairs.shadow_weight;
        // Sums of some 30,000 votes in f32, in another order; texels that come out at zero count for nothing.
        let tolerance = 1e-4 * found.gain.abs() + 1e-6 * pairs.shadow_weight;
        assert!((found.gain - drop).abs() < tolerance, "{plane:?}: gain {}, drop {drop}", found.gain);
        worthwhile += usize::from(drop > 0.01 * pairs.shadow_weight);
    }
    assert!(worthwhile > 5, "only {worthwhile} planes gain anything");
}

/// Pairs of one light whose rays cross the plane y = 0 at (x, 0); the first `split` are fold 0.
fn crossings(light: Vec3, pairs: &[(f32, f32)], split: usize) -> LightPairs {
    let (x, vote): (Vec<f32>, Vec<f32>) = pairs.iter().copied().unzip();
    let n = x.len();
    LightPairs { light, x, y: vec![-0.5 * light.y; n], z: vec![0.0; n], receiver: vec![0; n], vote, split }
}

#[test]
fn scores_cross_validate_and_choose_the_side() {
    let plane = ShadowPlane { origin: Vec3::new(-1.0, 0.0, -1.0), u: Vec3::Z * 2.0, v: Vec3::X * 2.0 };
    let found = |lights: Vec<LightPairs>| {
        let pairs = Pairs { lights, shadow_weight: 1.0, total_weight: 1.0, receivers: 1 };
        let score = score(&pairs, &plane, BIAS, 64);
        (score.gain, score.side)
    };
    let agree = [(0.3, 1.0), (0.3, 2.0)];
    // Behind the normal +Y the light is above. Each fold lets the other's vote in.
    assert_eq!(found(vec![crossings(Vec3::Y, &agree, 1)]), (3.0, Side::Both));
    // Lit receivers of more weight on the other side: serve one side only.
    let lit = [(0.3, -4.0), (0.3, -4.0)];
    assert_eq!(found(vec![crossings(Vec3::Y, &agree, 1), crossings(Vec3::NEG_Y, &lit, 1)]), (3.0, Side::Back));
    assert_eq!(found(vec![crossings(Vec3::NEG_Y, &agree, 1), crossings(Vec3::Y, &lit, 1)]), (3.0, Side::Front));
    // Folds that disagree: fold 0 would block at -0.3 and loses 2, fold 1 would block at 0.3 and loses 5. The same
    // from either side, so that serving one loses less than serving both.
    let disagree = [(-0.3, 1.0), (0.3, -5.0), (-0.3, -2.0), (0.3, 1.0)];
    let (gain, _) = found(vec![crossings(Vec3::Y, &disagree, 2), crossings(Vec3::NEG_Y, &disagree, 2)]);
    assert_eq!(gain, -7.0);
}

#[test]
fn uncovered_pairs_are_those_that_no_mask_blocks() {
    let mesh = Mesh::new(&knot_soup()).unwrap();
    let training = pairs(&mesh, &TRAINING);
    let plane = some_planes(&mesh, 1)[0];
    let mask = best_mask(&training, &plane, Side::Both, BIAS, 32);
    let open = uncovered(&training, &[&mask]);
    assert!(open.len() < training.len());
    for (all, left) in training.lights.iter().zip(&open.lights) {
        let mut keep = vec![true; all.len()];
        mask.for_each_texel(all, |i, texel| keep[i] = mask.blocked[texel] == 0);
        let expected: Vec<f32> = (0..all.len()).filter(|&i| keep[i]).map(|i| all.vote[i]).collect();
        assert_eq!(left.vote, expected);
        assert_eq!(left.split, (0..all.split).filter(|&i| keep[i]).count());
    }
}

#[test]
fn moving_scaling_and_turning_the_model_change_little() {
    let body = knot(64, 10);
    let turn = DQuat::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 1.1);
    let error = |f: &dyn Fn(DVec3) -> DVec3| fitted(&soup(&[(&mapped(&body, f), Sides::Front)]), 1).1.shadow_error;
    let home = error(&|p| p);
    assert!(home > 0.05 && home < 0.7, "{home}");
    // A power of two is exact in f64 and so in unit space.
    assert_eq!(error(&|p| p * 1024.0), home);
    // Elsewhere unit-space corners differ in their last bit, and a search that finds two planes equally good may
    // take the other: as far apart as two seeds.
    for (name, moved) in [
        ("moved", error(&|p| p + DVec3::new(1e4, -3e3, 77.7))),
        ("scaled", error(&|p| p * 1.7e-4)),
        ("turned", error(&|p| turn * p)),
    ] {
        assert!((moved - home).abs() < 0.15 * home, "{name}: {moved}, at home {home}");
    }
}

#[test]
fn threads_do_not_matter_and_seeds_matter_little() {
    let soup = knot_soup();
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fitted(&soup, 1))
    };
    let (one, two) = (with_threads(1), with_threads(2));
    assert!(!one.0.is_empty());
    assert_eq!(bytes(&one.0), bytes(&two.0));
    assert_eq!(one.1, two.1);
    let other = fitted(&soup, 5).1.shadow_error;
    // Other receivers, lights and candidates: the sampling noise of 2500 receivers and the search's luck.
    assert!((other - one.1.shadow_error).abs() < 0.15 * one.1.shadow_error, "{other} and {}", one.1.shadow_error);
}

/// Every bit of the planes.
fn bytes(planes: &[BakedPlane]) -> Vec<u8> {
    let mut out = Vec::new();
    for BakedPlane { plane, texture, side, bias } in planes {
        for v in [plane.origin, plane.u, plane.v] {
            out.extend(v.to_array().iter().flat_map(|c| c.to_bits().to_le_bytes()));
        }
        out.extend(bias.to_bits().to_le_bytes());
        out.push(*side as u8);
        out.extend([texture.width, texture.height].iter().flat_map(|n| n.to_le_bytes()));
        out.extend(&texture.texels);
    }
    out
}

/// Two level planes with one coverage everywhere, above and below everything.
fn lids(coverage: u8) -> Vec<BakedPlane> {
    let lid = |y: f32| BakedPlane {
        plane: ShadowPlane { origin: Vec3::new(-500.0, y, -500.0), u: Vec3::Z * 1e3, v: Vec3::X * 1e3 },
        texture: OccluderTexture { width: 3, height: 3, encoding: Encoding::Coverage, texels: vec![coverage; 9] },
        side: Side::Both,
        bias: BIAS,
    };
    vec![lid(1.5), lid(-1.5)]
}

#[test]
fn metrics_add_up() {
    let mesh = Mesh::new(&knot_soup()).unwrap();
    let pairs = pairs(&mesh, &HELD_OUT);
    let lit_per_shadow = (pairs.total_weight - pairs.shadow_weight) / pairs.shadow_weight;
    let close = |a: f64, b: f64| (a - b).abs() < 1e-5 * (1.0 + b.abs());
    let none = measured(&[], &pairs);
    assert!(close(none.shadow_error, 1.0) && close(none.missed, 1.0) && none.false_ == 0.0, "{none:?}");
    assert!(close(none.light_error, pairs.shadow_weight / pairs.total_weight), "{none:?}");
    assert!(none.worst_light.max >= none.worst_light.p95 && none.worst_light.max >= 1.0, "{none:?}");
    assert_eq!((none.receivers, none.lights), (pairs.receivers, HELD_OUT.lights));
    // Nothing is missed where everything is dark, and half as much is with half coverage.
    let all = measured(&lids(255), &pairs);
    assert!(all.missed < 0.01, "{all:?}");
    assert!((all.false_ / lit_per_shadow - 1.0).abs() < 0.01, "{all:?} of {lit_per_shadow}");
    let half = measured(&lids(51), &pairs);
    assert!((half.missed - 0.8).abs() < 0.01 && (half.false_ / lit_per_shadow - 0.2).abs() < 0.01, "{half:?}");
    for metrics in [none, all, half] {
        assert!(close(metrics.shadow_error, metrics.missed + metrics.false_), "{metrics:?}");
        let length = Vec3::from(metrics.worst_light.direction).length();
        assert!((length - 1.0).abs() < 1e-5, "{metrics:?}");
    }
    // The worst light is the largest of the lights measured one by one.
    let mean = pairs.shadow_weight / pairs.lights.len() as f64;
    let one = |l: usize| {
        let light = pairs.lights[l].clone();
        let shadow_weight = light.vote.iter().map(|v| f64::from(v.max(0.0))).sum();
        let alone = Pairs { lights: vec![light], shadow_weight, ..pairs };
        measured(&[], &alone).shadow_error * shadow_weight / mean
    };
    let mut by_light: Vec<f64> = (0..pairs.lights.len()).map(one).collect();
    by_light.sort_by(f64::total_cmp);
    // 80 lights: the largest, and the one that 95 % of the others do not exceed.
    assert!(close(by_light[79], none.worst_light.max) && close(by_light[75], none.worst_light.p95), "{none:?}");
}

#[test]
fn without_shadow_all_errors_are_zero() {
    let mesh = scenes::closed(&scenes::sphere(2));
    let pairs = pairs(&mesh, &HELD_OUT);
    for planes in [vec![], lids(255)] {
        let metrics = measured(&planes, &pairs);
        let expected = Metrics { receivers: pairs.receivers, lights: HELD_OUT.lights, ..Metrics::default() };
        assert_eq!(metrics, expected);
    }
}
