//! Search: the planes of one section.
//!
//! In: the section's pairs. Out: planes in the order of their worth. Method: greedy, always the plane that lowers the
//! error most on what the ones before leave open. Planes are proposed where the error is: through the middle of what
//! blocks pairs that are still uncovered, along the blocker's surface, across it, square to the light, square to an
//! axis, and anyhow. Proposals are screened on a small sample, the best get a rectangle tight around what they block
//! and are refined on a larger one (compass search over two tilts and the offset, then the bias). *Replace* rounds
//! take each plane out and search again.
//!
//! What a plane brings is measured as an asset would use it: it is read only under light directions where it gains
//! (its window), its texture is decided by the pairs of its window, and gains are counted under lights that did not
//! decide the texture.
//!
//! Tried and left out, in an earlier search for one list (teapot, 11 planes, held-out error 0.191 and 0.178 with seeds 1
//! and 2): four planes too many, then the least useful taken out (0.191, 0.195, at twice the time); three random planes
//! taken out together and searched anew, kept where better, three times (0.199, 0.167, at three times the time).
//!
//! Guaranteed: the result depends on the input alone, not on threads. Not guaranteed: optimality.

use crate::{
    crossing::Casts,
    mesh::Mesh,
    pair_table::{LightRows, PairTable, SPARE, SampleSize},
    plane::{PlacedPlane, ShadowPlane, Side},
    proposals::{Place, propose},
    rectangle::{enlarged, shifted, tight_around},
    sampling::hash,
    smoothing::smoothed,
    window::Window,
};
use rayon::prelude::*;

/// How hard to search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// At most this many planes, up to 255.
    pub max_planes: usize,
    /// Planes that are screened for each pick.
    pub proposals: usize,
    /// What they are screened on.
    pub screening: SampleSize,
    /// Texels a side of the screening textures, 16 to 64.
    pub screening_texels: usize,
    /// Screened planes that get a tight rectangle.
    pub finalists: usize,
    /// Finalists that are refined.
    pub refined: usize,
    /// What finalists are measured on.
    pub scoring: SampleSize,
    /// Texels a side of their textures, 32 to 128. With too few pairs a texel gains are noise: 11 planes on teapot_three
    /// from 150,000 pairs left 0.133 with 96 texels and 0.130 with 64, from 60,000 pairs 0.168 with 64 and 0.161 with 40 (three seeds).
    pub texels: usize,
    /// Halvings of the refinement's step.
    pub refine_steps: usize,
    /// Rounds in which each plane is taken out and searched anew; each costs as much as the greedy search.
    pub replace_rounds: usize,
    /// Another seed draws other samples and proposals.
    pub seed: u64,
}

/// A plane that the search found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Where it lies and how it casts.
    pub placed: PlacedPlane,
    /// Drop of the weighted error when it was found.
    pub gain: f64,
}

/// What the caller says to a set of planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Look for more.
    Continue,
    /// Good enough: stop, and see whether fewer do.
    Enough,
}

/// The planes found.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// The final planes.
    pub planes: Vec<Found>,
    /// Those of the greedy phase in the order they were picked: the first k are its answer for k planes.
    pub greedy: Vec<Found>,
    /// Exchanges made by the replace rounds.
    pub replaced: usize,
}

/// The bias that a search starts with; see [`BIASES`]. Held-out error of 11 planes that all had 0.0005, 0.003, 0.008,
/// 0.015, 0.025 or 0.04, read everywhere: teapot_three 0.183, 0.156, 0.135, 0.138, 0.144, 0.149; aircraft 0.153, 0.139,
/// 0.126, 0.120, 0.121, 0.135.
pub const BIAS: f32 = 0.01;

/// What a plane's bias is chosen from: small ones for plates that touch what they shadow, large ones for cuts through
/// round bodies, where the rays of receivers beside the cut cross the plane at the border of the texture. The smallest
/// still clears receivers that lie *on* the plane (computed up to 5e-5 beside it).
pub const BIASES: [f32; 6] = [5e-4, 2e-3, 5e-3, BIAS, 0.02, 0.04];

/// First tilt of the refinement, radians: planes through the middle of a blocker are off by about this.
const FIRST_TILT: f32 = 0.12;

/// Room at each side of a finalist's rectangle, as a share of it, so that moving it can uncover more; and of the final
/// one.
const ROOM: [f32; 2] = [0.1, 0.08];

/// A rectangle tighter than the refined one is taken even if it gains this much less: its texels are smaller.
const TIGHTER_IS_WORTH: f64 = 0.98;

