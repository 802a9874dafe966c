//! The certificate against exact optima of tiny instances, random multipliers, and a planted scene.

mod scenes;

use glam::Vec3;
use microlp::{ComparisonOp, OptimizationDirection, Problem, SolutionStatus, Variable};
use scenes::{Sampling, pairs, planted, planted_plates, unit_vector};
use shadowfit_solver::{
    certificate::{CertificateOptions, certify},
    lights::LightDomain,
    mesh::Mesh,
    pair_table::PairTable,
    plane::{PlacedPlane, ShadowPlane, Side},
    pool::{Instance, PoolPlane},
    relaxation::{Multipliers, bound},
    sampling::uniform,
    visibility::{LightPairs, Pairs},
};
use std::collections::BTreeMap;

/// Texels a side.
const TEXELS: usize = 12;

/// Receivers and lights of an instance: 640 pairs.
const RECEIVERS: u64 = 80;
const LIGHTS: u64 = 8;

/// Share of the pairs whose visibility is flipped at random: no planes explain them.
const NOISE: f64 = 0.06;

/// Until nothing changes: more rounds than any of the instances needs.
const ROUNDS: usize = 20;

fn square(middle: Vec3, normal: Vec3, half: f32) -> ShadowPlane {
    let (u, v) = normal.any_orthonormal_pair();
    ShadowPlane { origin: middle - (u + v) * half, u: u * 2.0 * half, v: v * 2.0 * half }
}

/// A random square near the origin.
fn random_square(seed: u64, index: u64) -> ShadowPlane {
    let middle = unit_vector(seed, 2 * index) * (0.5 * uniform(seed ^ 1, index) as f32);
    square(middle, unit_vector(seed, 2 * index + 1), 0.4 + 0.4 * uniform(seed ^ 2, index) as f32)
}

fn pool_plane(plane: ShadowPlane, family: usize) -> PoolPlane {
    let placed = PlacedPlane { plane, side: Side::Both, bias: 1e-3 };
    PoolPlane { placed, width: TEXELS, height: TEXELS, family }
}

/// Receivers in a ball under four discs, with noise, and a pool of discs' planes, their neighbours and others.
fn tiny(seed: u64, planes: usize) -> (PairTable, Vec<PoolPlane>) {
    let discs: Vec<ShadowPlane> = (0..4).map(|k| random_square(100 + seed, k)).collect();
    let hit = |p: Vec3, light: Vec3| {
        discs.iter().any(|disc| {
            let (normal, middle) = (disc.normal(), disc.origin + 0.5 * (disc.u + disc.v));
            let s = normal.dot(middle - p) / normal.dot(light);
            s > 0.0 && (p + s * light).distance(middle) < 0.4 * disc.u.length()
        })
    };
    let light_pairs = |l: u64| {
        let light = unit_vector(200 + seed, l);
        let (mut out, mut noise) = (empty(light), l * RECEIVERS);
        for i in 0..RECEIVERS {
            noise += 1;
            let p = unit_vector(300 + seed, i) * (0.3 + 0.7 * uniform(400 + seed, i) as f32);
            let weight = 0.5 + uniform(500 + seed, i) as f32;
            let blocked = hit(p, light) != (uniform(600 + seed, noise) < NOISE);
            out.x.push(p.x);
            out.y.push(p.y);
            out.z.push(p.z);
            out.receiver.push(i as u32);
            out.vote.push(if blocked { weight } else { -weight });
        }
        out
    };
    let lights: Vec<LightPairs> = (0..LIGHTS).map(light_pairs).collect();
    let sum = |part: fn(f32) -> f32| lights.iter().flat_map(|l| &l.vote).map(|v| f64::from(part(*v))).sum::<f64>();
    let (shadow_weight, total_weight) = (sum(|v| v.max(0.0)), sum(f32::abs));
    let pairs = Pairs { lights, shadow_weight, total_weight, receivers: RECEIVERS as usize };
    let pool = (0..planes as u64).map(|k| {
        let plane = match k {
            0..4 => discs[k as usize],
            4..8 => {
                let disc = discs[k as usize - 4];
                ShadowPlane { origin: disc.origin + 0.06 * unit_vector(700 + seed, k), ..disc }
            }
            _ => random_square(800 + seed, k),
        };
        pool_plane(plane, k as usize)
    });
    (PairTable::new(&pairs, &[Vec3::X]), pool.collect())
}

