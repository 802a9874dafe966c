//! Votes: what the pairs say about each texel of a plane.
//!
//! A pair's ray crosses the plane in one texel. Summing signed votes per texel gives, in one pass over the pairs,
//! the best binary texture (block where the sum is positive) and the exact drop of the error that it brings (the
//! sum of the positive sums). This loop is where a search spends its time: the affine rows of `shade::plane_rows`
//! make texels of a whole block of pairs a few vector operations; only the scatter is scalar.

use crate::{
    plane::{ShadowPlane, Side},
    sampling::uniform,
    shade::{PlaneRows, plane_rows},
    visibility::{LightPairs, Pairs},
};
use rayon::prelude::*;
use std::ops::Range;

/// The bias that a search starts with: a receiver nearer to a plane than this along the ray is not shadowed by it,
/// unit space. Where a plane cuts a body, the rays of receivers beside the cut cross it at the very border of the
/// texture, and half of them on the wrong side. Held-out error of 11 planes, greedy, seed 2, at 0.0005, 0.003, 0.008,
/// 0.015, 0.025 and 0.04: teapot_three 0.183, 0.156, 0.135, 0.138, 0.144, 0.149; aircraft 0.153, 0.139, 0.126, 0.120,
/// 0.121, 0.135.
pub const BIAS: f32 = 0.01;

/// What a plane's bias is chosen from: small ones for plates that touch what they shadow, large ones for cuts through
/// round bodies. The smallest still clears receivers that lie *on* the plane (computed up to 5e-5 beside it).
const BIASES: [f32; 6] = [5e-4, 2e-3, 5e-3, BIAS, 0.02, 0.04];

/// Pairs per block of the vector loop; the block's texels stay in registers and L1.
const BLOCK: usize = 64;

/// Lights per unit of parallel work. Fixed, so that sums are added in the same order at any thread count.
const LIGHTS_PER_TASK: usize = 16;

/// A plane with a binary texture. `blocked` has some entries more than texels: they stand for "crosses outside" and
/// are always 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Where it lies.
    pub plane: ShadowPlane,
    /// Which receivers it serves.
    pub side: Side,
    /// A receiver nearer than this along the ray is not shadowed, unit space.
    pub bias: f32,
    /// Texels along u.
    pub width: usize,
    /// Texels along v.
    pub height: usize,
    /// `[row][column]`, 1 = blocks, 0 = open.
    pub blocked: Vec<u8>,
}

impl Mask {
    /// An open texture.
    #[must_use]
    pub fn open(plane: ShadowPlane, side: Side, bias: f32, width: usize, height: usize) -> Self {
        Self { plane, side, bias, width, height, blocked: vec![0; width * height + OUTSIDE_LANES] }
    }

    /// Calls `f(pair, texel)` for the pairs of one light, in order; texels past the last mean "outside".
    /// Does nothing where the plane casts nothing under this light.
    pub fn for_each_texel(&self, pairs: &LightPairs, f: impl FnMut(usize, usize)) {
        if let Some(rows) = plane_rows(&self.plane, self.side, pairs.light) {
            for_each_texel((&rows, self.bias), pairs, 0..pairs.len(), (self.width, self.height), f);
        }
    }
}

/// 2^23: added to a float of 0..2^23 it leaves the integer part, rounded to nearest, in the low 23 bits. A plain
/// `as` conversion saturates, which no vector instruction does: the compiler then converts pair by pair.
const TO_INTEGER: f32 = 8_388_608.0;

/// Spare entries behind the texels for pairs that cross outside. One alone would make each of them wait for the
/// store of the one before.
const OUTSIDE_LANES: usize = 16;

