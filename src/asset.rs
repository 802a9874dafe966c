//! The shadow asset: the model's own file with shadow planes and occluder textures inside, and back.
//!
//! [`write()`] takes an input model and baked planes and writes, into one folder, `STEM.shadow.glb` (the input
//! with the glTF extension [`EXTENSION`]), `STEM.shadow.json` (the same set of planes with `uri`s in the place of
//! texture indices) and `STEM.atlas-0.png`, ... [`read()`] takes any of these, checks it, and gives the set back.
//! Where there are several sections, the primitives of the GLB say which they belong to (`labels`); the scene's reader
//! gives that back. A [`ModelGround`] below the model has the last section, which no primitive belongs to.
//! [`read_plane_file`] reads rectangles that a person placed.
//!
//! Numbers in the files are in model space, metres, f64 in the shortest spelling that stands for them; the solver's are
//! in unit space and f32. No planes is legal and means "no self-shadow": the set is there, without textures.
//!
//! Guaranteed: every other byte of the input's JSON and buffers is kept (only `buffers[0].byteLength` changes, and
//! what a primitive of several sections refers to); the input is never overwritten; files appear complete or not at all; the same request gives the same bytes.
//! Not done: an input that carries the extension already is refused rather than edited, since its textures
//! could only be left behind as dead weight. Fit the model that it was made from.

pub mod atlas;
mod document;
mod extension;
pub mod files;
mod labels;
mod pointer;
mod read;
pub mod splice;
mod write;

pub use atlas::Channel;
pub use extension::{ActiveEntry, Extension, GroundEntry, PlaneEntry, PlaneSet, TextureRef};
pub use read::{MAX_FILE_PLANES, ModelRectangle, read, read_plane_file};
pub use write::{AssetRequest, Written, WrittenAtlas, check_input, check_outputs, write};

pub use crate::gltf_file::EXTENSION;

use crate::gltf_file::Invalid;
use glam::DVec3;
use serde::Serialize;
use shadowfit_solver::{
    mesh::Frame,
    plane::{ActiveLists, BakedPlane, BakedSet, Ground, OccluderTexture, SectionLists, ShadowPlane, Side},
};
use std::path::{Path, PathBuf};

/// Axes whose angle has a smaller sine count as parallel. At 1e-6 (0.2 arc seconds) the rounding of f32 axes is
/// already a tenth of the angle; a sheared node in a real file stays above 1e-2.
const MIN_AXIS_SINE: f64 = 1e-6;

/// A box in model space, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: DVec3,
    /// Largest coordinates.
    pub max: DVec3,
}

impl Bounds {
    /// The middle.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// Finite, and no side negative.
    fn is_box(&self) -> bool {
        self.min.is_finite() && self.max.is_finite() && self.min.cmple(self.max).all()
    }
}

/// A rectangle (or parallelogram) in model space, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Corner with texture coordinates (0, 0).
    pub origin: DVec3,
    /// Edge along u, full length.
    pub u_axis: DVec3,
    /// Edge along v, full length.
    pub v_axis: DVec3,
}

impl Rectangle {
    /// The plane's rectangle in model space.
    #[must_use]
    pub fn from_unit_space(plane: &ShadowPlane, frame: &Frame) -> Self {
        Self {
            origin: frame.model_from_unit(plane.origin),
            u_axis: plane.u.as_dvec3() * frame.radius,
            v_axis: plane.v.as_dvec3() * frame.radius,
        }
    }

    /// The rectangle as a plane of unit space.
    #[must_use]
    pub fn in_unit_space(&self, frame: &Frame) -> ShadowPlane {
        let edge = |axis: DVec3| (axis / frame.radius).as_vec3();
        ShadowPlane { origin: frame.unit_from_model(self.origin), u: edge(self.u_axis), v: edge(self.v_axis) }
    }

    /// What makes it no rectangle to look textures up in: the member of the file, and why.
    fn fault(&self) -> Option<(&'static str, &'static str)> {
        let [o, u, v] = [self.origin, self.u_axis, self.v_axis];
        for (name, vector) in [("origin", o), ("uAxis", u), ("vAxis", v)] {
            if !vector.is_finite() {
                return Some((name, "not a finite number"));
            }
        }
        // Directions first: lengths of 1e200 must not overflow, lengths of 1e-200 must not vanish.
        let direction = |axis: DVec3| (axis / axis.abs().max_element()).normalize_or_zero();
        let sine = direction(u).cross(direction(v)).length();
        // Written so that NaN (an axis of length zero) is a fault.
        let spans = sine >= MIN_AXIS_SINE;
        (!spans).then_some(("vAxis", "parallel to uAxis, or one of the two has no length"))
    }
}

/// One plane of a [`ShadowSet`].
#[derive(Clone, Debug, PartialEq)]
pub struct ModelPlane {
    /// Where it lies.
    pub rectangle: Rectangle,
    /// What it blocks.
    pub texture: OccluderTexture,
    /// The share of each linear colour that it takes where its texture blocks, in 255ths.
    pub tint: [u8; 3],
    /// Which receivers it serves.
    pub side: Side,
    /// A receiver nearer than this along the ray is not shadowed, metres.
    pub bias: f64,
}

