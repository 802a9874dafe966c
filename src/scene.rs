//! glTF -> [`Scene`]: the triangles of a file in model space, with what the renderer needs to draw them.
//!
//! In: a `.glb` or `.gltf` file with the buffers and images beside it. Out: every triangle of the default scene
//! in its static pose, transforms composed in f64, in the order of the file (nodes depth first), and a list of
//! everything that was left out. Source: the glTF 2.0 specification (Khronos, ISO/IEC 12113:2022).
//!
//! Guaranteed for any input: no panic, no endless loop, no byte read outside the file's own buffers, no file
//! opened outside the model's folder, and memory bounded by [`MAX_TRIANGLES`], [`MAX_TEXELS`] and the files'
//! sizes. Not guaranteed: that a file with rules broken which concern no triangle (animations, cameras, unused
//! records) is refused; it is read.
//!
//! The JSON is decoded here and not by the `gltf` crate (see `document`), whose enumerations are used; the
//! container is that of [`gltf_file`].
//!
//! ```no_run
//! let scene = shadowfit::scene::load(std::path::Path::new("teapot.glb"))?;
//! println!("{} triangles", scene.soup.corners_model.len());
//! # Ok::<(), shadowfit::scene::SceneError>(())
//! ```

mod accessor;
mod assembly;
mod buffers;
mod document;
mod extensions;
mod ground;
mod instances;
mod materials;
mod nodes;
mod primitive;
pub(crate) mod raw;
mod sections;

pub use assembly::{MAX_DRAWS, MAX_TRIANGLES};
pub use materials::{MAX_IMAGE_TEXELS, MAX_TEXELS};
pub use primitive::MAX_COORDINATE;

use crate::gltf_file::{self, GltfFile, Invalid};
use glam::{DAffine3, Vec2, Vec3};
use serde::Serialize;
use shadowfit_solver::mesh::{Mesh, MeshError, Soup};
use std::{
    collections::HashMap,
    io,
    path::{Path, PathBuf},
    sync::Arc,
};

/// How a surface looks; only what Lambert shading needs.
#[derive(Clone, Debug)]
pub struct Material {
    /// Linear RGBA factor.
    pub base_color: [f32; 4],
    /// Index into [`Scene::images`] of the sRGB base colour texture.
    pub image: Option<usize>,
    /// Do texture coordinates repeat (true) or clamp, along u and v?
    pub repeat: [bool; 2],
    /// Fragments with alpha below this (0..1) are discarded (alphaMode MASK).
    pub alpha_cutoff: Option<f32>,
    /// Linear RGB share of the light that passes (alphaMode BLEND); `None` where the material is opaque. Of alpha `a` and
    /// base colour `c`, the share `1 - a` passes, tinted by `c` as far as the surface is there: `(1 - a)(1 - a (1 - c))`,
    /// the mean over all texels of the image. Most techniques take such materials for opaque, shadow planes do not.
    pub transmittance: Option<[f32; 3]>,
}

/// Something in the file that the fit does not use.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Skipped {
    /// What: "lines", "skin", "zero-area triangles", ...
    pub what: String,
    /// How many.
    pub count: usize,
    /// Why, and what was done instead.
    pub why: String,
}

/// Where a triangle of a scene comes from. Copies of a mesh have the same origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Origin {
    /// Index into the file's `meshes`.
    pub mesh: u32,
    /// Index into the mesh's `primitives`.
    pub primitive: u32,
    /// Counts the triangles of the primitive, strips and fans taken apart.
    pub triangle: u32,
}

/// A glTF file as triangles. All vectors but `materials`, `images` and `skipped` have one entry a triangle, and so
/// have those of `soup`.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Triangles in model space.
    pub soup: Soup,
    /// Shading normals of the corners, model space, unit.
    pub normals: Vec<[Vec3; 3]>,
    /// Base colour texture coordinates of the corners.
    pub uvs: Vec<[Vec2; 3]>,
    /// Index into `materials`.
    pub material_of: Vec<u32>,
    /// The triangle of the file.
    pub origins: Vec<Origin>,
    /// The section of a fitted asset, by the file's labels; 0 for a file without shadow planes. A triangle without a
    /// label in a file of several sections has the number of sections here, which is no section: it reads no planes.
    pub section_of: Vec<u32>,
    /// Materials; index 0 is always there: glTF's default material. Material `i` of the file is `i + 1`.
    pub materials: Vec<Material>,
    /// Decoded base colour images, sRGB.
    pub images: Vec<Arc<image::RgbaImage>>,
    /// All that was left out, counted.
    pub skipped: Vec<Skipped>,
    /// How many of the last triangles are a ground (see [`Scene::stand_on_ground`]); 0 of a file.
    pub ground_triangles: usize,
}

impl Scene {
    /// The triangles with a BVH, and what light passes their materials.
    ///
    /// # Errors
    /// As of [`Mesh::new`].
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let transmittance = |triangle: usize| {
            let material = &self.materials[self.material_of[triangle] as usize];
            material.transmittance.map_or(Vec3::ZERO, Vec3::from_array)
        };
        Ok(Mesh::new(&self.soup)?.with_transmittance(transmittance))
    }
}

