//! A pool of planes and who crosses them: the finite problem that a certificate is about.
//!
//! In: pairs, and planes that each have a texel grid. Out: an [`Instance`]: for every plane the texels that blocked
//! pairs cross, with the lit pairs that cross the same ones. Texels that no blocked pair crosses stay open in a best
//! texture and are left out; those that only blocked pairs cross block in one, and are one texel here. On it: the
//! error of chosen planes with exactly re-baked textures (cyclic per-texel majority, the others frozen), and a search
//! restricted to the pool (greedy, re-bake, replace).
//!
//! Not guaranteed: that re-baking or the search end in the best textures or planes; `relaxation` bounds those.

use crate::{
    crossing::Casts,
    pair_table::{PairTable, SPARE},
    plane::PlacedPlane,
};
use rayon::prelude::*;
use std::ops::Range;

/// A plane that may be chosen, with the grid of its binary texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoolPlane {
    /// Where it lies and how it casts.
    pub placed: PlacedPlane,
    /// Texels along u.
    pub width: usize,
    /// Texels along v; at most `pair_table::MAX_TEXELS` of all.
    pub height: usize,
    /// Variants of one plane share this number: at most one of them may be chosen.
    pub family: usize,
}

/// Lights per block of pairs, the unit of parallel work. Fixed, so that sums are added in the same order at any
/// thread count.
const LIGHTS_PER_BLOCK: usize = 16;

/// Who crosses a plane, among the pairs of one block, in the order of the pairs; texels are those of the instance.
#[derive(Clone, Debug, Default)]
pub(crate) struct Crossings {
    /// Blocked pair of the block, texel.
    pub(crate) blocked: Vec<(u32, u32)>,
    /// Entry of the family's `lit`, texel.
    pub(crate) lit: Vec<(u32, u32)>,
}

/// The pairs of some lights. Lit pairs that cross no contested texel are left out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Block {
    /// Weights of the blocked pairs.
    pub(crate) blocked: Vec<f32>,
    /// Weights of the lit pairs.
    pub(crate) lit: Vec<f32>,
    /// `[plane]`.
    pub(crate) planes: Vec<Crossings>,
    /// `[family]`: the lit pairs that cross any of its planes.
    pub(crate) family_lit: Vec<Vec<u32>>,
}

/// Pairs, planes, and which pair crosses which texel.
#[derive(Clone, Debug, Default)]
pub struct Instance {
    pub(crate) blocks: Vec<Block>,
    /// First texel of each plane; one entry more than planes.
    pub(crate) first_texel: Vec<usize>,
    /// Planes of each family.
    pub(crate) families: Vec<Vec<usize>>,
    /// Family of each plane.
    family_of: Vec<usize>,
    /// Weight of the blocked pairs.
    pub(crate) shadow_weight: f64,
}

/// Marks a texel that does not count, and a pair without an index.
const NONE: u32 = u32::MAX;

impl Instance {
    /// Who of `pairs` crosses what of `pool`.
    ///
    /// # Panics
    /// A grid of the pool has more than `pair_table::MAX_TEXELS`.
    #[must_use]
    pub fn new(pairs: &PairTable, pool: &[PoolPlane]) -> Self {
        let numbered: Vec<(Vec<u32>, u32)> = pool.par_iter().map(|plane| contested(pairs, plane)).collect();
        let mut first_texel = vec![0usize];
        for (_, count) in &numbered {
            first_texel.push(first_texel[first_texel.len() - 1] + *count as usize);
        }
        // Families in the order of their first planes.
        let (mut families, mut family_of): (Vec<Vec<usize>>, Vec<usize>) = (Vec::new(), Vec::new());
        for (index, plane) in pool.iter().enumerate() {
            let known = families.iter().position(|members| pool[members[0]].family == plane.family);
            let family = known.unwrap_or_else(|| {
                families.push(Vec::new());
                families.len() - 1
            });
            families[family].push(index);
            family_of.push(family);
        }
        let casts: Vec<Casts> =
            pool.iter().map(|plane| Casts::new(pairs, &plane.placed, (plane.width, plane.height))).collect();
        let block = |first: usize| {
            let lights = first..pairs.lights.len().min(first + LIGHTS_PER_BLOCK);
            let mut block = block((pairs, lights), &casts, &numbered, &first_texel);
            block.share_lit(&families);
            block
        };
        let firsts: Vec<usize> = (0..pairs.lights.len()).step_by(LIGHTS_PER_BLOCK).collect();
        let blocks: Vec<Block> = firsts.into_par_iter().map(block).collect();
        let shadow_weight = blocks.iter().flat_map(|b| &b.blocked).map(|w| f64::from(*w)).sum();
        Self { blocks, first_texel, families, family_of, shadow_weight }
    }

    /// Planes of the pool.
    #[must_use]
    pub fn planes(&self) -> usize {
        self.family_of.len()
    }

    /// Texels that count, of all planes.
    #[must_use]
    pub fn texels(&self) -> usize {
        self.first_texel[self.planes()]
    }

