//! Baked planes -> `STEM.shadow.glb`, `STEM.shadow.json`, `STEM.atlas-N.png`.
//!
//! In: the input model's file and the planes in unit space. Steps: open and check the input; pack and encode the
//! textures; splice nodes, textures and the extension into the input's JSON text; append the pictures to the
//! binary chunk (or name them by `uri` where the input has no binary chunk to append to); stage all files;
//! rename them.

use super::{
    AssetError, Bounds, EXTENSION, Encoding, Extension, PlaneEntry, PlaneSet, Rectangle, TextureRef,
    atlas::{self, Atlas, Layout},
    files::{self, Batch},
    splice::{Edits, Spot},
};
use crate::gltf_file::{
    External, GltfFile, Invalid, Kind,
    container::{self, Chunks},
    uri,
};
use gltf::json::texture::{MagFilter, MinFilter, WrappingMode};
use serde_json::{Value, json};
use shadowfit_solver::{
    mesh::Frame,
    plane::{BakedPlane, OccluderTexture},
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
    /// The planes in unit space, all in one section. None means "no self-shadow".
    pub planes: &'a [BakedPlane],
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
    let textures: Vec<&OccluderTexture> = request.planes.iter().map(|baked| &baked.texture).collect();
    let (layout, atlases) = atlas::build(&textures)?;
    let pictures = pictures(request.stem, &atlases);
    let model = source.extended(&pictures, |first| extension(request, &layout, |i| TextureRef::Index(first + i)))?;
    let sidecar = extension(request, &layout, |i| TextureRef::Uri(pictures[i].uri.clone()))?;
    let sidecar = format!("{:#}\n", json!(sidecar));

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
    batch.stage(&outputs.sidecar(), sidecar.as_bytes())?;
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
        copied: externals.iter().map(|external| outputs.folder.join(&external.relative)).collect(),
        not_copied,
        planes: request.planes.len(),
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
    source.extended(&[], |_| Ok(Extension { sets: Vec::new() }))?;
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

    /// What a fit writes beside the atlases: by this module, and by the report.
    fn but_atlases(&self) -> [PathBuf; 4] {
        let other = |ending: &str| self.folder.join(format!("{}.{ending}", self.stem));
        [self.model(), self.sidecar(), other("report.json"), other("compare.png")]
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

/// An atlas as the documents name it.
struct Picture<'a> {
    name: String,
    uri: String,
    png: &'a [u8],
}

fn pictures<'a>(stem: &str, atlases: &'a [Atlas]) -> Vec<Picture<'a>> {
    let picture = |(i, atlas): (usize, &'a Atlas)| Picture {
        name: format!("shadow atlas {i}"),
        uri: uri::encode(&atlas_name(stem, i)),
        png: &atlas.png,
    };
    atlases.iter().enumerate().map(picture).collect()
}

