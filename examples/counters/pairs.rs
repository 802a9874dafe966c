//! Pairs a second: crossings alone, and the whole measurement of a plane, as the search does it.

use crate::{Counter, best_seconds, limits, model::Model};
use glam::Vec3;
use shadowfit::effort::Effort;
use shadowfit_solver::{
    lights::LightDomain,
    mesh::Mesh,
    pair_table::PairTable,
    plane::{PlacedPlane, ShadowPlane, Side},
    search::{BIAS, BIASES, SearchOptions, place},
    sections::{TraceOptions, trace},
};
use std::{error::Error, hint::black_box};

/// Multiply-adds of a crossing: three affine rows.
const MULTIPLY_ADDS: f64 = 9.0;

/// Floats that a crossing reads.
const FLOATS: f64 = 3.0;

/// Planes measured in one pass.
const PLANES: usize = 48;

/// Pairs of a table far larger than any cache.
const MANY_PAIRS: usize = 8_000_000;

/// Crossings of a sample as the search measures it (in the cache) and of a table as lists are decided on (in memory),
/// and the measurement of planes on the sample.
pub fn counters() -> Result<Vec<Counter>, Box<dyn Error>> {
    let mesh = Mesh::new(&Model::with_triangles(16_000).to_soup())?;
    let plan = Effort::balanced().divided;
    let (options, pairs_of_section) = (plan.search, plan.trace.pairs / plan.sections);
    let directions = LightDomain::Sphere.directions(plan.directions, 1);
    let table = |pairs: usize| {
        let options = TraceOptions { pairs, exposure_rays: 4, ..plan.trace };
        trace(&mesh, &vec![0; mesh.triangle_count()], &directions, LightDomain::Sphere, &options).remove(0)
    };
    let multiply_adds = limits::fused_multiply_adds()?;
    let section = table(pairs_of_section);
    let sample = section.sample(options.scoring, options.seed);
    let mut out = Vec::new();
    for (what, table) in [("sample", &sample), ("table", &table(MANY_PAIRS))] {
        let rate = crossings(table, options.texels)?;
        let name = format!("crossings in a {what} of {} pairs", table.len());
        let read = limits::floats_read(&[&table.x, &table.y, &table.z], 4 * repeats(table))? / FLOATS;
        let computed = multiply_adds / MULTIPLY_ADDS;
        for (limit, of) in [(read, "summing the same floats"), (computed, "9 multiply-adds a pair")] {
            let limit = Some((limit, of.to_string()));
            out.push(Counter { name: name.clone(), rate, limit, agreeing: None });
        }
    }
    let crossings = out[0].rate;
    let rate = measurements(&mesh, &section, &sample, &options)?;
    let limit = Some((crossings, "its crossings alone".to_string()));
    let name = format!("measurement of a plane on a sample of {} pairs", sample.len());
    out.push(Counter { name, rate, limit, agreeing: None });
    Ok(out)
}

/// Passes over a table that take a few tenths of a second: the clock advances in steps of some milliseconds.
fn repeats(table: &PairTable) -> usize {
    (200_000_000 / table.len()).max(1)
}

/// A plane through the middle, larger than the model.
fn middle_plane(normal: Vec3) -> ShadowPlane {
    let (u, v) = normal.any_orthonormal_pair();
    ShadowPlane { origin: -(u + v), u: u * 2.0, v: v * 2.0 }
}

fn crossings(table: &PairTable, texels: usize) -> Result<f64, Box<dyn Error>> {
    let placed = PlacedPlane { plane: middle_plane(Vec3::new(0.36, 0.48, 0.8)), side: Side::Both, bias: BIAS };
    let mut out = Vec::new();
    let repeats = repeats(table);
    let seconds = best_seconds(7, || {
        for _ in 0..repeats {
            table.crossings(black_box(&placed), (texels, texels), &mut out);
            black_box(&out);
        }
    })?;
    Ok((table.len() * repeats) as f64 / seconds)
}

/// Pairs a second of measuring planes with every bias; drawing the sample does not count.
fn measurements(
    mesh: &Mesh,
    section: &PairTable,
    sample: &PairTable,
    options: &SearchOptions,
) -> Result<f64, Box<dyn Error>> {
    let normals = LightDomain::Sphere.directions(PLANES, 2);
    let planes: Vec<(ShadowPlane, Side)> = normals.into_iter().map(|n| (middle_plane(n), Side::Both)).collect();
    let all = best_seconds(5, || drop(black_box(place(mesh, section, &planes, options))))?;
    let drawing = best_seconds(5, || drop(black_box(place(mesh, section, &[], options))))?;
    Ok((sample.len() * planes.len() * BIASES.len()) as f64 / (all - drawing))
}