/// See [`Mask::for_each_texel`]; `size` is `(width, height)`.
fn for_each_texel(
    (rows, bias): (&PlaneRows, f32),
    pairs: &LightPairs,
    range: Range<usize>,
    size: (usize, usize),
    mut f: impl FnMut(usize, usize),
) {
    let outside = (size.0 * size.1) as u32;
    let (w, h) = (size.0 as f32, size.1 as f32);
    let [ra, rb, rs] = [rows.a * w, rows.b * h, rows.s].map(|row| row.to_array());
    let mut texels = [0u32; BLOCK];
    let mut start = range.start;
    while start < range.end {
        let end = (start + BLOCK).min(range.end);
        let (x, y, z) = (&pairs.x[start..end], &pairs.y[start..end], &pairs.z[start..end]);
        for (lane, (((texel, &x), &y), &z)) in texels.iter_mut().zip(x).zip(y).zip(z).enumerate() {
            let a = ra[0] * x + ra[1] * y + ra[2] * z + ra[3];
            let b = rb[0] * x + rb[1] * y + rb[2] * z + rb[3];
            let s = rs[0] * x + rs[1] * y + rs[2] * z + rs[3];
            let inside = (s > bias) & (a >= 0.0) & (a < w) & (b >= 0.0) & (b < h);
            // Column and row as whole floats, the index exact in them up to 2^23 texels.
            let column = (a - 0.5).max(0.0) + TO_INTEGER - TO_INTEGER;
            let row = (b - 0.5).max(0.0) + TO_INTEGER - TO_INTEGER;
            let index = (row * w + column + TO_INTEGER).to_bits() & 0x007f_ffff;
            *texel = if inside { index } else { outside + (lane % OUTSIDE_LANES) as u32 };
        }
        for (i, &texel) in texels[..end - start].iter().enumerate() {
            f(start + i, texel as usize);
        }
        start = end;
    }
}

/// What a plane would bring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Drop of the weighted error, cross-validated: texels decided on one fold of the receivers, counted on the
    /// other. A gain counted on the votes that chose the texels favours planes that spread few pairs over many.
    pub gain: f64,
    /// The side for which that is largest.
    pub side: Side,
}

/// Scores a plane on pairs that nothing covers yet, with a texture of `texels` x `texels`.
#[must_use]
pub fn score(pairs: &Pairs, plane: &ShadowPlane, bias: f32, texels: usize) -> Score {
    let count = texels * texels + OUTSIDE_LANES;
    // [side of the receivers: front, back][fold][texel]
    let mut grids = vec![0.0f32; 4 * count];
    for light in &pairs.lights {
        let Some(rows) = plane_rows(plane, Side::Both, light.light) else { continue };
        // Receivers that a crossing can shadow lie on the side away from the light.
        let back = usize::from(plane.normal().dot(light.light) > 0.0);
        for (fold, range) in [0..light.split, light.split..light.len()].into_iter().enumerate() {
            let grid = &mut grids[(2 * back + fold) * count..][..count];
            for_each_texel((&rows, bias), light, range, (texels, texels), |i, texel| grid[texel] += light.vote[i]);
        }
    }
    let grid = |back: usize, fold: usize| &grids[(2 * back + fold) * count..][..texels * texels];
    let folds = |back: usize| (grid(back, 0), grid(back, 1));
    let ((f0, f1), (b0, b1)) = (folds(0), folds(1));
    let sum = |p: &[f32], q: &[f32]| p.iter().zip(q).map(|(p, q)| p + q).collect::<Vec<f32>>();
    let both = cross_validated(&sum(f0, b0), &sum(f1, b1), texels);
    let (front, back) = (cross_validated(f0, f1, texels), cross_validated(b0, b1, texels));
    let mut best = Score { gain: both, side: Side::Both };
    for (gain, side) in [(front, Side::Front), (back, Side::Back)] {
        if gain > best.gain {
            best = Score { gain, side };
        }
    }
    best
}

/// The bias with the largest gain, and that gain.
#[must_use]
pub fn best_bias(pairs: &Pairs, plane: &ShadowPlane, texels: usize) -> (f32, Score) {
    let scored = BIASES.map(|bias| (bias, score(pairs, plane, bias, texels)));
    scored.into_iter().fold(scored[0], |a, b| if b.1.gain > a.1.gain { b } else { a })
}

/// Gain of the texels that one fold's votes, smoothed, would block, counted on the other fold; both ways.
fn cross_validated(votes0: &[f32], votes1: &[f32], width: usize) -> f64 {
    let one_way = |deciding: &[f32], counting: &[f32]| {
        let chosen = smoothed(deciding, width).into_iter().zip(counting).filter(|(decision, _)| *decision > 0.0);
        chosen.map(|(_, vote)| f64::from(*vote)).sum::<f64>()
    };
    one_way(votes0, votes1) + one_way(votes1, votes0)
}

