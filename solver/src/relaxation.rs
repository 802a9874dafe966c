//! Relaxation: a lower bound on the error of any planes of a pool, and multipliers that prove it.
//!
//! In: an [`Instance`] and K. For chosen planes with binary textures t let c be the texel that a pair crosses, m_b = 1
//! where no chosen plane covers blocked pair b, f_r = 1 where one covers lit pair r. Then
//! `error = sum_b w_b m_b + sum_r w_r f_r`, `m_b >= 1 - sum_j t_j(c_j(b))`, and for each family F (of which at most one
//! plane is chosen) `f_r >= sum_{j in F} t_j(c_j(r))`. With a multiplier alpha_b in [0, w_b] for each of the first
//! and beta_{r,F} >= 0, sum_F beta_{r,F} <= w_r, for each of the second kind, w m >= alpha m and w f >= sum beta f give
//!
//! `error >= sum_b alpha_b - sum of the K largest over F of max_{j in F} sum_texels max(0, sum alpha - sum beta_F)`,
//!
//! for *any* such multipliers (Lagrangian relaxation: Geoffrion 1974; Held, Wolfe, Crowder 1974). They are sought by
//! the primal-dual method of Chambolle and Pock (2011) with the diagonal steps of Pock and Chambolle (2011) on the
//! saddle point in (t; alpha, beta); t is projected exactly onto 0 <= t_j <= y_j, sum_{j in F} y_j <= 1, sum y <= K.
//! [`bound`] clamps alpha, scales beta and sums in f64, so that it holds wherever the search stops.
//!
//! Guaranteed: the bound. Not guaranteed: that it is tight, where planes of *different* families nearly coincide:
//! fractions of many of them cover as much as one, and share its false shadows.
//!
//! Tried and left out (180,000 pairs, 48 x 48 texels): a beta per plane, which also bounds sets with several planes of a
//! family, 300 iterations: aircraft, 3 of 97 planes, found 0.204, bound 0.180 (a beta per family: 0.202); teapot, 11 of
//! 243 planes, found 0.191, bound 0.123 (0.150). Betas per family, and two planes of one counted as covering all that
//! crosses them, for the same sets: 0.144 and 0.030. Projected subgradient with Polyak's step towards the error found, in
//! place of the primal-dual method, after 100, 200 and 300 iterations: aircraft, 3 of 45 planes, found 0.2044, bounds
//! 0.1956, 0.1982, 0.1991 (0.2036, 0.2040, 0.2040); teapot, 11 of 101, found 0.1905, 0.1514, 0.1597, 0.1631 (0.1711,
//! 0.1746, 0.1755).

use crate::pool::{Block, Instance};
use rayon::prelude::*;

/// Prices of a pair's shadow: what proves a bound. See the module's formula.
#[derive(Clone, Debug, Default)]
pub struct Multipliers {
    blocks: Vec<BlockMultipliers>,
}

#[derive(Clone, Debug, Default)]
struct BlockMultipliers {
    /// `[blocked pair]`.
    alpha: Vec<f32>,
    /// `[family][entry of the family's lit pairs]`; scaled to sum to the pair's weight before use.
    beta: Vec<Vec<f32>>,
}

impl Multipliers {
    /// Each price its pair's weight times a share; `share` is asked in a fixed order.
    #[must_use]
    pub fn from_shares(instance: &Instance, mut share: impl FnMut() -> f32) -> Self {
        let block = |block: &Block| BlockMultipliers {
            alpha: block.blocked.iter().map(|w| w * share()).collect(),
            beta: block
                .family_lit
                .iter()
                .map(|lit| lit.iter().map(|i| block.lit[*i as usize] * share()).collect())
                .collect(),
        };
        Self { blocks: instance.blocks.iter().map(block).collect() }
    }

    /// The prices of the blocked pairs, in the order of the pairs.
    pub(crate) fn alpha(&self) -> impl Iterator<Item = f32> {
        self.blocks.iter().flat_map(|block| block.alpha.iter().copied())
    }
}

/// What multipliers prove.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bound {
    /// No K planes of the pool, at most one of a family, have a smaller `shadow_error`.
    pub lower_bound: f64,
    /// What the best plane of each family would save at these prices, as `shadow_error`.
    pub values: Vec<f64>,
}

/// Sums of fewer than 4e6 terms in f64 are wrong by less than this share of the sum of their magnitudes (4e6 x 1.1e-16);
/// it is taken off, so that rounding cannot lift a bound above the truth.
const ROUNDING: f64 = 1e-9;

