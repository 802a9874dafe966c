//! Bake: the final occluder textures, decided by many more pairs than the search used.
//!
//! In: planes (from the search or by hand). Out: one texture each, cropped to what it uses. Method: textures start
//! open; each in turn is set to the weighted majority per texel of the pairs that no other plane covers, the others
//! frozen. Without smoothing that step is exact: the training error never rises (block coordinate descent). With it,
//! texels that few pairs cross follow their neighbours, which costs training error and saves more held-out error.
//! The outermost ring of texels stays open so that a clamped bilinear tap never smears a border outwards.
//!
//! Not guaranteed: the best set of textures (the descent ends in a local optimum), or a texture that generalises
//! where a texel is crossed by few pairs: give it enough (15 pairs a texel cost about a third more held-out error).

use crate::{
    plane::{BakedPlane, Encoding, OccluderTexture, ShadowPlane},
    rectangle::{Turn, tighten},
    visibility::{LightPairs, Pairs},
    votes::{Mask, fill_unvoted, smoothed, sum_votes},
};
use rayon::prelude::*;

/// How textures are baked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BakeOptions {
    /// Texels along the longer side of each rectangle, 4 and up.
    pub texture_size: usize,
    /// Rounds of exact re-baking, 1 and up; after the third little changes.
    pub rounds: usize,
    /// Times that the votes pass a 3 x 3 binomial kernel before they decide. 0 is the exact step, which over-fits
    /// as soon as pairs per texel are few: the teapot's held-out error at 256 texels, 35 pairs a texel, was 0.283,
    /// 0.190, 0.187 and 0.190 with 0, 1, 2 and 4 passes; at 128 texels 0.223, 0.198, 0.202 and 0.209.
    pub smoothing: usize,
    /// May rectangles turn in their plane for a tighter fit?
    pub turn: Turn,
}

/// For each pair, `[light][pair]`, how many planes cover it.
type Covers = Vec<Vec<u8>>;

/// Bakes the planes in their order; a plane that ends up blocking nothing is left out.
#[must_use]
pub fn bake(pairs: &Pairs, planes: &[Mask], options: &BakeOptions) -> Vec<BakedPlane> {
    let mut covers: Covers = pairs.lights.iter().map(|light| vec![0; light.len()]).collect();
    let mut masks: Vec<Mask> = Vec::with_capacity(planes.len());
    for plane in planes {
        if let Some(mut mask) = fit_rectangle(pairs, &covers, plane, options) {
            rebake(pairs, &mut covers, &mut mask, options.smoothing);
            masks.push(mask);
        }
    }
    for _ in 1..options.rounds {
        for mask in &mut masks {
            rebake(pairs, &mut covers, mask, options.smoothing);
        }
    }
    masks.iter().filter(|mask| mask.blocked.contains(&1)).map(baked).collect()
}

/// The plane's rectangle, tight around what blocks in it, with an open texture of the final size.
fn fit_rectangle(pairs: &Pairs, covers: &Covers, plane: &Mask, options: &BakeOptions) -> Option<Mask> {
    let (width, height) = texture_shape(&plane.plane, options.texture_size);
    let mut rough = Mask::open(plane.plane, plane.side, plane.bias, width, height);
    let votes = open_votes(pairs, covers, &rough);
    for (blocked, vote) in rough.blocked.iter_mut().zip(&votes[..width * height]) {
        *blocked = u8::from(*vote > 0.0);
    }
    let tight = tighten(pairs, &rough, options.turn)?;
    let (width, height) = texture_shape(&tight, options.texture_size);
    Some(Mask::open(with_ring(&tight, width, height), plane.side, plane.bias, width, height))
}

/// Square texels, `texture_size` along the longer side, at least one inside the open ring.
fn texture_shape(plane: &ShadowPlane, texture_size: usize) -> (usize, usize) {
    let (u, v) = (plane.u.length(), plane.v.length());
    let texel = u.max(v) / texture_size as f32;
    let count = |length: f32| ((length / texel).ceil() as usize).clamp(3, texture_size);
    (count(u), count(v))
}

/// The rectangle enlarged so that it fills all texels but the outermost ring.
fn with_ring(plane: &ShadowPlane, width: usize, height: usize) -> ShadowPlane {
    let (su, sv) = (plane.u / (width - 2) as f32, plane.v / (height - 2) as f32);
    ShadowPlane { origin: plane.origin - su - sv, u: su * width as f32, v: sv * height as f32 }
}

/// Votes of the pairs that nothing covers.
fn open_votes(pairs: &Pairs, covers: &Covers, mask: &Mask) -> Vec<f32> {
    sum_votes(pairs, mask, |light, pair, texel| covers[light][pair] == mask.blocked[texel])
}

/// One exact step for one plane; `covers` is kept up to date.
fn rebake(pairs: &Pairs, covers: &mut Covers, mask: &mut Mask, smoothing: usize) {
    // A pair counts if no *other* plane covers it: its count equals what this plane itself contributes.
    let mut votes = open_votes(pairs, covers, mask);
    votes.truncate(mask.width * mask.height);
    for _ in 0..smoothing {
        votes = smoothed(&votes, mask.width);
    }
    fill_unvoted(&mut votes, mask.width);
    let mut next = Mask::open(mask.plane, mask.side, mask.bias, mask.width, mask.height);
    for y in 1..mask.height - 1 {
        for x in 1..mask.width - 1 {
            let i = y * mask.width + x;
            next.blocked[i] = u8::from(votes[i] > 0.0);
        }
    }
    let update = |(light, covers): (&LightPairs, &mut Vec<u8>)| {
        mask.for_each_texel(light, |i, texel| covers[i] = covers[i] - mask.blocked[texel] + next.blocked[texel]);
    };
    pairs.lights.par_iter().zip(covers.par_iter_mut()).for_each(update);
    *mask = next;
}

fn baked(mask: &Mask) -> BakedPlane {
    let texels = mask.width * mask.height;
    let texels = mask.blocked[..texels].iter().map(|&b| b * u8::MAX).collect();
    let texture = OccluderTexture { width: mask.width, height: mask.height, encoding: Encoding::Coverage, texels };
    BakedPlane { plane: mask.plane, texture, side: mask.side, bias: mask.bias }
}

impl Default for BakeOptions {
    /// 256 texels, as the `balanced` preset bakes.
    fn default() -> Self {
        Self { texture_size: 256, rounds: 3, smoothing: 2, turn: Turn::Free }
    }
}