fn empty(light: Vec3) -> LightPairs {
    let column = Vec::new;
    LightPairs {
        light,
        x: column(),
        y: column(),
        z: column(),
        receiver: Vec::new(),
        vote: column(),
        arrives: Vec::new(),
    }
}

/// `[plane][pair]`: the texel that a pair crosses, if any.
fn crossings(pairs: &PairTable, pool: &[PoolPlane]) -> Vec<Vec<Option<usize>>> {
    let crossed = |plane: &PoolPlane| {
        let mut texels = Vec::new();
        pairs.crossings(&plane.placed, (plane.width, plane.height), &mut texels);
        texels.into_iter().map(|texel| Some(usize::from(texel)).filter(|texel| *texel < TEXELS * TEXELS)).collect()
    };
    pool.iter().map(crossed).collect()
}

fn votes(pairs: &PairTable) -> Vec<f64> {
    pairs.vote.iter().map(|vote| f64::from(*vote)).collect()
}

/// The least error of the chosen planes over all binary textures, or `None` where it is not below `limit`.
fn best_textures(votes: &[f64], chosen: &[&Vec<Option<usize>>], limit: f64) -> Option<f64> {
    // Pairs that cross the same texels are one; those that cross none are decided.
    let mut rays: BTreeMap<Vec<Option<usize>>, [f64; 2]> = BTreeMap::new();
    for (i, vote) in votes.iter().enumerate() {
        let ray = chosen.iter().map(|texels| texels[i]).collect();
        rays.entry(ray).or_default()[usize::from(*vote < 0.0)] += vote.abs();
    }
    let solve = |exact: bool| {
        let mut problem = Problem::new(OptimizationDirection::Minimize);
        let mut texels: BTreeMap<(usize, usize), Variable> = BTreeMap::new();
        let mut fixed = 0.0;
        for (ray, [blocked, lit]) in &rays {
            let crossed: Vec<(usize, usize)> =
                ray.iter().enumerate().filter_map(|(plane, texel)| Some((plane, (*texel)?))).collect();
            if crossed.is_empty() {
                fixed += blocked;
                continue;
            }
            let crossed: Vec<Variable> = crossed
                .into_iter()
                .map(|texel| {
                    *texels.entry(texel).or_insert_with(|| {
                        if exact { problem.add_binary_var(0.0) } else { problem.add_var(0.0, (0.0, 1.0)) }
                    })
                })
                .collect();
            if *blocked > 0.0 {
                let missed = problem.add_var(*blocked, (0.0, 1.0));
                let sum: Vec<(Variable, f64)> = crossed.iter().chain([&missed]).map(|v| (*v, 1.0)).collect();
                problem.add_constraint(sum, ComparisonOp::Ge, 1.0);
            }
            if *lit > 0.0 {
                let false_ = problem.add_var(*lit, (0.0, 1.0));
                for texel in crossed {
                    problem.add_constraint([(false_, 1.0), (texel, -1.0)], ComparisonOp::Ge, 0.0);
                }
            }
        }
        let solution = problem.solve().expect("feasible: all open").into_solution().expect("no limit is set");
        assert_eq!(solution.status(), SolutionStatus::Optimal);
        fixed + solution.objective()
    };
    // The relaxation first: most choices of planes are far from the best.
    (solve(false) < limit).then(|| solve(true)).filter(|error| *error < limit)
}

/// All choices of `count` of `n` things.
fn choices(n: usize, count: usize) -> Vec<Vec<usize>> {
    if count == 0 {
        return vec![Vec::new()];
    }
    let longer = |shorter: Vec<usize>| {
        (shorter.last().map_or(0, |last| last + 1)..n).map(move |next| [&shorter[..], &[next]].concat())
    };
    choices(n, count - 1).into_iter().flat_map(longer).collect()
}

