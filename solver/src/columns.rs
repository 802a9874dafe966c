//! Columns: which planes a certificate should be about.
//!
//! In: a mesh, its pairs, the planes found, candidates. Out: a certificate. The pool starts with the found planes, their
//! neighbours of a compass step (one family with the plane itself), and the best of the candidates, each with its
//! tight rectangle. Then column generation (Gilmore and Gomory, "A Linear Programming Approach to the Cutting-Stock
//! Problem", 1961): blocked pairs vote with their multiplier, lit pairs with their whole weight, and the ordinary search
//! looks for planes that are worth more under these votes than the least of the K best of the pool. Such planes enter,
//! and the bound is computed anew.
//!
//! Not guaranteed: that a pool which stopped growing holds the best planes. The search is a heuristic, and lit pairs
//! vote with more than their share of a multiplier: with the exact one, nothing where other planes already pay for a
//! pair, every plane that crosses much of the model would enter.

use crate::{
    candidates::Candidate,
    certificate::{Certificate, CertificateOptions, prove},
    mesh::Mesh,
    plane::ShadowPlane,
    pool::PoolPlane,
    rectangle::shifted,
    rectangle::{Turn, around_section, tighten},
    relaxation::Multipliers,
    selection::{SelectionOptions, Verdict, distinct, select},
    visibility::{LightPairs, Pairs},
    votes::{BIAS, Mask, best_bias, best_mask, score, thinned},
};
use glam::Vec3;
use rayon::prelude::*;

/// What the pool holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnOptions {
    /// The iteration.
    pub certificate: CertificateOptions,
    /// Blocked and lit pairs of the sample that the certificate is about; all where there are fewer.
    pub pairs: [usize; 2],
    /// Texels a side of every plane's grid. The finer, the lower error and bound; a grid with fewer than some ten
    /// pairs a texel fits the sample's noise.
    pub texels: usize,
    /// Screened candidates in the first pool.
    pub screened: usize,
    /// Steps at which neighbours of a found plane are tried, each half of the one before: six planes each.
    pub neighbour_steps: usize,
    /// Times that the pool may grow.
    pub rounds: usize,
    /// Most planes that enter each time.
    pub growth: usize,
}

/// Pairs of the sample that candidates are screened on, blocked and lit, and texels a side: what a search screens with.
const SCREENING_PAIRS: [usize; 2] = [30_000, 60_000];
const SCREENING_TEXELS: usize = 32;

/// Texels a side for the side, bias and rectangle of a screened candidate.
const SHAPING_TEXELS: usize = 64;

/// First tilt of the neighbours, radians: half of the first one of a search, which ends nearer than that.
const NEIGHBOUR_TILT: f32 = 0.06;

/// Certifies `found` over a pool that is grown around it; `search` says how new planes are sought.
#[must_use]
pub fn certify_found(
    (mesh, pairs): (&Mesh, &Pairs),
    found: &[Mask],
    candidates: &[Candidate],
    search: &SelectionOptions,
    options: &ColumnOptions,
) -> Certificate {
    let sample = &thinned(pairs, options.pairs[0], options.pairs[1]);
    let indices: Vec<usize> = (0..found.len()).collect();
    let mut pool = first_pool((mesh, sample), found, candidates, options);
    let mut proved = prove(sample, &pool, &indices, &options.certificate);
    for round in 0..=options.rounds {
        if found.is_empty() || proved.0.found <= 0.0 {
            proved.0.settled = true;
            break;
        }
        // What a plane must be worth to be chosen.
        let mut values = proved.2.clone();
        values.sort_by(|a, b| b.total_cmp(a));
        let least = values[found.len().min(values.len()) - 1] * sample.shadow_weight;
        let priced = priced(sample, &proved.1);
        let wanted = SelectionOptions {
            max_planes: options.growth,
            min_gain: least / priced.shadow_weight.max(f64::MIN_POSITIVE),
            replace_rounds: 0,
            ..*search
        };
        let entering = select(mesh, &priced, candidates, &wanted, &mut |_| Verdict::Continue).planes;
        if entering.is_empty() {
            proved.0.settled = true;
            break;
        }
        if round == options.rounds {
            break;
        }
        for mask in entering {
            let family = next_family(&pool);
            pool.push(pool_plane(&mask, options.texels, family));
        }
        let iterations = proved.0.iterations;
        proved = prove(sample, &pool, &indices, &options.certificate);
        proved.0.iterations += iterations;
    }
    proved.0
}

