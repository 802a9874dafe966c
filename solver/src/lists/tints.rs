//! Tints: what the pairs that a plane explains lose of each colour.
//!
//! In: pairs under which surfaces let light pass. Out: the few tints, one for each kind of caster that a plane stands for.
//! Method: the blocked shares `1 - V` are sorted into cells of the colour cube; cells whose mean lowers the weighted
//! distance of all to their nearest most are taken, one by one (greedy k-medians), while that pays.

use crate::{pair_table::PairTable, shade::share, visibility::mean};
use glam::Vec3;
use std::collections::BTreeMap;

/// Cells along each side of the colour cube. Two casters in one cell become their mean, off by up to a 24th.
const CELLS: f32 = 12.0;

/// Most tints of one plane.
pub(super) const MOST: usize = 4;

/// A further tint must take this share of the shadow that the plane explains: noise at borders takes less.
const LEAST_GAIN: f64 = 0.01;

/// Tints of some pairs, the one that does most first.
pub(super) fn of_pairs(table: &PairTable, explained: impl Iterator<Item = usize>) -> Vec<[u8; 3]> {
    let mut cells: BTreeMap<[u8; 3], (f64, Vec3)> = BTreeMap::new();
    for i in explained {
        let taken = 1.0 - table.arriving(i);
        let (weight, sum) = cells.entry((taken * CELLS).round().to_array().map(|x| x as u8)).or_default();
        *weight += f64::from(table.vote[i]);
        *sum += table.vote[i] * taken;
    }
    let cells: Vec<(f64, Vec3)> = cells.into_values().map(|(weight, sum)| (weight, sum / weight as f32)).collect();
    let mut left: Vec<f64> = cells.iter().map(|(weight, taken)| weight * f64::from(mean(*taken))).collect();
    let all: f64 = left.iter().sum();
    let mut tints = Vec::new();
    while tints.len() < MOST {
        let with = |centre: Vec3| -> Vec<f64> {
            cells.iter().zip(&left).map(|((w, taken), left)| left.min(w * distance(*taken, centre))).collect()
        };
        let tried = cells.iter().map(|(_, centre)| (with(*centre).iter().sum::<f64>(), *centre));
        let Some((after, centre)) = tried.reduce(|a, b| if b.0 < a.0 { b } else { a }) else { break };
        if left.iter().sum::<f64>() - after < LEAST_GAIN * all {
            break;
        }
        left = with(centre);
        tints.push((centre * 255.0).round().to_array().map(|x| x as u8));
    }
    tints
}

/// Which of `tints` comes nearest to what a pair loses.
pub(super) fn nearest(table: &PairTable, tints: &[[u8; 3]], i: usize) -> usize {
    let taken = 1.0 - table.arriving(i);
    let distances = tints.iter().map(|tint| distance(taken, share(*tint))).enumerate();
    distances.reduce(|a, b| if b.1 < a.1 { b } else { a }).map_or(0, |(nearest, _)| nearest)
}

fn distance(a: Vec3, b: Vec3) -> f64 {
    f64::from(mean((a - b).abs()))
}
