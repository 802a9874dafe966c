//! Active lists: which of a section's planes are read under which light, and what each plane then has to block.
//!
//! In: a section's pairs and planes. Out: per direction the few planes that lower its error most, and per plane the
//! votes of the pairs that it is read for and no other plane covers, on a fine grid. Method: textures and lists are
//! decided in turn, each with the other frozen (the alternation of Lloyd's k-means): a plane specialises in the lights
//! it is read under, and lists follow what planes have become. A texture is counted under lights that did not decide it.
//! Where surfaces let light pass, planes get tints (`tinted`).
//!
//! Not guaranteed: the best lists (the alternation ends in a local optimum).

mod tinted;
mod tints;

use crate::{
    pair_table::{LightRows, MAX_TEXELS, PairTable, SPARE},
    plane::{OPAQUE, PlacedPlane},
    search::Found,
    smoothing::{fill_unvoted, smoothed},
};
use rayon::prelude::*;

/// How lists are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ListOptions {
    /// Longest list, 1 and up.
    pub max_lookups: usize,
    /// Texels along the longer side of the grid that votes are counted on, up to 255. Too fine a grid has too few pairs
    /// a texel, too coarse a one blurs borders.
    pub grid: usize,
    /// Times that textures and lists are decided in turn; after the third little changes.
    pub rounds: usize,
    /// Times that votes pass a 3 x 3 binomial kernel before they decide a texture.
    pub smoothing: usize,
}

/// A plane with what it has to block.
#[derive(Clone, Debug, PartialEq)]
pub struct VotedPlane {
    /// Where it lies and how it casts.
    pub placed: PlacedPlane,
    /// The share of each linear colour that it takes where it blocks, in 255ths.
    pub tint: [u8; 3],
    /// Texels of the grid along u.
    pub width: usize,
    /// Texels of the grid along v.
    pub height: usize,
    /// `[fold][row][column]`: votes of the pairs that the plane is read for and no other covers.
    pub votes: [Vec<f32>; 2],
}

/// The planes of a section and which of them are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SectionFit {
    /// Planes that are in a list.
    pub planes: Vec<VotedPlane>,
    /// Indices into `planes`, one list a direction.
    pub lists: Vec<Vec<u32>>,
}

/// A plane while textures and lists change.
struct Candidate {
    placed: PlacedPlane,
    size: (usize, usize),
    /// Texel of each pair of the table.
    texels: Vec<u16>,
    /// The texture of all votes.
    blocked: Vec<u8>,
    /// The textures of each fold's votes.
    by_fold: [Vec<u8>; 2],
}

/// Lights per unit of parallel work. Fixed, so that sums are added in the same order at any thread count.
const LIGHTS_PER_TASK: usize = 64;

struct Assignment<'a> {
    table: &'a PairTable,
    options: &'a ListOptions,
    planes: Vec<Candidate>,
    /// `[direction][plane]`.
    read: Vec<Vec<bool>>,
    /// `[light][pair]`: planes that cover it.
    covers: Vec<Vec<u8>>,
}

/// Makes the lists of one section.
#[must_use]
pub fn assign(table: &PairTable, planes: &[Found], options: &ListOptions) -> SectionFit {
    let candidates = planes.par_iter().map(|found| Candidate::new(table, found.placed, options.grid)).collect();
    let mut assignment = Assignment {
        table,
        options,
        planes: candidates,
        read: vec![vec![false; planes.len()]; table.directions],
        covers: table.lights.iter().map(|rows| vec![0; rows.end - rows.start]).collect(),
    };
    assignment.start();
    if table.has_tints() {
        return tinted::assign(&assignment);
    }
    for _ in 0..options.rounds {
        assignment.choose_lists();
        for k in 0..planes.len() {
            assignment.decide_texture(k);
        }
    }
    assignment.choose_lists();
    assignment.finish()
}

impl Candidate {
    fn new(table: &PairTable, placed: PlacedPlane, grid: usize) -> Self {
        let (u, v) = (placed.plane.u.length(), placed.plane.v.length());
        let texel = u.max(v) / grid as f32;
        let count = |length: f32| ((length / texel).ceil() as usize).clamp(1, grid);
        let size = (count(u), count(v));
        let mut texels = Vec::new();
        table.crossings(&placed, size, &mut texels);
        let open = || vec![0; size.0 * size.1 + SPARE];
        Self { placed, size, texels, blocked: open(), by_fold: [open(), open()] }
    }
}