fn pool_plane(mask: &Mask, texels: usize, family: usize) -> PoolPlane {
    PoolPlane { plane: mask.plane, side: mask.side, bias: mask.bias, width: texels, height: texels, family }
}

fn next_family(pool: &[PoolPlane]) -> usize {
    pool.iter().map(|plane| plane.family + 1).max().unwrap_or(0)
}

/// Found planes first, each with its neighbours' family.
fn first_pool(
    (mesh, pairs): (&Mesh, &Pairs),
    found: &[Mask],
    candidates: &[Candidate],
    options: &ColumnOptions,
) -> Vec<PoolPlane> {
    let mut pool: Vec<PoolPlane> =
        found.iter().enumerate().map(|(family, mask)| pool_plane(mask, options.texels, family)).collect();
    for index in 0..found.len() {
        let mut tilt = NEIGHBOUR_TILT;
        for _ in 0..options.neighbour_steps {
            for (direction, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
                let moved = shifted(&pool[index].plane, direction, sign * tilt);
                pool.push(PoolPlane { plane: moved, ..pool[index] });
            }
            tilt *= 0.5;
        }
    }
    for mask in screened((mesh, pairs), candidates, options.screened) {
        let family = next_family(&pool);
        pool.push(pool_plane(&mask, options.texels, family));
    }
    pool
}

/// The best candidates, no two nearly the same, with sides, biases and tight rectangles.
fn screened((mesh, pairs): (&Mesh, &Pairs), candidates: &[Candidate], count: usize) -> Vec<Mask> {
    let corners = || mesh.corners.iter().flatten();
    let low = corners().fold(Vec3::INFINITY, |a, p| a.min(*p));
    let high = corners().fold(Vec3::NEG_INFINITY, |a, p| a.max(*p));
    let sample = &thinned(pairs, SCREENING_PAIRS[0], SCREENING_PAIRS[1]);
    let scored = |candidate: &Candidate| {
        let plane = around_section(low, high, candidate.normal, candidate.offset)?;
        Some((score(sample, &plane, BIAS, SCREENING_TEXELS).gain, plane))
    };
    let scored: Vec<(f64, ShadowPlane)> = candidates.par_iter().filter_map(scored).collect();
    let shaped = |(_, plane): &(f64, ShadowPlane)| {
        let (bias, score) = best_bias(sample, plane, SHAPING_TEXELS);
        let plane = tighten(sample, &best_mask(sample, plane, score.side, bias, SHAPING_TEXELS), Turn::Free)?;
        Some(Mask::open(plane, score.side, bias, 1, 1))
    };
    distinct(scored, count).par_iter().filter_map(shaped).collect()
}

/// The pairs with the votes that multipliers give them.
fn priced(pairs: &Pairs, multipliers: &Multipliers) -> Pairs {
    let mut alpha = multipliers.alpha();
    let mut shadow_weight = 0.0;
    let mut reprice = |light: &LightPairs| {
        light.revoted(|i| {
            let vote = light.vote[i];
            let price = if vote > 0.0 { alpha.next()? } else { vote };
            shadow_weight += f64::from(price.max(0.0));
            (price != 0.0).then_some(price)
        })
    };
    let lights: Vec<LightPairs> = pairs.lights.iter().map(&mut reprice).collect();
    Pairs { lights, shadow_weight, ..*pairs }
}

impl Default for ColumnOptions {
    fn default() -> Self {
        Self {
            certificate: CertificateOptions::default(),
            pairs: [150_000, 300_000],
            texels: 64,
            screened: 24,
            neighbour_steps: 1,
            rounds: 1,
            growth: 4,
        }
    }
}
