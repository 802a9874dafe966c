//! The pairs of one section in one table, for the search.
//!
//! Lights are sorted by the *direction* (of the active lists) that stands for them and dealt to two folds in turn:
//! what a texture does is always counted under lights that did not decide it. Folds of receivers under the same lights,
//! as the search of whole models had them, hid most of the over-fitting: with 384 lights in 64 sections the held-out
//! error was 0.058 on new receivers, 0.069 under new lights and 0.049 on the training pairs.

use crate::{
    sampling::uniform,
    visibility::{Pairs, arriving, taken},
};
use glam::Vec3;
use rayon::prelude::*;
use std::borrow::Cow;

/// The rows of one light in a [`PairTable`].
#[derive(Clone, Copy, Debug)]
pub struct LightRows {
    /// Unit direction towards the light.
    pub light: Vec3,
    /// Index of the nearest direction of the active lists.
    pub direction: usize,
    /// 0 or 1.
    pub fold: usize,
    /// First pair.
    pub start: usize,
    /// One past the last pair.
    pub end: usize,
}

/// Pairs, structure of arrays; the columns have one entry a pair. Some have a vote of 0 and stand for nothing.
#[derive(Clone, Debug, Default)]
pub struct PairTable {
    /// Receiver positions, unit space.
    pub x: Vec<f32>,
    /// As `x`.
    pub y: Vec<f32>,
    /// As `x`.
    pub z: Vec<f32>,
    /// `+w` where blocked, `-w` where lit.
    pub vote: Vec<f32>,
    /// The share of each linear colour that arrives; empty for an opaque model.
    pub arrives: Vec<Vec3>,
    /// Index of the receiver.
    pub receiver: Vec<u32>,
    /// Rows by light, sorted by direction.
    pub lights: Vec<LightRows>,
    /// The same lights: x, y and z of sixteen at a time; the last are filled up with zeros.
    pub light_lanes: Vec<[[f32; LANES]; 3]>,
    /// Number of directions.
    pub directions: usize,
    /// Receivers that the pairs were made from.
    pub receivers: usize,
    /// The box of the receivers: its lowest and its highest corner.
    pub bounds: [Vec3; 2],
}

/// How many pairs a sample takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleSize {
    /// Lights; each costs as much as some twenty pairs.
    pub lights: usize,
    /// Pairs, a third of them blocked.
    pub pairs: usize,
}

/// Spare entries behind the texels of a grid, for pairs that cross outside. One alone would make each of them wait
/// for the store of the one before.
pub const SPARE: usize = 16;

/// The rows of a light are padded with pairs of no weight to a multiple of this, which the vector loop takes at once:
/// a sample has some twenty pairs a light, and the odd ones at the end cost as much as all others.
pub(crate) const LANES: usize = 16;

/// Most texels of a grid: an index and its spare must fit 16 bits.
pub const MAX_TEXELS: usize = (1 << 16) - SPARE;

/// Lights per unit of parallel work. Fixed, so that sums are added in the same order at any thread count.
const LIGHTS_PER_TASK: usize = 256;

/// Lit pairs of a receiver are drawn in proportion to the share of its light that is blocked, plus this. Smaller makes
/// false shadows on receivers that are never shadowed noisy; larger wastes the sample on them.
const LIT_FLOOR: f32 = 0.03;

impl PairTable {
    /// All pairs of `pairs`, whose lights are served by `directions` (unit vectors).
    #[must_use]
    pub fn new(pairs: &Pairs, directions: &[Vec3]) -> Self {
        let mut order: Vec<(usize, usize)> =
            pairs.lights.iter().map(|l| nearest(directions, l.light)).zip(0..).collect();
        order.sort_unstable();
        let mut table = Self { directions: directions.len(), receivers: pairs.receivers, ..Self::default() };
        table.reserve(pairs.len() + LANES * order.len(), order.len());
        for (position, (direction, index)) in order.into_iter().enumerate() {
            let light = &pairs.lights[index];
            let start = table.len();
            table.x.extend(&light.x);
            table.y.extend(&light.y);
            table.z.extend(&light.z);
            table.vote.extend(&light.vote);
            table.arrives.extend(&light.arrives);
            table.receiver.extend(&light.receiver);
            table.pad(start);
            let end = table.len();
            table.push_light(LightRows { light: light.light, direction, fold: position % 2, start, end });
        }
        table.bound();
        table
    }

