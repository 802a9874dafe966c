//! Windows: what a plane brings where it is read only under light directions in which it gains.
//!
//! In: pairs and a plane. Out: the drop of the weighted error. The texture is decided by the pairs of the window, the
//! window by what the texture gains, in turn; gains are counted under lights that did not decide the texture.
//!
//! Not guaranteed: the best window. A plane that loses more under all lights than it gains under some starts with a
//! texture that blocks nothing, and stays there.

use crate::{
    pair_table::{PairTable, SPARE},
    plane::PlacedPlane,
    smoothing::smoothed,
};

/// Rounds of deciding the texture and the window in turn.
const WINDOW_ROUNDS: usize = 2;

/// Memory for one measurement, kept from one to the next.
#[derive(Default)]
pub(crate) struct Scratch {
    /// Texel of each pair.
    pub(crate) texels: Vec<u16>,
    /// Votes per texel, the folds one after the other.
    pub(crate) votes: Vec<f32>,
    /// 1 where a texture decided by a fold blocks.
    pub(crate) blocked: Vec<f32>,
    /// Gain per direction; the window is where it is positive.
    pub(crate) gains: Vec<f32>,
}

/// Drop of the weighted error by a plane with a texture of `n` x `n` that is read only where it gains, counted under
/// lights that did not decide the texture. Leaves texels and gains per direction in `scratch`.
pub(crate) fn windowed(pairs: &PairTable, placed: &PlacedPlane, n: usize, scratch: &mut Scratch) -> f64 {
    pairs.crossings(placed, (n, n), &mut scratch.texels);
    let count = n * n + SPARE;
    let Scratch { texels, votes, blocked, gains } = scratch;
    gains.clear();
    gains.resize(pairs.directions, 1.0);
    for _ in 0..WINDOW_ROUNDS {
        votes.clear();
        votes.resize(2 * count, 0.0);
        for rows in pairs.lights.iter().filter(|rows| gains[rows.direction] > 0.0) {
            let votes = &mut votes[rows.fold * count..][..count];
            for (&texel, &vote) in texels[rows.start..rows.end].iter().zip(&pairs.vote[rows.start..rows.end]) {
                votes[texel as usize] += vote;
            }
        }
        blocked.clear();
        blocked.resize(2 * count, 0.0);
        for fold in 0..2 {
            let smooth = smoothed(&votes[fold * count..][..n * n], n);
            for (blocked, vote) in blocked[fold * count..].iter_mut().zip(smooth) {
                *blocked = f32::from(u8::from(vote > 0.0));
            }
        }
        gains.fill(0.0);
        for rows in &pairs.lights {
            let blocked = &blocked[(1 - rows.fold) * count..][..count];
            let pairs = texels[rows.start..rows.end].iter().zip(&pairs.vote[rows.start..rows.end]);
            gains[rows.direction] += pairs.map(|(&texel, vote)| vote * blocked[texel as usize]).sum::<f32>();
        }
    }
    gains.iter().map(|gain| f64::from(gain.max(0.0))).sum()
}

/// Votes per texel of all pairs in the window that [`windowed`] left in `scratch`.
pub(crate) fn window_votes(pairs: &PairTable, n: usize, scratch: &Scratch) -> Vec<f32> {
    let mut votes = vec![0.0f32; n * n + SPARE];
    for rows in pairs.lights.iter().filter(|rows| scratch.gains[rows.direction] > 0.0) {
        for (&texel, &vote) in scratch.texels[rows.start..rows.end].iter().zip(&pairs.vote[rows.start..rows.end]) {
            votes[texel as usize] += vote;
        }
    }
    votes.truncate(n * n);
    votes
}
