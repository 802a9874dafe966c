//! Budget: how many texels each plane gets.
//!
//! In: planes with votes on fine grids. Out: a size for each, or none where it is not worth its bytes. Method: at a few
//! sizes a field is fitted to the votes of one fold and counted on those of the other, which is what the plane is worth
//! at that size; then the sizes with the largest worth less bytes times a price are taken, and the price is raised until
//! the bytes fit (Lagrangian relaxation of the multiple-choice knapsack problem; Shoham and Gersho, "Efficient Bit
//! Allocation for an Arbitrary Set of Quantizers", 1988).

use crate::{
    field::{VoteGrid, VotedShape, blocked_votes},
    lists::VotedPlane,
};
use rayon::prelude::*;

/// How texels are given out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BudgetOptions {
    /// Most planes.
    pub max_planes: usize,
    /// Most bytes of all textures together.
    pub bytes: usize,
    /// Most texels along the longer side of a texture, 8 and up.
    pub texture_size: usize,
    /// Share of the shadow that a byte must gain; planes that do not pay are dropped.
    pub byte_gain: f64,
    /// Passes over the votes that decide a field's first border.
    pub smoothing: usize,
}

/// Texels along the longer side that are tried; gains between two of them are interpolated.
const TRIED: [usize; 5] = [8, 16, 32, 64, 128];

/// Sizes between two tried ones.
const STEPS: usize = 4;

/// Halvings of the price interval: beyond it sizes no longer change.
const PRICE_STEPS: usize = 60;

/// One size that a plane may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offer {
    /// Width and height, texels.
    pub size: (usize, usize),
    /// What it costs.
    pub bytes: usize,
    /// Drop of the weighted error that it brings, decided and counted under different lights.
    pub gain: f64,
}

/// What each plane is worth at each size; `bytes` and `byte_gain` have no part in it.
#[must_use]
pub fn offers(planes: &[&VotedPlane], options: &BudgetOptions) -> Vec<Vec<Offer>> {
    let mut offers: Vec<Vec<Offer>> = planes.par_iter().map(|plane| offers_of(plane, options)).collect();
    keep_best(&mut offers, options.max_planes);
    offers
}

/// Width and height of each plane's texture, the open ring included; `None`: dropped. `shadow_weight` is that of all
/// pairs.
#[must_use]
pub fn sizes(offers: &[Vec<Offer>], shadow_weight: f64, options: &BudgetOptions) -> Vec<Option<(usize, usize)>> {
    let choose = |price: f64| -> Vec<Option<Offer>> {
        let worth = |offer: &&Offer| offer.gain - price * offer.bytes as f64;
        let best = |offers: &Vec<Offer>| {
            let best = offers.iter().max_by(|a, b| worth(a).total_cmp(&worth(b)));
            best.filter(|offer| worth(offer) > 0.0).copied()
        };
        offers.iter().map(best).collect()
    };
    let bytes = |chosen: &[Option<Offer>]| chosen.iter().flatten().map(|offer| offer.bytes).sum::<usize>();
    let mut low = options.byte_gain * shadow_weight;
    let mut chosen = choose(low);
    if bytes(&chosen) > options.bytes {
        let mut high = low.max(f64::MIN_POSITIVE);
        while bytes(&choose(high)) > options.bytes {
            (low, high) = (high, high * 2.0);
        }
        for _ in 0..PRICE_STEPS {
            let middle = 0.5 * (low + high);
            *(if bytes(&choose(middle)) > options.bytes { &mut low } else { &mut high }) = middle;
        }
        chosen = choose(high);
    }
    chosen.into_iter().map(|offer| offer.map(|offer| offer.size)).collect()
}

/// Leaves offers only to the `count` planes with the largest gains.
fn keep_best(offers: &mut [Vec<Offer>], count: usize) {
    let gain = |k: usize| offers[k].iter().fold(0.0f64, |most, offer| most.max(offer.gain));
    let mut order: Vec<(f64, usize)> = (0..offers.len()).map(|k| (gain(k), k)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    for (_, k) in order.into_iter().skip(count) {
        offers[k].clear();
    }
}

/// What a plane is worth at each size.
fn offers_of(plane: &VotedPlane, options: &BudgetOptions) -> Vec<Offer> {
    let grid = |fold: usize| VoteGrid { votes: &plane.votes[fold], width: plane.width, height: plane.height };
    let shapes = [0, 1].map(|fold| VotedShape::new(grid(fold), options.smoothing));
    let most = options.texture_size.min(TRIED[TRIED.len() - 1]).max(TRIED[0]);
    let measured = |size: usize| {
        let shape = texture_shape(plane, size);
        let worth = |fold: usize| blocked_votes(&grid(1 - fold), &shapes[fold].field(shape));
        worth(0) + worth(1)
    };
    let mut offers = Vec::new();
    let mut last: Option<(usize, f64)> = None;
    for size in TRIED.into_iter().take_while(|size| *size < most).chain([most]) {
        let gain = measured(size);
        let (from, from_gain) = last.unwrap_or((size, gain));
        for step in 1..=STEPS {
            // Gains are about linear in the logarithm of the size.
            let share = step as f64 / STEPS as f64;
            let between = from as f64 * (size as f64 / from as f64).powf(share);
            let shape = texture_shape(plane, between.round() as usize);
            let gain = from_gain + (gain - from_gain) * share;
            offers.push(Offer { size: shape, bytes: shape.0 * shape.1, gain });
        }
        last = Some((size, gain));
    }
    offers
}

/// Square texels, `size` along the longer side, and at least one inside the ring.
fn texture_shape(plane: &VotedPlane, size: usize) -> (usize, usize) {
    let longer = plane.width.max(plane.height) as f32;
    let count = |cells: usize| ((cells as f32 / longer * size as f32).round() as usize).max(3);
    (count(plane.width), count(plane.height))
}