/// A replacement must gain this much more (relative): less is noise and would never settle.
const REPLACE_MARGIN: f64 = 2e-3;

/// Everything a search needs, borrowed.
struct Search<'a> {
    place: Place<'a>,
    table: &'a PairTable,
    options: &'a SearchOptions,
}

/// A texture with its window.
struct Cast {
    blocked: Vec<u8>,
    window: Vec<bool>,
}

/// Searches planes for the pairs of `table`. A plane must lower the weighted error by `min_gain`. `judge` sees the
/// planes after each pick; once it says [`Verdict::Enough`] the search turns to fewer planes and keeps the smallest
/// set that `judge` accepts.
pub fn search(
    mesh: &Mesh,
    table: &PairTable,
    options: &SearchOptions,
    min_gain: f64,
    judge: &mut dyn FnMut(&[Found]) -> Verdict,
) -> Selection {
    let search = Search::new(mesh, table, options);
    let (greedy, verdict) = search.greedy(min_gain, judge);
    let mut planes = greedy.clone();
    let mut replaced = 0;
    for round in 0..options.replace_rounds {
        let exchanges = search.replace_round(&mut planes, round);
        replaced += exchanges;
        if exchanges == 0 {
            break;
        }
    }
    search.drop_unpaid(&mut planes, min_gain);
    if verdict == Verdict::Enough {
        search.shrink(&mut planes, judge);
    }
    Selection { planes, greedy, replaced }
}

impl<'a> Search<'a> {
    fn new(mesh: &'a Mesh, table: &'a PairTable, options: &'a SearchOptions) -> Self {
        Self { place: Place::new(mesh), table, options }
    }

    fn greedy(&self, min_gain: f64, judge: &mut dyn FnMut(&[Found]) -> Verdict) -> (Vec<Found>, Verdict) {
        let mut planes = Vec::new();
        let mut covered = vec![false; self.table.len()];
        while planes.len() < self.options.max_planes.min(usize::from(u8::MAX)) {
            let seed = hash(self.options.seed, planes.len() as u64);
            let open = self.table.sample_where(self.options.scoring, seed, |i| !covered[i]);
            let Some((found, cast)) = self.best_plane(&open, seed, None) else { break };
            if found.gain < min_gain {
                break;
            }
            covered.iter_mut().zip(self.covered_by(&found.placed, &cast)).for_each(|(a, b)| *a |= b);
            planes.push(found);
            if judge(&planes) == Verdict::Enough {
                return (planes, Verdict::Enough);
            }
        }
        (planes, Verdict::Continue)
    }

    /// Takes each plane out and puts the best one found back; returns the number of exchanges.
    fn replace_round(&self, planes: &mut [Found], round: usize) -> usize {
        let mut window = Window::default();
        let mut exchanges = 0;
        let mut covers = self.covers(planes);
        let mut counts = self.counts(&covers);
        for k in 0..planes.len() {
            let seed = hash(self.options.seed ^ 0x5EED, (round * planes.len() + k) as u64);
            let is_open = |i: usize| counts[i] == u8::from(covers[k][i]);
            let open = self.table.sample_where(self.options.scoring, seed, is_open);
            let kept = Found { gain: self.gain(&open, &planes[k].placed, &mut window), ..planes[k] };
            let found = self.best_plane(&open, seed, Some(&planes[k]));
            if let Some((found, cast)) = found.filter(|(found, _)| found.gain > kept.gain * (1.0 + REPLACE_MARGIN)) {
                exchanges += 1;
                let cover = self.covered_by(&found.placed, &cast);
                for ((count, before), after) in counts.iter_mut().zip(&covers[k]).zip(&cover) {
                    *count = *count + u8::from(*after) - u8::from(*before);
                }
                covers[k] = cover;
                planes[k] = found;
            } else {
                planes[k] = kept;
            }
        }
        exchanges
    }

    /// Drops planes that gain too little given the others, the least useful first.
    fn drop_unpaid(&self, planes: &mut Vec<Found>, min_gain: f64) {
        while let Some((least, gain)) = least(&self.gains(planes)) {
            if gain >= min_gain {
                break;
            }
            planes.remove(least);
        }
    }

    /// Takes the least useful plane out and lets the others move, as long as `judge` finds the rest good enough.
    fn shrink(&self, planes: &mut Vec<Found>, judge: &mut dyn FnMut(&[Found]) -> Verdict) {
        while planes.len() > 1 {
            let mut fewer = planes.clone();
            let Some((least, _)) = least(&self.gains(&fewer)) else { break };
            fewer.remove(least);
            self.replace_round(&mut fewer, planes.len());
            if judge(&fewer) == Verdict::Continue {
                break;
            }
            *planes = fewer;
        }
    }

