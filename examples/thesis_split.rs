//! The thesis's own division of the teapot against the automatic one, at the same planes and lookups.
//!
//!     cargo run --release --example thesis_split [PLANES_PER_SECTION...]
//!
//! Coleman, "Fast Self-Shadowing Using Occluder Textures" (2006), cut his teapot by hand: the lid, the side of the
//! spout, the side of the handle. Here the lid is what lies within the rim's inner radius and above its height, and the
//! body is cut where x = 0. Both divisions go through the same search, lists and bake with the numbers of `--preset
//! fast --sections 3`.

use glam::DVec3;
use shadowfit::{effort::Effort, scene};
use shadowfit_solver::{
    fit::bake,
    lights::LightDomain,
    lists::{ListOptions, assign},
    mesh::Mesh,
    metrics::measure,
    pair_table::PairTable,
    receivers::{ReceiverOptions, sample},
    search::{SearchOptions, Verdict, search},
    sections,
    visibility::trace,
};
use std::{error::Error, path::Path};

/// Height of the rim where the lid lies on it, metres.
const SEAT_HEIGHT: f64 = 0.12;
/// Radius of the lid, metres.
const LID_RADIUS: f64 = 0.0651;
/// Planes of each section where no argument says: 12 are about the thesis's eleven in all.
const PLANES: [usize; 3] = [4, 8, 12];
/// Longest list.
const LOOKUPS: usize = 4;
/// Sampling of the pilot, the lists' directions, training, and of what is measured.
const SEEDS: [u64; 4] = [11, 12, 13, 14];
const PILOT: (usize, usize) = (16_384, 64);
const HELD_OUT: (usize, usize) = (24_000, 307);
const EXPOSURE_RAYS: usize = 32;

fn main() -> Result<(), Box<dyn Error>> {
    let given: Vec<usize> = std::env::args().skip(1).map(|word| word.parse()).collect::<Result<_, _>>()?;
    let mesh = Mesh::new(&scene::load(Path::new("models/teapot.glb"))?.soup)?;
    let by_hand: Vec<u32> = mesh.corners.iter().map(|[a, b, c]| hand_section(&mesh, (*a + *b + *c) / 3.0)).collect();
    let pilot = sampled(&mesh, PILOT, SEEDS[0]);
    let units: Vec<u32> = (0..mesh.triangle_count() as u32).collect();
    let automatic = sections::divide(&mesh, &units, (&pilot.0, &pilot.1), 3, None);
    println!("planes/section  division   planes  shadow_error  missed  false");
    for planes in if given.is_empty() { PLANES.to_vec() } else { given } {
        for (name, section_of) in [("by hand", &by_hand), ("automatic", &automatic)] {
            println!("{planes:<15} {name:<10} {}", fitted(&mesh, section_of, planes));
        }
    }
    Ok(())
}

/// 0: the lid; 1: the spout's side; 2: the handle's side.
fn hand_section(mesh: &Mesh, middle: glam::Vec3) -> u32 {
    let DVec3 { x, y, z } = mesh.frame.model_from_unit(middle);
    if y > SEAT_HEIGHT && x.hypot(z) < LID_RADIUS { 0 } else { 1 + u32::from(x < 0.0) }
}

fn sampled(
    mesh: &Mesh,
    (count, lights): (usize, usize),
    seed: u64,
) -> (shadowfit_solver::receivers::Receivers, shadowfit_solver::visibility::Pairs) {
    let receivers = sample(mesh, &ReceiverOptions { count, exposure_rays: EXPOSURE_RAYS, seed });
    let domain = LightDomain::Sphere;
    let pairs = trace(mesh, &receivers, &domain.directions(lights, seed), domain.solid_angle());
    (receivers, pairs)
}

/// Fits a division and measures it: one row.
fn fitted(mesh: &Mesh, section_of: &[u32], max_planes: usize) -> String {
    let (plan, domain) = (Effort::fast().divided, LightDomain::Sphere);
    let directions = domain.directions(plan.directions, SEEDS[1]);
    let training = sections::TraceOptions { seed: SEEDS[2], ..plan.trace };
    let tables = sections::trace(mesh, section_of, &directions, domain, &training);
    let shadow: f64 = tables.iter().map(|table| table.weights().0).sum();
    let options = SearchOptions { max_planes, ..plan.search };
    let lists = ListOptions { max_lookups: LOOKUPS, ..plan.lists };
    let fit = |table: &PairTable| {
        let found = search(mesh, table, &options, plan.min_gain * shadow, &mut |_| Verdict::Continue);
        assign(table, &found.planes, &lists)
    };
    let fits: Vec<_> = tables.iter().map(fit).collect();
    let set = bake(&fits, &directions, shadow, &plan.budget);
    let (receivers, pairs) = sampled(mesh, HELD_OUT, SEEDS[3]);
    let sections: Vec<u32> = receivers.triangles.iter().map(|&triangle| section_of[triangle as usize]).collect();
    let metrics = measure(&set, &pairs, &sections);
    let (error, missed, false_) = (metrics.shadow_error, metrics.missed, metrics.false_);
    format!("{:>7}  {error:>12.4}  {missed:>6.4}  {false_:>5.4}", set.planes.len())
}
