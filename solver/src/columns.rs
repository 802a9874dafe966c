//! Columns: which planes a certificate should be about.
//!
//! In: a mesh, the pairs of one section, the planes found. Out: a certificate. The pool starts with the found planes,
//! their neighbours of a compass step (one family with the plane itself), and what a search of more planes with another
//! seed finds; a plane that nearly coincides with one of the pool joins its family. Then column generation (Gilmore and
//! Gomory, "A Linear Programming Approach to the Cutting-Stock Problem", 1961): blocked pairs vote with their multiplier,
//! lit pairs with their whole weight, and the ordinary search proposes planes under these votes. Those that are worth
//! more on their own grid than the least of the K best of the pool enter, and the bound is computed anew.
//!
//! Every plane is read for all receivers under all lights: the table that is searched has one direction. What
//! `--max-planes` would fit without active lists is bounded; a set with active lists may do better than the bound.
//!
//! Not guaranteed: that a pool which stopped growing holds the best planes. The search is a heuristic, and lit pairs
//! vote with more than their share of a multiplier: with the exact one, nothing where other planes already pay for a
//! pair, every plane that crosses much of the model would enter.

use crate::{
    certificate::{Certificate, CertificateOptions, prove},
    mesh::Mesh,
    pair_table::{PairTable, SPARE, SampleSize},
    plane::PlacedPlane,
    pool::PoolPlane,
    rectangle::shifted,
    relaxation::Multipliers,
    sampling::hash,
    search::{SearchOptions, Verdict, search},
};

/// What the pool holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnOptions {
    /// The iteration.
    pub certificate: CertificateOptions,
    /// The sample that the certificate is about; all where there are fewer.
    pub sample: SampleSize,
    /// Texels a side of every plane's grid, up to 255. The finer, the lower error and bound; a grid with fewer than some
    /// ten pairs a texel fits the sample's noise.
    pub texels: usize,
    /// Planes in the first pool beyond as many as were found, of a search with another seed.
    pub further: usize,
    /// Steps at which neighbours of a found plane are tried, each half of the one before: six planes each.
    pub neighbour_steps: usize,
    /// Times that the pool may grow.
    pub rounds: usize,
    /// Most planes that enter each time.
    pub growth: usize,
}

/// First tilt of the neighbours, radians: half of the first one of a search, which ends nearer than that.
const NEIGHBOUR_TILT: f32 = 0.06;

/// Planes within this cosine (8 degrees) and distance, unit space, are variants of one: a set would hardly have both, and
/// the relaxation shares the false shadows of one among both. With a family for each, the bound of 3 of 25 planes of the
/// aircraft, found 0.2248 (and the best of the pool), was 0.2126 in place of 0.2247.
const SAME_COSINE: f32 = 0.99;
const SAME_DISTANCE: f32 = 0.03;

/// A search counts gains of smoothed textures under lights that did not decide them, which is less than what a plane
/// saves with the best texture on the sample: proposals of this share of the wanted worth are looked at.
const PROPOSED_SHARE: f64 = 0.5;

/// Further planes explain at least this share of the shadow; those of less fit noise.
const FURTHER_GAIN: f64 = 5e-4;

/// Certifies `found` over a pool that is grown around it; `search` says how new planes are sought, but for their number
/// and the rounds of replacing.
#[must_use]
pub fn certify_found(
    (mesh, table): (&Mesh, &PairTable),
    found: &[PlacedPlane],
    search: &SearchOptions,
    options: &ColumnOptions,
) -> Certificate {
    let sample = &read_everywhere(table.sample(options.sample, search.seed));
    let indices: Vec<usize> = (0..found.len()).collect();
    let mut pool = first_pool((mesh, sample), found, search, options);
    let mut proved = prove(sample, &pool, &indices, &options.certificate);
    for round in 0..=options.rounds {
        if found.is_empty() || proved.0.found <= 0.0 {
            proved.0.settled = true;
            break;
        }
        // What a plane must be worth to be chosen.
        let mut values = proved.2.clone();
        values.sort_by(|a, b| b.total_cmp(a));
        let least = values[found.len().min(values.len()) - 1] * sample.weights().0;
        let priced = priced(sample, &proved.1);
        let wanted = SearchOptions { seed: hash(search.seed, 2 + round as u64), ..*search };
        let mut entering = searched((mesh, &priced), &wanted, options.growth, least * PROPOSED_SHARE);
        entering.retain(|placed| worth(&priced, placed, options.texels) > least);
        if entering.is_empty() {
            proved.0.settled = true;
            break;
        }
        if round == options.rounds {
            break;
        }
        for placed in entering {
            add(&mut pool, placed, options.texels);
        }
        let iterations = proved.0.iterations;
        proved = prove(sample, &pool, &indices, &options.certificate);
        proved.0.iterations += iterations;
    }
    proved.0
}