/// The textures of all votes and of each fold's.
fn decided(votes: [Vec<f32>; 2], width: usize, smoothing: usize) -> (Vec<u8>, [Vec<u8>; 2]) {
    let decide = |mut votes: Vec<f32>| {
        for _ in 0..smoothing {
            votes = smoothed(&votes, width);
        }
        fill_unvoted(&mut votes, width);
        let mut blocked: Vec<u8> = votes.into_iter().map(|vote| u8::from(vote > 0.0)).collect();
        blocked.extend([0; SPARE]);
        blocked
    };
    let both = votes[0].iter().zip(&votes[1]).map(|(a, b)| a + b).collect();
    (decide(both), votes.map(decide))
}

impl Assignment<'_> {
    /// First textures, plane by plane: each is read where it lowers what the ones before leave open.
    fn start(&mut self) {
        for k in 0..self.planes.len() {
            self.set_read(k, &vec![true; self.table.directions]);
            self.decide_texture(k);
            let window: Vec<bool> = self.gains(k).into_iter().map(|gain| gain > 0.0).collect();
            self.set_read(k, &window);
            self.decide_texture(k);
        }
    }

    /// Sets under which directions plane `k` is read; `covers` is kept up to date.
    fn set_read(&mut self, k: usize, window: &[bool]) {
        let (plane, read) = (&self.planes[k], &self.read);
        let update = |(rows, covers): (&LightRows, &mut Vec<u8>)| {
            let (before, after) = (u8::from(read[rows.direction][k]), u8::from(window[rows.direction]));
            if before != after {
                for (cover, &texel) in covers.iter_mut().zip(&plane.texels[rows.start..rows.end]) {
                    let blocked = plane.blocked[texel as usize];
                    *cover = *cover + after * blocked - before * blocked;
                }
            }
        };
        self.table.lights.par_iter().zip(self.covers.par_iter_mut()).for_each(update);
        for (read, &now) in self.read.iter_mut().zip(window) {
            read[k] = now;
        }
    }

    /// Votes per texel and fold of the pairs that plane `k` is read for and no other covers.
    fn votes(&self, k: usize) -> [Vec<f32>; 2] {
        let plane = &self.planes[k];
        let count = plane.blocked.len();
        let partial = |(lights, covers): (&[LightRows], &[Vec<u8>])| {
            let mut votes = [vec![0.0f32; count], vec![0.0f32; count]];
            for (rows, covers) in lights.iter().zip(covers).filter(|(rows, _)| self.read[rows.direction][k]) {
                let votes = &mut votes[rows.fold];
                for (i, &cover) in (rows.start..rows.end).zip(covers) {
                    let texel = plane.texels[i] as usize;
                    // Its count equals what this plane itself contributes.
                    if cover == plane.blocked[texel] {
                        votes[texel] += self.table.vote[i];
                    }
                }
            }
            votes
        };
        let tasks = self.table.lights.par_chunks(LIGHTS_PER_TASK).zip(self.covers.par_chunks(LIGHTS_PER_TASK));
        let partials: Vec<[Vec<f32>; 2]> = tasks.map(partial).collect();
        let mut votes = [vec![0.0f32; count], vec![0.0f32; count]];
        for partial in partials {
            for (votes, partial) in votes.iter_mut().zip(partial) {
                votes.iter_mut().zip(partial).for_each(|(sum, vote)| *sum += vote);
            }
        }
        votes.map(|mut votes| {
            votes.truncate(count - SPARE);
            votes
        })
    }

    /// Decides the texture of plane `k` anew, the others frozen.
    fn decide_texture(&mut self, k: usize) {
        let votes = self.votes(k);
        let (blocked, by_fold) = decided(votes, self.planes[k].size.0, self.options.smoothing);
        let (plane, read) = (&self.planes[k], &self.read);
        let update = |(rows, covers): (&LightRows, &mut Vec<u8>)| {
            if read[rows.direction][k] {
                for (cover, &texel) in covers.iter_mut().zip(&plane.texels[rows.start..rows.end]) {
                    *cover = *cover + blocked[texel as usize] - plane.blocked[texel as usize];
                }
            }
        };
        self.table.lights.par_iter().zip(self.covers.par_iter_mut()).for_each(update);
        let plane = &mut self.planes[k];
        (plane.blocked, plane.by_fold) = (blocked, by_fold);
    }

    /// What plane `k` gains per direction on pairs that no other covers.
    fn gains(&self, k: usize) -> Vec<f32> {
        let plane = &self.planes[k];
        let mut gains = vec![0.0; self.table.directions];
        for (rows, covers) in self.table.lights.iter().zip(&self.covers) {
            let reads = u8::from(self.read[rows.direction][k]);
            let blocked = &plane.by_fold[1 - rows.fold];
            for (i, &cover) in (rows.start..rows.end).zip(covers) {
                let texel = plane.texels[i] as usize;
                if blocked[texel] != 0 && cover == reads * plane.blocked[texel] {
                    gains[rows.direction] += self.table.vote[i];
                }
            }
        }
        gains
    }

    /// Per direction the planes that lower its error most, one by one.
    fn choose_lists(&mut self) {
        let of_direction: Vec<&[LightRows]> = self.table.lights.chunk_by(|a, b| a.direction == b.direction).collect();
        let chosen: Vec<Vec<bool>> = of_direction.par_iter().map(|lights| self.best_list(lights)).collect();
        let mut read = vec![vec![false; self.planes.len()]; self.table.directions];
        for (lights, chosen) in of_direction.iter().zip(chosen) {
            read[lights[0].direction] = chosen;
        }
        for k in 0..self.planes.len() {
            let window: Vec<bool> = read.iter().map(|read| read[k]).collect();
            self.set_read(k, &window);
        }
    }

    fn best_list(&self, lights: &[LightRows]) -> Vec<bool> {
        let (start, end) = (lights[0].start, lights[lights.len() - 1].end);
        let mut covered = vec![0u8; end - start];
        let mut chosen = vec![false; self.planes.len()];
        let gain = |plane: &Candidate, covered: &[u8]| {
            let mut gain = 0.0f32;
            for rows in lights {
                let blocked = &plane.by_fold[1 - rows.fold];
                let covered = &covered[rows.start - start..rows.end - start];
                let (texels, votes) = (&plane.texels[rows.start..rows.end], &self.table.vote[rows.start..rows.end]);
                for ((&texel, &vote), &covered) in texels.iter().zip(votes).zip(covered) {
                    gain += vote * f32::from(blocked[texel as usize] & !covered & 1);
                }
            }
            gain
        };
        // Gains fall as more is covered, but for false shadows: a bound that has fallen to 0 is done with.
        let mut bounds = vec![f32::INFINITY; self.planes.len()];
        for _ in 0..self.options.max_lookups.min(self.planes.len()) {
            let mut best = (0.0f32, None);
            for (k, plane) in self.planes.iter().enumerate() {
                if !chosen[k] && bounds[k] > best.0 {
                    bounds[k] = gain(plane, &covered);
                    if bounds[k] > best.0 {
                        best = (bounds[k], Some(k));
                    }
                }
            }
            let Some(k) = best.1 else { break };
            chosen[k] = true;
            for rows in lights {
                let blocked = &self.planes[k].by_fold[1 - rows.fold];
                for i in rows.start..rows.end {
                    covered[i - start] |= blocked[self.planes[k].texels[i] as usize];
                }
            }
        }
        chosen
    }

    /// Planes that are read, with their votes.
    fn finish(self) -> SectionFit {
        let used: Vec<usize> = (0..self.planes.len()).filter(|&k| self.read.iter().any(|read| read[k])).collect();
        let list = |read: &Vec<bool>| (0..).zip(&used).filter(|(_, k)| read[**k]).map(|(i, _)| i).collect();
        let planes = used.iter().map(|&k| {
            let Candidate { placed, size: (width, height), .. } = self.planes[k];
            VotedPlane { placed, tint: OPAQUE, width, height, votes: self.votes(k) }
        });
        SectionFit { planes: planes.collect(), lists: self.read.iter().map(list).collect() }
    }
}

// An index of the grid must fit the table's 16 bits.
const _: () = assert!(255 * 255 <= MAX_TEXELS);
