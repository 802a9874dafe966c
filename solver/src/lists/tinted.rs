//! Lists and textures where surfaces let light pass.
//!
//! In: an assignment that took every caster for opaque. Out: planes with tints, their votes and lists. A plane of one tint
//! cannot serve a pane and its frame, nor two panes of different colours side by side: each plane becomes one a kind of
//! caster that it explains (`tints`), first with the pairs of that kind, and lists take what they need of it.
//!
//! Method: as of [`super`], but for what a pair votes. Where planes let light pass, one more that covers a pair is no
//! longer harmless: A pair of weight w to which the other planes that are read leave the light A votes
//! `w (|A - V| - |A (1 - t) - V|)` for its texel on a plane of tint t, the exact drop of its error.
//!
//! Held-out errors of the scenes in `tests/tints.rs`, with all casters' planes opaque / one tint a plane / as here: a pane
//! 0.322, 0.106, 0.067; a pane beside a plate 0.122, 0.024, 0.020; two panes side by side 0.465, 0.131, 0.075; one behind the
//! other 0.292, 0.015, 0.015; a pane in a frame 0.140, 0.140, 0.069. Planes: 2, 4, 2, 4, 1 with one tint, 3, 5, 5, 4, 3 here.
//! With votes for uncovered pairs only, as opaque planes have them, neighbouring panes doubled at their border and frames
//! lost their panes (preset `fast`: 0.043 in the place of 0.016, 0.227 in the place of 0.013).
//!
//! A texture of colours in place of one tint a plane would save those planes and cost three bytes a texel and a second
//! look-up; not built.
//!
//! Not guaranteed: the best tints; they stay those of the first look. Products of many panes are as many tints, of which
//! a plane has [`tints::MOST`].

use super::{Assignment, Candidate, SectionFit, VotedPlane, decided, tints};
use crate::{
    pair_table::{LightRows, PairTable, SPARE},
    plane::{PlacedPlane, Side},
    shade::share,
    visibility::mean,
};
use glam::Vec3;
use rayon::prelude::*;

/// A set of planes.
type Planes = u128;

/// Most planes of a section after they have become one a tint; the last ones are left out.
const MOST_PLANES: usize = 128;

/// A plane of one tint.
struct Pane {
    placed: PlacedPlane,
    tint: [u8; 3],
    size: (usize, usize),
    /// Texel of each pair of the table.
    texels: Vec<u16>,
    /// The texture of all votes.
    blocked: Vec<u8>,
    /// The textures of each fold's votes.
    by_fold: [Vec<u8>; 2],
}

struct Tinted<'a> {
    opaque: &'a Assignment<'a>,
    table: &'a PairTable,
    panes: Vec<Pane>,
    /// The planes that each direction reads.
    read: Vec<Planes>,
    /// The planes that cover each pair where they are read.
    covers: Vec<Planes>,
}

/// Makes lists of tinted planes.
pub(super) fn assign(opaque: &Assignment<'_>) -> SectionFit {
    let of_plane = |k: usize| panes(opaque, k);
    let mut panes: Vec<Pane> = (0..opaque.planes.len()).into_par_iter().flat_map_iter(of_plane).collect();
    panes.truncate(MOST_PLANES);
    let table = opaque.table;
    let (read, covers) = (vec![0; table.directions], vec![0; table.len()]);
    let mut tinted = Tinted { opaque, table, panes, read, covers };
    (0..tinted.panes.len()).for_each(|k| tinted.cover(k));
    for _ in 0..opaque.options.rounds {
        tinted.choose_lists();
        for k in 0..tinted.panes.len() {
            tinted.decide_texture(k);
        }
    }
    tinted.choose_lists();
    tinted.finish()
}

