//! Baked planes -> `STEM.shadow.glb`, `STEM.shadow.json`, `STEM.atlas-N.png`.
//!
//! In: the input model's file and the planes in unit space. Steps: open and check the input; pack and encode the
//! textures; label the primitives; splice nodes, labels, textures and the extension into the input's JSON text;
//! append new vertices and the pictures to the binary chunk (where the input has none to append to, the pictures are
//! named by `uri` and the vertices go into `STEM.shadow.bin`); stage all files; rename them.

use super::{
    AssetError, Bounds, EXTENSION, Extension, TextureRef,
    atlas::{self, Atlas},
    document::{self, Additions, Home, Picture},
    files::{self, Batch},
    labels::Labels,
};
use crate::{
    gltf_file::{
        External, GltfFile, Kind,
        container::{self, Chunks},
        uri,
    },
    scene::Origin,
};
use serde_json::Value;
use shadowfit_solver::{
    mesh::Frame,
    plane::{BakedSet, OccluderTexture},
};
use std::{
    fmt, io,
    path::{Path, PathBuf},
};

/// What to write, and where.
#[derive(Clone, Copy, Debug)]
pub struct AssetRequest<'a> {
    /// The model that the planes were fitted to, GLB or glTF.
    pub input: &'a Path,
    /// Folder of the output; made where it is missing.
    pub out_dir: &'a Path,
    /// Start of the output's file names.
    pub stem: &'a str,
    /// Where unit space lies in model space.
    pub frame: &'a Frame,
    /// Box of the receivers.
    pub bounds: Bounds,
    /// The planes in unit space. None means "no self-shadow".
    pub set: &'a BakedSet,
    /// [`Scene::origins`](crate::scene::Scene::origins) of the input. Used where the model has several sections.
    pub origins: &'a [Origin],
    /// The section of each triangle of the scene; copies of a mesh agree. Used where there are several.
    pub section_of: &'a [u32],
}

/// An atlas on the disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenAtlas {
    /// The PNG.
    pub path: PathBuf,
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Size of the PNG.
    pub png_bytes: u64,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// `STEM.shadow.glb`.
    pub model: PathBuf,
    /// `STEM.shadow.json`.
    pub sidecar: PathBuf,
    /// `STEM.atlas-0.png`, ...
    pub atlases: Vec<WrittenAtlas>,
    /// `STEM.shadow.bin`, where there had to be one.
    pub buffer: Option<PathBuf>,
    /// Files of the model that lie beside the output now.
    pub copied: Vec<PathBuf>,
    /// Paths and URIs of images that the model names and that were not there to be copied.
    pub not_copied: Vec<String>,
    /// Number of planes.
    pub planes: usize,
    /// Bytes of the atlases on the GPU (three channels of one byte a texel).
    pub texture_bytes: u64,
}

impl Written {
    /// All files but copies.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let atlases = self.atlases.iter().map(|atlas| &atlas.path);
        [&self.model, &self.sidecar].into_iter().chain(atlases).chain(&self.buffer).map(PathBuf::as_path)
    }

    /// Bytes of the atlases as PNG files.
    #[must_use]
    pub fn png_bytes(&self) -> u64 {
        self.atlases.iter().map(|atlas| atlas.png_bytes).sum()
    }
}

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.planes == 0 {
            return write!(f, "{}: no self-shadow, 0 planes", self.model.display());
        }
        let (model, planes, atlases) = (self.model.display(), self.planes, self.atlases.len());
        let (gpu, png) = (self.texture_bytes, self.png_bytes());
        write!(f, "{model}: planes: {planes}, atlases: {atlases}, {gpu} bytes on the GPU, {png} bytes as PNG")
    }
}

