//! Bake: the final textures of all sections' planes, and the lists that read them.
//!
//! In: per section, planes with votes on fine grids and a list per direction. Out: one set. Each plane gets a texture of
//! the size and encoding that the budget gives it; planes that are not worth their bytes leave the lists.

use crate::{
    budget::{Allocation, BudgetOptions, Offers, allocate},
    field::{VoteGrid, VotedShape},
    lists::{SectionFit, VotedPlane},
    plane::{ActiveLists, BakedPlane, BakedSet, Encoding, PlacedPlane},
};
use glam::Vec3;
use rayon::prelude::*;

/// Bakes the planes of all sections to textures of the sizes that the budget gives them. `directions` are those of the
/// lists.
#[must_use]
pub fn bake(fits: &[SectionFit], directions: &[Vec3], shadow_weight: f64, options: &BudgetOptions) -> BakedSet {
    Baker::new(fits, directions, shadow_weight, options).within(options.bytes)
}

/// What planes are worth at each size, for bakes within several budgets.
pub struct Baker<'a> {
    fits: &'a [SectionFit],
    planes: Vec<&'a VotedPlane>,
    offers: Offers,
    directions: &'a [Vec3],
    shadow_weight: f64,
    options: BudgetOptions,
}

impl<'a> Baker<'a> {
    /// Measures the planes, which takes the most of a bake. As [`bake`], but for the bytes.
    #[must_use]
    pub fn new(fits: &'a [SectionFit], directions: &'a [Vec3], shadow_weight: f64, options: &BudgetOptions) -> Self {
        let planes: Vec<&VotedPlane> = fits.iter().flat_map(|fit| &fit.planes).collect();
        let offers = Offers::new(&planes, options);
        Self { fits, planes, offers, directions, shadow_weight, options: *options }
    }

    /// Bakes within so many bytes.
    #[must_use]
    pub fn within(&self, bytes: usize) -> BakedSet {
        let allocation = allocate(&self.offers, self.shadow_weight, &BudgetOptions { bytes, ..self.options });
        bake_sizes(self.fits, &self.planes, &allocation, (self.directions, self.options.smoothing))
    }
}

/// Bakes planes to textures of given sizes.
fn bake_sizes(
    fits: &[SectionFit],
    planes: &[&VotedPlane],
    allocation: &Allocation,
    (directions, smoothing): (&[Vec3], usize),
) -> BakedSet {
    let bake_one = |(plane, size): (&&VotedPlane, &Option<(usize, usize)>)| {
        size.and_then(|size| baked(plane, (allocation.encoding, size), smoothing))
    };
    let baked: Vec<Option<BakedPlane>> = planes.par_iter().zip(&allocation.sizes).map(bake_one).collect();
    let mut set = BakedSet::default();
    let mut index: Vec<Option<u32>> = Vec::with_capacity(baked.len());
    for plane in baked {
        index.push(plane.is_some().then_some(set.planes.len() as u32));
        set.planes.extend(plane);
    }
    let mut first = 0;
    let mut lists = vec![Vec::with_capacity(fits.len()); directions.len()];
    for fit in fits {
        let index = &index[first..first + fit.planes.len()];
        first += fit.planes.len();
        set.sections.push(index.iter().flatten().copied().collect());
        for (lists, list) in lists.iter_mut().zip(&fit.lists) {
            lists.push(list.iter().filter_map(|&k| index[k as usize]).collect::<Vec<u32>>());
        }
    }
    set.active = Some(ActiveLists { directions: directions.to_vec(), lists });
    set
}

/// The plane with a texture of the given size; `None` where it would block nothing.
fn baked(voted: &VotedPlane, (encoding, size): (Encoding, (usize, usize)), smoothing: usize) -> Option<BakedPlane> {
    let votes: Vec<f32> = voted.votes[0].iter().zip(&voted.votes[1]).map(|(a, b)| a + b).collect();
    let grid = VoteGrid { votes: &votes, width: voted.width, height: voted.height };
    let texture = VotedShape::new(grid, smoothing).texture(encoding, size);
    let blocks = texture.texels.iter().any(|&texel| !texture.is_open(texel));
    let PlacedPlane { plane, side, bias } = voted.placed;
    blocks.then_some(BakedPlane { plane, texture, tint: voted.tint, side, bias })
}
