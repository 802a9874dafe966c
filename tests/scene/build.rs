//! Builds small glTF files in memory.

use serde_json::{Map, Value, json};
use shadowfit::scene::{Scene, SceneError, load};
use std::{fs, path::Path};
use tempfile::TempDir;

pub const BYTE: u32 = 5120;
pub const UBYTE: u32 = 5121;
pub const SHORT: u32 = 5122;
pub const USHORT: u32 = 5123;
pub const UINT: u32 = 5125;
pub const FLOAT: u32 = 5126;

/// The JSON and the binary chunk of a model.
#[derive(Clone)]
pub struct Model {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Model {
    /// No meshes; one buffer, the binary chunk.
    pub fn empty() -> Self {
        let lists = ["accessors", "bufferViews", "meshes", "nodes", "materials", "textures", "images", "samplers"];
        let mut json = json!({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 0}]});
        for list in lists {
            json[list] = json!([]);
        }
        Self { json, bin: Vec::new() }
    }

    /// One triangle (0,0,0), (1,0,0), (0,1,0), drawn by node 0.
    pub fn triangle() -> Self {
        let mut model = Self::empty();
        let position = model.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        model.mesh(json!({"POSITION": position}));
        model.push("nodes", json!({"mesh": 0}));
        model
    }

    /// A mesh of one primitive with those attributes.
    pub fn mesh(&mut self, attributes: Value) -> usize {
        self.push("meshes", json!({"primitives": [{"attributes": attributes}]}))
    }

    /// Primitive 0 of mesh 0.
    pub fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// Appends to a top-level list and returns the index.
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json.as_object_mut().unwrap().entry(list).or_insert(json!([])).as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// Appends bytes and a view of them.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    /// An accessor with a view of its own.
    pub fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": kind, "count": count}))
    }

    /// An accessor of floats.
    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        self.accessor(FLOAT, kind, values.len() / width, bytemuck::cast_slice(values))
    }

    /// An accessor of 16-bit numbers.
    pub fn shorts(&mut self, component: u32, kind: &str, count: usize, values: &[u16]) -> usize {
        self.accessor(component, kind, count, bytemuck::cast_slice(values))
    }

    /// A PNG as an embedded image with a texture.
    pub fn texture(&mut self, image: &image::RgbaImage) -> usize {
        let view = self.view(&png(image));
        let source = self.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
        self.push("textures", json!({"source": source}))
    }

    /// A textured material on primitive 0, with texture coordinates for its three corners.
    pub fn textured(&mut self, texture: usize, mut material: Value) -> &mut Self {
        let uv = self.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
        let pbr = material.as_object_mut().unwrap().entry("pbrMetallicRoughness").or_insert(json!({}));
        pbr["baseColorTexture"] = json!({"index": texture});
        let material = self.push("materials", material);
        self.primitive()["material"] = json!(material);
        self.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
        self
    }

    /// The JSON text with the buffer's length filled in, empty lists left out.
    pub fn text(&self) -> String {
        let mut json = self.json.clone();
        if json["buffers"][0]["byteLength"] == json!(0) {
            json["buffers"][0]["byteLength"] = json!(self.bin.len());
        }
        let kept: Map<String, Value> =
            json.as_object().unwrap().clone().into_iter().filter(|(_, value)| *value != json!([])).collect();
        Value::Object(kept).to_string()
    }

    /// The GLB.
    pub fn glb(&self) -> Vec<u8> {
        glb(self.text().as_bytes(), &self.bin)
    }

    /// Writes `model.glb` and reads it.
    pub fn load(&self) -> Result<Scene, SceneError> {
        load_bytes("model.glb", &self.glb())
    }

    /// Reads the model, which must be well.
    pub fn scene(&self) -> Scene {
        self.load().unwrap_or_else(|error| panic!("{error}\n{}", self.text()))
    }
}

/// A GLB of two chunks, written by the `gltf` crate: the second opinion about the container.
pub fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    // The header's numbers are filled in on writing.
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    gltf::binary::Glb { header, json: json.into(), bin: Some(bin.into()) }.to_vec().unwrap()
}

/// A PNG in memory.
pub fn png(image: &image::RgbaImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Writes one file into a fresh folder and reads it.
pub fn load_bytes(name: &str, bytes: &[u8]) -> Result<Scene, SceneError> {
    let folder = TempDir::new().unwrap();
    load_in(folder.path(), name, bytes)
}

/// Writes one file into a folder and reads it.
pub fn load_in(folder: &Path, name: &str, bytes: &[u8]) -> Result<Scene, SceneError> {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    load(&path)
}

/// The entry of a kind among the notices.
pub fn skipped(scene: &Scene, what: &str) -> usize {
    scene.skipped.iter().find(|skipped| skipped.what == what).map_or(0, |skipped| skipped.count)
}