/// Why a file is not a scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The model file itself cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The model file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file, or one that it needs, breaks the rules of glTF or a limit of this reader.
    #[error(
        "{}: invalid glTF{}: {reason}; export the model again, or see what `npx gltf-validator` says",
        path.display(),
        at(pointer)
    )]
    Invalid {
        /// The model file.
        path: PathBuf,
        /// JSON pointer (RFC 6901) of the culprit; empty where it is the whole file.
        pointer: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The file is well, but needs a feature that this reader does not have.
    #[error("{}: needs {}, not supported: {remedy}", path.display(), features.join(", "))]
    Unsupported {
        /// The model file.
        path: PathBuf,
        /// Names of the extensions or formats.
        features: Vec<String>,
        /// How to get rid of them.
        remedy: String,
    },
}

impl SceneError {
    /// The process exit code: 2 the file cannot be read, 3 invalid input, 5 an unsupported feature.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Io { .. } => 2,
            Self::Invalid { .. } => 3,
            Self::Unsupported { .. } => 5,
        }
    }
}

fn at(pointer: &str) -> String {
    if pointer.is_empty() { String::new() } else { format!(" at {pointer}") }
}

/// Reads a `.glb` or `.gltf` file. What it is decides its content, not its name.
///
/// # Errors
/// A file that cannot be read, that is invalid (no triangles counts as invalid), or that needs an unsupported
/// feature.
pub fn load(path: &Path) -> Result<Scene, SceneError> {
    let bytes = gltf_file::read_file(path).map_err(|source| SceneError::Io { path: path.to_owned(), source })?;
    read(path, &bytes).map_err(|fault| fault.at(path))
}

/// The recipe of [`load`].
fn read(path: &Path, bytes: &[u8]) -> Result<Scene, Fault> {
    let file = GltfFile::new(path, bytes)?;
    file.check_version()?;
    let document = document::Document::parse(file.root())?;
    let mut notices = Notices::default();
    extensions::check(&document, &mut notices)?;
    let hierarchy = nodes::Hierarchy::new(&document)?;
    let buffers = buffers::Buffers::load(&file, &document)?;
    let data = accessor::Data { document: &document, buffers: &buffers };
    let mut scene = assembly::assemble(&file, &data, &hierarchy, &mut notices)?;
    scene.skipped = notices.list;
    Ok(scene)
}

/// Model space from the space of each node of a glTF file.
///
/// # Errors
/// A record of the wrong shape, a hierarchy that is not a forest, or a transform that is not finite and affine.
pub(crate) fn node_transforms(file: &GltfFile<'_>) -> Result<Vec<DAffine3>, Invalid> {
    let hierarchy = document::Document::parse(file.root()).and_then(|document| nodes::Hierarchy::new(&document));
    hierarchy.map(|hierarchy| hierarchy.model_from_node).map_err(Invalid::from)
}

/// An error that does not know its file yet.
#[derive(Clone, Debug)]
enum Fault {
    Invalid { pointer: String, reason: String },
    Unsupported { features: Vec<String>, remedy: String },
}

impl Fault {
    fn new(pointer: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Invalid { pointer: pointer.into(), reason: reason.into() }
    }

    /// The reference at `pointer` to element `index` of a top-level list that has only `length`.
    fn index(pointer: &str, index: usize, list: &str, length: usize) -> Self {
        Self::new(pointer, format!("{index}, but /{list} has {length} elements"))
    }

    /// Extensions that `gltf-transform` removes.
    fn unsupported(names: &[&str]) -> Self {
        let features = names.iter().map(|name| (*name).to_owned()).collect();
        Self::Unsupported { features, remedy: "remove it with `npx @gltf-transform/cli copy IN OUT`".to_owned() }
    }

    fn at(self, path: &Path) -> SceneError {
        let path = path.to_owned();
        match self {
            Self::Invalid { pointer, reason } => SceneError::Invalid { path, pointer, reason },
            Self::Unsupported { features, remedy } => SceneError::Unsupported { path, features, remedy },
        }
    }
}

impl From<Fault> for Invalid {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Invalid { pointer, reason } => Self { pointer, reason },
            Fault::Unsupported { .. } => Self { pointer: String::new(), reason: fault.to_string() },
        }
    }
}

impl From<Invalid> for Fault {
    fn from(Invalid { pointer, reason }: Invalid) -> Self {
        Self::Invalid { pointer, reason }
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Invalid { pointer, reason } => write!(f, "{pointer}: {reason}"),
            Self::Unsupported { features, remedy } => write!(f, "needs {}: {remedy}", features.join(", ")),
        }
    }
}

/// Collects [`Skipped`]: one entry a kind, in the order of first appearance.
#[derive(Default)]
struct Notices {
    list: Vec<Skipped>,
    index_of: HashMap<String, usize>,
}

impl Notices {
    /// Counts `count` more of `what`; the first `why` stays.
    fn add(&mut self, what: &str, count: usize, why: &str) {
        if count == 0 {
            return;
        }
        if let Some(&index) = self.index_of.get(what) {
            self.list[index].count += count;
        } else {
            self.index_of.insert(what.to_owned(), self.list.len());
            self.list.push(Skipped { what: what.to_owned(), count, why: why.to_owned() });
        }
    }
}