/// Writes the asset's files.
///
/// # Errors
/// The input is not a model that can be extended (see [`check_input`]); a plane or texture that cannot be
/// stored; an output path that is a file of the input; the file system. Nothing is left behind then.
pub fn write(request: &AssetRequest<'_>) -> Result<Written, AssetError> {
    let bytes = files::read(request.input)?;
    let source = Source::new(request.input, &bytes)?;
    let outputs = Outputs::new(request)?;
    let textures: Vec<&OccluderTexture> = request.set.planes.iter().map(|baked| &baked.texture).collect();
    let (layout, atlases) = atlas::build(&textures)?;
    let pictures = pictures(request.stem, &atlases);
    let sidecar = Extension::new(request, &layout, |i| TextureRef::Uri(pictures[i].uri.clone()))?.lines()?;
    let labels = Labels::new(request, &source.file)?;
    let (model, buffer) = source.extended((&pictures, &labels, request.stem), |first| {
        Extension::new(request, &layout, |i| TextureRef::Index(first + i))?.text()
    })?;

    let (externals, not_copied) = source.externals()?;
    let atlas_paths: Vec<PathBuf> = (0..atlases.len()).map(|i| outputs.atlas(i)).collect();
    outputs.refuse_overwriting(request.input, &externals, &atlas_paths)?;
    let mut batch = Batch::default();
    for external in &externals {
        batch.stage_copy(&external.path, &outputs.folder.join(&external.relative))?;
    }
    for (path, atlas) in atlas_paths.iter().zip(&atlases) {
        batch.stage(path, &atlas.png)?;
    }
    if let Some(buffer) = &buffer {
        batch.stage(&outputs.buffer(), buffer)?;
    }
    batch.stage(&outputs.sidecar(), &sidecar)?;
    batch.stage(&outputs.model(), &model)?;
    batch.commit()?;

    let atlases = atlas_paths.into_iter().zip(&atlases).map(|(path, atlas)| WrittenAtlas {
        path,
        width: atlas.width,
        height: atlas.height,
        png_bytes: atlas.png.len() as u64,
    });
    Ok(Written {
        model: outputs.model(),
        sidecar: outputs.sidecar(),
        atlases: atlases.collect(),
        buffer: buffer.map(|_| outputs.buffer()),
        copied: externals.iter().map(|external| outputs.folder.join(&external.relative)).collect(),
        not_copied,
        planes: request.set.planes.len(),
        texture_bytes: layout.texture_bytes(),
    })
}

/// Can [`write()`] extend this model? Asked before a long search, so that it does not end in vain.
///
/// # Errors
/// The file cannot be read, is no glTF 2.0, carries the extension already, or names files outside its folder.
pub fn check_input(input: &Path) -> Result<(), AssetError> {
    let bytes = files::read(input)?;
    let source = Source::new(input, &bytes)?;
    source.externals()?;
    source.extended((&[], &Labels::default(), ""), |_| Extension { sets: Vec::new() }.text())?;
    Ok(())
}

/// Refuses an output folder in which a file of the fit would take the place of one of `inputs`. Asked before a long
/// search; [`write()`] knows of the model's buffers and images too.
///
/// # Errors
/// [`AssetError::OverwritesInput`].
pub fn check_outputs(out_dir: &Path, stem: &str, inputs: &[&Path]) -> Result<(), AssetError> {
    let outputs = Outputs { folder: out_dir, stem };
    let taken = |path: &PathBuf| inputs.iter().any(|input| files::is_same_file(path, input));
    match outputs.but_atlases().into_iter().chain([outputs.atlas(0)]).find(taken) {
        Some(path) => Err(AssetError::OverwritesInput { path }),
        None => Ok(()),
    }
}

/// Output paths.
struct Outputs<'a> {
    folder: &'a Path,
    stem: &'a str,
}

impl<'a> Outputs<'a> {
    fn new(request: &AssetRequest<'a>) -> Result<Self, AssetError> {
        let stem = request.stem;
        let is_name = Path::new(stem).file_name().is_some_and(|name| name == stem) && !stem.contains(['/', '\\', '\0']);
        if !is_name {
            return Err(AssetError::Stem { stem: stem.into() });
        }
        Ok(Self { folder: request.out_dir, stem })
    }

    fn model(&self) -> PathBuf {
        self.folder.join(format!("{}.shadow.glb", self.stem))
    }

    fn sidecar(&self) -> PathBuf {
        self.folder.join(format!("{}.shadow.json", self.stem))
    }

    fn buffer(&self) -> PathBuf {
        self.folder.join(buffer_name(self.stem))
    }

    /// What a fit writes beside the atlases: by this module, and by the report.
    fn but_atlases(&self) -> [PathBuf; 5] {
        let other = |ending: &str| self.folder.join(format!("{}.{ending}", self.stem));
        [self.model(), self.sidecar(), self.buffer(), other("report.json"), other("compare.png")]
    }

    fn atlas(&self, index: usize) -> PathBuf {
        self.folder.join(atlas_name(self.stem, index))
    }

    /// No output may be a file of the input, nor take the place of a copy of one.
    fn refuse_overwriting(&self, input: &Path, externals: &[External], atlases: &[PathBuf]) -> Result<(), AssetError> {
        for path in self.but_atlases().iter().chain(atlases) {
            let is_copy = externals.iter().any(|external| self.folder.join(&external.relative) == *path);
            let is_source = externals.iter().any(|external| files::is_same_file(path, &external.path));
            if is_copy || is_source || files::is_same_file(path, input) {
                return Err(AssetError::OverwritesInput { path: path.clone() });
            }
        }
        Ok(())
    }
}

