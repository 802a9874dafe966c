//! The output's JSON: the input's text with the frame node, the atlases, the labels and the extension spliced in.

use super::{
    AssetError, EXTENSION,
    labels::{Block, Label, Labels, Vertices},
    splice::{Edits, Spot},
};
use crate::gltf_file::{Invalid, SECTION_ATTRIBUTE};
use gltf::json::{
    mesh::Mode,
    texture::{MagFilter, MinFilter, WrappingMode},
};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Compressed copies of a primitive's vertices, which a reader would prefer: they go where vertices get new numbers.
const COMPRESSED_COPIES: [&str; 1] = ["KHR_draco_mesh_compression"];

/// An atlas as the documents name it.
pub(super) struct Picture<'a> {
    /// For people.
    pub name: String,
    /// Percent-encoded file name.
    pub uri: String,
    /// The file.
    pub png: &'a [u8],
}

/// What the document has to name.
pub(super) struct Additions<'a> {
    /// Atlases.
    pub pictures: &'a [Picture<'a>],
    /// Labels of primitives with their accessors.
    pub labels: &'a Labels,
    /// Where the binary data goes.
    pub home: Home,
}

/// Where the bytes of new buffer views go.
pub(super) enum Home {
    /// Into buffer 0, the binary chunk: accessors and pictures.
    Chunk {
        /// Bytes before the first addition.
        start: usize,
    },
    /// Into a file: accessors only, the pictures being files of their own.
    File {
        /// Percent-encoded file name.
        uri: String,
    },
}

/// Appends bytes, each block at a multiple of four.
pub(super) fn append(bin: &mut Vec<u8>, blocks: &[&[u8]]) {
    for bytes in blocks {
        bin.resize(bin.len().next_multiple_of(4), 0);
        bin.extend_from_slice(bytes);
    }
}

/// The bytes that belong into the home, in the order of their buffer views.
pub(super) fn blocks<'a>(additions: &'a Additions<'_>) -> Vec<&'a [u8]> {
    let accessors = additions.labels.blocks.iter().map(|block| block.bytes.as_slice());
    let pictures = additions.pictures.iter().map(|picture| picture.png);
    match additions.home {
        Home::Chunk { .. } => accessors.chain(pictures).collect(),
        Home::File { .. } => accessors.collect(),
    }
}

/// The document with all additions. `extension` makes the root object's text from the index of the first atlas.
///
/// # Errors
/// Something in the document is not what its name says.
pub(super) fn spliced(
    text: &str,
    additions: &Additions<'_>,
    extension: impl FnOnce(usize) -> Result<String, AssetError>,
    place: impl Fn(Invalid) -> AssetError,
) -> Result<String, AssetError> {
    let open = || -> Result<_, Invalid> {
        let root = Spot::root(text)?;
        let mut document = Document { members: root.members()?, edits: Edits::default(), grown: Vec::new() };
        let frame_node = json!({ "name": "shadow planes", "extensions": { EXTENSION: { "set": 0 } } });
        let node = document.append("nodes", vec![frame_node])?;
        document.add_to_scene(node)?;
        let first_texture = document.add_binary(additions)?;
        let used = document.member("extensionsUsed").map(|spot| spot.slice().to_owned()).unwrap_or_default();
        let is_declared =
            serde_json::from_str::<Vec<String>>(&used).is_ok_and(|names| names.iter().any(|n| n == EXTENSION));
        if !is_declared {
            document.append("extensionsUsed", vec![json!(EXTENSION)])?;
        }
        Ok((root, document, first_texture))
    };
    let (root, document, first_texture) = open().map_err(&place)?;
    let extension = extension(first_texture)?;
    document.finish(text, &root, extension).map_err(place)
}

/// A glTF document with its edits.
struct Document<'a> {
    members: Vec<(String, Spot<'a>)>,
    edits: Edits,
    /// Arrays of the root that get more elements.
    grown: Vec<Grown>,
}

/// An array with new elements.
struct Grown {
    key: &'static str,
    before: usize,
    elements: Vec<Value>,
}

