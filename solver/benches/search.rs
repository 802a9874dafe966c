//! What a fit spends its time in: shadow rays, pair evaluations, and the whole search and bake.
//!
//! Run: `cargo bench -p shadowfit-solver`. Rates are per second of wall clock on all cores of the rayon pool, except
//! `crossings`, which is one plane on one core (a search looks at many planes side by side).

#[path = "../tests/scenes/mod.rs"]
mod scenes;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use scenes::{Sampling, baked, fit_options, knot, list_directions, pairs, planted, receivers, soup};
use shadowfit_solver::{
    lights::LightDomain,
    mesh::{Mesh, Sides},
    pair_table::PairTable,
    plane::{PlacedPlane, ShadowPlane, Side},
    search::{BIAS, Verdict, search},
    visibility::trace,
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
    let mut group = c.benchmark_group("crossings");
    let (name, mesh) = &scenes()[0];
    let table = PairTable::new(&pairs(mesh, &SAMPLING), &[]);
    group.throughput(Throughput::Elements(table.len() as u64));
    let normal = scenes::unit_vector(3, 1);
    let (u, v) = normal.any_orthonormal_pair();
    let plane = ShadowPlane { origin: -(u + v), u: u * 2.0, v: v * 2.0 };
    let placed = PlacedPlane { plane, side: Side::Both, bias: BIAS };
    for texels in [32, 64, 128] {
        let mut out = Vec::new();
        group.bench_function(format!("{name}, {texels} texels"), |b| {
            b.iter(|| table.crossings(black_box(&placed), (texels, texels), &mut out));
        });
    }
}

fn whole_fits(c: &mut Criterion) {
    let mut group = c.benchmark_group("fit");
    group.sample_size(10);
    let options = fit_options(SAMPLING.domain, 4, 1);
    for (name, mesh) in scenes() {
        let table = PairTable::new(&pairs(&mesh, &SAMPLING), &list_directions(&options));
        let min_gain = options.min_gain * table.weights().0;
        let found = || search(&mesh, &table, &options.search, min_gain, &mut |_| Verdict::Continue);
        group.bench_function(format!("search 4, {name}"), |b| b.iter(found));
        let planes = found().planes;
        group.bench_function(format!("bake 4, {name}"), |b| b.iter(|| baked(&table, black_box(&planes), &options)));
    }
}

criterion_group!(benches, rays, pair_evaluations, whole_fits);
criterion_main!(benches);
