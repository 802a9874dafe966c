//! Shadow planes and their occluder textures: the things that the search finds and the asset carries.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A rectangle (or, under a sheared node, a parallelogram) that casts shadow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowPlane {
    /// The corner where texture coordinate (a, b) is (0, 0), unit space.
    pub origin: Vec3,
    /// Edge along a, full length.
    pub u: Vec3,
    /// Edge along b, full length.
    pub v: Vec3,
}

impl ShadowPlane {
    /// Unit normal, `u x v` normalised; zero where the rectangle has no area.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.u.cross(self.v).normalize_or_zero()
    }
}

/// On which side of a plane a receiver must lie to be shadowed by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Either side.
    #[default]
    Both,
    /// In front of the normal `u x v` only.
    Front,
    /// Behind it only.
    Back,
}

/// Coverage on a rectangle: 0 = open, 255 = blocks. The outermost ring of texels is open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OccluderTexture {
    /// Texels along u, at least 3.
    pub width: usize,
    /// Texels along v, at least 3.
    pub height: usize,
    /// `[row][column]`, row along v, column along u.
    pub coverage: Vec<u8>,
}

/// One plane, ready to cast.
#[derive(Clone, Debug, PartialEq)]
pub struct BakedPlane {
    /// Where it lies.
    pub plane: ShadowPlane,
    /// What it blocks.
    pub texture: OccluderTexture,
    /// Which receivers it serves.
    pub side: Side,
    /// A receiver nearer than this along the ray is not shadowed, unit space.
    pub bias: f32,
}