/// The extension's root object; `texture` names an atlas.
fn extension(
    request: &AssetRequest<'_>,
    layout: &Layout,
    texture: impl Fn(usize) -> TextureRef,
) -> Result<Extension, AssetError> {
    if !request.bounds.is_box() {
        return Err(AssetError::Bounds { bounds: request.bounds });
    }
    let mut planes = Vec::with_capacity(request.planes.len());
    for (plane, (baked, place)) in request.planes.iter().zip(&layout.placements).enumerate() {
        let rectangle = Rectangle::from_unit_space(&baked.plane, request.frame);
        let bias = f64::from(baked.bias) * request.frame.radius;
        let bias_fault = (!(bias.is_finite() && bias >= 0.0)).then_some(("bias", "not a finite number from 0 up"));
        if let Some((member, why)) = rectangle.fault().or(bias_fault) {
            return Err(AssetError::Plane { plane, why: format!("{member}: {why}") });
        }
        let [width, height] = [baked.texture.width as u32, baked.texture.height as u32];
        planes.push(PlaneEntry {
            origin: rectangle.origin,
            u_axis: rectangle.u_axis,
            v_axis: rectangle.v_axis,
            occluder_texture: texture(place.atlas),
            region: [place.x, place.y, width, height],
            channel: place.channel,
            encoding: Encoding::Coverage,
            side: baked.side,
            bias,
        });
    }
    let sections = vec![(0..planes.len()).collect()];
    Ok(Extension { sets: vec![PlaneSet { bounds: request.bounds, planes, sections }] })
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

    /// The output GLB. `set` makes the extension's root object from the index of the first atlas texture.
    fn extended(
        &self,
        pictures: &[Picture<'_>],
        set: impl FnOnce(usize) -> Result<Extension, AssetError>,
    ) -> Result<Vec<u8>, AssetError> {
        let place = |fault| AssetError::invalid(self.file.path(), fault);
        let set = set(self.file.root().get("textures").and_then(Value::as_array).map_or(0, Vec::len))?;
        // Pictures go behind the binary chunk where buffer 0 is that chunk.
        let has_own_buffer = self.file.root().pointer("/buffers/0").is_some_and(|buffer| buffer.get("uri").is_none());
        let mut bin = self.file.chunks().bin.map(<[u8]>::to_vec);
        let mut offsets = None;
        if let (Some(bin), true, false) = (&mut bin, has_own_buffer, pictures.is_empty()) {
            offsets = Some(append(bin, pictures));
        }
        let buffer_end = bin.as_ref().map_or(0, Vec::len);
        let json = spliced(self.file.chunks().json, &json!(set), &Pictures { pictures, offsets, buffer_end })
            .map_err(place)?;
        let chunks = Chunks { json: &json, bin: bin.as_deref(), others: self.file.chunks().others.clone() };
        container::join(&chunks).map_err(|why| AssetError::Malformed { path: self.file.path().into(), why })
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

/// Appends the pictures, each at a multiple of four, and returns their offsets.
fn append(bin: &mut Vec<u8>, pictures: &[Picture<'_>]) -> Vec<usize> {
    let mut offsets = Vec::with_capacity(pictures.len());
    for picture in pictures {
        bin.resize(bin.len().next_multiple_of(4), 0);
        offsets.push(bin.len());
        bin.extend_from_slice(picture.png);
    }
    offsets
}

/// What the document has to name.
struct Pictures<'a> {
    pictures: &'a [Picture<'a>],
    /// Offsets in buffer 0, or `None` where the pictures are files.
    offsets: Option<Vec<usize>>,
    /// Length of buffer 0 with the pictures.
    buffer_end: usize,
}

/// The document with the frame node, the atlases and the extension.
fn spliced(text: &str, set: &Value, pictures: &Pictures<'_>) -> Result<String, Invalid> {
    let root = Spot::root(text)?;
    let mut document = Document { members: root.members()?, edits: Edits::default(), new: Vec::new() };
    let frame_node = json!({ "name": "shadow planes", "extensions": { EXTENSION: { "set": 0 } } });
    let node = document.append("nodes", &[frame_node])?;
    document.add_to_scene(node)?;
    if !pictures.pictures.is_empty() {
        document.add_textures(pictures)?;
    }
    let used = document.member("extensionsUsed").map(|spot| spot.slice().to_owned()).unwrap_or_default();
    let declared = serde_json::from_str::<Vec<String>>(&used).is_ok_and(|names| names.iter().any(|n| n == EXTENSION));
    if !declared {
        document.append("extensionsUsed", &[json!(EXTENSION)])?;
    }
    match document.member("extensions") {
        Some(extensions) => document.edits.add_members(&extensions, &[(EXTENSION, set.to_string())])?,
        None => document.new.push(("extensions", json!({ EXTENSION: set }).to_string())),
    }
    document.edits.add_members(&root, &document.new)?;
    Ok(document.edits.apply(text))
}

/// A glTF document with its edits.
struct Document<'a> {
    members: Vec<(String, Spot<'a>)>,
    edits: Edits,
    /// Members that the root has not got yet.
    new: Vec<(&'static str, String)>,
}

impl<'a> Document<'a> {
    fn member(&self, key: &str) -> Option<Spot<'a>> {
        self.members.iter().find_map(|(k, spot)| (k == key).then(|| spot.clone()))
    }

    /// Appends to an array of the root, which is made where it is missing. Returns the first new index.
    fn append(&mut self, key: &'static str, elements: &[Value]) -> Result<usize, Invalid> {
        match self.member(key) {
            Some(array) => {
                let texts: Vec<String> = elements.iter().map(Value::to_string).collect();
                self.edits.append(&array, &texts)?;
                Ok(array.elements()?.len())
            }
            None => {
                self.new.push((key, json!(elements).to_string()));
                Ok(0)
            }
        }
    }

    /// Makes the node a root of the default scene: the one that `scene` names, else the first, else none.
    fn add_to_scene(&mut self, node: usize) -> Result<(), Invalid> {
        let Some(scenes) = self.member("scenes") else { return Ok(()) };
        let scenes = scenes.elements()?;
        let index = self.member("scene").map_or(Ok(0), |spot| spot.slice().parse::<usize>());
        let Some(scene) = index.ok().and_then(|i| scenes.get(i)) else {
            let reason = format!("not one of the {} scenes", scenes.len());
            return if scenes.is_empty() { Ok(()) } else { Err(Invalid { pointer: "/scene".into(), reason }) };
        };
        match scene.member("nodes")? {
            Some(nodes) => self.edits.append(&nodes, &[node.to_string()]),
            None => self.edits.add_members(scene, &[("nodes", format!("[{node}]"))]),
        }
    }

    /// Sampler, images, textures, and for pictures inside the file buffer views and the buffer's new length.
    fn add_textures(&mut self, pictures: &Pictures<'_>) -> Result<(), Invalid> {
        let clamp = WrappingMode::ClampToEdge;
        let sampler =
            json!({ "magFilter": MagFilter::Linear, "minFilter": MinFilter::Linear, "wrapS": clamp, "wrapT": clamp });
        let sampler = self.append("samplers", &[sampler])?;
        let names = pictures.pictures.iter();
        let images: Vec<Value> = match &pictures.offsets {
            Some(offsets) => {
                let sizes = names.clone().map(|picture| picture.png.len());
                let views = offsets
                    .iter()
                    .zip(sizes)
                    .map(|(&offset, length)| json!({ "buffer": 0, "byteOffset": offset, "byteLength": length }));
                let first = self.append("bufferViews", &views.collect::<Vec<_>>())?;
                self.lengthen_buffer(pictures.buffer_end)?;
                let image = |(i, picture): (usize, &Picture<'_>)| json!({ "name": picture.name, "mimeType": "image/png", "bufferView": first + i });
                names.enumerate().map(image).collect()
            }
            None => names.map(|picture| json!({ "name": picture.name, "uri": picture.uri })).collect(),
        };
        let first = self.append("images", &images)?;
        let texture = |(i, picture): (usize, &Picture<'_>)| json!({ "name": picture.name, "sampler": sampler, "source": first + i });
        let textures: Vec<Value> = pictures.pictures.iter().enumerate().map(texture).collect();
        self.append("textures", &textures)?;
        Ok(())
    }

    fn lengthen_buffer(&mut self, length: usize) -> Result<(), Invalid> {
        let missing = || Invalid { pointer: "/buffers/0/byteLength".into(), reason: "missing".into() };
        let buffers = self.member("buffers").ok_or_else(missing)?.elements()?;
        let byte_length = buffers.first().ok_or_else(missing)?.member("byteLength")?.ok_or_else(missing)?;
        self.edits.replace(&byte_length, length.to_string());
        Ok(())
    }
}
