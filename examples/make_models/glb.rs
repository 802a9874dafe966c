//! Writes a model as binary glTF 2.0: one node, one mesh, one primitive per part, everything in one buffer.
//! Positions and normals only: nothing here has a picture texture, so texture coordinates would be unused.
//!
//! Source: Khronos, "glTF 2.0 Specification", 2021, sections 3.6 (accessors) and 4.4 (GLB layout).

use glam::DVec3;
use serde_json::{Value, json};

use super::mesh::Mesh;

const GENERATOR: &str = "shadowfit make_models";
const MAGIC: u32 = 0x4654_6C67;
const VERSION: u32 = 2;
const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;
/// Chunks and buffer views start at multiples of this.
const ALIGNMENT: usize = 4;

const COMPONENT_U16: u32 = 5123;
const COMPONENT_U32: u32 = 5125;
const COMPONENT_F32: u32 = 5126;
const TARGET_VERTICES: u32 = 34962;
const TARGET_INDICES: u32 = 34963;

/// A plain matt or glossy colour.
pub struct Material {
    pub name: &'static str,
    /// Red, green, blue in linear light.
    pub base_color: [f64; 3],
    /// 0 mirror to 1 matt.
    pub roughness: f64,
    pub sides: Sides,
}

/// Which sides of a triangle are a surface.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    Front,
    Both,
}

/// The triangles of one material.
pub struct Part {
    pub mesh: Mesh,
    /// Edges sharper than this stay sharp in the shading, degrees.
    pub crease_deg: f64,
    pub material: Material,
}

/// A whole file: metres, Y up.
pub struct Model {
    pub name: &'static str,
    pub parts: Vec<Part>,
}

impl Model {
    /// The file's bytes.
    pub fn to_glb(&self) -> Vec<u8> {
        let mut buffer = BufferBuilder::default();
        let primitives: Vec<Value> = self.parts.iter().enumerate().map(|(i, part)| buffer.push_part(part, i)).collect();
        let materials: Vec<Value> = self.parts.iter().map(|part| part.material.to_json()).collect();
        let document = json!({
            "asset": {"version": "2.0", "generator": GENERATOR},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"name": self.name, "mesh": 0}],
            "meshes": [{"name": self.name, "primitives": primitives}],
            "materials": materials,
            "accessors": buffer.accessors,
            "bufferViews": buffer.views,
            "buffers": [{"byteLength": buffer.bytes.len()}],
        });
        glb_bytes(document.to_string().into_bytes(), buffer.bytes)
    }
}

impl Material {
    fn to_json(&self) -> Value {
        let [r, g, b] = self.base_color;
        let mut material = json!({
            "name": self.name,
            "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": self.roughness},
        });
        if self.sides == Sides::Both {
            material["doubleSided"] = Value::Bool(true);
        }
        material
    }
}

/// The binary chunk with the views and accessors that point into it.
#[derive(Default)]
struct BufferBuilder {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl BufferBuilder {
    /// Appends the part's arrays and returns its primitive.
    fn push_part(&mut self, part: &Part, material: usize) -> Value {
        let shaded = part.mesh.shaded(part.crease_deg);
        let attributes = json!({
            "POSITION": self.push_vectors(&to_f32(&shaded.positions), Bounds::Written),
            "NORMAL": self.push_vectors(&to_f32(&shaded.normals), Bounds::Omitted),
        });
        let indices = self.push_indices(&shaded.indices, shaded.positions.len());
        json!({"attributes": attributes, "indices": indices, "material": material})
    }

    fn push_vectors(&mut self, items: &[[f32; 3]], bounds: Bounds) -> usize {
        let bytes: Vec<u8> = items.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        let view = self.push_view(&bytes, TARGET_VERTICES);
        let mut accessor =
            json!({"bufferView": view, "componentType": COMPONENT_F32, "count": items.len(), "type": "VEC3"});
        if bounds == Bounds::Written {
            let fold = |pick: fn(f32, f32) -> f32, start| -> Vec<f32> {
                (0..3).map(|axis| items.iter().map(|item| item[axis]).fold(start, pick)).collect()
            };
            accessor["min"] = json!(fold(f32::min, f32::INFINITY));
            accessor["max"] = json!(fold(f32::max, f32::NEG_INFINITY));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// 16-bit where every index is below the primitive restart value, else 32-bit.
    fn push_indices(&mut self, indices: &[usize], vertex_count: usize) -> usize {
        let (component, bytes): (u32, Vec<u8>) = if vertex_count <= usize::from(u16::MAX) {
            (COMPONENT_U16, indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect())
        } else {
            (COMPONENT_U32, indices.iter().flat_map(|&i| (i as u32).to_le_bytes()).collect())
        };
        let view = self.push_view(&bytes, TARGET_INDICES);
        self.accessors
            .push(json!({"bufferView": view, "componentType": component, "count": indices.len(), "type": "SCALAR"}));
        self.accessors.len() - 1
    }

    fn push_view(&mut self, bytes: &[u8], target: u32) -> usize {
        self.views
            .push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target}));
        self.bytes.extend_from_slice(bytes);
        pad(&mut self.bytes, 0);
        self.views.len() - 1
    }
}

/// Whether an accessor states its minimum and maximum: positions must.
#[derive(PartialEq, Eq)]
enum Bounds {
    Written,
    Omitted,
}

fn to_f32(items: &[DVec3]) -> Vec<[f32; 3]> {
    items.iter().map(|p| p.as_vec3().to_array()).collect()
}

fn pad(bytes: &mut Vec<u8>, filler: u8) {
    bytes.resize(bytes.len().next_multiple_of(ALIGNMENT), filler);
}

/// Header, JSON chunk (padded with spaces), binary chunk (padded with zeros).
fn glb_bytes(mut json: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    pad(&mut json, b' ');
    pad(&mut binary, 0);
    let length = HEADER_BYTES + 2 * CHUNK_HEADER_BYTES + json.len() + binary.len();
    let mut out = Vec::with_capacity(length);
    for word in [MAGIC, VERSION, length as u32] {
        out.extend_from_slice(&word.to_le_bytes());
    }
    for (kind, chunk) in [(CHUNK_JSON, &json), (CHUNK_BIN, &binary)] {
        out.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        out.extend_from_slice(&kind.to_le_bytes());
        out.extend_from_slice(chunk);
    }
    out
}