    /// Fills the rows from `start` on up to whole lanes.
    fn pad(&mut self, start: usize) {
        let count = (self.len() - start).next_multiple_of(LANES) - (self.len() - start);
        for column in [&mut self.x, &mut self.y, &mut self.z] {
            column.extend(std::iter::repeat_n(column.last().copied().unwrap_or_default(), count));
        }
        self.vote.extend(std::iter::repeat_n(0.0, count));
        if !self.arrives.is_empty() {
            self.arrives.extend(std::iter::repeat_n(Vec3::ONE, count));
        }
        self.receiver.extend(std::iter::repeat_n(self.receiver.last().copied().unwrap_or_default(), count));
    }

    /// Adds the rows of a light of another table: points where `image` says, receivers counted from `first` on.
    pub(crate) fn append(&mut self, from: &Self, rows: LightRows, first: usize, image: impl Fn(Vec3) -> Vec3) {
        let start = self.len();
        for p in (rows.start..rows.end).map(|i| image(from.point(i))) {
            self.x.push(p.x);
            self.y.push(p.y);
            self.z.push(p.z);
        }
        self.vote.extend(&from.vote[rows.start..rows.end]);
        self.arrives.extend(from.arrives.get(rows.start..rows.end).unwrap_or_default());
        self.receiver.extend(from.receiver[rows.start..rows.end].iter().map(|receiver| receiver + first as u32));
        self.push_light(LightRows { start, end: self.len(), ..rows });
    }

    /// Measures the box of the receivers.
    pub(crate) fn bound(&mut self) {
        let points = || (0..self.len()).map(|i| self.point(i));
        self.bounds = [points().fold(Vec3::INFINITY, Vec3::min), points().fold(Vec3::NEG_INFINITY, Vec3::max)];
    }

    /// Adds the rows of a light.
    pub(crate) fn push_light(&mut self, rows: LightRows) {
        let lane = self.lights.len() % LANES;
        if lane == 0 {
            self.light_lanes.push([[0.0; LANES]; 3]);
        }
        if let Some(lanes) = self.light_lanes.last_mut() {
            lanes.iter_mut().zip(rows.light.to_array()).for_each(|(column, x)| column[lane] = x);
        }
        self.lights.push(rows);
    }

    fn reserve(&mut self, pairs: usize, lights: usize) {
        for column in [&mut self.x, &mut self.y, &mut self.z, &mut self.vote] {
            column.reserve(pairs);
        }
        self.receiver.reserve(pairs);
        self.lights.reserve(lights);
    }

    /// The same pairs for lists that do not depend on the light: one direction stands for all.
    #[must_use]
    pub fn undirected(mut self) -> Self {
        self.directions = 1;
        self.lights.iter_mut().for_each(|rows| rows.direction = 0);
        self
    }

    /// The same pairs with all votes multiplied.
    #[must_use]
    pub fn scaled(mut self, factor: f32) -> Self {
        self.vote.iter_mut().for_each(|vote| *vote *= factor);
        self
    }