/// The proven least `shadow_error` of any `count` planes of the pool, at most one of a family; `known` is reached.
fn optimum(pairs: &PairTable, pool: &[PoolPlane], count: usize, known: f64) -> f64 {
    let (votes, crossings) = (votes(pairs), crossings(pairs, pool));
    let (shadow, _) = pairs.weights();
    let mut best = known * shadow + 1e-6;
    for chosen in choices(pool.len(), count) {
        let alone = |k: usize| chosen[..k].iter().all(|other| pool[*other].family != pool[chosen[k]].family);
        if (0..count).all(alone) {
            let planes: Vec<_> = chosen.iter().map(|plane| &crossings[*plane]).collect();
            best = best_textures(&votes, &planes, best).unwrap_or(best);
        }
    }
    best / shadow
}

#[test]
fn bounds_never_exceed_exact_optima_and_the_search_comes_near() {
    let options = CertificateOptions { settled: 0.0, ..CertificateOptions::default() };
    let (mut near, mut tight) = (0, 0);
    for seed in 0..10 {
        let (count, planes) = if seed < 7 { (2, 24) } else { (3, 12) };
        let (pairs, mut pool) = tiny(seed, planes);
        if seed % 2 == 1 {
            // A disc's plane and its neighbour are one family.
            (4..8).for_each(|k| pool[k].family = k - 4);
        }
        let (chosen, found) = Instance::new(&pairs, &pool).search(count, ROUNDS);
        let optimum = optimum(&pairs, &pool, count, found);
        let certificate = certify(&pairs, &pool, &chosen, &options);
        let lower = certificate.lower_bound;
        println!("seed {seed}: bound {lower:.5}, optimum {optimum:.5}, found {found:.5}");
        assert_eq!(certificate.found, found, "seed {seed}");
        assert!(optimum <= found * (1.0 + 1e-6), "seed {seed}: {optimum} is no optimum: {found} was found");
        assert!(lower <= optimum * (1.0 + 1e-9), "seed {seed}: {lower} is above the optimum {optimum}");
        assert!(optimum > 0.1, "seed {seed}: nothing to explain");
        tight += usize::from(lower >= 0.9 * optimum);
        near += usize::from(found <= 1.02 * optimum);
    }
    assert!(near >= 9, "the search came within 2 % of the optimum on {near} of 10 instances");
    assert!(tight >= 9, "the bound came within 10 % of the optimum on {tight} of 10 instances");
}

#[test]
fn no_multipliers_prove_more_than_any_textures_reach() {
    for seed in 0..10 {
        let (pairs, mut pool) = tiny(seed, 24);
        (4..8).for_each(|k| pool[k].family = k - 4);
        let (votes, crossings) = (votes(&pairs), crossings(&pairs, &pool));
        let instance = Instance::new(&pairs, &pool);
        let mut highest = 0.0f64;
        for trial in 0..40 {
            // Shares beyond 0..1 as well: the formula clamps and scales.
            let (mut asked, seed) = (0, 1000 * seed + trial);
            let most = 0.2 + 1.2 * uniform(seed, 0);
            let multipliers = Multipliers::from_shares(&instance, || {
                asked += 1;
                (most * uniform(seed, asked) - 0.05) as f32
            });
            let count = 1 + trial as usize % 4;
            let lower = bound(&instance, &multipliers, count).lower_bound;
            highest = highest.max(lower);
            for set in 0..20 {
                let draw = |k: u64| uniform(seed ^ 0xABCD, 100 * set + k);
                let mut chosen: Vec<usize> = Vec::new();
                for k in 0..50 {
                    let plane = (draw(k) * pool.len() as f64) as usize;
                    let alone = chosen.iter().all(|other| pool[*other].family != pool[plane].family);
                    if alone && chosen.len() < count {
                        chosen.push(plane);
                    }
                }
                let error = random_error((&pairs, &votes), &crossings, &chosen, seed + set);
                assert!(lower <= error, "seed {seed}, set {set}: bound {lower} is above the error {error}");
            }
        }
        assert!(highest > 0.0, "seed {seed}: no multipliers prove anything");
    }
}