    /// `shadow_error` of the planes `chosen` (indices into the pool), textures re-baked in that order until nothing
    /// changes, at most `rounds` times.
    #[must_use]
    pub fn rebaked_error(&self, chosen: &[usize], rounds: usize) -> f64 {
        let mut bake = Bake::new(self);
        bake.rebake_all(chosen, rounds);
        bake.error()
    }

    /// Greedy, re-bake, replace: up to `count` planes of the pool, at most one of a family, and their error. A
    /// replacement is judged by the error after re-baking all.
    #[must_use]
    pub fn search(&self, count: usize, rounds: usize) -> (Vec<usize>, f64) {
        let mut chosen: Vec<usize> = Vec::new();
        let mut error = self.rebaked_error(&[], 0);
        for _ in 0..count {
            let Some((plane, with)) = self.best_addition(&chosen, rounds) else { break };
            if with >= error {
                break;
            }
            chosen.push(plane);
            error = with;
        }
        loop {
            let before = error;
            for old in chosen.clone() {
                // Take one out, put the best back.
                let others: Vec<usize> = chosen.iter().copied().filter(|plane| *plane != old).collect();
                if let Some((plane, with)) = self.best_addition(&others, rounds)
                    && with < error
                {
                    chosen = others;
                    chosen.push(plane);
                    error = with;
                }
            }
            if error >= before {
                return (chosen, error);
            }
        }
    }

    /// The plane that lowers the error most, and that error.
    fn best_addition(&self, chosen: &[usize], rounds: usize) -> Option<(usize, f64)> {
        let free = |plane: usize| chosen.iter().all(|other| self.family_of[*other] != self.family_of[plane]);
        let with = |plane: usize| {
            let planes: Vec<usize> = chosen.iter().copied().chain([plane]).collect();
            (plane, self.rebaked_error(&planes, rounds))
        };
        let tried: Vec<(usize, f64)> =
            (0..self.planes()).into_par_iter().filter(|plane| free(*plane)).map(with).collect();
        tried.into_iter().reduce(|a, b| if b.1 < a.1 { b } else { a })
    }
}

impl Block {
    /// Numbers the lit pairs of each family, and lets its planes' crossings name them by those numbers.
    fn share_lit(&mut self, families: &[Vec<usize>]) {
        for members in families {
            let (mut shared, mut number) = (Vec::new(), vec![NONE; self.lit.len()]);
            for &plane in members {
                for (i, _) in &mut self.planes[plane].lit {
                    let number = &mut number[*i as usize];
                    if *number == NONE {
                        *number = shared.len() as u32;
                        shared.push(*i);
                    }
                    *i = *number;
                }
            }
            self.family_lit.push(shared);
        }
    }
}

/// New numbers of a plane's texels, and how many: 0 for all that only blocked pairs cross, 1 and up for those that
/// both kinds cross, [`NONE`] for the others.
fn contested(pairs: &PairTable, plane: &PoolPlane) -> (Vec<u32>, u32) {
    let texels = plane.width * plane.height;
    let mut crossed = Vec::new();
    pairs.crossings(&plane.placed, (plane.width, plane.height), &mut crossed);
    let mut kinds = vec![0u8; texels + SPARE];
    for (texel, vote) in crossed.into_iter().zip(&pairs.vote) {
        kinds[usize::from(texel)] |= if *vote > 0.0 { 1 } else { 2 };
    }
    let mut count = 1;
    let number = |(texel, kinds): (usize, u8)| match kinds {
        1 if texel < texels => 0,
        3 if texel < texels => {
            count += 1;
            count - 1
        }
        _ => NONE,
    };
    let numbers = kinds.into_iter().enumerate().map(number).collect();
    (numbers, count)
}

fn block(
    (pairs, lights): (&PairTable, Range<usize>),
    casts: &[Casts],
    numbered: &[(Vec<u32>, u32)],
    first: &[usize],
) -> Block {
    let start = pairs.lights[lights.start].start;
    let votes = &pairs.vote[start..pairs.lights[lights.end - 1].end];
    let mut planes = Vec::with_capacity(casts.len());
    let mut crossed = vec![false; votes.len()];
    let mut texels = vec![0u16; votes.len()];
    for ((casts, (numbers, _)), first) in casts.iter().zip(numbered).zip(first) {
        // Where nothing crosses, the last number stands: that of what lies outside.
        texels.fill((numbers.len() - 1) as u16);
        for light in lights.clone() {
            let rows = &pairs.lights[light];
            let _ = casts.of_light(pairs, light, &mut texels[rows.start - start..rows.end - start]);
        }
        let mut crossings = Crossings::default();
        for (i, (&texel, &vote)) in texels.iter().zip(votes).enumerate() {
            let number = numbers[usize::from(texel)];
            if number != NONE {
                let kind = if vote > 0.0 { &mut crossings.blocked } else { &mut crossings.lit };
                kind.push((i as u32, number + *first as u32));
                crossed[i] = true;
            }
        }
        planes.push(crossings);
    }
    // Number the pairs by kind, leaving out lit ones that no texture can ever shadow.
    let (mut blocked, mut lit, mut index) = (Vec::new(), Vec::new(), vec![0u32; votes.len()]);
    for (i, &vote) in votes.iter().enumerate() {
        if vote > 0.0 {
            index[i] = blocked.len() as u32;
            blocked.push(vote);
        } else if crossed[i] && vote < 0.0 {
            index[i] = lit.len() as u32;
            lit.push(-vote);
        }
    }
    for crossings in &mut planes {
        crossings.lit.retain(|(i, _)| votes[*i as usize] < 0.0);
        for (i, _) in crossings.blocked.iter_mut().chain(&mut crossings.lit) {
            *i = index[*i as usize];
        }
    }
    Block { blocked, lit, planes, family_lit: Vec::new() }
}