/// Votes under a 3 x 3 binomial kernel; beyond the border there are none.
pub fn smoothed(votes: &[f32], width: usize) -> Vec<f32> {
    let height = votes.len() / width;
    let mut rows = vec![0.0; votes.len()];
    for (row, votes) in rows.chunks_exact_mut(width).zip(votes.chunks_exact(width)) {
        for x in 0..width {
            let (left, right) =
                (if x > 0 { votes[x - 1] } else { 0.0 }, if x + 1 < width { votes[x + 1] } else { 0.0 });
            row[x] = left + 2.0 * votes[x] + right;
        }
    }
    let mut out = vec![0.0; votes.len()];
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            let above = if y > 0 { rows[i - width] } else { 0.0 };
            let below = if y + 1 < height { rows[i + width] } else { 0.0 };
            out[i] = above + 2.0 * rows[i] + below;
        }
    }
    out
}

/// Gives texels without a vote the votes of their surroundings: where few receivers or nearly one light leave most
/// texels uncrossed, the texture would be full of holes. Votes are summed 2 x 2 until every texel has one, and
/// interpolated back (the pull-push of Gortler et al., "The Lumigraph", 1996). Other texels stay as they are.
pub fn fill_unvoted(votes: &mut [f32], width: usize) {
    let height = votes.len() / width;
    if width.max(height) == 1 || votes.iter().all(|v| *v != 0.0) || votes.iter().all(|v| *v == 0.0) {
        return;
    }
    // Pull: a texel of the coarser level is the mean of four.
    let (coarse_width, coarse_height) = (width.div_ceil(2), height.div_ceil(2));
    let mut coarse = vec![0.0f32; coarse_width * coarse_height];
    for y in 0..height {
        for x in 0..width {
            coarse[y / 2 * coarse_width + x / 2] += 0.25 * votes[y * width + x];
        }
    }
    fill_unvoted(&mut coarse, coarse_width);
    // Push: bilinear, 3/4 of the texel's own parent and 1/4 of the neighbour on its side, along each axis.
    let neighbour =
        |i: usize, n: usize| if i.is_multiple_of(2) { (i / 2).saturating_sub(1) } else { (i / 2 + 1).min(n - 1) };
    for y in 0..height {
        for x in 0..width {
            if votes[y * width + x] == 0.0 {
                let row = |y: usize| {
                    0.75 * coarse[y * coarse_width + x / 2]
                        + 0.25 * coarse[y * coarse_width + neighbour(x, coarse_width)]
                };
                votes[y * width + x] = 0.75 * row(y / 2) + 0.25 * row(neighbour(y, coarse_height));
            }
        }
    }
}

/// Sums of the votes per texel (plus the one for "outside") over the pairs for which `counts(light, pair, texel)`.
pub fn sum_votes(pairs: &Pairs, mask: &Mask, counts: impl Fn(usize, usize, usize) -> bool + Sync) -> Vec<f32> {
    let partial = |(task, lights): (usize, &[LightPairs])| {
        let mut votes = vec![0.0f32; mask.blocked.len()];
        for (k, light) in lights.iter().enumerate() {
            let index = task * LIGHTS_PER_TASK + k;
            mask.for_each_texel(light, |i, texel| {
                if counts(index, i, texel) {
                    votes[texel] += light.vote[i];
                }
            });
        }
        votes
    };
    let partials: Vec<Vec<f32>> = pairs.lights.par_chunks(LIGHTS_PER_TASK).enumerate().map(partial).collect();
    let mut votes = vec![0.0f32; mask.blocked.len()];
    for partial in partials {
        votes.iter_mut().zip(partial).for_each(|(sum, v)| *sum += v);
    }
    votes
}

/// The best binary texture of a plane for pairs that nothing covers yet.
#[must_use]
pub fn best_mask(pairs: &Pairs, plane: &ShadowPlane, side: Side, bias: f32, texels: usize) -> Mask {
    let mut mask = Mask::open(*plane, side, bias, texels, texels);
    let votes = sum_votes(pairs, &mask, |_, _, _| true);
    for (blocked, vote) in mask.blocked.iter_mut().zip(smoothed(&votes[..texels * texels], texels)) {
        *blocked = u8::from(vote > 0.0);
    }
    mask
}

