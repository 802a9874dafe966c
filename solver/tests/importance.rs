//! Importance: drawn pairs stand for all, rare shadows are found, and threads do not matter.

mod scenes;

use glam::DVec3;
use scenes::{closed, cuboid, knot, quad, receivers, soup};
use shadowfit_solver::{
    importance::Rates,
    lights::LightDomain,
    mesh::{Mesh, Sides},
    pair_table::PairTable,
    receivers::Receivers,
    sections::{self, TraceOptions},
    visibility::{LightPairs, Pairs, trace, trace_drawn},
};

/// Lights and directions of the lists.
const LIGHTS: (usize, usize) = (192, 48);

/// The smallest rate is this share of the largest, where the budget is short of all candidates.
const FLOOR: f32 = 0.03;

/// All pairs of a mesh, those drawn, and the rate of each of all, in order.
struct Drawn {
    all: Pairs,
    some: Pairs,
    rates: Vec<Vec<f32>>,
}

fn draw(mesh: &Mesh, receivers: &Receivers, wanted: usize, seed: u64) -> Drawn {
    let domain = LightDomain::Sphere;
    let (lights, directions) = (domain.directions(LIGHTS.0, seed), domain.directions(LIGHTS.1, seed + 100));
    let rates = Rates::new((mesh, receivers), &lights, &directions, wanted, seed);
    let all = trace(mesh, receivers, &lights, domain.solid_angle());
    let some = trace_drawn(mesh, receivers, &lights, domain.solid_angle(), |light, i| rates.of(light, i));
    let of_light = |(k, light): (usize, &LightPairs)| light.receiver.iter().map(|i| rates.of(k, *i as usize)).collect();
    let rates = all.lights.iter().enumerate().map(of_light).collect();
    Drawn { all, some, rates }
}

impl Drawn {
    /// Votes and rates of all pairs.
    fn votes(&self) -> impl Iterator<Item = (f32, f32)> {
        let votes = self.all.lights.iter().flat_map(|light| &light.vote);
        votes.copied().zip(self.rates.iter().flatten().copied())
    }

    /// Standard deviation of the drawn sum of the votes that `counts`: each is drawn or not, on its own.
    fn deviation(&self, counts: impl Fn(f32) -> bool) -> f64 {
        let variance = |(vote, rate): (f32, f32)| f64::from(vote * vote * (1.0 - rate) / rate);
        self.votes().filter(|(vote, _)| counts(*vote)).map(variance).sum::<f64>().sqrt()
    }
}

#[test]
fn sums_of_drawn_pairs_are_those_of_all() {
    let mesh = closed(&knot(64, 10));
    for seed in 0..8 {
        let drawn = draw(&mesh, &receivers(&mesh, 2_000, seed), 20_000, seed);
        assert!((15_000..25_000).contains(&drawn.some.len()), "{} pairs for 20,000", drawn.some.len());
        let sums = [
            (drawn.some.shadow_weight, drawn.all.shadow_weight, drawn.deviation(|vote| vote > 0.0)),
            (drawn.some.total_weight, drawn.all.total_weight, drawn.deviation(|_| true)),
        ];
        for (some, all, deviation) in sums {
            // Five standard deviations, and those are small themselves: chance alone fails once in a million.
            assert!((some - all).abs() < 5.0 * deviation, "seed {seed}: {some} for {all} +- {deviation}");
            assert!(deviation < 0.03 * all, "seed {seed}: {all} +- {deviation}");
        }
    }
}

#[test]
fn more_is_drawn_where_shadow_is_undecided() {
    let mesh = closed(&knot(64, 10));
    let drawn = draw(&mesh, &receivers(&mesh, 2_000, 1), 20_000, 1);
    let count = |pairs: &Pairs| {
        let votes = pairs.lights.iter().flat_map(|light| &light.vote);
        votes.filter(|vote| **vote > 0.0).count() as f64 / pairs.len() as f64
    };
    let (all, some) = (count(&drawn.all), count(&drawn.some));
    assert!(some > 1.3 * all && some < 0.7, "blocked share {some} drawn of {all}");
    let (low, high) = drawn.votes().fold((1.0f32, 0.0f32), |(low, high), (_, rate)| (low.min(rate), high.max(rate)));
    assert!(high <= 1.0 && low >= FLOOR * high * 0.999, "rates from {low} to {high}");
}

/// A plate of a thousandth of the ground, which pilots miss.
#[test]
fn a_rare_shadow_is_found() {
    let ground = quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0);
    let plate = quad(DVec3::new(0.3, 0.02, 0.3), DVec3::Z * 0.06, DVec3::X * 0.06);
    let mesh = Mesh::new(&soup(&[(&ground, Sides::Front), (&plate, Sides::Front)])).expect("the scene has triangles");
    let drawn = draw(&mesh, &receivers(&mesh, 8_000, 3), 40_000, 3);
    let blocked = || drawn.votes().filter(|(vote, _)| *vote > 0.0);
    // All of them are missed with a probability of at most the product of (1 - rate): below e^-10.
    let certainty: f64 = blocked().map(|(_, rate)| -f64::from(1.0 - rate.min(0.999)).ln()).sum();
    assert!(certainty > 10.0, "{} blocked pairs, e^-{certainty}", blocked().count());
    let rare = drawn.all.shadow_weight / drawn.all.total_weight;
    assert!(rare < 2e-3, "a share of {rare} is not rare");
    let (some, all, deviation) =
        (drawn.some.shadow_weight, drawn.all.shadow_weight, drawn.deviation(|vote| vote > 0.0));
    assert!(some > 0.0 && (some - all).abs() < 5.0 * deviation, "{some} for {all} +- {deviation}");
}

#[test]
fn threads_do_not_matter_and_hidden_sections_have_no_pairs() {
    // A knot beside a box, and in the box another one that is seen from nowhere.
    let at = DVec3::X * 5.0;
    let (outer, inner) = (cuboid(at, DVec3::ONE, 4), cuboid(at, DVec3::splat(0.5), 2));
    let shown: Vec<_> = knot(32, 8).into_iter().chain(outer).collect();
    let mesh = Mesh::new(&soup(&[(&shown, Sides::Front), (&inner, Sides::Front)])).expect("the scene has triangles");
    let section_of: Vec<u32> = mesh.source.iter().map(|source| u32::from(*source as usize >= shown.len())).collect();
    let options = TraceOptions { pairs: 100_000, lights: 96, stride: 4, exposure_rays: 16, seed: 4 };
    let directions = LightDomain::Sphere.directions(24, 1);
    let tables = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sections::trace(&mesh, &section_of, &directions, LightDomain::Sphere, &options))
    };
    let (one, three) = (tables(1), tables(3));
    let columns = |tables: &[PairTable]| -> Vec<(Vec<u32>, Vec<u32>)> {
        tables.iter().map(|t| (t.receiver.clone(), t.vote.iter().map(|v| v.to_bits()).collect())).collect()
    };
    assert_eq!(columns(&one), columns(&three));
    assert!(!one[0].is_empty());
    assert!(one[1].is_empty(), "{} pairs of hidden surface", one[1].len());
}
