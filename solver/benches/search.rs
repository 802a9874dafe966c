//! What a fit spends its time in: shadow rays, crossings, one pick of the search, lists, and fields.
//!
//! Run: `cargo bench -p shadowfit-solver`. Rates are per second of wall clock on all cores of the rayon pool, except
//! `crossings` and `field`, which are one plane on one core (a fit works on many planes side by side).

#[path = "../tests/scenes/mod.rs"]
mod scenes;

use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main, measurement::WallTime};
use scenes::{Sampling, fit_options, knot, list_directions, pairs, planted, receivers, soup};
use shadowfit_solver::{
    field::{VoteGrid, VotedShape},
    lights::LightDomain,
    lists::{VotedPlane, assign},
    mesh::{Mesh, Sides},
    pair_table::PairTable,
    plane::{PlacedPlane, ShadowPlane, Side},
    search::{BIAS, SearchOptions, Verdict, search},
    visibility::trace,
};
use std::hint::black_box;

const SAMPLING: Sampling = Sampling { domain: LightDomain::Sphere, receivers: 4_000, lights: 128, seed: 1 };

/// Planes of a fit.
const PLANES: usize = 4;

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

fn crossings(c: &mut Criterion) {
    let mut group = c.benchmark_group("crossings");
    let (name, mesh) = &scenes()[0];
    let table = PairTable::new(&pairs(mesh, &SAMPLING), &[]);
    group.throughput(Throughput::Elements(table.len() as u64));
    let normal = scenes::unit_vector(3, 1);
    let (u, v) = normal.any_orthonormal_pair();
    let plane = ShadowPlane { origin: -(u + v), u: u * 2.0, v: v * 2.0 };
    let placed = PlacedPlane { plane, side: Side::Both, bias: BIAS };
    let mut out = Vec::new();
    for texels in [32, 255] {
        group.bench_function(format!("{name}, {texels} texels"), |b| {
            b.iter(|| table.crossings(black_box(&placed), (texels, texels), &mut out));
        });
    }
}

fn fits(c: &mut Criterion) {
    let mut group = c.benchmark_group("fit");
    group.sample_size(10);
    let options = fit_options(SAMPLING.domain, PLANES, 1);
    for (name, mesh) in scenes() {
        let table = PairTable::new(&pairs(&mesh, &SAMPLING), &list_directions(&options));
        let searched = |max_planes: usize| {
            let options = SearchOptions { max_planes, replace_rounds: 0, ..options.search };
            search(&mesh, &table, black_box(&options), 0.0, &mut |_| Verdict::Continue).planes
        };
        group.bench_function(format!("one pick, {name}"), |b| b.iter(|| searched(1)));
        let planes = searched(PLANES);
        group.bench_function(format!("lists of {PLANES}, {name}"), |b| {
            b.iter(|| assign(&table, black_box(&planes), &options.lists));
        });
        let fit = assign(&table, &planes, &options.lists);
        fields(&mut group, name, &fit.planes[0]);
    }
}

/// A texture of half the texels of the votes, and one of an eighth.
fn fields(group: &mut BenchmarkGroup<'_, WallTime>, name: &str, plane: &VotedPlane) {
    let votes: Vec<f32> = plane.votes[0].iter().zip(&plane.votes[1]).map(|(a, b)| a + b).collect();
    let grid = VoteGrid { votes: &votes, width: plane.width, height: plane.height };
    for divisor in [2, 8] {
        let size = (plane.width.div_ceil(divisor).max(3), plane.height.div_ceil(divisor).max(3));
        group.bench_function(format!("field at 1/{divisor}, {name}"), |b| {
            b.iter(|| VotedShape::new(black_box(grid), 2).field(size));
        });
    }
}

criterion_group!(benches, rays, crossings, fits);
criterion_main!(benches);
