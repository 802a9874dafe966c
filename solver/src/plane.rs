//! Shadow planes and their occluder textures: the things that the search finds and the asset carries.

use crate::pair_table::nearest;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

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

/// A rectangle with the rules by which it casts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedPlane {
    /// Where it lies.
    pub plane: ShadowPlane,
    /// Which receivers it serves.
    pub side: Side,
    /// A receiver nearer than this along the ray is not shadowed, unit space.
    pub bias: f32,
}

/// How a texel is to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// 0 is open, 255 blocks, bilinear in between.
    #[default]
    Coverage,
    /// A distance field: blocks where the bilinear value is at least [`SDF_BORDER`], open elsewhere; no grey. A
    /// border keeps its place between texels, so it is as crisp at a quarter of the texels (Green, "Improved
    /// Alpha-Tested Magnification for Vector Textures and Special Effects", 2007).
    Sdf,
}

/// The value 0..1 at which a distance field begins to block: a byte of 128 does, one of 127 does not.
pub const SDF_BORDER: f32 = 0.5;

/// How many texels the values of a distance field span on either side of a border: fewer, and bilinear interpolation
/// cannot place it; more, and bytes are too coarse. Soft edges reach as far and no farther.
pub const SDF_TEXELS: f32 = 2.0;

/// What a distance field rises by from texel to texel towards a border.
pub const SDF_PER_TEXEL: f32 = SDF_BORDER / SDF_TEXELS;

/// What a rectangle blocks. The outermost ring of texels is open: 0 as coverage, below 128 in a distance field.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct OccluderTexture {
    /// Texels along u, at least 3.
    pub width: usize,
    /// Texels along v, at least 3.
    pub height: usize,
    /// What a texel means.
    pub encoding: Encoding,
    /// `[row][column]`, row along v, column along u.
    pub texels: Vec<u8>,
}

impl OccluderTexture {
    /// Does a texel of this value, alone, block nothing?
    #[must_use]
    pub fn is_open(&self, texel: u8) -> bool {
        match self.encoding {
            Encoding::Coverage => texel == 0,
            Encoding::Sdf => f32::from(texel) < SDF_BORDER * 255.0,
        }
    }
}

/// The textures that differ, in the order of their first appearance, and which of them each one is. Planes with equal
/// textures share one: only these have to be stored.
#[must_use]
pub fn distinct<'a>(textures: impl IntoIterator<Item = &'a OccluderTexture>) -> (Vec<&'a OccluderTexture>, Vec<usize>) {
    let (mut found, mut known) = (Vec::new(), HashMap::new());
    let mut number = |texture| {
        *known.entry(texture).or_insert_with(|| {
            found.push(texture);
            found.len() - 1
        })
    };
    let numbers = textures.into_iter().map(&mut number).collect();
    (found, numbers)
}

/// The tint of a plane that lets nothing pass where it blocks.
pub const OPAQUE: [u8; 3] = [255; 3];

/// One plane, ready to cast.
#[derive(Clone, Debug, PartialEq)]
pub struct BakedPlane {
    /// Where it lies.
    pub plane: ShadowPlane,
    /// What it blocks.
    pub texture: OccluderTexture,
    /// The share of each linear colour that it takes where its texture blocks, in 255ths.
    pub tint: [u8; 3],
    /// Which receivers it serves.
    pub side: Side,
    /// A receiver nearer than this along the ray is not shadowed, unit space.
    pub bias: f32,
}

/// Indices of planes, one list a section.
pub type SectionLists = Vec<Vec<u32>>;

/// Which planes each section reads, for directions that stand for the light's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActiveLists {
    /// Unit vectors towards the light; the one with the largest dot product with the light picks the lists, of two
    /// equal ones the first.
    pub directions: Vec<Vec3>,
    /// One entry a direction; each list is a part of its section's.
    pub lists: Vec<SectionLists>,
}

/// A level square below the model that receives its shadow and casts none. Its middle lies below the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Where it lies along +Y, unit space.
    pub height: f32,
    /// Half of its side, unit space: receivers were taken from there.
    pub half_extent: f32,
}

/// Planes, and which of them each section reads.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BakedSet {
    /// All planes.
    pub planes: Vec<BakedPlane>,
    /// The planes of each section; at least one section.
    pub sections: SectionLists,
    /// Shorter lists per light direction; without them a section reads all its planes.
    pub active: Option<ActiveLists>,
    /// The ground that the last section is for, where there is one; no triangle belongs to that section.
    pub ground: Option<Ground>,
}

impl BakedSet {
    /// One section that reads all planes.
    #[must_use]
    pub fn one_section(planes: Vec<BakedPlane>) -> Self {
        let all = (0..planes.len() as u32).collect();
        Self { planes, sections: vec![all], active: None, ground: None }
    }

    /// The number of sections that triangles belong to.
    #[must_use]
    pub fn model_sections(&self) -> usize {
        self.sections.len().saturating_sub(usize::from(self.ground.is_some()))
    }

    /// The ground and its section.
    #[must_use]
    pub fn ground_section(&self) -> Option<(Ground, u32)> {
        self.ground.map(|ground| (ground, self.model_sections() as u32))
    }

    /// Does some plane let light pass where it blocks?
    #[must_use]
    pub fn is_tinted(&self) -> bool {
        self.planes.iter().any(|baked| baked.tint != OPAQUE)
    }

    /// Bytes of the textures, one a texel; shared ones count once.
    #[must_use]
    pub fn texture_bytes(&self) -> usize {
        distinct(self.planes.iter().map(|baked| &baked.texture)).0.iter().map(|texture| texture.texels.len()).sum()
    }

    /// The planes that each section reads under a light in direction `l`.
    #[must_use]
    pub fn lists(&self, l: Vec3) -> &SectionLists {
        let Some(active) = &self.active else { return &self.sections };
        active.lists.get(nearest(&active.directions, l)).unwrap_or(&self.sections)
    }
}