impl<'a> Document<'a> {
    fn member(&self, key: &str) -> Option<Spot<'a>> {
        self.members.iter().find_map(|(k, spot)| (k == key).then(|| spot.clone()))
    }

    /// Appends to an array of the root, which is made where it is missing. Returns the first new index.
    fn append(&mut self, key: &'static str, elements: Vec<Value>) -> Result<usize, Invalid> {
        let at = match self.grown.iter().position(|grown| grown.key == key) {
            Some(at) => at,
            None => {
                let before = self.member(key).map_or(Ok(0), |array| array.elements().map(|list| list.len()))?;
                self.grown.push(Grown { key, before, elements: Vec::new() });
                self.grown.len() - 1
            }
        };
        let grown = &mut self.grown[at];
        let first = grown.before + grown.elements.len();
        grown.elements.extend(elements);
        Ok(first)
    }

    /// The text with all edits and the extension.
    fn finish(mut self, text: &str, root: &Spot<'_>, extension: String) -> Result<String, Invalid> {
        let mut new: Vec<(&str, String)> = Vec::new();
        for grown in std::mem::take(&mut self.grown).into_iter().filter(|grown| !grown.elements.is_empty()) {
            match self.member(grown.key) {
                Some(array) => {
                    let texts: Vec<String> = grown.elements.iter().map(Value::to_string).collect();
                    self.edits.append(&array, &texts)?;
                }
                None => new.push((grown.key, json!(grown.elements).to_string())),
            }
        }
        match self.member("extensions") {
            Some(extensions) => self.edits.add_members(&extensions, &[(EXTENSION, extension)])?,
            None => new.push(("extensions", format!("{{\"{EXTENSION}\":{extension}}}"))),
        }
        self.edits.add_members(root, &new)?;
        Ok(self.edits.apply(text))
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

    /// Labels, atlases, and the buffer views of both; returns the index of the first atlas texture.
    fn add_binary(&mut self, additions: &Additions<'_>) -> Result<usize, Invalid> {
        let Additions { pictures, labels, home } = additions;
        let start = if let Home::Chunk { start } = home { *start } else { 0 };
        // Lay the bytes out as `append` does.
        let mut end = start;
        let mut ranges = Vec::new();
        for bytes in blocks(additions) {
            ranges.push((end.next_multiple_of(4), bytes.len()));
            end = end.next_multiple_of(4) + bytes.len();
        }
        let buffer = match home {
            Home::Chunk { .. } if end > start => self.lengthen_buffer(end).map(|()| 0)?,
            Home::File { uri } if end > 0 => self.append("buffers", vec![json!({ "uri": uri, "byteLength": end })])?,
            _ => 0,
        };
        let view = |(at, &(offset, length)): (usize, &(usize, usize))| {
            let mut view = json!({ "buffer": buffer, "byteOffset": offset, "byteLength": length });
            if let (Some(Value::Object(more)), Value::Object(view)) =
                (labels.blocks.get(at).map(|block| &block.view), &mut view)
            {
                view.extend(more.clone());
            }
            view
        };
        let views: Vec<Value> = ranges.iter().enumerate().map(view).collect();
        let first_view = self.append("bufferViews", views)?;
        self.add_labels(labels, first_view)?;
        if pictures.is_empty() {
            return self.append("textures", Vec::new());
        }
        let image = |(i, picture): (usize, &Picture<'_>)| match home {
            Home::Chunk { .. } => {
                let view = first_view + labels.blocks.len() + i;
                json!({ "name": picture.name, "mimeType": "image/png", "bufferView": view })
            }
            Home::File { .. } => json!({ "name": picture.name, "uri": picture.uri }),
        };
        let images = pictures.iter().enumerate().map(image).collect();
        self.add_textures(pictures, images)
    }

    /// Sampler, images and textures; returns the first texture's index.
    fn add_textures(&mut self, pictures: &[Picture<'_>], images: Vec<Value>) -> Result<usize, Invalid> {
        let clamp = WrappingMode::ClampToEdge;
        let sampler =
            json!({ "magFilter": MagFilter::Linear, "minFilter": MinFilter::Linear, "wrapS": clamp, "wrapT": clamp });
        let sampler = self.append("samplers", vec![sampler])?;
        let first = self.append("images", images)?;
        let texture = |(i, picture): (usize, &Picture<'_>)| json!({ "name": picture.name, "sampler": sampler, "source": first + i });
        self.append("textures", pictures.iter().enumerate().map(texture).collect())
    }

    fn lengthen_buffer(&mut self, length: usize) -> Result<(), Invalid> {
        let missing = || Invalid { pointer: "/buffers/0/byteLength".into(), reason: "missing".into() };
        let buffers = self.member("buffers").ok_or_else(missing)?.elements()?;
        let byte_length = buffers.first().ok_or_else(missing)?.member("byteLength")?.ok_or_else(missing)?;
        self.edits.replace(&byte_length, length.to_string());
        Ok(())
    }

    /// Accessors of the labels, and the labels of all primitives.
    fn add_labels(&mut self, labels: &Labels, first_view: usize) -> Result<(), Invalid> {
        if labels.primitives.is_empty() {
            return Ok(());
        }
        let accessor = |(i, block): (usize, &Block)| {
            let mut accessor = json!({ "bufferView": first_view + i });
            if let (Value::Object(accessor), Value::Object(more)) = (&mut accessor, &block.accessor) {
                accessor.extend(more.clone());
            }
            accessor
        };
        let first = self.append("accessors", labels.blocks.iter().enumerate().map(accessor).collect())?;
        let missing = || Invalid { pointer: "/meshes".into(), reason: "missing".into() };
        let meshes = self.member("meshes").ok_or_else(missing)?.elements()?;
        let mut by_mesh: BTreeMap<usize, Vec<(usize, &Label)>> = BTreeMap::new();
        for (&(mesh, primitive), label) in &labels.primitives {
            by_mesh.entry(mesh).or_default().push((primitive, label));
        }
        for (mesh, list) in by_mesh {
            let mesh = meshes.get(mesh).ok_or_else(missing)?;
            let primitives = mesh.member("primitives")?.ok_or_else(missing)?.elements()?;
            for (primitive, label) in list {
                let primitive = Primitive::new(primitives.get(primitive).ok_or_else(missing)?)?;
                match label {
                    Label::Whole(section) => primitive.label(&mut self.edits, *section)?,
                    Label::PerVertex(vertices) => primitive.relabel(&mut self.edits, vertices, first)?,
                }
            }
        }
        Ok(())
    }
}

/// A primitive in the text.
struct Primitive<'s, 'a> {
    spot: &'s Spot<'a>,
    members: Vec<(String, Spot<'a>)>,
}

impl<'s, 'a> Primitive<'s, 'a> {
    fn new(spot: &'s Spot<'a>) -> Result<Self, Invalid> {
        Ok(Self { spot, members: spot.members()? })
    }

    fn member(&self, key: &str) -> Option<&Spot<'a>> {
        self.members.iter().find_map(|(k, spot)| (k == key).then_some(spot))
    }

    /// All of it belongs to one section.
    fn label(&self, edits: &mut Edits, section: u32) -> Result<(), Invalid> {
        let label = format!("{{\"section\":{section}}}");
        match self.member("extensions") {
            Some(extensions) => edits.add_members(extensions, &[(EXTENSION, label)]),
            None => edits.add_members(self.spot, &[("extensions", format!("{{\"{EXTENSION}\":{label}}}"))]),
        }
    }

    /// Its vertices say it; accessors of `vertices` count from `first`.
    fn relabel(&self, edits: &mut Edits, vertices: &Vertices, first: usize) -> Result<(), Invalid> {
        let mut new = Vec::new();
        if let Some(attributes) = self.member("attributes") {
            let label = (first + vertices.sections).to_string();
            match attributes.member(SECTION_ATTRIBUTE)? {
                Some(stale) => edits.replace(&stale, label),
                None => edits.add_members(attributes, &[(SECTION_ATTRIBUTE, label)])?,
            }
            replace_accessors(edits, attributes, vertices, first)?;
        }
        if let Some(targets) = self.member("targets") {
            for target in targets.elements()? {
                replace_accessors(edits, &target, vertices, first)?;
            }
        }
        let Some(indices) = vertices.indices else { return Ok(()) };
        let indices = (first + indices).to_string();
        match self.member("indices") {
            Some(old) => edits.replace(old, indices),
            None => new.push(("indices", indices)),
        }
        let triangles = Mode::Triangles.as_gl_enum().to_string();
        if let Some(mode) = self.member("mode").filter(|mode| mode.slice() != triangles) {
            edits.replace(mode, triangles);
        }
        if let Some(extensions) = self.member("extensions") {
            let members = extensions.members()?;
            let is_kept = |(name, _): &&(String, Spot<'_>)| !COMPRESSED_COPIES.contains(&name.as_str());
            let kept: Vec<_> = members.iter().filter(is_kept).collect();
            if kept.len() < members.len() {
                let texts: Vec<String> =
                    kept.into_iter().map(|(name, spot)| format!("{}:{}", json!(name), spot.slice())).collect();
                edits.replace(extensions, format!("{{{}}}", texts.join(",")));
            }
        }
        edits.add_members(self.spot, &new)
    }
}

/// Puts the copies in the place of a map's accessors.
fn replace_accessors(edits: &mut Edits, map: &Spot<'_>, vertices: &Vertices, first: usize) -> Result<(), Invalid> {
    for (name, spot) in map.members()? {
        let copy = spot.slice().parse().ok().and_then(|index: usize| vertices.copies.get(&index));
        if let (Some(copy), true) = (copy, name != SECTION_ATTRIBUTE) {
            edits.replace(&spot, (first + copy).to_string());
        }
    }
    Ok(())
}