/// The pairs that none of `masks` covers.
#[must_use]
pub fn uncovered(pairs: &Pairs, masks: &[&Mask]) -> Pairs {
    let filter = |light: &LightPairs| {
        let mut covered = vec![0u8; light.len()];
        for mask in masks {
            mask.for_each_texel(light, |i, texel| covered[i] |= mask.blocked[texel]);
        }
        light.revoted(|i| (covered[i] == 0).then_some(light.vote[i]))
    };
    Pairs { lights: pairs.lights.par_iter().map(filter).collect(), ..*pairs }
}

/// Lit pairs of a receiver are drawn in proportion to the share of its light that is blocked, plus this. Smaller
/// makes false shadows on receivers that are never shadowed noisy; larger wastes the sample on them.
const LIT_FLOOR: f64 = 0.03;

/// A sample of about `blocked` blocked and `lit` lit pairs, with votes scaled up to what they stand for, so that
/// gains on it are unbiased. Lit pairs are many (19 in 20 on a teapot), and most belong to receivers that nothing
/// ever shadows: they are drawn where the decisions are, on receivers that are partly in shadow.
#[must_use]
pub fn thinned(pairs: &Pairs, blocked: usize, lit: usize) -> Pairs {
    let receivers = shadowed_receivers(pairs);
    let blocked_total: u64 = receivers.iter().map(|r| u64::from(r.blocked_pairs)).sum();
    let keep_blocked = (blocked as f64 / blocked_total.max(1) as f64).min(1.0);
    let scale = lit_scale(&receivers, lit);
    let thin = |(k, light): (usize, &LightPairs)| {
        // Error diffusion: every 1/p-th pair, from another start for each light and kind.
        let mut due = [uniform(k as u64, 0), uniform(k as u64, 1)];
        light.revoted(|i| {
            let is_lit = light.vote[i] <= 0.0;
            let keep = if is_lit { receivers[light.receiver[i] as usize].keep(scale) } else { keep_blocked };
            let due = &mut due[usize::from(is_lit)];
            *due += keep;
            (*due >= 1.0).then(|| {
                *due -= 1.0;
                light.vote[i] / keep as f32
            })
        })
    };
    Pairs { lights: pairs.lights.par_iter().enumerate().map(thin).collect(), ..*pairs }
}

/// What the pairs say about one receiver.
#[derive(Clone, Copy, Default)]
struct ShadowedReceiver {
    blocked_pairs: u32,
    lit_pairs: u32,
    blocked: f64,
    total: f64,
}

impl ShadowedReceiver {
    /// Probability with which its lit pairs are kept.
    fn keep(&self, scale: f64) -> f64 {
        let share = if self.total > 0.0 { self.blocked / self.total } else { 0.0 };
        (scale * (share + LIT_FLOOR)).min(1.0)
    }
}

fn shadowed_receivers(pairs: &Pairs) -> Vec<ShadowedReceiver> {
    let mut receivers = vec![ShadowedReceiver::default(); pairs.receivers];
    for light in &pairs.lights {
        for (&vote, &receiver) in light.vote.iter().zip(&light.receiver) {
            let receiver = &mut receivers[receiver as usize];
            receiver.total += f64::from(vote.abs());
            receiver.blocked += f64::from(vote.max(0.0));
            *(if vote > 0.0 { &mut receiver.blocked_pairs } else { &mut receiver.lit_pairs }) += 1;
        }
    }
    receivers
}

/// The scale at which about `lit` lit pairs are kept: fixed-point steps, since probabilities saturate at 1.
fn lit_scale(receivers: &[ShadowedReceiver], lit: usize) -> f64 {
    let mut scale = 1.0;
    for _ in 0..8 {
        let kept: f64 = receivers.iter().map(|r| r.keep(scale) * f64::from(r.lit_pairs)).sum();
        if kept <= 0.0 {
            break;
        }
        scale *= lit as f64 / kept;
    }
    scale
}