/// `shadow_error` of planes with textures between random and best: each texel follows its votes but for a share.
fn random_error(
    (pairs, votes): (&PairTable, &[f64]),
    crossings: &[Vec<Option<usize>>],
    chosen: &[usize],
    seed: u64,
) -> f64 {
    let mut covered = vec![false; votes.len()];
    for &plane in chosen {
        let mut sums = vec![0.0; TEXELS * TEXELS];
        for (i, texel) in crossings[plane].iter().enumerate() {
            if let (Some(texel), false) = (texel, covered[i]) {
                sums[*texel] += votes[i];
            }
        }
        let strayed = 0.3 * uniform(seed, 1);
        let blocks = |texel: usize| (sums[texel] > 0.0) != (uniform(seed, (1000 * plane + texel) as u64) < strayed);
        for (covered, texel) in covered.iter_mut().zip(&crossings[plane]) {
            *covered |= texel.is_some_and(blocks);
        }
    }
    let wrong = |(vote, covered): (&f64, &bool)| if (*vote > 0.0) == *covered { 0.0 } else { vote.abs() };
    votes.iter().zip(&covered).map(wrong).sum::<f64>() / pairs.weights().0
}

#[test]
fn planted_planes_are_proven_nearly_best() {
    let mesh = Mesh::new(&planted()).unwrap();
    let sampling = Sampling { domain: LightDomain::Hemisphere, receivers: 3_000, lights: 48, seed: 3 };
    let pairs = PairTable::new(&pairs(&mesh, &sampling), &[Vec3::X]);
    let grid = |plane: ShadowPlane, family: usize| PoolPlane { width: 32, height: 32, ..pool_plane(plane, family) };
    let mut pool: Vec<PoolPlane> = Vec::new();
    for (family, plate) in planted_plates().into_iter().enumerate() {
        let middle = mesh.frame.unit_from_model(plate.middle);
        let scale = (mesh.frame.unit_from_model(plate.middle + plate.normal) - middle).length();
        let plane = square(middle, plate.normal.as_vec3(), 1.03 * plate.half as f32 * scale);
        pool.push(grid(plane, family));
        let moved = ShadowPlane { origin: plane.origin + 0.02 * plane.normal(), ..plane };
        pool.push(grid(moved, family));
    }
    pool.extend((0..16).map(|k| grid(random_square(9, k), 4 + k as usize)));
    let certificate = certify(&pairs, &pool, &[0, 2, 4, 6], &CertificateOptions::default());
    println!("{certificate:?}");
    assert!(certificate.lower_bound <= certificate.found);
    // Texels on the outlines are wrong, and no others.
    assert!(certificate.found > 0.0 && certificate.found < 0.05);
    assert!(certificate.gap < 0.1 * certificate.found, "{certificate:?}");
    // One plane short, the error is that of a whole plate, and the bound says so.
    let short = certify(&pairs, &pool, &[0, 2, 4], &CertificateOptions::default());
    assert!(short.lower_bound > 0.1 && short.lower_bound <= short.found, "{short:?}");
}

#[test]
fn the_certificate_does_not_depend_on_the_number_of_threads() {
    let (pairs, pool) = tiny(3, 24);
    let with = |threads: usize| {
        let threads = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        threads.install(|| certify(&pairs, &pool, &[0, 9], &CertificateOptions::default()))
    };
    assert_eq!(with(1), with(2));
    assert_eq!(with(1), with(5));
}

#[test]
fn without_shadow_there_is_nothing_to_prove() {
    let (mut pairs, pool) = tiny(1, 8);
    pairs.vote.iter_mut().for_each(|vote| *vote = -vote.abs());
    let certificate = certify(&pairs, &pool, &[0, 1], &CertificateOptions::default());
    assert_eq!((certificate.lower_bound, certificate.found, certificate.gap), (0.0, 0.0, 0.0));
}