/// One of a plane's tints a kind of caster that it alone explains.
fn panes(opaque: &Assignment<'_>, k: usize) -> Vec<Pane> {
    let Assignment { table, planes, read, covers, .. } = opaque;
    let Candidate { ref texels, ref blocked, .. } = planes[k];
    // Pairs that no other plane covers.
    let uncovered = |(rows, covers): (&LightRows, &Vec<u8>)| -> Vec<Crossing> {
        let pairs = (rows.start..rows.end).zip(covers);
        let alone = pairs.filter(|(i, cover)| **cover == blocked[texels[*i] as usize]);
        alone.map(|(pair, _)| Crossing { pair, fold: rows.fold, light: rows.light }).collect()
    };
    let read = table.lights.iter().zip(covers).filter(|(rows, _)| read[rows.direction][k]);
    let own: Vec<Crossing> = read.flat_map(uncovered).collect();
    let is_explained = |i: &usize| table.vote[*i] > 0.0 && blocked[texels[*i] as usize] == 1;
    let explained = || own.iter().filter(|crossing| is_explained(&crossing.pair));
    let tints = tints::of_pairs(table, explained().map(|crossing| crossing.pair));
    let pane = |side: Side, number: usize| {
        pane(opaque, PlacedPlane { side, ..planes[k].placed }, (&tints, number), (&own, planes[k].size))
    };
    let found = planes[k].placed.side;
    if tints.len() == 1 || found != Side::Both {
        return (0..tints.len()).map(|number| pane(found, number)).collect();
    }
    // What stands on a pane and what lies below it are blocked by other casters through the same texels.
    let normal = planes[k].placed.plane.normal();
    let lies = |crossing: &Crossing| if normal.dot(crossing.light) < 0.0 { Side::Front } else { Side::Back };
    let is_needed = |side: Side, number: usize| {
        explained().any(|crossing| lies(crossing) == side && tints::nearest(table, &tints, crossing.pair) == number)
    };
    let kinds = (0..tints.len()).flat_map(|number| [Side::Front, Side::Back].map(|side| (side, number)));
    kinds.filter(|(side, number)| is_needed(*side, *number)).map(|(side, number)| pane(side, number)).collect()
}

/// A pair that a plane may cover.
struct Crossing {
    pair: usize,
    fold: usize,
    light: Vec3,
}

/// A plane with the votes of one of its tints.
fn pane(
    opaque: &Assignment<'_>,
    placed: PlacedPlane,
    (tints, number): (&[[u8; 3]], usize),
    (own, size): (&[Crossing], (usize, usize)),
) -> Pane {
    let (table, mut texels) = (opaque.table, Vec::new());
    table.crossings(&placed, size, &mut texels);
    let mut votes = [0, 1].map(|_| vec![0.0f32; size.0 * size.1 + SPARE]);
    for &Crossing { pair, fold, .. } in own {
        let vote = table.vote[pair];
        let is_other = vote > 0.0 && tints::nearest(table, tints, pair) != number;
        votes[fold][texels[pair] as usize] += if is_other { -vote } else { vote };
    }
    let votes = votes.map(|votes| votes[..votes.len() - SPARE].to_vec());
    let (blocked, by_fold) = decided(votes, size.0, opaque.options.smoothing);
    Pane { placed, tint: tints[number], size, texels, blocked, by_fold }
}