/// The bound of the module's formula for `planes` planes.
#[must_use]
pub fn bound(instance: &Instance, multipliers: &Multipliers, planes: usize) -> Bound {
    if instance.shadow_weight <= 0.0 {
        return Bound::default();
    }
    let blocks = instance.blocks.par_iter().zip(&multipliers.blocks);
    let votes: Vec<Vec<f64>> = blocks.map(|(block, m)| texel_votes(instance, block, m)).collect();
    let value = |plane: usize| {
        let texels = instance.first_texel[plane]..instance.first_texel[plane + 1];
        texels.map(|texel| votes.iter().map(|votes| votes[texel]).sum::<f64>().max(0.0)).sum::<f64>()
    };
    let best = |members: &Vec<usize>| members.iter().map(|plane| value(*plane)).fold(0.0, f64::max);
    let values: Vec<f64> = instance.families.par_iter().map(best).collect();
    let mut largest = values.clone();
    largest.sort_by(|a, b| b.total_cmp(a));
    let saved: f64 = largest.iter().take(planes).sum();
    let clamped = |(block, m): (&Block, &BlockMultipliers)| -> f64 {
        m.alpha.iter().zip(&block.blocked).map(|(alpha, w)| f64::from(alpha.clamp(0.0, *w))).sum()
    };
    let alpha: f64 = instance.blocks.iter().zip(&multipliers.blocks).map(clamped).sum();
    let lit: f64 = instance.blocks.iter().flat_map(|block| &block.lit).map(|w| f64::from(*w)).sum();
    let slack = ROUNDING * ((planes + 1) as f64 * instance.shadow_weight + lit);
    let share = |x: f64| x / instance.shadow_weight;
    Bound { lower_bound: share(alpha - saved - slack).max(0.0), values: values.into_iter().map(share).collect() }
}

/// Sum of alpha less sum of beta, per texel.
fn texel_votes(instance: &Instance, block: &Block, multipliers: &BlockMultipliers) -> Vec<f64> {
    let mut sums = vec![0.0f64; block.lit.len()];
    for (lit, beta) in block.family_lit.iter().zip(&multipliers.beta) {
        for (&i, beta) in lit.iter().zip(beta) {
            sums[i as usize] += f64::from(beta.max(0.0));
        }
    }
    // A larger beta never lowers the bound: scale up as well as down.
    let scale = |(w, sum): (&f32, f64)| if sum > 0.0 { f64::from(*w) / sum } else { 0.0 };
    let scales: Vec<f64> = block.lit.iter().zip(sums).map(scale).collect();
    let mut votes = vec![0.0f64; instance.texels()];
    for (family, members) in instance.families.iter().enumerate() {
        let (lit, beta) = (&block.family_lit[family], &multipliers.beta[family]);
        for &plane in members {
            for &(i, texel) in &block.planes[plane].blocked {
                votes[texel as usize] += f64::from(multipliers.alpha[i as usize].clamp(0.0, block.blocked[i as usize]));
            }
            for &(slot, texel) in &block.planes[plane].lit {
                let slot = slot as usize;
                votes[texel as usize] -= f64::from(beta[slot].max(0.0)) * scales[lit[slot] as usize];
            }
        }
    }
    votes
}

/// Dual steps relative to the mean weight of a pair; the primal ones are its inverse. Larger ones start slowly, smaller
/// ones oscillate: at 0.3, 1 and 3 the bound of 3 of 43 planes of the aircraft was 0.2015, 0.2019 and 0.1980 after 100
/// iterations, 0.2033, 0.2030 and 0.2027 after 400 (1.2 million pairs, 51 planes: 0.1875 at 0.2, 0.1911 at 0.5 after 100).
const STEP: f32 = 0.5;

/// Blocked pairs start at this share of their weight: most are covered by several planes of a pool.
const FIRST_ALPHA: f32 = 0.5;

/// Texels per task of element-wise loops; fixed only for cache's sake, no sums cross it.
const TEXELS_PER_TASK: usize = 4096;

/// The iteration: `t` and `f` are the primal side, the multipliers the dual one.
pub(crate) struct Saddle<'a> {
    instance: &'a Instance,
    planes: usize,
    /// Dual step of a constraint with one entry.
    step: f32,
    /// How strongly each texel blocks, 0 to the plane's share of being chosen.
    t: Vec<f32>,
    /// `t` extrapolated.
    t_ahead: Vec<f32>,
    /// Pairs that cross each texel.
    crossings: Vec<f32>,
    multipliers: Multipliers,
    states: Vec<BlockState>,
}

/// The part of the iteration that belongs to one block of pairs.
struct BlockState {
    /// `[lit pair]`: how false its shadow is, and the same extrapolated.
    f: Vec<f32>,
    f_ahead: Vec<f32>,
    /// `[lit pair]`.
    beta_sum: Vec<f32>,
    /// Planes that cross each blocked pair; families that cross each lit pair.
    planes_across: Vec<f32>,
    families_across: Vec<f32>,
    /// `[family][entry]`: planes of the family that cross the pair, and the sum of their texels.
    members_across: Vec<Vec<f32>>,
    covers: Vec<Vec<f32>>,
    /// `[texel]`: sum of alpha less sum of beta.
    votes: Vec<f32>,
}

