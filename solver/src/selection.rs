//! Selection: the fewest planes whose best textures explain the shadows.
//!
//! Greedy: take the plane whose gain (see `votes::score`) on the pairs that nothing covers yet is largest, with the
//! gains of an earlier step as lazy bounds (Minoux, "Accelerated Greedy Algorithms", 1978; a heuristic here, since
//! false shadows make the objective not submodular). Candidates are screened on a sample of the pairs, the best are
//! refined continuously (compass search over two tilts and the offset) on all. Then *replace* rounds take each plane
//! out, search again and keep what is better; last, planes that no longer pay are dropped.
//!
//! Guaranteed: the result depends on the input alone, not on threads. Not guaranteed: optimality.

use crate::{
    candidates::Candidate,
    mesh::Mesh,
    plane::{ShadowPlane, Side},
    rectangle::{Turn, around_section, tighten},
    visibility::Pairs,
    votes::{Mask, Score, best_mask, score, thinned, uncovered},
};
use glam::Vec3;
use rayon::prelude::*;

/// How hard to search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelectionOptions {
    /// At most this many planes.
    pub max_planes: usize,
    /// A plane must lower `shadow_error` by at least this. 0.02 and up leaves visible shadows out; below 0.002 the
    /// search picks noise.
    pub min_gain: f64,
    /// Texels a side of the textures that the search itself uses. 32 to 128; the cost does not depend on it, but
    /// with few pairs per texel gains get noisy.
    pub texels: usize,
    /// Blocked pairs of the screening sample, and twice as many lit ones. Cost and sureness of screening grow with it.
    pub screening_pairs: usize,
    /// Screened candidates that are scored on all pairs.
    pub finalists: usize,
    /// Finalists that are refined.
    pub refined: usize,
    /// Halvings of the refinement's step: precision 2^-n of a candidate spacing.
    pub refine_steps: usize,
    /// Replace rounds; each costs about as much as the greedy search.
    pub replace_rounds: usize,
}

/// What the caller says to a set of planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Look for more.
    Continue,
    /// Good enough: stop, and see whether fewer do.
    Enough,
}

/// The planes found.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// The final planes with their search textures.
    pub planes: Vec<Mask>,
    /// The planes of the greedy phase in the order they were picked: the first k are its answer for k planes.
    pub greedy: Vec<Mask>,
    /// Exchanges made by the replace rounds.
    pub replaced: usize,
    /// Planes dropped at the end because they no longer paid.
    pub dropped: usize,
}

/// A replacement must gain this much more (relative): less is noise and would never settle.
const REPLACE_MARGIN: f64 = 1e-3;

/// Stale candidates are re-scored in batches of this size, in parallel. Fixed, so that the outcome does not
/// depend on the number of threads.
const BATCH: usize = 64;

/// Texels a side while screening: the sample has few pairs per texel.
const SCREENING_TEXELS: usize = 32;

/// First tilt of the refinement in radians and first shift in unit space: about the spacing of the candidates.
const FIRST_TILT: f32 = 0.12;
const FIRST_SHIFT: f32 = 0.06;

/// A plane by three numbers: what the refinement moves.
#[derive(Clone, Copy)]
struct Pose {
    normal: Vec3,
    offset: f32,
}

/// Everything a search needs, borrowed.
struct Search<'a> {
    options: &'a SelectionOptions,
    candidates: &'a [Candidate],
    pairs: &'a Pairs,
    low: Vec3,
    high: Vec3,
}

/// Chooses planes for `pairs`. `judge` sees the planes after each pick; once it says [`Verdict::Enough`] the search
/// turns to fewer planes and keeps the smallest set that `judge` accepts.
pub fn select(
    mesh: &Mesh,
    pairs: &Pairs,
    candidates: &[Candidate],
    options: &SelectionOptions,
    judge: &mut dyn FnMut(&[Mask]) -> Verdict,
) -> Selection {
    let corners = || mesh.corners.iter().flatten();
    let low = corners().fold(Vec3::INFINITY, |a, p| a.min(*p));
    let high = corners().fold(Vec3::NEG_INFINITY, |a, p| a.max(*p));
    // A flat model has a box without thickness: give the sections some.
    let pad = Vec3::splat(1e-3);
    let search = Search { options, candidates, pairs, low: low - pad, high: high + pad };
    if pairs.shadow_weight <= 0.0 {
        return Selection::default();
    }
    let (greedy, verdict) = search.greedy(judge);
    let mut planes = greedy.clone();
    let mut replaced = 0;
    for _ in 0..options.replace_rounds {
        let exchanges = search.replace_round(&mut planes);
        replaced += exchanges;
        if exchanges == 0 {
            break;
        }
    }
    let mut dropped = search.drop_unpaid(&mut planes);
    if verdict == Verdict::Enough {
        dropped += search.shrink(&mut planes, judge);
    }
    Selection { planes, greedy, replaced, dropped }
}

