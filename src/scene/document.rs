//! The JSON of a glTF file, as typed records.
//!
//! In: the JSON. Out: a [`Document`], where every index and number is still unchecked against the rest of
//! the file: the stages that use it check it and answer with its JSON pointer.
//!
//! The enumerations (component types, modes, ..) are those of the `gltf` crate, the records are not: it cuts
//! indices to 32 bits without a word, refuses a scene without `nodes` (which is legal), rounds node transforms to
//! f32 and reports errors without a JSON pointer. The tests use its readers as the second opinion.

use super::Fault;
use gltf::json::{
    accessor::{GenericComponentType, IndexComponentType, Type},
    material::AlphaMode,
    mesh::Mode,
    texture::WrappingMode,
    validation::Checked,
};
use serde::{
    Deserialize, Deserializer,
    de::{DeserializeOwned, Error as _},
};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// A value of an enumeration. One that glTF 2.0 does not have is an error only where it is used.
#[derive(Clone, Debug)]
pub(super) struct Listed<T>(Result<T, Value>);

impl<T: Copy> Listed<T> {
    /// The value, if glTF 2.0 has it.
    pub(super) fn known(&self) -> Option<T> {
        self.0.as_ref().ok().copied()
    }

    /// The value, which stands at `pointer`.
    ///
    /// # Errors
    /// glTF 2.0 does not have it.
    pub(super) fn get(&self, pointer: &str) -> Result<T, Fault> {
        let unknown = |value: &Value| Fault::new(pointer, format!("{value}, but glTF 2.0 has no such value"));
        self.0.as_ref().copied().map_err(unknown)
    }
}

impl<'de, T> Deserialize<'de> for Listed<T>
where
    Checked<T>: DeserializeOwned,
{
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        // The crate looks at the lower 32 bits only.
        let is_whole = value.as_u64().is_none_or(|code| u32::try_from(code).is_ok());
        Ok(Self(match Checked::<T>::deserialize(&value).map_err(D::Error::custom)? {
            Checked::Valid(known) if is_whole => Ok(known),
            _ => Err(value),
        }))
    }
}

/// Extension objects by name.
pub(super) type Extensions = Map<String, Value>;

/// What the reader uses of a glTF file.
#[derive(Debug, Default)]
pub(super) struct Document {
    /// Typed views of binary data.
    pub accessors: Vec<Accessor>,
    /// Byte ranges of buffers.
    pub buffer_views: Vec<BufferView>,
    /// Blocks of bytes.
    pub buffers: Vec<Buffer>,
    /// Pictures.
    pub images: Vec<Image>,
    /// Surfaces.
    pub materials: Vec<Material>,
    /// Lists of primitives.
    pub meshes: Vec<Mesh>,
    /// The node hierarchy.
    pub nodes: Vec<Node>,
    /// Texture wrapping.
    pub samplers: Vec<Sampler>,
    /// Lists of root nodes.
    pub scenes: Vec<Scene>,
    /// The default scene.
    pub scene: Option<usize>,
    /// Joints.
    pub skins: Vec<Skin>,
    /// Images with samplers.
    pub textures: Vec<Texture>,
    /// Number of animations; nothing else of them is read.
    pub animations: usize,
    /// Extensions that the file uses.
    pub extensions_used: Vec<String>,
    /// Extensions without which the file means nothing.
    pub extensions_required: Vec<String>,
}

/// `accessors[i]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub buffer_view: Option<usize>,
    #[serde(default)]
    pub byte_offset: u64,
    pub component_type: Listed<GenericComponentType>,
    #[serde(default)]
    pub normalized: bool,
    pub count: u64,
    #[serde(rename = "type")]
    pub kind: Listed<Type>,
    pub sparse: Option<Sparse>,
}

/// `accessors[i].sparse`.
#[derive(Debug, Deserialize)]
pub(super) struct Sparse {
    pub count: u64,
    pub indices: SparseIndices,
    pub values: SparseValues,
}

/// `accessors[i].sparse.indices`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub buffer_view: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub component_type: Listed<IndexComponentType>,
}

/// `accessors[i].sparse.values`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub buffer_view: usize,
    #[serde(default)]
    pub byte_offset: u64,
}

/// `bufferViews[i]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: Option<u64>,
    #[serde(default)]
    pub extensions: Extensions,
}

/// `buffers[i]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub uri: Option<String>,
    pub byte_length: u64,
    #[serde(default)]
    pub extensions: Extensions,
}

/// `images[i]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Image {
    pub uri: Option<String>,
    pub buffer_view: Option<usize>,
}

/// `textures[i]`.
#[derive(Debug, Deserialize)]
pub(super) struct Texture {
    pub sampler: Option<usize>,
    pub source: Option<usize>,
    #[serde(default)]
    pub extensions: Extensions,
}