/// A level square that receives the model's shadow and casts none, its middle below that of the model's box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelGround {
    /// Where it lies along +Y, metres.
    pub height: f64,
    /// Half of its side, metres.
    pub half_extent: f64,
}

impl ModelGround {
    /// The ground in model space.
    #[must_use]
    pub fn from_unit_space(ground: &Ground, frame: &Frame) -> Self {
        let height = frame.centre_model.y + f64::from(ground.height) * frame.radius;
        Self { height, half_extent: f64::from(ground.half_extent) * frame.radius }
    }

    /// The ground in unit space.
    #[must_use]
    pub fn in_unit_space(&self, frame: &Frame) -> Ground {
        let height = (self.height - frame.centre_model.y) / frame.radius;
        Ground { height: height as f32, half_extent: (self.half_extent / frame.radius) as f32 }
    }

    /// What makes it no ground: the member of the file, and why.
    fn fault(&self) -> Option<(&'static str, &'static str)> {
        if !self.height.is_finite() {
            return Some(("height", "not a finite number"));
        }
        let has_area = self.half_extent.is_finite() && self.half_extent > 0.0;
        (!has_area).then_some(("halfExtent", "not a finite number above 0"))
    }
}

/// The planes of one model, read back and checked, in model space.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowSet {
    /// Box of the receivers at bake time.
    pub bounds: Bounds,
    /// All planes; empty means "no self-shadow".
    pub planes: Vec<ModelPlane>,
    /// Indices into `planes`, one list a section; at least one section.
    pub sections: SectionLists,
    /// Shorter lists per light direction, where there are such; directions in model space.
    pub active: Option<ActiveLists>,
    /// The ground that the last section is for, where there is one.
    pub ground: Option<ModelGround>,
}

impl ShadowSet {
    /// The planes as the solver and the renderer use them.
    #[must_use]
    pub fn in_unit_space(&self, frame: &Frame) -> BakedSet {
        let baked = |plane: &ModelPlane| BakedPlane {
            plane: plane.rectangle.in_unit_space(frame),
            texture: plane.texture.clone(),
            tint: plane.tint,
            side: plane.side,
            bias: (plane.bias / frame.radius) as f32,
        };
        // Unit space is moved and scaled: directions stay.
        BakedSet {
            planes: self.planes.iter().map(baked).collect(),
            sections: self.sections.clone(),
            active: self.active.clone(),
            ground: self.ground.map(|ground| ground.in_unit_space(frame)),
        }
    }
}

/// Why an asset cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum AssetError {
    /// The file system says no.
    #[error("cannot {action} {}: {source}", .path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// With which file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// An output path names a file that the model is made of.
    #[error("{} is a file of the input and is never overwritten: choose another output folder", .path.display())]
    OverwritesInput {
        /// The output path.
        path: PathBuf,
    },
    /// A file that the model needs cannot be copied without destroying another one.
    #[error("{} exists with other contents than the file that the model uses: remove it or choose another output folder", .path.display())]
    Occupied {
        /// The output path.
        path: PathBuf,
    },
    /// Not the expected container or text.
    #[error("{}: {why}", .path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// A place in a JSON document is wrong.
    #[error("{}: {pointer}: {why}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// JSON pointer.
        pointer: String,
        /// What is wrong there.
        why: String,
    },
    /// The input went through this program before.
    #[error("{}: {pointer}: carries {EXTENSION} already: fit the model that it was made from", .path.display())]
    AlreadyFitted {
        /// The file.
        path: PathBuf,
        /// JSON pointer.
        pointer: String,
    },
    /// The stem is no file name.
    #[error("{stem:?} cannot be the start of a file name")]
    Stem {
        /// As given.
        stem: String,
    },
    /// A baked plane that no file can hold.
    #[error("shadow plane {plane}: {why}")]
    Plane {
        /// Index in the request.
        plane: usize,
        /// What is wrong.
        why: String,
    },
    /// Sections or active lists that do not fit the planes or the model.
    #[error("sections: {why}")]
    Sections {
        /// What is wrong.
        why: String,
    },
    /// A ground that no file can hold.
    #[error("ground: {why}")]
    Ground {
        /// What is wrong.
        why: String,
    },
    /// The receivers' box is empty or not finite.
    #[error("the receivers' box is not one: {bounds:?}")]
    Bounds {
        /// As given.
        bounds: Bounds,
    },
    /// The PNG encoder failed.
    #[error("cannot encode an atlas: {0}")]
    Encode(image::ImageError),
}

impl AssetError {
    /// A fault of the file at `path`.
    fn invalid(path: &Path, Invalid { pointer, reason: why }: Invalid) -> Self {
        let path = path.into();
        if pointer.is_empty() { Self::Malformed { path, why } } else { Self::Invalid { path, pointer, why } }
    }

    /// The program's exit code: 2 input or output, 3 invalid input, 4 a fault of the planes, not of the files.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Io { .. } | Self::OverwritesInput { .. } | Self::Occupied { .. } => 2,
            Self::Malformed { .. } | Self::Invalid { .. } | Self::AlreadyFitted { .. } | Self::Stem { .. } => 3,
            Self::Plane { .. }
            | Self::Sections { .. }
            | Self::Ground { .. }
            | Self::Bounds { .. }
            | Self::Encode(_) => 4,
        }
    }
}