    /// What each plane gains given the others.
    fn gains(&self, planes: &[Found]) -> Vec<f64> {
        let covers = self.covers(planes);
        let counts = self.counts(&covers);
        let gain = |k: usize| {
            let is_open = |i: usize| counts[i] == u8::from(covers[k][i]);
            let open = self.table.sample_where(self.options.scoring, self.options.seed, is_open);
            self.gain(&open, &planes[k].placed, &mut Window::default())
        };
        (0..planes.len()).into_par_iter().map(gain).collect()
    }

    /// How many planes cover each pair. No more than 255 planes are searched together.
    fn counts(&self, covers: &[Vec<bool>]) -> Vec<u8> {
        let mut counts = vec![0u8; self.table.len()];
        for cover in covers {
            counts.iter_mut().zip(cover).for_each(|(count, covered)| *count += u8::from(*covered));
        }
        counts
    }

    /// Which pairs each plane covers, in the order of the planes: each decided by what those before leave open.
    fn covers(&self, planes: &[Found]) -> Vec<Vec<bool>> {
        let mut window = Window::default();
        let mut any = vec![false; self.table.len()];
        let cover = |found: &Found| {
            let open = self.table.sample_where(self.options.scoring, self.options.seed, |i| !any[i]);
            let cover = self.covered_by(&found.placed, &self.cast(&open, &found.placed, &mut window));
            any.iter_mut().zip(&cover).for_each(|(a, b)| *a |= b);
            cover
        };
        planes.iter().map(cover).collect()
    }

    /// The best plane for a sample of pairs that nothing covers; `start` is one more to improve.
    fn best_plane(&self, scoring: &PairTable, seed: u64, start: Option<&Found>) -> Option<(Found, Cast)> {
        let o = self.options;
        let screening = &scoring.sample(o.screening, hash(seed, 1));
        let wide: Vec<ShadowPlane> = propose(&self.place, scoring, o.proposals, seed);
        let screened = measured(wide, |plane, window| {
            Some((window.measure(screening, &placed_anew(*plane), o.screening_texels), *plane))
        });
        let finalists: Vec<ShadowPlane> = screened.into_iter().take(o.finalists).map(|(_, plane)| plane).collect();
        let mut tight = measured(finalists, |plane, window| {
            let plane = self.tight(scoring, &placed_anew(*plane), ROOM[0], window)?;
            Some((window.measure(scoring, &placed_anew(plane), o.texels), plane))
        });
        tight.truncate(o.refined);
        let starts: Vec<Found> =
            tight.iter().map(|(gain, plane)| Found { placed: placed_anew(*plane), gain: *gain }).collect();
        let starts: Vec<Found> = starts.into_iter().chain(start.copied()).collect();
        let refined: Vec<Found> =
            starts.par_iter().map_init(Window::default, |window, found| self.refine(scoring, *found, window)).collect();
        let best = refined.into_iter().reduce(|a, b| if b.gain > a.gain { b } else { a })?;
        let cast = self.cast(scoring, &best.placed, &mut Window::default());
        Some((best, cast))
    }

    fn gain(&self, pairs: &PairTable, placed: &PlacedPlane, window: &mut Window) -> f64 {
        window.measure(pairs, placed, self.options.texels)
    }

    /// Compass search (a step each way in both tilts and the offset; what gains is kept, else the step is halved), then
    /// a tight rectangle, then the bias.
    fn refine(&self, pairs: &PairTable, start: Found, window: &mut Window) -> Found {
        let mut at = Found { gain: self.gain(pairs, &start.placed, window), ..start };
        let mut tilt = FIRST_TILT;
        for _ in 0..self.options.refine_steps {
            for direction in 0..3 {
                for step in [tilt, -tilt] {
                    let moved = PlacedPlane { plane: shifted(&at.placed.plane, direction, step), ..at.placed };
                    let gain = self.gain(pairs, &moved, window);
                    if gain > at.gain {
                        at = Found { placed: moved, gain };
                        break;
                    }
                }
            }
            tilt *= 0.5;
        }
        self.settled(pairs, at, window)
    }

    /// The plane with a tight rectangle, where that gains, and the bias that gains most.
    fn settled(&self, pairs: &PairTable, mut at: Found, window: &mut Window) -> Found {
        if let Some(plane) = self.tight(pairs, &at.placed, ROOM[1], window) {
            let tight = PlacedPlane { plane, ..at.placed };
            let gain = self.gain(pairs, &tight, window);
            if gain > at.gain * TIGHTER_IS_WORTH {
                at = Found { placed: tight, gain };
            }
        }
        self.with_bias(pairs, at, window)
    }