fn pool_plane(placed: PlacedPlane, texels: usize, family: usize) -> PoolPlane {
    PoolPlane { placed, width: texels, height: texels, family }
}

/// Puts a plane into the pool: into the family of one that it nearly coincides with, else into one of its own.
fn add(pool: &mut Vec<PoolPlane>, placed: PlacedPlane, texels: usize) {
    let normal = placed.plane.normal();
    let same = |other: &&PoolPlane| {
        let other = &other.placed.plane;
        let middle = other.origin + 0.5 * (other.u + other.v);
        let distance = normal.dot(middle - placed.plane.origin).abs();
        normal.dot(other.normal()).abs() > SAME_COSINE && distance < SAME_DISTANCE
    };
    let own = pool.iter().map(|plane| plane.family + 1).max().unwrap_or(0);
    let family = pool.iter().find(same).map_or(own, |other| other.family);
    pool.push(pool_plane(placed, texels, family));
}

/// The same pairs for planes without active lists.
fn read_everywhere(mut table: PairTable) -> PairTable {
    table.directions = 1;
    table.lights.iter_mut().for_each(|rows| rows.direction = 0);
    table
}

/// Found planes first, each with its neighbours' family.
fn first_pool(
    (mesh, sample): (&Mesh, &PairTable),
    found: &[PlacedPlane],
    search: &SearchOptions,
    options: &ColumnOptions,
) -> Vec<PoolPlane> {
    let mut pool: Vec<PoolPlane> =
        found.iter().enumerate().map(|(family, placed)| pool_plane(*placed, options.texels, family)).collect();
    for index in 0..found.len() {
        let mut tilt = NEIGHBOUR_TILT;
        for _ in 0..options.neighbour_steps {
            for (direction, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
                let placed = pool[index].placed;
                let plane = shifted(&placed.plane, direction, sign * tilt);
                pool.push(PoolPlane { placed: PlacedPlane { plane, ..placed }, ..pool[index] });
            }
            tilt *= 0.5;
        }
    }
    let wanted = SearchOptions { seed: hash(search.seed, 1), ..*search };
    let least = FURTHER_GAIN * sample.weights().0;
    for placed in searched((mesh, sample), &wanted, found.len() + options.further, least) {
        add(&mut pool, placed, options.texels);
    }
    pool
}

/// Up to `count` planes that gain `least` each.
fn searched((mesh, table): (&Mesh, &PairTable), options: &SearchOptions, count: usize, least: f64) -> Vec<PlacedPlane> {
    let options = SearchOptions { max_planes: count, replace_rounds: 0, ..*options };
    let selection = search(mesh, table, &options, least.max(f64::MIN_POSITIVE), &mut |_| Verdict::Continue);
    selection.planes.iter().map(|found| found.placed).collect()
}

/// What the plane alone saves of the votes with the best texture of `n` x `n`.
fn worth(table: &PairTable, placed: &PlacedPlane, n: usize) -> f64 {
    let mut crossed = Vec::new();
    table.crossings(placed, (n, n), &mut crossed);
    let mut votes = vec![0.0f64; n * n + SPARE];
    for (texel, vote) in crossed.into_iter().zip(&table.vote) {
        votes[usize::from(texel)] += f64::from(*vote);
    }
    votes[..n * n].iter().map(|vote| vote.max(0.0)).sum()
}

/// The pairs with the votes that multipliers give them.
fn priced(table: &PairTable, multipliers: &Multipliers) -> PairTable {
    let mut alpha = multipliers.alpha();
    table.revoted(|i| {
        let vote = table.vote[i];
        let price = if vote > 0.0 { alpha.next()? } else { vote };
        (price != 0.0).then_some(price)
    })
}

impl Default for ColumnOptions {
    fn default() -> Self {
        Self {
            certificate: CertificateOptions::default(),
            sample: SampleSize { lights: 192, pairs: 450_000 },
            texels: 64,
            further: 12,
            neighbour_steps: 1,
            rounds: 1,
            growth: 4,
        }
    }
}