/// `samplers[i]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Sampler {
    pub wrap_s: Option<Listed<WrappingMode>>,
    pub wrap_t: Option<Listed<WrappingMode>>,
}

/// `materials[i]`.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Material {
    pub alpha_cutoff: Option<f64>,
    pub alpha_mode: Option<Listed<AlphaMode>>,
    pub double_sided: bool,
    pub pbr_metallic_roughness: Pbr,
}

/// `materials[i].pbrMetallicRoughness`.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Pbr {
    pub base_color_factor: Option<[f64; 4]>,
    pub base_color_texture: Option<TextureInfo>,
}

/// A reference to a texture.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub index: usize,
    #[serde(default)]
    pub tex_coord: usize,
    #[serde(default)]
    pub extensions: Extensions,
}

/// The extension `KHR_texture_transform` of a [`TextureInfo`].
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct TextureTransform {
    pub offset: Option<[f64; 2]>,
    pub rotation: f64,
    pub scale: Option<[f64; 2]>,
    pub tex_coord: Option<usize>,
}

/// `meshes[i]`.
#[derive(Debug, Deserialize)]
pub(super) struct Mesh {
    pub primitives: Vec<Primitive>,
    #[serde(default)]
    pub weights: Vec<f64>,
}

/// `meshes[i].primitives[j]`.
#[derive(Debug, Deserialize)]
pub(super) struct Primitive {
    #[serde(default)]
    pub attributes: BTreeMap<String, usize>,
    pub indices: Option<usize>,
    pub material: Option<usize>,
    pub mode: Option<Listed<Mode>>,
    #[serde(default)]
    pub targets: Vec<BTreeMap<String, usize>>,
    #[serde(default)]
    pub extensions: Extensions,
}

/// `nodes[i]`.
#[derive(Debug, Deserialize)]
pub(super) struct Node {
    #[serde(default)]
    pub children: Vec<usize>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    pub mesh: Option<usize>,
    pub skin: Option<usize>,
    pub weights: Option<Vec<f64>>,
    #[serde(default)]
    pub extensions: Extensions,
}

/// The extension `EXT_mesh_gpu_instancing` of a [`Node`].
#[derive(Debug, Deserialize)]
pub(super) struct Instancing {
    pub attributes: BTreeMap<String, usize>,
}

/// `scenes[i]`.
#[derive(Debug, Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub nodes: Vec<usize>,
}

/// `skins[i]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Skin {
    pub inverse_bind_matrices: Option<usize>,
    pub joints: Vec<usize>,
}

impl Document {
    /// Takes the records out of the JSON of a glTF file.
    ///
    /// # Errors
    /// A record of the wrong shape.
    pub(super) fn parse(root: &Value) -> Result<Self, Fault> {
        Ok(Self {
            accessors: list(root, "accessors")?,
            buffer_views: list(root, "bufferViews")?,
            buffers: list(root, "buffers")?,
            images: list(root, "images")?,
            materials: list(root, "materials")?,
            meshes: list(root, "meshes")?,
            nodes: list(root, "nodes")?,
            samplers: list(root, "samplers")?,
            scenes: list(root, "scenes")?,
            scene: root.get("scene").map(|value| record(value, "/scene")).transpose()?,
            skins: list(root, "skins")?,
            textures: list(root, "textures")?,
            animations: root.get("animations").and_then(Value::as_array).map_or(0, Vec::len),
            extensions_used: list(root, "extensionsUsed")?,
            extensions_required: list(root, "extensionsRequired")?,
        })
    }
}

/// A record at `pointer`; an error names the innermost value of the wrong shape.
pub(super) fn record<T: DeserializeOwned>(value: &Value, pointer: &str) -> Result<T, Fault> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        use serde_path_to_error::Segment;
        let mut inner = pointer.to_owned();
        for segment in error.path() {
            match segment {
                Segment::Seq { index } => inner += &format!("/{index}"),
                Segment::Map { key } => inner += &format!("/{}", key.replace('~', "~0").replace('/', "~1")),
                Segment::Enum { .. } | Segment::Unknown => {}
            }
        }
        Fault::new(inner, error.inner().to_string())
    })
}

/// The records of a top-level list; an absent list is empty.
fn list<T: DeserializeOwned>(root: &Value, key: &str) -> Result<Vec<T>, Fault> {
    match root.get(key) {
        None => Ok(Vec::new()),
        Some(Value::Array(values)) => {
            values.iter().enumerate().map(|(i, value)| record(value, &format!("/{key}/{i}"))).collect()
        }
        Some(_) => Err(Fault::new(format!("/{key}"), "not a list")),
    }
}