impl BlockState {
    fn new(instance: &Instance, block: &Block) -> Self {
        let mut planes_across = vec![0.0; block.blocked.len()];
        for &(i, _) in block.planes.iter().flat_map(|crossings| &crossings.blocked) {
            planes_across[i as usize] += 1.0;
        }
        let mut families_across = vec![0.0; block.lit.len()];
        for &i in block.family_lit.iter().flatten() {
            families_across[i as usize] += 1.0;
        }
        let mut members_across: Vec<Vec<f32>> = block.family_lit.iter().map(|lit| vec![0.0; lit.len()]).collect();
        for (across, members) in members_across.iter_mut().zip(&instance.families) {
            for &(slot, _) in members.iter().flat_map(|plane| &block.planes[*plane].lit) {
                across[slot as usize] += 1.0;
            }
        }
        let lit = || vec![0.0; block.lit.len()];
        let (covers, votes) = (members_across.clone(), vec![0.0; instance.texels()]);
        Self {
            f: lit(),
            f_ahead: lit(),
            beta_sum: lit(),
            planes_across,
            families_across,
            members_across,
            covers,
            votes,
        }
    }

    /// Dual step: prices rise where the constraints are broken.
    fn raise(&mut self, (instance, block): (&Instance, &Block), m: &mut BlockMultipliers, t: &[f32], step: f32) {
        self.votes.fill(0.0);
        let mut covers = vec![0.0f32; block.blocked.len()];
        for &(i, texel) in block.planes.iter().flat_map(|crossings| &crossings.blocked) {
            covers[i as usize] += t[texel as usize];
        }
        for (i, alpha) in m.alpha.iter_mut().enumerate() {
            let missing = 1.0 - covers[i];
            *alpha = (*alpha + step / self.planes_across[i].max(1.0) * missing).clamp(0.0, block.blocked[i]);
        }
        for &(i, texel) in block.planes.iter().flat_map(|crossings| &crossings.blocked) {
            self.votes[texel as usize] += m.alpha[i as usize];
        }
        self.beta_sum.fill(0.0);
        for (family, members) in instance.families.iter().enumerate() {
            let (covers, beta) = (&mut self.covers[family], &mut m.beta[family]);
            covers.fill(0.0);
            let crossings = || members.iter().flat_map(|plane| &block.planes[*plane].lit);
            for &(slot, texel) in crossings() {
                covers[slot as usize] += t[texel as usize];
            }
            for (slot, &i) in block.family_lit[family].iter().enumerate() {
                let step = step / (1.0 + self.members_across[family][slot]);
                beta[slot] = (beta[slot] + step * (covers[slot] - self.f_ahead[i as usize])).max(0.0);
                self.beta_sum[i as usize] += beta[slot];
            }
            for &(slot, texel) in crossings() {
                self.votes[texel as usize] -= beta[slot as usize];
            }
        }
    }

    /// Primal step of the false shadows.
    fn lower_false(&mut self, block: &Block, step: f32) {
        for (i, f) in self.f.iter_mut().enumerate() {
            let slope = block.lit[i] - self.beta_sum[i];
            let next = (*f - slope / (step * self.families_across[i].max(1.0))).clamp(0.0, 1.0);
            self.f_ahead[i] = 2.0 * next - *f;
            *f = next;
        }
    }
}

impl<'a> Saddle<'a> {
    /// A start without planes.
    pub(crate) fn new(instance: &'a Instance, planes: usize) -> Self {
        let mut crossings = vec![0.0; instance.texels()];
        for c in instance.blocks.iter().flat_map(|block| &block.planes) {
            for &(_, texel) in c.blocked.iter().chain(&c.lit) {
                crossings[texel as usize] += 1.0;
            }
        }
        let weights = || instance.blocks.iter().flat_map(|block| block.blocked.iter().chain(&block.lit));
        let mean_weight = weights().map(|w| f64::from(*w)).sum::<f64>() / weights().count().max(1) as f64;
        let mut multipliers = Multipliers::from_shares(instance, || FIRST_ALPHA);
        multipliers.blocks.iter_mut().flat_map(|m| &mut m.beta).for_each(|beta| beta.fill(0.0));
        let open = vec![0.0; instance.texels()];
        let states = instance.blocks.par_iter().map(|block| BlockState::new(instance, block)).collect();
        let step = STEP * mean_weight as f32;
        let mut saddle =
            Self { instance, planes, step, t: open.clone(), t_ahead: open, crossings, multipliers, states };
        saddle.raise();
        saddle
    }

    pub(crate) fn multipliers(&self) -> &Multipliers {
        &self.multipliers
    }

