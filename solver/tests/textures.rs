//! Textures from votes: coverage, fields, and what a budget makes of them.

use glam::Vec3;
use shadowfit_solver::{
    budget::{self, Allocation, BudgetOptions, Offers, Sizing},
    field::{VoteGrid, VotedShape, blocked_votes},
    lists::VotedPlane,
    plane::{Encoding, OPAQUE, OccluderTexture, PlacedPlane, ShadowPlane, Side},
    sampling::uniform,
};

const CELLS: usize = 96;

const OPTIONS: BudgetOptions = BudgetOptions {
    max_planes: usize::MAX,
    bytes: usize::MAX,
    texture_size: 32,
    sizing: Sizing::Largest,
    encoding: None,
    byte_gain: 0.0,
    smoothing: 0,
};

/// Votes for a disc, in the proportion `sure` and up to 1.5 times; noise decides where it is 0.
fn disc(radius: f32, sure: f32, seed: u64) -> Vec<f32> {
    let vote = |i: usize| {
        let at = |k: usize| (k as f32 + 0.5) / CELLS as f32 - 0.5;
        let (x, y) = (at(i % CELLS), at(i / CELLS));
        let sign = if x.hypot(y) < radius { 1.0 } else { -1.0 };
        let noise = uniform(seed, i as u64) as f32;
        sure * sign * (1.0 + 0.5 * noise) + (1.0 - sure) * (noise - 0.5)
    };
    (0..CELLS * CELLS).map(vote).collect()
}

fn grid(votes: &[f32]) -> VoteGrid<'_> {
    VoteGrid { votes, width: CELLS, height: CELLS }
}

fn plane(votes: [Vec<f32>; 2]) -> VotedPlane {
    let plane = ShadowPlane { origin: Vec3::ZERO, u: Vec3::X, v: Vec3::Y };
    let placed = PlacedPlane { plane, side: Side::Both, bias: 0.01 };
    VotedPlane { placed, tint: OPAQUE, width: CELLS, height: CELLS, votes }
}

fn is_ring(i: usize, size: usize) -> bool {
    [i % size, i / size].iter().any(|&k| k == 0 || k + 1 == size)
}

/// Offers and sizes at once.
fn allocate(planes: &[&VotedPlane], shadow_weight: f64, options: &BudgetOptions) -> Allocation {
    budget::allocate(&Offers::new(planes, options), shadow_weight, options)
}

#[test]
fn coverage_is_the_best_of_all_bytes() {
    let size = 12;
    for (sure, seed) in [(1.0, 1), (0.3, 2), (0.0, 3)] {
        let votes = disc(0.3, sure, seed);
        let best = VotedShape::new(grid(&votes), 0).coverage((size, size));
        let gain = blocked_votes(&grid(&votes), &best);
        for i in (0..size * size).filter(|i| !is_ring(*i, size)) {
            for byte in [0, 80, 255] {
                let mut other: OccluderTexture = best.clone();
                other.texels[i] = byte;
                let gain_of_other = blocked_votes(&grid(&votes), &other);
                assert!(gain_of_other <= gain + 1e-3, "{sure}: texel {i} = {byte}: {gain_of_other} > {gain}");
            }
        }
    }
}

#[test]
fn outermost_texels_are_open() {
    let votes = vec![1.0; CELLS * CELLS];
    let shape = VotedShape::new(grid(&votes), 1);
    for (encoding, size) in
        [(Encoding::Coverage, 16), (Encoding::Sdf, 16), (Encoding::Coverage, 3), (Encoding::Sdf, 256)]
    {
        let texture = shape.texture(encoding, (size, size));
        assert_eq!((texture.width, texture.height, texture.encoding), (size, size, encoding));
        for (i, &texel) in texture.texels.iter().enumerate() {
            assert_eq!(texture.is_open(texel), is_ring(i, size), "{encoding:?} of {size}: texel {i} = {texel}");
        }
    }
}

#[test]
fn more_texels_than_cells_leave_no_holes() {
    let (cells, size) = (16, 128);
    let votes = vec![1.0; cells * cells];
    let grid = VoteGrid { votes: &votes, width: cells, height: cells };
    let texture = VotedShape::new(grid, 0).coverage((size, size));
    assert_eq!(texture.texels.iter().filter(|texel| **texel == 255).count(), (size - 2) * (size - 2));
}

#[test]
fn a_field_keeps_a_disc_that_coverage_blurs() {
    let planes = [plane([disc(0.3, 1.0, 1), disc(0.3, 1.0, 2)])];
    let planes: Vec<&VotedPlane> = planes.iter().collect();
    let allocation = allocate(&planes, 1.0, &BudgetOptions { texture_size: 16, ..OPTIONS });
    assert_eq!(allocation.encoding, Encoding::Sdf);
    for encoding in [Encoding::Coverage, Encoding::Sdf] {
        let allocation = allocate(&planes, 1.0, &BudgetOptions { encoding: Some(encoding), ..OPTIONS });
        assert_eq!((allocation.encoding, allocation.sizes), (encoding, vec![Some((32, 32))]));
    }
}

#[test]
fn a_plane_that_only_harms_is_dropped_at_any_size() {
    let opposite = disc(0.3, 1.0, 1).iter().map(|vote| -vote).collect();
    let planes = [plane([disc(0.3, 1.0, 1), opposite]), plane([disc(0.2, 1.0, 3), disc(0.2, 1.0, 4)])];
    let planes: Vec<&VotedPlane> = planes.iter().collect();
    for sizing in [Sizing::Largest, Sizing::ByGain] {
        for encoding in [None, Some(Encoding::Coverage), Some(Encoding::Sdf)] {
            let sizes = allocate(&planes, 1.0, &BudgetOptions { sizing, encoding, ..OPTIONS }).sizes;
            assert!(sizes[0].is_none() && sizes[1].is_some(), "{sizing:?} {encoding:?}: {sizes:?}");
        }
    }
}