fn atlas_name(stem: &str, index: usize) -> String {
    format!("{stem}.atlas-{index}.png")
}

fn buffer_name(stem: &str) -> String {
    format!("{stem}.shadow.bin")
}

fn pictures<'a>(stem: &str, atlases: &'a [Atlas]) -> Vec<Picture<'a>> {
    let picture = |(i, atlas): (usize, &'a Atlas)| Picture {
        name: format!("shadow atlas {i}"),
        uri: uri::encode(&atlas_name(stem, i)),
        png: &atlas.png,
    };
    atlases.iter().enumerate().map(picture).collect()
}

/// The input model, opened and checked.
struct Source<'a> {
    file: GltfFile<'a>,
}

impl<'a> Source<'a> {
    fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Self, AssetError> {
        let open = || {
            let file = GltfFile::new(path, bytes)?;
            file.check_version()?;
            Ok(file)
        };
        let file = open().map_err(|fault| AssetError::invalid(path, fault))?;
        if let Some(pointer) = fitted_already(file.root()) {
            return Err(AssetError::AlreadyFitted { path: path.into(), pointer });
        }
        Ok(Self { file })
    }

    /// The files to be copied beside the output, and the URIs of images that are not there to be copied: the
    /// output names them as the input does.
    fn externals(&self) -> Result<(Vec<External>, Vec<String>), AssetError> {
        let externals = self.file.externals().map_err(|fault| AssetError::invalid(self.file.path(), fault))?;
        let (mut found, mut not_copied) = (Vec::new(), Vec::new());
        for (external, kind) in externals.files {
            if external.path.is_file() {
                found.push(external);
            } else if kind == Kind::Image {
                not_copied.push(external.relative);
            } else {
                let source = io::ErrorKind::NotFound.into();
                return Err(AssetError::Io { action: "read", path: external.path, source });
            }
        }
        not_copied.extend(externals.elsewhere);
        Ok((found, not_copied))
    }

    /// The output GLB, and the bytes of the file beside it where the new vertices cannot go into its binary chunk.
    /// `extension` makes the root object's text from the index of the first atlas texture.
    fn extended(
        &self,
        (pictures, labels, stem): (&[Picture<'_>], &Labels, &str),
        extension: impl FnOnce(usize) -> Result<String, AssetError>,
    ) -> Result<(Vec<u8>, Option<Vec<u8>>), AssetError> {
        let place = |fault| AssetError::invalid(self.file.path(), fault);
        // Additions go behind the binary chunk where buffer 0 is that chunk.
        let has_own_buffer = self.file.root().pointer("/buffers/0").is_some_and(|buffer| buffer.get("uri").is_none());
        let mut bin = self.file.chunks().bin.map(<[u8]>::to_vec);
        let home = match &bin {
            Some(bin) if has_own_buffer => Home::Chunk { start: bin.len() },
            _ => Home::File { uri: uri::encode(&buffer_name(stem)) },
        };
        let additions = Additions { pictures, labels, home };
        let json = document::spliced(self.file.chunks().json, &additions, extension, place)?;
        let blocks = document::blocks(&additions);
        let mut beside = Vec::new();
        match (&mut bin, &additions.home) {
            (Some(bin), Home::Chunk { .. }) => document::append(bin, &blocks),
            _ => document::append(&mut beside, &blocks),
        }
        let chunks = Chunks { json: &json, bin: bin.as_deref(), others: self.file.chunks().others.clone() };
        let model = container::join(&chunks);
        let model = model.map_err(|why| AssetError::Malformed { path: self.file.path().into(), why })?;
        Ok((model, (!beside.is_empty()).then_some(beside)))
    }
}

/// JSON pointer of a trace of this extension, if there is one.
fn fitted_already(root: &Value) -> Option<String> {
    let carries = |value: &Value| value.get("extensions").is_some_and(|e| e.get(EXTENSION).is_some());
    if carries(root) {
        return Some(format!("/extensions/{EXTENSION}"));
    }
    let node = list(root, "nodes").iter().position(carries).map(|i| format!("/nodes/{i}/extensions/{EXTENSION}"));
    let labelled = |mesh: &Value| list(mesh, "primitives").iter().any(carries);
    let mesh = || list(root, "meshes").iter().position(labelled).map(|i| format!("/meshes/{i}/primitives"));
    let required = || {
        let named = list(root, "extensionsRequired").iter().position(|name| name == EXTENSION);
        named.map(|i| format!("/extensionsRequired/{i}"))
    };
    node.or_else(mesh).or_else(required)
}

/// The elements of an array member, none where it is missing.
fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}