    pub(crate) fn bound(&self) -> Bound {
        bound(self.instance, &self.multipliers, self.planes)
    }

    /// One step of both sides.
    pub(crate) fn advance(&mut self) {
        let mut t = vec![0.0f32; self.t.len()];
        t.par_chunks_mut(TEXELS_PER_TASK).enumerate().for_each(|(task, t)| {
            let first = task * TEXELS_PER_TASK;
            for (i, t) in t.iter_mut().enumerate() {
                let votes: f32 = self.states.iter().map(|state| state.votes[first + i]).sum();
                *t = self.t[first + i] + votes / (self.step * self.crossings[first + i].max(1.0));
            }
        });
        project(self.instance, &mut t, &self.crossings, self.planes);
        for ((ahead, next), last) in self.t_ahead.iter_mut().zip(&t).zip(&self.t) {
            *ahead = 2.0 * next - last;
        }
        self.t = t;
        let step = self.step;
        let blocks = self.instance.blocks.par_iter().zip(&mut self.states);
        blocks.for_each(|(block, state)| state.lower_false(block, step));
        self.raise();
    }

    fn raise(&mut self) {
        let (instance, t, step) = (self.instance, &self.t_ahead, self.step);
        let blocks = instance.blocks.par_iter().zip(&mut self.states).zip(&mut self.multipliers.blocks);
        blocks.for_each(|((block, state), m)| state.raise((instance, block), m, t, step));
    }
}

/// A plane's texels as a function of the price of choosing it: the projection's own small problem.
struct Share {
    /// Positive texels, the largest first; running sums of their crossings and of crossings x texel.
    texels: Vec<f64>,
    crossings: Vec<f64>,
    moments: Vec<f64>,
}

impl Share {
    fn new(t: &[f32], crossings: &[f32]) -> Self {
        let mut positive: Vec<(f32, f32)> =
            t.iter().zip(crossings).filter(|(t, _)| **t > 0.0).map(|(t, n)| (*t, *n)).collect();
        positive.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)));
        let (mut n_sum, mut moment) = (0.0, 0.0);
        let mut share = Self { texels: Vec::new(), crossings: Vec::new(), moments: Vec::new() };
        for (t, n) in positive {
            n_sum += f64::from(n);
            moment += f64::from(n) * f64::from(t);
            share.texels.push(f64::from(t));
            share.crossings.push(n_sum);
            share.moments.push(moment);
        }
        share
    }

    /// The y in 0..1 at which `sum crossings x max(0, t - y)` is the price.
    fn at(&self, price: f64) -> f64 {
        let y = |last: usize| (self.moments[last] - price) / self.crossings[last];
        let (mut low, mut high) = (0, self.texels.len());
        while low < high {
            let middle = usize::midpoint(low, high);
            let next = self.texels.get(middle + 1).copied().unwrap_or(0.0);
            if y(middle) >= next { high = middle } else { low = middle + 1 }
        }
        match self.texels.len() {
            0 => 0.0,
            count => y(low.min(count - 1)).clamp(0.0, 1.0),
        }
    }
}

/// Halvings of a price interval: to 1e-12 of it, where f32 texels no longer see a difference.
const PRICE_HALVINGS: usize = 40;

/// The least price, from 0 on, at which a falling `total` is at most `cap`.
fn price(cap: f64, total: impl Fn(f64) -> f64) -> f64 {
    if total(0.0) <= cap {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    while total(high) > cap {
        high *= 2.0;
    }
    for _ in 0..PRICE_HALVINGS {
        let middle = f64::midpoint(low, high);
        if total(middle) > cap {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Projects `t`, in the metric of `crossings`, onto `0 <= t <= y`, `sum y <= 1` in a family, `sum y <= planes`.
fn project(instance: &Instance, t: &mut [f32], crossings: &[f32], planes: usize) {
    let texels = |plane: usize| instance.first_texel[plane]..instance.first_texel[plane + 1];
    let shares: Vec<Share> = (0..instance.planes())
        .into_par_iter()
        .map(|plane| Share::new(&t[texels(plane)], &crossings[texels(plane)]))
        .collect();
    let total = |members: &[usize], price: f64| members.iter().map(|plane| shares[*plane].at(price)).sum::<f64>();
    // A family's own cap sets a floor under its price; then one price for all.
    let families = &instance.families;
    let floors: Vec<f64> = families.par_iter().map(|members| price(1.0, |p| total(members, p))).collect();
    let all = |p: f64| families.iter().zip(&floors).map(|(members, floor)| total(members, p.max(*floor))).sum();
    let common = price(planes as f64, all);
    for (members, floor) in families.iter().zip(floors) {
        for &plane in members {
            let y = shares[plane].at(common.max(floor)) as f32;
            t[texels(plane)].iter_mut().for_each(|t| *t = t.clamp(0.0, y));
        }
    }
}
