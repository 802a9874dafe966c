//! Budget: how many texels each plane gets, and what they mean.
//!
//! In: planes with votes on fine grids. Out: a size for each, or none where it is not worth its bytes, and the encoding
//! of all. Method: at a few sizes a texture is fitted to the votes of one fold and counted on those of the other, which
//! is what the plane is worth at that size; then the sizes with the largest worth less bytes times a price are taken, and the price is raised until
//! the bytes fit (Lagrangian relaxation of the multiple-choice knapsack problem; Shoham and Gersho, "Efficient Bit
//! Allocation for an Arbitrary Set of Quantizers", 1988). The encoding is the one that is worth more.

use crate::{
    field::{VoteGrid, VotedShape, blocked_votes},
    lists::VotedPlane,
    plane::Encoding,
};
use rayon::prelude::*;

/// How texels are given out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BudgetOptions {
    /// Most planes.
    pub max_planes: usize,
    /// Most bytes of all textures together.
    pub bytes: usize,
    /// Most texels along the longer side of a texture, 8 to 256.
    pub texture_size: usize,
    /// What decides how many of them a texture has.
    pub sizing: Sizing,
    /// What texels mean; `None`: whichever is worth more.
    pub encoding: Option<Encoding>,
    /// Share of the shadow that a byte must gain; planes that do not pay are dropped.
    pub byte_gain: f64,
    /// Passes over the votes that decide a field's first border.
    pub smoothing: usize,
}

/// How a texture's size is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sizing {
    /// By what its bytes gain.
    ByGain,
    /// As large as may be; neither bytes nor their gains count.
    Largest,
}

/// Planes with their sizes.
#[derive(Clone, Debug, PartialEq)]
pub struct Allocation {
    /// Of all textures.
    pub encoding: Encoding,
    /// Width and height of each plane's texture, the open ring included; `None`: dropped.
    pub sizes: Vec<Option<(usize, usize)>>,
}

/// Texels along the longer side that are tried; gains between two of them are interpolated.
const TRIED: [usize; 6] = [8, 16, 32, 64, 128, 256];

/// Sizes between two tried ones.
const STEPS: usize = 4;

/// Halvings of the price interval: beyond it sizes no longer change.
const PRICE_STEPS: usize = 60;

/// One size that a plane may have.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Offer {
    /// Width and height, texels.
    size: (usize, usize),
    /// What it costs.
    bytes: usize,
    /// Drop of the weighted error that it brings, decided and counted under different lights.
    gain: f64,
}

/// What planes are worth.
#[derive(Clone, Debug, PartialEq)]
pub struct Offers {
    /// Per encoding and plane, at each size.
    by_encoding: Vec<(Encoding, Vec<Vec<Offer>>)>,
}

impl Offers {
    /// Measures planes; `bytes` and `byte_gain` have no part in it.
    #[must_use]
    pub fn new(planes: &[&VotedPlane], options: &BudgetOptions) -> Self {
        let encodings =
            options.encoding.map_or_else(|| vec![Encoding::Sdf, Encoding::Coverage], |encoding| vec![encoding]);
        let of_encoding = |encoding: Encoding| {
            let mut offers: Vec<Vec<Offer>> =
                planes.par_iter().map(|plane| offers_of(plane, encoding, options)).collect();
            keep_best(&mut offers, options.max_planes);
            (encoding, offers)
        };
        Self { by_encoding: encodings.into_iter().map(of_encoding).collect() }
    }
}

/// Sizes and encoding of the planes' textures. `shadow_weight` is that of all pairs.
#[must_use]
pub fn allocate(offers: &Offers, shadow_weight: f64, options: &BudgetOptions) -> Allocation {
    let (least_price, most_bytes) = match options.sizing {
        Sizing::ByGain => (options.byte_gain * shadow_weight, options.bytes),
        Sizing::Largest => (0.0, usize::MAX),
    };
    let allocation = |(encoding, offers): &(Encoding, Vec<Vec<Offer>>)| {
        let chosen = chosen(offers, least_price, most_bytes);
        let worth: f64 = chosen.iter().flatten().map(|offer| offer.gain - least_price * offer.bytes as f64).sum();
        let sizes = chosen.into_iter().map(|offer| offer.map(|offer| offer.size)).collect();
        (worth, Allocation { encoding: *encoding, sizes })
    };
    let allocations = offers.by_encoding.iter().map(allocation);
    let best = allocations.reduce(|a, b| if b.0 > a.0 { b } else { a });
    best.map_or_else(|| Allocation { encoding: Encoding::Sdf, sizes: Vec::new() }, |(_, allocation)| allocation)
}

/// The best offer to each plane at the least price of a byte at which all fit.
fn chosen(offers: &[Vec<Offer>], least_price: f64, most_bytes: usize) -> Vec<Option<Offer>> {
    let choose = |price: f64| -> Vec<Option<Offer>> {
        let worth = |offer: &&Offer| offer.gain - price * offer.bytes as f64;
        let best = |offers: &Vec<Offer>| {
            let best = offers.iter().max_by(|a, b| worth(a).total_cmp(&worth(b)));
            best.filter(|offer| worth(offer) > 0.0).copied()
        };
        offers.iter().map(best).collect()
    };
    let bytes = |chosen: &[Option<Offer>]| chosen.iter().flatten().map(|offer| offer.bytes).sum::<usize>();
    let mut low = least_price;
    let mut chosen = choose(low);
    if bytes(&chosen) > most_bytes {
        let mut high = low.max(f64::MIN_POSITIVE);
        while bytes(&choose(high)) > most_bytes {
            (low, high) = (high, high * 2.0);
        }
        for _ in 0..PRICE_STEPS {
            let middle = 0.5 * (low + high);
            *(if bytes(&choose(middle)) > most_bytes { &mut low } else { &mut high }) = middle;
        }
        chosen = choose(high);
    }
    chosen
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
fn offers_of(plane: &VotedPlane, encoding: Encoding, options: &BudgetOptions) -> Vec<Offer> {
    let grid = |fold: usize| VoteGrid { votes: &plane.votes[fold], width: plane.width, height: plane.height };
    let shapes = [0, 1].map(|fold| VotedShape::new(grid(fold), options.smoothing));
    let most = options.texture_size.min(TRIED[TRIED.len() - 1]).max(TRIED[0]);
    let measured = |size: usize| {
        let shape = texture_shape(plane, size);
        let worth = |fold: usize| blocked_votes(&grid(1 - fold), &shapes[fold].texture(encoding, shape));
        worth(0) + worth(1)
    };
    if options.sizing == Sizing::Largest {
        let size = texture_shape(plane, most);
        return vec![Offer { size, bytes: size.0 * size.1, gain: measured(most) }];
    }
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