impl Search<'_> {
    fn worth(&self, gain: f64) -> bool {
        gain >= self.options.min_gain * self.pairs.shadow_weight
    }

    fn greedy(&self, judge: &mut dyn FnMut(&[Mask]) -> Verdict) -> (Vec<Mask>, Verdict) {
        let mut planes: Vec<Mask> = Vec::new();
        let mut open = self.pairs.clone();
        let mut bounds = vec![f64::INFINITY; self.candidates.len()];
        while planes.len() < self.options.max_planes {
            let Some((gain, mask)) = self.best_plane(&open, &mut bounds, None) else { break };
            if !self.worth(gain) {
                break;
            }
            open = uncovered(&open, &[&mask]);
            planes.push(mask);
            if judge(&planes) == Verdict::Enough {
                return (planes, Verdict::Enough);
            }
        }
        (planes, Verdict::Continue)
    }

    /// Takes each plane out and puts the best one found back; returns the number of exchanges.
    fn replace_round(&self, planes: &mut [Mask]) -> usize {
        let mut exchanges = 0;
        for k in 0..planes.len() {
            let others: Vec<&Mask> = planes.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, m)| m).collect();
            let open = uncovered(self.pairs, &others);
            let mut bounds = vec![f64::INFINITY; self.candidates.len()];
            let kept = score(&open, &planes[k].plane, self.options.texels);
            let found = self.best_plane(&open, &mut bounds, Some(pose_of(&planes[k].plane)));
            planes[k] = match found {
                Some((gain, mask)) if gain > kept.gain * (1.0 + REPLACE_MARGIN) => {
                    exchanges += 1;
                    mask
                }
                // The others have moved: the same rectangle, its texture decided anew.
                _ => best_mask(&open, &planes[k].plane, kept.side, self.options.texels),
            };
        }
        exchanges
    }

    /// What each plane gains given the others.
    fn gains(&self, planes: &[Mask]) -> Vec<f64> {
        let gain = |k: usize| {
            let others: Vec<&Mask> = planes.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, m)| m).collect();
            score(&uncovered(self.pairs, &others), &planes[k].plane, self.options.texels).gain
        };
        (0..planes.len()).map(gain).collect()
    }

    /// Drops planes that gain too little given the others, the least useful first; returns how many.
    fn drop_unpaid(&self, planes: &mut Vec<Mask>) -> usize {
        let before = planes.len();
        loop {
            let gains = self.gains(planes);
            match least(&gains) {
                Some(k) if !self.worth(gains[k]) => planes.remove(k),
                _ => return before - planes.len(),
            };
        }
    }

    /// Takes the least useful plane out and lets the others move, as long as `judge` finds the rest good enough;
    /// returns how many went.
    fn shrink(&self, planes: &mut Vec<Mask>, judge: &mut dyn FnMut(&[Mask]) -> Verdict) -> usize {
        let before = planes.len();
        while planes.len() > 1 {
            let mut fewer = planes.clone();
            let Some(k) = least(&self.gains(&fewer)) else { break };
            fewer.remove(k);
            self.replace_round(&mut fewer);
            if judge(&fewer) == Verdict::Continue {
                break;
            }
            *planes = fewer;
        }
        before - planes.len()
    }

    /// The best plane for pairs that nothing covers. `bounds` holds each candidate's last screening gain (a lazy
    /// upper bound); `start` is one more pose to refine.
    fn best_plane(&self, open: &Pairs, bounds: &mut [f64], start: Option<Pose>) -> Option<(f64, Mask)> {
        let sample = thinned(open, self.options.screening_pairs, 2 * self.options.screening_pairs);
        let mut poses: Vec<Pose> =
            self.screen(&sample, bounds).into_iter().map(|i| pose(&self.candidates[i])).collect();
        poses.extend(start);
        // Score the finalists on all pairs and refine the best of them.
        let mut scored: Vec<(f64, Pose)> = poses.par_iter().map(|p| (self.score(open, *p).gain, *p)).collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        scored.truncate(self.options.refined);
        let refined: Vec<(f64, Pose)> = scored.par_iter().map(|(gain, p)| self.refine(open, *gain, *p)).collect();
        let (_, best) = refined.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a })?;
        self.finish(open, best)
    }

    /// Indices of the best candidates on a sample, best first.
    fn screen(&self, sample: &Pairs, bounds: &mut [f64]) -> Vec<usize> {
        let mut order: Vec<usize> = (0..bounds.len()).collect();
        order.sort_by(|&a, &b| bounds[b].total_cmp(&bounds[a]).then(a.cmp(&b)));
        let mut best: Vec<usize> = Vec::new();
        for batch in order.chunks(BATCH) {
            // Nothing left can beat the finalists if gains only fall.
            let full = best.len() >= self.options.finalists;
            if full && best.last().is_some_and(|&worst| bounds[worst] >= bounds[batch[0]]) {
                break;
            }
            let gains: Vec<f64> = batch.par_iter().map(|&i| self.screening_gain(sample, i)).collect();
            for (&i, gain) in batch.iter().zip(gains) {
                bounds[i] = gain;
                best.push(i);
            }
            best.sort_by(|&a, &b| bounds[b].total_cmp(&bounds[a]).then(a.cmp(&b)));
            best.truncate(self.options.finalists);
        }
        best
    }

    fn screening_gain(&self, sample: &Pairs, candidate: usize) -> f64 {
        let Pose { normal, offset } = pose(&self.candidates[candidate]);
        around_section(self.low, self.high, normal, offset)
            .map_or(f64::NEG_INFINITY, |plane| score(sample, &plane, SCREENING_TEXELS).gain)
    }

    fn score(&self, open: &Pairs, pose: Pose) -> Score {
        around_section(self.low, self.high, pose.normal, pose.offset)
            .map_or(Score { gain: f64::NEG_INFINITY, side: Side::Both }, |plane| {
                score(open, &plane, self.options.texels)
            })
    }

    /// Compass search: try a step each way in both tilts and the offset, keep what gains, else halve the step.
    fn refine(&self, open: &Pairs, gain: f64, start: Pose) -> (f64, Pose) {
        let (mut gain, mut at) = (gain, start);
        let mut scale = 1.0;
        for _ in 0..self.options.refine_steps {
            let (t, b) = at.normal.any_orthonormal_pair();
            for (tilt, shift) in [(t, 0.0), (b, 0.0), (Vec3::ZERO, FIRST_SHIFT)] {
                for sign in [scale, -scale] {
                    let normal = (at.normal + tilt * (FIRST_TILT * sign)).normalize();
                    // Tilt about the foot of the plane, so that it stays where it is.
                    let offset = at.offset * normal.dot(at.normal) + shift * sign;
                    let moved = Pose { normal, offset };
                    let moved_gain = self.score(open, moved).gain;
                    if moved_gain > gain {
                        (gain, at) = (moved_gain, moved);
                        break;
                    }
                }
            }
            scale *= 0.5;
        }
        (gain, at)
    }

    /// The pose as a rectangle tight around what it blocks, with its texture.
    fn finish(&self, open: &Pairs, pose: Pose) -> Option<(f64, Mask)> {
        let texels = self.options.texels;
        let wide = around_section(self.low, self.high, pose.normal, pose.offset)?;
        let rough = best_mask(open, &wide, score(open, &wide, texels).side, texels);
        let plane = tighten(open, &rough, Turn::Free)?;
        let tight = score(open, &plane, texels);
        Some((tight.gain, best_mask(open, &plane, tight.side, texels)))
    }
}

/// Index of the smallest number.
fn least(gains: &[f64]) -> Option<usize> {
    (0..gains.len()).min_by(|&a, &b| gains[a].total_cmp(&gains[b]))
}

fn pose(candidate: &Candidate) -> Pose {
    Pose { normal: candidate.normal, offset: candidate.offset }
}

fn pose_of(plane: &ShadowPlane) -> Pose {
    let normal = plane.normal();
    Pose { normal, offset: normal.dot(plane.origin) }
}
