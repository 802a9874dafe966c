//! Baselines: published and naive ways to place planes, to compare the search with.
//!
//! In: a mesh, how many planes, a seed. Out: rectangles in the order in which the method adds them, each around the
//! model's whole section, so that a bake cuts them to what they use; biases, sides and textures come from the same
//! bake as the search's own planes. None of them looks at shadows: they place planes where the surface is.
//!
//! - *billboard*: Decoret, Durand, Sillion, Dorsey, "Billboard Clouds for Extreme Model Simplification" (2003);
//! - *stochastic*: after Lacewell, Edwards, Shirley, Thompson, "Stochastic Billboard Clouds for Interactive Foliage
//!   Rendering" (2006);
//! - *k-means*: after Huang, Novins, Wuensche, "Improved Billboard Clouds for Extreme Model Simplification" (2004);
//! - *axes*: the three planes through the centre square to the axes; *random*: anywhere through the model.
//!
//! Each follows its paper in the essentials that its file names, not in every constant.

mod billboard;
mod kmeans;
mod stochastic;

use crate::{
    lights::direction,
    mesh::Mesh,
    plane::ShadowPlane,
    rectangle::around_section,
    sampling::{hash, uniform},
};
use glam::Vec3;
use std::f32::consts::TAU;

/// Sections are taken of the model's box enlarged by this, unit space: a flat model's box has no thickness, and a
/// plane through a face of the box would have no section.
const BOX_PAD: f32 = 1e-3;

/// Random planes drawn at most for each one wanted: a plane at a corner of the box may miss it.
const DRAWS: usize = 8;

/// How planes are placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Baseline {
    /// Densest planes of a billboard cloud, greedily.
    Billboard,
    /// The best of random planes through triangles, greedily.
    Stochastic,
    /// Planes through clusters of triangles.
    KMeans,
    /// Three planes through the centre.
    Axes,
    /// Anywhere.
    Random,
}

/// What to place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaselineOptions {
    /// Planes wanted, 1 and up; a method may find fewer.
    pub count: usize,
    /// Another seed gives other planes where the method draws at random.
    pub seed: u64,
    /// A billboard stands for the triangles nearer to it than this, unit space: 0 exclusive to 1. Smaller needs more
    /// planes to cover the model.
    pub tolerance: f32,
}

impl Default for BaselineOptions {
    fn default() -> Self {
        Self { count: 12, seed: 1, tolerance: 0.1 }
    }
}

impl Baseline {
    /// All of them, in the order of tables.
    pub const ALL: [Self; 5] = [Self::Billboard, Self::Stochastic, Self::KMeans, Self::Axes, Self::Random];

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Billboard => "billboard cloud",
            Self::Stochastic => "stochastic billboards",
            Self::KMeans => "k-means",
            Self::Axes => "axis planes",
            Self::Random => "random planes",
        }
    }

    /// Are the first k of its planes its answer for k planes? Clusters are others for every k.
    #[must_use]
    pub fn is_nested(self) -> bool {
        self != Self::KMeans
    }

    /// Does [`BaselineOptions::tolerance`] change its planes?
    #[must_use]
    pub fn has_tolerance(self) -> bool {
        matches!(self, Self::Billboard | Self::Stochastic)
    }

    /// The planes, in the order in which they are added.
    #[must_use]
    pub fn planes(self, mesh: &Mesh, options: &BaselineOptions) -> Vec<ShadowPlane> {
        let sections = Sections::of(mesh);
        let found: Vec<Unbounded> = match self {
            Self::Billboard => billboard::planes(mesh, options),
            Self::Stochastic => stochastic::planes(mesh, options),
            Self::KMeans => kmeans::planes(mesh, options),
            Self::Axes => [Vec3::X, Vec3::Y, Vec3::Z].map(|normal| Unbounded { normal, offset: 0.0 }).to_vec(),
            Self::Random => random(mesh, options),
        };
        found.iter().filter_map(|plane| sections.around(plane)).take(options.count).collect()
    }
}

/// The plane `normal . p = offset`, unit space.
#[derive(Clone, Copy, Debug)]
struct Unbounded {
    normal: Vec3,
    offset: f32,
}

impl Unbounded {
    fn height(&self, p: Vec3) -> f32 {
        self.normal.dot(p) - self.offset
    }

    /// Are all corners within `tolerance`?
    fn is_near(&self, corners: &[Vec3; 3], tolerance: f32) -> bool {
        corners.iter().all(|p| self.height(*p).abs() <= tolerance)
    }
}

/// The model's box, for rectangles around what a plane cuts.
struct Sections {
    low: Vec3,
    high: Vec3,
}

impl Sections {
    fn of(mesh: &Mesh) -> Self {
        let corners = || mesh.corners.iter().flatten();
        let low = corners().fold(Vec3::INFINITY, |a, p| a.min(*p)) - BOX_PAD;
        let high = corners().fold(Vec3::NEG_INFINITY, |a, p| a.max(*p)) + BOX_PAD;
        Self { low, high }
    }

    fn around(&self, plane: &Unbounded) -> Option<ShadowPlane> {
        around_section(self.low, self.high, plane.normal, plane.offset)
    }
}

/// Uniform directions; offsets uniform over the model's extent along each.
fn random(mesh: &Mesh, options: &BaselineOptions) -> Vec<Unbounded> {
    let one = |i: usize| {
        let draw = |k: usize| uniform(hash(options.seed, 0xA11), (3 * i + k) as u64) as f32;
        let normal = direction(TAU * draw(0), (2.0 * draw(1) - 1.0).asin());
        let heights = || mesh.corners.iter().flatten().map(|p| normal.dot(*p));
        let (low, high) = heights().fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
        Unbounded { normal, offset: low + (high - low) * draw(2) }
    };
    (0..options.count * DRAWS).map(one).collect()
}
