//! Windows: what a plane brings where it is read only under light directions in which it gains.
//!
//! In: pairs and a plane. Out: the drop of the weighted error. The texture is decided by the pairs of the window, the
//! window by what the texture gains, in turn; gains are counted under lights that did not decide the texture.
//!
//! Not guaranteed: the best window. A plane that loses more under all lights than it gains under some starts with a
//! texture that blocks nothing, and stays there. Starting also from the directions on either side of the plane, and
//! taking the best of the three, did not pay (mean of four seeds): teapot_three with 11 planes 0.135 instead of 0.128,
//! cesium_air with 8 0.136 instead of 0.141, t_shape with 4 0.031 instead of 0.026, at 1.5 times the time.

use crate::{crossing::Casts, pair_table::PairTable, plane::PlacedPlane, smoothing::smoothed};

/// Rounds of deciding the texture and the window in turn.
const WINDOW_ROUNDS: usize = 2;

/// One measurement, and memory for the next: pairs that cross the rectangle, the window and its votes.
#[derive(Default)]
pub(crate) struct Window {
    /// Texels a side.
    n: usize,
    /// The plane under each light.
    casts: Casts,
    /// Texel of each pair that crosses the rectangle, grouped by light.
    texels: Vec<u16>,
    /// Their votes.
    pair_votes: Vec<f32>,
    /// Lights with such pairs.
    lights: Vec<CrossedLight>,
    /// Texels of one light's pairs before those that cross nothing are left out.
    of_light: Vec<u16>,
    /// Votes per texel, the folds one after the other.
    votes: Vec<f32>,
    /// 1 where a texture decided by a fold blocks.
    blocked: Vec<f32>,
    /// Gain per direction; the window is where it is positive.
    gains: Vec<f32>,
}

/// A light under which pairs cross the rectangle, and where they are.
struct CrossedLight {
    direction: usize,
    fold: usize,
    start: usize,
    end: usize,
}

impl Window {
    /// Drop of the weighted error by a plane with a texture of `n` x `n` that is read only where it gains, counted
    /// under lights that did not decide the texture.
    pub(crate) fn measure(&mut self, pairs: &PairTable, placed: &PlacedPlane, n: usize) -> f64 {
        self.n = n;
        self.cross(pairs, placed);
        self.gains.clear();
        self.gains.resize(pairs.directions, 1.0);
        for _ in 0..WINDOW_ROUNDS {
            self.decide_textures();
            self.count_gains();
        }
        self.gains.iter().map(|gain| f64::from(gain.max(0.0))).sum()
    }

    /// Under which directions the plane just measured is read.
    pub(crate) fn directions(&self) -> Vec<bool> {
        self.gains.iter().map(|gain| *gain > 0.0).collect()
    }

    /// Votes per texel of all pairs in the window of the plane just measured.
    pub(crate) fn all_votes(&self) -> Vec<f32> {
        let mut votes = vec![0.0f32; self.n * self.n];
        for light in self.lights.iter().filter(|light| self.gains[light.direction] > 0.0) {
            let range = light.start..light.end;
            for (&texel, &vote) in self.texels[range.clone()].iter().zip(&self.pair_votes[range]) {
                votes[usize::from(texel)] += vote;
            }
        }
        votes
    }

    /// Finds the pairs that cross the rectangle; the others, most of them, are not looked at again.
    fn cross(&mut self, pairs: &PairTable, placed: &PlacedPlane) {
        let Self { n, casts, texels, pair_votes, lights, of_light, .. } = self;
        let (outside, mut count) = (*n * *n, 0);
        lights.clear();
        // Every entry up to `count` is written before it is read.
        texels.resize(pairs.len(), 0);
        pair_votes.resize(pairs.len(), 0.0);
        casts.renew(pairs, placed, (*n, *n));
        for (light, rows) in pairs.lights.iter().enumerate() {
            let start = count;
            of_light.resize(rows.end - rows.start, 0);
            if !casts.of_light(pairs, light, of_light) {
                continue;
            }
            for (&texel, &vote) in of_light.iter().zip(&pairs.vote[rows.start..rows.end]) {
                (texels[count], pair_votes[count]) = (texel, vote);
                count += usize::from(usize::from(texel) < outside);
            }
            if count > start {
                lights.push(CrossedLight { direction: rows.direction, fold: rows.fold, start, end: count });
            }
        }
    }

    /// The textures that each fold's lights in the window decide.
    fn decide_textures(&mut self) {
        let Self { n, texels, pair_votes, lights, votes, blocked, gains, .. } = self;
        let count = *n * *n;
        votes.clear();
        votes.resize(2 * count, 0.0);
        for light in lights.iter().filter(|light| gains[light.direction] > 0.0) {
            let votes = &mut votes[light.fold * count..][..count];
            let range = light.start..light.end;
            for (&texel, &vote) in texels[range.clone()].iter().zip(&pair_votes[range]) {
                votes[usize::from(texel)] += vote;
            }
        }
        blocked.clear();
        for votes in votes.chunks_exact(count) {
            blocked.extend(smoothed(votes, *n).into_iter().map(|vote| f32::from(u8::from(vote > 0.0))));
        }
    }

    /// What the textures gain per direction under the other fold's lights.
    fn count_gains(&mut self) {
        let Self { n, texels, pair_votes, lights, blocked, gains, .. } = self;
        let count = *n * *n;
        gains.fill(0.0);
        for light in lights {
            let blocked = &blocked[(1 - light.fold) * count..][..count];
            let range = light.start..light.end;
            let pairs = texels[range.clone()].iter().zip(&pair_votes[range]);
            gains[light.direction] += pairs.map(|(&texel, vote)| vote * blocked[usize::from(texel)]).sum::<f32>();
        }
    }
}