    /// Number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.vote.len()
    }

    /// True where there is no pair.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.vote.is_empty()
    }

    /// Sums of w (1 - V), V the mean of the colours, and of w.
    #[must_use]
    pub fn weights(&self) -> (f64, f64) {
        self.vote.iter().enumerate().fold((0.0, 0.0), |(shadow, total), (i, &vote)| {
            (shadow + taken(&self.vote, &self.arrives, i), total + f64::from(vote.abs()))
        })
    }

    /// The share of each colour that arrives of pair `i`.
    #[must_use]
    pub fn arriving(&self, i: usize) -> Vec3 {
        arriving(&self.vote, &self.arrives, i)
    }

    /// Does some pair lose a part of the light and keep another?
    #[must_use]
    pub fn has_tints(&self) -> bool {
        self.arrives.iter().any(|v| *v != Vec3::ZERO && *v != Vec3::ONE)
    }

    /// The pairs with the votes by which planes are searched: where something is kept, what is lost of the light. With
    /// whole votes a propeller's faint disc (a twelfth is lost) was worth as many planes as a wall.
    #[must_use]
    pub fn by_loss(&self) -> Cow<'_, Self> {
        if !self.has_tints() {
            return Cow::Borrowed(self);
        }
        let vote =
            |i: usize| if self.vote[i] > 0.0 { taken(&self.vote, &self.arrives, i) as f32 } else { self.vote[i] };
        Cow::Owned(Self { vote: (0..self.len()).map(vote).collect(), ..self.clone() })
    }

    /// Receiver position of pair `i`.
    #[must_use]
    pub fn point(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    /// The rows of every `stride`-th light from the `first` on, of which `vote` gives a vote.
    fn picked(&self, (first, stride): (usize, usize), mut vote: impl FnMut(usize) -> Option<f32>) -> Self {
        let Self { directions, receivers, bounds, .. } = *self;
        let mut out = Self { directions, receivers, bounds, ..Self::default() };
        for rows in self.lights.iter().skip(first).step_by(stride) {
            let start = out.len();
            for i in (rows.start..rows.end).filter(|i| self.vote[*i] != 0.0) {
                if let Some(vote) = vote(i) {
                    out.x.push(self.x[i]);
                    out.y.push(self.y[i]);
                    out.z.push(self.z[i]);
                    out.vote.push(vote);
                    out.arrives.extend(self.arrives.get(i));
                    out.receiver.push(self.receiver[i]);
                }
            }
            out.pad(start);
            out.push_light(LightRows { start, end: out.len(), ..*rows });
        }
        out
    }

    /// The pairs for which `vote(pair)` gives one, with that vote.
    #[must_use]
    pub fn revoted(&self, vote: impl FnMut(usize) -> Option<f32>) -> Self {
        self.picked((0, 1), vote)
    }

    /// A sample of about the given size, with votes scaled up to what they stand for. Lit pairs, which are many and
    /// mostly of receivers that nothing ever shadows, are drawn where the decisions are.
    #[must_use]
    pub fn sample(&self, size: SampleSize, seed: u64) -> Self {
        self.sample_where(size, seed, |_| true)
    }

    /// The same of the pairs for which `keep(pair)`. Only the lights of the sample are read.
    #[must_use]
    pub fn sample_where(&self, size: SampleSize, seed: u64, keep: impl Fn(usize) -> bool + Sync) -> Self {
        // An odd stride keeps both folds.
        let stride = (self.lights.len() / size.lights.max(1)).max(1) | 1;
        let first = (uniform(seed, 2) * stride as f64) as usize;
        let importance = self.importance(&keep);
        let mut blocked = 0usize;
        let mut lit_importance = 0.0f64;
        for rows in self.lights.iter().skip(first).step_by(stride) {
            for i in (rows.start..rows.end).filter(|i| keep(*i)) {
                lit_importance +=
                    if self.vote[i] < 0.0 { f64::from(importance[self.receiver[i] as usize]) } else { 0.0 };
                blocked += usize::from(self.vote[i] > 0.0);
            }
        }
        let wanted = size.pairs as f64 / 3.0;
        let keep_blocked = (wanted / blocked.max(1) as f64).min(1.0);
        let lit_scale = 2.0 * wanted / lit_importance.max(f64::MIN_POSITIVE);
        // Error diffusion: every 1/p-th pair.
        let mut due = [uniform(seed, 0), uniform(seed, 1)];
        self.picked((first, stride), |i| {
            let is_lit = self.vote[i] <= 0.0;
            let importance = f64::from(importance[self.receiver[i] as usize]);
            let share = if is_lit { (lit_scale * importance).min(1.0) } else { keep_blocked };
            let due = &mut due[usize::from(is_lit)];
            *due += if keep(i) { share } else { 0.0 };
            (*due >= 1.0).then(|| {
                *due -= 1.0;
                self.vote[i] * (stride as f64 / share) as f32
            })
        })
    }

    /// How much lit pairs of each receiver matter: the share of its light that is blocked, of the pairs for which
    /// `keep(pair)`, and a little. From all lights: those of a sample alone, or all pairs whether kept or not, took the
    /// held-out error of 11 planes on teapot_three from 0.135 to 0.140 and 0.148 (mean of four and six seeds).
    fn importance(&self, keep: &(impl Fn(usize) -> bool + Sync)) -> Vec<f32> {
        let of_lights = |lights: &[LightRows]| {
            let mut weights = vec![[0.0f32; 2]; self.receivers];
            for i in lights.iter().flat_map(|rows| rows.start..rows.end).filter(|i| keep(*i)) {
                let [blocked, all] = &mut weights[self.receiver[i] as usize];
                *blocked += self.vote[i].max(0.0);
                *all += self.vote[i].abs();
            }
            weights
        };
        let partials: Vec<Vec<[f32; 2]>> = self.lights.par_chunks(LIGHTS_PER_TASK).map(of_lights).collect();
        let sum = |receiver: usize| {
            partials.iter().map(|weights| weights[receiver]).fold([0.0f32; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
        };
        let importance = |[blocked, all]: [f32; 2]| if all > 0.0 { blocked / all + LIT_FLOOR } else { 1.0 };
        (0..self.receivers).map(|receiver| importance(sum(receiver))).collect()
    }
}

/// Index of the direction with the largest dot product with `light`, of two equal ones the first: what a renderer
/// picks an active list by.
#[must_use]
pub fn nearest(directions: &[Vec3], light: Vec3) -> usize {
    let (mut nearest, mut largest) = (0, f32::NEG_INFINITY);
    for (i, direction) in directions.iter().enumerate() {
        let dot = direction.dot(light);
        if dot > largest {
            (nearest, largest) = (i, dot);
        }
    }
    nearest
}
