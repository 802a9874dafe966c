//! Importance: how many of its candidate pairs a part of a section gets.
//!
//! In: a section's receivers, lights, and the directions of its lists. Out: the rate at which each pair (receiver,
//! light) is to be drawn; a pair's vote is divided by it, so that all sums stay what they are on average. Method:
//! stratified sampling (Neyman, "On the Two Different Aspects of the Representative Method", 1934) in two phases.
//! Strata are groups of near receivers under the lights of one direction. A pilot of few rays estimates the share p of
//! each that is blocked, together with the strata beside it, and rates go with sqrt(p(1-p)): where a pilot is all lit
//! or all in shadow few pairs tell the rest. Pilot rays decide rates and nothing else: kept as pairs they would bias
//! the sums towards what made them stop.
//!
//! Not guaranteed: that a shadow smaller than a stratum is seen by the pilot. One of n candidates is then still drawn
//! at the least rate r, and missed with probability (1-r)^n; r is `FLOOR` of the largest rate.
//!
//! Held-out error and user seconds of the whole fit, 14 million pairs, 96 sections, seed 7, one run each: teapot_three
//! uniform 0.0564, 52 s; so 0.0449, 55 s (an earlier draw of the same rates 0.0429: what follows differs by hardly
//! more). j31_twintail 0.0966, 93 s; 0.0895, 106 s. Floors of 0.1 and 0.01: teapot_three 0.0474 and 0.0467; 8 million
//! pairs from 16 candidates each 0.0508, 48 s. Left out: rates in proportion to the weight of a pair too, so that votes
//! are of one size (0.0531 instead of 0.0488; 4 candidates a pair, floor 0.1); lit pairs in the search's samples drawn
//! evenly instead of by the shadow of their receivers (0.0476 instead of 0.0474; floor 0.1).

use crate::{
    mesh::Mesh,
    pair_table::nearest,
    receivers::Receivers,
    sampling::hash,
    sections::{Feature, feature, widest_axis},
};
use glam::Vec3;

/// Most receivers of a group.
const GROUP: usize = 16;

/// Pilot rays of a stratum.
const PILOT_RAYS: usize = 4;

/// Directions around a stratum's own, six in a triangular lattice, whose pilots count too.
const NEIGHBOURS: usize = 6;

/// What a ray beside a stratum counts of one inside.
const NEIGHBOUR_WEIGHT: f32 = 0.25;

/// Rate of a stratum where nothing was undecided, as a share of where everything was. More wastes pairs there; less
/// makes their votes heavy.
const FLOOR: f32 = 0.03;

/// Halvings of the interval in which the largest rate lies.
const SCALE_STEPS: usize = 24;

/// The rates of a section's pairs.
#[derive(Clone, Debug)]
pub struct Rates {
    /// `[receiver]`.
    group_of: Vec<u32>,
    /// `[light]`: the nearest direction.
    direction_of: Vec<u32>,
    directions: usize,
    /// `[group][direction]`, above 0, at most 1.
    rates: Vec<f32>,
}

/// What a pilot saw in a stratum: rays that are lit, and blocked.
type Seen = [f32; 2];

impl Rates {
    /// Rates by which about `wanted` pairs are drawn.
    #[must_use]
    pub fn new(
        (mesh, receivers): (&Mesh, &Receivers),
        lights: &[Vec3],
        directions: &[Vec3],
        wanted: usize,
        seed: u64,
    ) -> Self {
        let groups = groups(receivers);
        let mut group_of = vec![0; receivers.points.len()];
        for (group, members) in (0..).zip(&groups) {
            members.iter().for_each(|&receiver| group_of[receiver as usize] = group);
        }
        let direction_of: Vec<u32> = lights.iter().map(|light| nearest(directions, *light) as u32).collect();
        let mut lights_of = vec![Vec::new(); directions.len()];
        direction_of.iter().zip(lights).for_each(|(direction, light)| lights_of[*direction as usize].push(*light));

        let strata = groups.iter().flat_map(|members| lights_of.iter().map(move |lights| (members, lights)));
        let (mut seen, mut candidates) = (Vec::new(), Vec::new());
        for ((members, lights), direction) in strata.zip(directions.iter().cycle()) {
            let facing = members.iter().filter(|i| receivers.normals[**i as usize].dot(*direction) > 0.0).count();
            candidates.push((facing * lights.len()) as f32);
            seen.push(pilot((mesh, receivers), members, lights, hash(seed, seen.len() as u64)));
        }
        let mut rates = undecided(&seen, &neighbours(directions));
        let scale = scale(&rates, &candidates, wanted);
        rates.iter_mut().for_each(|rate| *rate = (*rate * scale).min(1.0));
        Self { group_of, direction_of, directions: directions.len(), rates }
    }