    /// The plane with the bias that gains most.
    fn with_bias(&self, pairs: &PairTable, start: Found, window: &mut Window) -> Found {
        let mut best = start;
        for bias in BIASES {
            let placed = PlacedPlane { bias, ..start.placed };
            let gain = self.gain(pairs, &placed, window);
            if gain > best.gain {
                best = Found { placed, gain };
            }
        }
        best
    }

    /// The texture that all pairs of the plane's window decide, and the window.
    fn cast(&self, pairs: &PairTable, placed: &PlacedPlane, window: &mut Window) -> Cast {
        let n = self.options.texels;
        self.gain(pairs, placed, window);
        let votes = window.all_votes();
        let mut blocked: Vec<u8> = smoothed(&votes, n).into_iter().map(|vote| u8::from(vote > 0.0)).collect();
        blocked.resize(n * n + SPARE, 0);
        Cast { blocked, window: window.directions() }
    }

    /// The rectangle in the same plane, tight around what blocks in its window.
    fn tight(&self, pairs: &PairTable, placed: &PlacedPlane, room: f32, window: &mut Window) -> Option<ShadowPlane> {
        let n = self.options.texels;
        self.gain(pairs, placed, window);
        let votes = window.all_votes();
        let mut blocking = smoothed(&votes, n);
        blocking.iter_mut().zip(&votes).for_each(|(s, v)| *s = if *s > 0.0 { v.max(0.0) } else { 0.0 });
        Some(enlarged(&tight_around(&placed.plane, &blocking, n)?, room))
    }

    /// Which pairs of the whole table the plane covers.
    fn covered_by(&self, placed: &PlacedPlane, cast: &Cast) -> Vec<bool> {
        let n = self.options.texels;
        let casts = Casts::new(self.table, placed, (n, n));
        let of_light = |(light, rows): (usize, &LightRows)| {
            let mut texels = vec![0u16; rows.end - rows.start];
            if cast.window[rows.direction] && casts.of_light(self.table, light, &mut texels) {
                texels.iter().map(|&texel| cast.blocked[usize::from(texel)] != 0).collect()
            } else {
                vec![false; texels.len()]
            }
        };
        let parts: Vec<Vec<bool>> = self.table.lights.par_iter().enumerate().map(of_light).collect();
        parts.concat()
    }
}

/// Planes that a person placed, in their order, with the biases that gain most.
#[must_use]
pub fn place(mesh: &Mesh, table: &PairTable, planes: &[(ShadowPlane, Side)], options: &SearchOptions) -> Vec<Found> {
    let search = Search::new(mesh, table, options);
    let sample = table.sample(options.scoring, options.seed);
    let place = |window: &mut Window, &(plane, side): &(ShadowPlane, Side)| {
        let placed = PlacedPlane { plane, side, bias: BIAS };
        search.with_bias(&sample, Found { placed, gain: 0.0 }, window)
    };
    planes.par_iter().map_init(Window::default, place).collect()
}

/// Planes that another method placed, in its order: rectangles are made tight around what they block, and biases are
/// those that gain most.
#[must_use]
pub fn place_loosely(mesh: &Mesh, table: &PairTable, planes: &[ShadowPlane], options: &SearchOptions) -> Vec<Found> {
    let search = Search::new(mesh, table, options);
    let sample = table.sample(options.scoring, options.seed);
    let place = |window: &mut Window, plane: &ShadowPlane| {
        let placed = placed_anew(*plane);
        let gain = search.gain(&sample, &placed, window);
        search.settled(&sample, Found { placed, gain }, window)
    };
    planes.par_iter().map_init(Window::default, place).collect()
}

/// A plane as a search starts with it.
fn placed_anew(plane: ShadowPlane) -> PlacedPlane {
    PlacedPlane { plane, side: Side::Both, bias: BIAS }
}

/// Index of the smallest number, and that number.
fn least(gains: &[f64]) -> Option<(usize, f64)> {
    gains.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Measures planes in parallel; the best first, the earlier one of equals.
fn measured(
    planes: Vec<ShadowPlane>,
    measure: impl Fn(&ShadowPlane, &mut Window) -> Option<(f64, ShadowPlane)> + Sync,
) -> Vec<(f64, ShadowPlane)> {
    let mut scored: Vec<(f64, ShadowPlane)> =
        planes.par_iter().map_init(Window::default, |window, plane| measure(plane, window)).flatten().collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    scored
}