impl Tinted<'_> {
    /// What some planes leave of the light.
    fn left(&self, mut planes: Planes) -> Vec3 {
        let mut left = Vec3::ONE;
        while planes != 0 {
            left *= 1.0 - share(self.panes[planes.trailing_zeros() as usize].tint);
            planes &= planes - 1;
        }
        left
    }

    /// How much the error of pair `i`, to which others leave the light `left`, falls by a plane that takes `taken`.
    fn vote(&self, i: usize, left: Vec3, taken: Vec3) -> f32 {
        let arrives = self.table.arriving(i);
        let wrong = |predicted: Vec3| mean((predicted - arrives).abs());
        self.table.vote[i].abs() * (wrong(left) - wrong(left * (1.0 - taken)))
    }

    /// Votes per texel and fold of the pairs that plane `k` is read for.
    fn votes(&self, k: usize) -> [Vec<f32>; 2] {
        let pane = &self.panes[k];
        let (taken, own) = (share(pane.tint), 1 << k);
        let mut votes = [0, 1].map(|_| vec![0.0f32; pane.by_fold[0].len()]);
        for rows in self.table.lights.iter().filter(|rows| self.read[rows.direction] & own != 0) {
            let others = self.read[rows.direction] & !own;
            for i in rows.start..rows.end {
                let left = self.left(self.covers[i] & others);
                votes[rows.fold][pane.texels[i] as usize] += self.vote(i, left, taken);
            }
        }
        votes.map(|votes| votes[..votes.len() - SPARE].to_vec())
    }

    /// Decides the texture of plane `k` anew, the others frozen.
    fn decide_texture(&mut self, k: usize) {
        let (blocked, by_fold) = decided(self.votes(k), self.panes[k].size.0, self.opaque.options.smoothing);
        (self.panes[k].blocked, self.panes[k].by_fold) = (blocked, by_fold);
        self.cover(k);
    }

    /// Notes which pairs plane `k` covers.
    fn cover(&mut self, k: usize) {
        let pane = &self.panes[k];
        for (cover, &texel) in self.covers.iter_mut().zip(&pane.texels) {
            *cover = *cover & !(1 << k) | Planes::from(pane.blocked[texel as usize]) << k;
        }
    }

    /// Per direction the planes that lower its error most, one by one.
    fn choose_lists(&mut self) {
        let of_direction: Vec<&[LightRows]> = self.table.lights.chunk_by(|a, b| a.direction == b.direction).collect();
        let chosen: Vec<Planes> = of_direction.par_iter().map(|lights| self.best_list(lights)).collect();
        self.read.fill(0);
        for (lights, chosen) in of_direction.iter().zip(chosen) {
            self.read[lights[0].direction] = chosen;
        }
    }

    fn best_list(&self, lights: &[LightRows]) -> Planes {
        let (start, end) = (lights[0].start, lights[lights.len() - 1].end);
        let mut left = vec![Vec3::ONE; end - start];
        let mut chosen = 0;
        let blocks =
            |pane: &Pane, rows: &LightRows, i: usize| pane.by_fold[1 - rows.fold][pane.texels[i] as usize] != 0;
        let gain = |pane: &Pane, left: &[Vec3]| -> f32 {
            let of_rows = |rows: &LightRows| -> f32 {
                let blocked = (rows.start..rows.end).filter(|i| blocks(pane, rows, *i));
                blocked.map(|i| self.vote(i, left[i - start], share(pane.tint))).sum()
            };
            lights.iter().map(of_rows).sum()
        };
        for _ in 0..self.opaque.options.max_lookups.min(self.panes.len()) {
            let open = self.panes.iter().enumerate().filter(|(k, _)| chosen >> k & 1 == 0);
            let gains = open.map(|(k, pane)| (gain(pane, &left), k)).filter(|(gain, _)| *gain > 0.0);
            let Some((_, k)) = gains.reduce(|a, b| if b.0 > a.0 { b } else { a }) else { break };
            chosen |= 1 << k;
            for rows in lights {
                for i in (rows.start..rows.end).filter(|i| blocks(&self.panes[k], rows, *i)) {
                    left[i - start] *= 1.0 - share(self.panes[k].tint);
                }
            }
        }
        chosen
    }

    /// Planes that are read, with their votes.
    fn finish(self) -> SectionFit {
        let used: Vec<usize> =
            (0..self.panes.len()).filter(|&k| self.read.iter().any(|read| read >> k & 1 != 0)).collect();
        let list = |read: &Planes| (0..).zip(&used).filter(|(_, k)| read >> **k & 1 != 0).map(|(i, _)| i).collect();
        let planes = used.iter().map(|&k| {
            let Pane { placed, tint, size: (width, height), .. } = self.panes[k];
            VotedPlane { placed, tint, width, height, votes: self.votes(k) }
        });
        SectionFit { planes: planes.collect(), lists: self.read.iter().map(list).collect() }
    }
}