    /// The rate of the pair of a light and a receiver, above 0, at most 1.
    #[must_use]
    pub fn of(&self, light: usize, receiver: usize) -> f32 {
        self.rates[self.group_of[receiver] as usize * self.directions + self.direction_of[light] as usize]
    }
}

/// Receivers in halves of halves by position and normal, in that order.
fn groups(receivers: &Receivers) -> Vec<Vec<u32>> {
    let features: Vec<Feature> =
        receivers.points.iter().zip(&receivers.normals).map(|(p, n)| feature(*p, *n)).collect();
    let (mut groups, mut open) = (Vec::new(), vec![(0..features.len() as u32).collect::<Vec<u32>>()]);
    while let Some(mut members) = open.pop() {
        if members.len() <= GROUP {
            groups.push(members);
            continue;
        }
        let axis = widest_axis(&features, &members);
        let at = |i: u32| features[i as usize][axis];
        members.sort_unstable_by(|a, b| at(*a).total_cmp(&at(*b)).then(a.cmp(b)));
        let high = members.split_off(members.len() / 2);
        open.extend([high, members]);
    }
    groups
}

/// A few rays of a stratum.
fn pilot((mesh, receivers): (&Mesh, &Receivers), members: &[u32], lights: &[Vec3], seed: u64) -> Seen {
    let mut seen = [0.0; 2];
    if members.is_empty() || lights.is_empty() {
        return seen;
    }
    for ray in 0..PILOT_RAYS {
        let drawn = hash(seed, ray as u64);
        let light = lights[(drawn % lights.len() as u64) as usize];
        let receiver = members[((drawn >> 32) % members.len() as u64) as usize] as usize;
        if receivers.normals[receiver].dot(light) > 0.0 {
            seen[usize::from(mesh.is_blocked(receivers.origins[receiver], light))] += 1.0;
        }
    }
    seen
}

/// The directions around each.
fn neighbours(directions: &[Vec3]) -> Vec<Vec<usize>> {
    let around = |own: &Vec3| {
        let mut others: Vec<usize> = (0..directions.len()).filter(|i| directions[*i] != *own).collect();
        others.sort_by(|a, b| directions[*b].dot(*own).total_cmp(&directions[*a].dot(*own)).then(a.cmp(b)));
        others.truncate(NEIGHBOURS);
        others
    };
    directions.iter().map(around).collect()
}

/// How undecided each stratum is, from [`FLOOR`] to 1, by its own pilot and those beside it: of the directions around,
/// and of the groups before and after.
fn undecided(seen: &[Seen], neighbours: &[Vec<usize>]) -> Vec<f32> {
    let directions = neighbours.len();
    let of_stratum = |(at, own): (usize, &Seen)| {
        let direction = at % directions;
        let around = neighbours[direction].iter().map(|other| at - direction + other);
        let groups = [at.checked_sub(directions), Some(at + directions)];
        let beside = around.chain(groups.into_iter().flatten()).filter_map(|other| seen.get(other));
        let [lit, blocked] = beside
            .fold(*own, |sum, other| [sum[0] + NEIGHBOUR_WEIGHT * other[0], sum[1] + NEIGHBOUR_WEIGHT * other[1]]);
        let total = lit + blocked;
        if total > 0.0 { (2.0 * (lit * blocked).sqrt() / total).max(FLOOR) } else { FLOOR }
    };
    seen.iter().enumerate().map(of_stratum).collect()
}

/// What rates must be multiplied by, none to more than 1, so that `wanted` candidates are drawn.
fn scale(rates: &[f32], candidates: &[f32], wanted: usize) -> f32 {
    let drawn = |scale: f32| -> f32 {
        rates.iter().zip(candidates).map(|(rate, candidates)| (rate * scale).min(1.0) * candidates).sum()
    };
    // At the upper end all candidates are drawn.
    let (mut low, mut high) = (0.0, 1.0 / FLOOR);
    for _ in 0..SCALE_STEPS {
        let middle = 0.5 * (low + high);
        *(if drawn(middle) < wanted as f32 { &mut low } else { &mut high }) = middle;
    }
    high
}
