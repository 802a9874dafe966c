//! Halves: a mirrored model is fitted once and used twice.
//!
//! In: pair tables of sections of which 2k and 2k + 1 are each other's image ([`crate::sections::divide`]), later the set
//! fitted to half as many. Out: one table for each two sections, and the set of both halves. A pair (p, l) of the far
//! section becomes (image of p, image of l) and joins the near one's, so that a plane is decided by twice the pairs, under
//! twice the lights, and its texture gains what it gains in both; then planes and lists are reflected, and the textures
//! are the same. Both halves keep the truth that was traced on them: where they differ, the plane serves both as well as
//! one can.
//!
//! Tried and left out: sharing between sections that are no images, each offered the planes of its three nearest
//! neighbours as further candidates of its lists, votes added in the common rectangle. Preset
//! `fast`, seed 7: teapot_three 0.0695 became 0.0663 with 163 and 184 KiB, cesium_air 0.0919 became 0.0920 with 251 and
//! 279 KiB, both at 1.5 times the seconds and with twice as many planes in the lists' sections.
//!
//! A ground is its own image: it stays one section, and its lights are folded in the place of its receivers, but for those
//! of directions in the mirror plane, which are their own images.
//!
//! Guaranteed: V~(p, l) of the set is V~(image of p, image of l), to the bit where the mirror is a coordinate plane
//! through the origin, but for lights as near to two directions of the lists, of which the first counts, and on a ground
//! for those nearest to a direction in the mirror plane.

use crate::{
    pair_table::{LightRows, PairTable, nearest},
    plane::{ActiveLists, BakedPlane, BakedSet, PlacedPlane, SectionLists},
    symmetry::Mirror,
};
use glam::Vec3;
use rayon::prelude::*;

/// Is a direction of a list the image of one that stands for both?
fn is_image(direction: usize, directions: &[Vec3], mirror: &Mirror) -> bool {
    let light = directions[direction];
    mirror.normal().dot(light) < 0.0 && nearest(directions, mirror.vector(light)) != direction
}

/// Folds a section that is its own image, as a ground is: pairs under lights of the far half join those of the near one.
#[must_use]
pub fn folded_by_light(table: PairTable, mirror: &Mirror, directions: &[Vec3]) -> PairTable {
    let half = |of_images: bool| {
        let emptied = |rows: &LightRows| {
            let kept = is_image(rows.direction, directions, mirror) == of_images;
            LightRows { end: if kept { rows.end } else { rows.start }, ..*rows }
        };
        PairTable { lights: table.lights.iter().map(emptied).collect(), ..table.clone() }
    };
    joined(vec![half(false), half(true)], mirror, directions)
}

/// Joins the tables of each two sections. `directions` are those of the tables, their own image together.
#[must_use]
pub fn folded(tables: Vec<PairTable>, mirror: &Mirror, directions: &[Vec3]) -> Vec<PairTable> {
    tables.into_par_iter().chunks(2).map(|halves| joined(halves, mirror, directions)).collect()
}

/// The pairs of a near section and, folded, those of its image, if it has any.
fn joined(halves: Vec<PairTable>, mirror: &Mirror, directions: &[Vec3]) -> PairTable {
    let mut halves = halves.into_iter();
    let near = halves.next().unwrap_or_default();
    let nothing = || PairTable {
        lights: near.lights.iter().map(|rows| LightRows { start: 0, end: 0, ..*rows }).collect(),
        ..PairTable::default()
    };
    let far = halves.next().unwrap_or_else(nothing);
    // Lights of both, sorted by direction; of one direction the near half's first.
    let image = |rows: &LightRows| {
        let light = mirror.vector(rows.light) + Vec3::ZERO;
        LightRows { light, direction: nearest(directions, light), ..*rows }
    };
    let near_rows = near.lights.iter().map(|rows| (*rows, &near, None));
    let mut order: Vec<_> = near_rows.chain(far.lights.iter().map(|rows| (image(rows), &far, Some(mirror)))).collect();
    order.sort_by_key(|(rows, ..)| rows.direction);
    let receivers = near.receivers + far.receivers;
    let mut table = PairTable { directions: directions.len(), receivers, ..PairTable::default() };
    for (position, (rows, from, mirror)) in order.into_iter().enumerate() {
        let first = if mirror.is_some() { near.receivers } else { 0 };
        let place = |p| mirror.map_or(p, |mirror| mirror.point(p));
        table.append(from, LightRows { fold: position % 2, ..rows }, first, place);
    }
    table.bound();
    table
}

/// The set of both halves: section k becomes 2k, and its image 2k + 1; that of a ground, which is its own image, stays
/// one. The images of planes have their textures.
#[must_use]
pub fn unfolded(half: BakedSet, mirror: &Mirror) -> BakedSet {
    let (planes, sections) = (half.planes.len() as u32, half.model_sections());
    let image = |baked: &BakedPlane| {
        let BakedPlane { plane, side, bias, ref texture, tint } = *baked;
        let PlacedPlane { plane, side, bias } = mirror.placed(&PlacedPlane { plane, side, bias });
        BakedPlane { plane, texture: texture.clone(), tint, side, bias }
    };
    let images: Vec<BakedPlane> = half.planes.iter().map(image).collect();
    let of_images = |list: &Vec<u32>| -> Vec<u32> { list.iter().map(|plane| plane + planes).collect() };
    let both = |near: &[Vec<u32>], far: &[Vec<u32>]| -> SectionLists {
        near[..sections].iter().zip(far).flat_map(|(near, far)| [near.clone(), of_images(far)]).collect()
    };
    let active = half.active.as_ref().map(|ActiveLists { directions, lists }| {
        // Under a light the far half reads what the near one reads under the light's image, and so does the ground if
        // the light was folded.
        let of = |(direction, near): (usize, &SectionLists)| {
            let far = &lists[nearest(directions, mirror.vector(directions[direction]))];
            let folded = is_image(direction, directions, mirror);
            let ground = if folded { far.get(sections).map(of_images) } else { near.get(sections).cloned() };
            both(near, far).into_iter().chain(ground).collect()
        };
        ActiveLists { directions: directions.clone(), lists: lists.iter().enumerate().map(of).collect() }
    });
    let of_ground = |list: &Vec<u32>| list.iter().copied().chain(of_images(list)).collect();
    let ground = half.sections.get(sections).map(of_ground);
    let sections = both(&half.sections, &half.sections).into_iter().chain(ground).collect();
    BakedSet { planes: half.planes.into_iter().chain(images).collect(), sections, active, ground: half.ground }
}