/// Textures of some planes, and how many of them cover each pair.
struct Bake<'a> {
    instance: &'a Instance,
    /// `[texel]`, 1 = blocks.
    blocks: Vec<u8>,
    /// `[block][blocked pair]`.
    covers_blocked: Vec<Vec<u8>>,
    /// `[block][lit pair]`.
    covers_lit: Vec<Vec<u8>>,
}

impl<'a> Bake<'a> {
    fn new(instance: &'a Instance) -> Self {
        Self {
            instance,
            blocks: vec![0; instance.texels()],
            covers_blocked: instance.blocks.iter().map(|block| vec![0; block.blocked.len()]).collect(),
            covers_lit: instance.blocks.iter().map(|block| vec![0; block.lit.len()]).collect(),
        }
    }

    /// What the pairs that no *other* plane covers say about each texel of a plane.
    fn votes(&self, plane: usize) -> Vec<f64> {
        let first = self.instance.first_texel[plane];
        let mut votes = vec![0.0; self.instance.first_texel[plane + 1] - first];
        let covers = self.covers_blocked.iter().zip(&self.covers_lit);
        for (block, (covers_blocked, covers_lit)) in self.instance.blocks.iter().zip(covers) {
            for &(i, texel) in &block.planes[plane].blocked {
                if covers_blocked[i as usize] == self.blocks[texel as usize] {
                    votes[texel as usize - first] += f64::from(block.blocked[i as usize]);
                }
            }
            let lit = &block.family_lit[self.instance.family_of[plane]];
            for &(slot, texel) in &block.planes[plane].lit {
                let i = lit[slot as usize];
                if covers_lit[i as usize] == self.blocks[texel as usize] {
                    votes[texel as usize - first] -= f64::from(block.lit[i as usize]);
                }
            }
        }
        votes
    }

    /// Sets a plane's texture.
    fn set(&mut self, plane: usize, texture: &[u8]) {
        let (instance, first) = (self.instance, self.instance.first_texel[plane]);
        for (index, block) in instance.blocks.iter().enumerate() {
            let lit = &block.family_lit[instance.family_of[plane]];
            let update = |covers: &mut u8, texel: u32| {
                *covers = *covers - self.blocks[texel as usize] + texture[texel as usize - first];
            };
            for &(i, texel) in &block.planes[plane].blocked {
                update(&mut self.covers_blocked[index][i as usize], texel);
            }
            for &(slot, texel) in &block.planes[plane].lit {
                update(&mut self.covers_lit[index][lit[slot as usize] as usize], texel);
            }
        }
        self.blocks[first..][..texture.len()].copy_from_slice(texture);
    }

    /// One exact step for one plane; says whether its texture changed.
    fn rebake(&mut self, plane: usize) -> bool {
        let texture: Vec<u8> = self.votes(plane).into_iter().map(|vote| u8::from(vote > 0.0)).collect();
        let changed = self.blocks[self.instance.first_texel[plane]..][..texture.len()] != texture;
        if changed {
            self.set(plane, &texture);
        }
        changed
    }

    fn rebake_all(&mut self, planes: &[usize], rounds: usize) {
        for _ in 0..rounds {
            let changes = planes.iter().filter(|plane| self.rebake(**plane)).count();
            if changes == 0 {
                break;
            }
        }
    }

    fn error(&self) -> f64 {
        let mut wrong = 0.0;
        let covers = self.covers_blocked.iter().zip(&self.covers_lit);
        for (block, (covers_blocked, covers_lit)) in self.instance.blocks.iter().zip(covers) {
            let missed = block.blocked.iter().zip(covers_blocked).filter(|(_, covers)| **covers == 0);
            let false_ = block.lit.iter().zip(covers_lit).filter(|(_, covers)| **covers > 0);
            wrong += missed.map(|(w, _)| f64::from(*w)).sum::<f64>();
            wrong += false_.map(|(w, _)| f64::from(*w)).sum::<f64>();
        }
        if self.instance.shadow_weight > 0.0 { wrong / self.instance.shadow_weight } else { 0.0 }
    }
}
