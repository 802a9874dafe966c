//! What a fit spends its time in: shadow rays, pair evaluations, and the whole search and bake.
//!
//! Run: `cargo bench -p shadowfit-solver`. Rates are per second of wall clock on all cores of the rayon pool, except
//! `score`, which is one plane on one core (a search scores many planes side by side).

#[path = "../tests/scenes/mod.rs"]
mod scenes;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use scenes::{Sampling, fit, fit_options, knot, pairs, planted, receivers, soup};
use shadowfit_solver::{
    bake::bake,
    candidates::generate,
    lights::LightDomain,
    mesh::{Mesh, Sides},
    plane::ShadowPlane,
    selection::{Verdict, select},
    visibility::trace,
    votes::{BIAS, score},
};
use std::hint::black_box;

const SAMPLING: Sampling = Sampling { domain: LightDomain::Sphere, receivers: 4_000, lights: 128, seed: 1 };

/// The knot has long curved shadows everywhere; the planted plates have an exact answer.
fn scenes() -> [(&'static str, Mesh); 2] {
    let knot = soup(&[(&knot(160, 20), Sides::Front)]);
    [("knot", knot), ("planted", planted())]
        .map(|(name, soup)| (name, Mesh::new(&soup).expect("the scene has triangles")))
}

fn rays(c: &mut Criterion) {
    let mut group = c.benchmark_group("trace");
    for (name, mesh) in scenes() {
        let receivers = receivers(&mesh, SAMPLING.receivers, SAMPLING.seed);
        let lights = SAMPLING.domain.directions(SAMPLING.lights, SAMPLING.seed);
        let rays = trace(&mesh, &receivers, &lights, 1.0).len();
        group.throughput(Throughput::Elements(rays as u64));
        group.bench_function(name, |b| b.iter(|| trace(&mesh, &receivers, black_box(&lights), 1.0)));
    }
}

fn pair_evaluations(c: &mut Criterion) {
    let mut group = c.benchmark_group("score");
    let (name, mesh) = &scenes()[0];
    let pairs = pairs(mesh, &SAMPLING);
    group.throughput(Throughput::Elements(pairs.len() as u64));
    let normal = scenes::unit_vector(3, 1);
    let (u, v) = normal.any_orthonormal_pair();
    let plane = ShadowPlane { origin: -(u + v), u: u * 2.0, v: v * 2.0 };
    for texels in [32, 64, 128] {
        group.bench_function(format!("{name}, {texels} texels"), |b| {
            b.iter(|| score(&pairs, black_box(&plane), BIAS, texels))
        });
    }
}

fn whole_fits(c: &mut Criterion) {
    let mut group = c.benchmark_group("fit");
    group.sample_size(10);
    let options = fit_options(4, 1);
    for (name, mesh) in scenes() {
        let pairs = pairs(&mesh, &SAMPLING);
        let candidates = generate(&mesh, &options.candidates);
        group.bench_function(format!("select 4, {name}"), |b| {
            b.iter(|| select(&mesh, &pairs, black_box(&candidates), &options.selection, &mut |_| Verdict::Continue));
        });
        let (selection, _) = fit(&mesh, &pairs, &options);
        group.bench_function(format!("bake 4, {name}"), |b| {
            b.iter(|| bake(&pairs, black_box(&selection.planes), &options.bake));
        });
    }
}

criterion_group!(benches, rays, pair_evaluations, whole_fits);
criterion_main!(benches);
