//! Sections as labels of the model's primitives.
//!
//! In: the input model, and the section of every triangle of its scene. Out: what each primitive has to say, and new
//! accessors with their bytes. A primitive of one section gets a label. One of several sections gets the vertex
//! attribute `_SHADOW_SECTION`; where triangles of different sections share a vertex it is stored once a section, so
//! that all three corners of a triangle carry the same number, whichever of them a GPU takes. Then the primitive gets
//! copies of the vertices that it uses, in their order, the additional ones behind them, and a list of triangles in
//! the order of the reader (strips and fans become lists): the scene stays the same to the last bit.
//!
//! It stays one primitive, one draw. Cost: the primitive's vertices are in the file twice, since the bytes of the
//! input are not touched. An attribute that cannot be read keeps its old accessor, as broken as it was.

use super::{AssetError, AssetRequest};
use crate::{
    gltf_file::{GltfFile, MAX_FILE_BYTES, SECTION_ATTRIBUTE},
    scene::raw::{Bounded, Corners, RawFile},
};
use serde_json::{Value, json};
use std::collections::{BTreeMap, HashMap};

/// Vertices that a primitive may leave unused for each one that it uses before its label gets copies of the used
/// ones: a label is 4 bytes, a vertex with position, normal and texture coordinates 32.
const UNUSED_PER_USED: u64 = 8;

/// GPUs take the index 65535 of 16 bits as "start again" (glTF 2.0 specification, section 3.7.2.1).
const MAX_U16_VERTICES: usize = 0xffff;

/// No section, no vertex yet.
const NONE: u32 = u32::MAX;

/// Labels of all primitives that the scene shows.
#[derive(Clone, Debug, Default)]
pub(super) struct Labels {
    /// By mesh and primitive.
    pub primitives: BTreeMap<(usize, usize), Label>,
    /// New accessors, each in a buffer view of its own.
    pub blocks: Vec<Block>,
    /// Bytes of them.
    total: u64,
}

/// What one primitive has to say.
#[derive(Clone, Debug)]
pub(super) enum Label {
    /// All of it belongs to that section.
    Whole(u32),
    /// Its vertices say it.
    PerVertex(Vertices),
}

/// New accessors of a primitive, as indices into [`Labels::blocks`].
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    /// `_SHADOW_SECTION`.
    pub sections: usize,
    /// The others by the index of the accessor whose place they take; empty where vertices stay as they are.
    pub copies: BTreeMap<usize, usize>,
    /// A list of triangles, where vertices got new numbers.
    pub indices: Option<usize>,
}

/// An accessor with its buffer view and bytes.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// The record but `bufferView`.
    pub accessor: Value,
    /// The view's record but `buffer`, `byteOffset` and `byteLength`.
    pub view: Value,
    /// The elements.
    pub bytes: Vec<u8>,
}

impl Labels {
    /// Labels for the sections of `request`; none where the model has one section.
    ///
    /// # Errors
    /// Sections that do not fit the set or the scene, or more bytes than a GLB holds.
    pub(super) fn new(request: &AssetRequest<'_>, file: &GltfFile<'_>) -> Result<Self, AssetError> {
        let mut labels = Self::default();
        if request.set.model_sections() <= 1 {
            return Ok(labels);
        }
        let mut raw = None;
        for ((mesh, primitive), sections) in by_primitive(request)? {
            let first = sections[0];
            let label = if sections.iter().all(|section| *section == first) {
                Label::Whole(first)
            } else {
                let raw = match &mut raw {
                    Some(raw) => raw,
                    none => none.insert(RawFile::load(file).map_err(|fault| AssetError::invalid(file.path(), fault))?),
                };
                let corners = raw.corners(mesh, primitive).map_err(|fault| AssetError::invalid(file.path(), fault))?;
                let record = file.root().pointer(&format!("/meshes/{mesh}/primitives/{primitive}"));
                Label::PerVertex(labels.relabel(raw, record.unwrap_or(&Value::Null), &corners, &sections)?)
            };
            labels.primitives.insert((mesh, primitive), label);
        }
        Ok(labels)
    }

    /// New accessors for a primitive of several sections.
    fn relabel(
        &mut self,
        raw: &RawFile<'_>,
        record: &Value,
        corners: &Corners,
        sections: &[u32],
    ) -> Result<Vertices, AssetError> {
        if sections.len() != corners.triangles {
            let why = format!("{} for a primitive of {} triangles", sections.len(), corners.triangles);
            return Err(AssetError::Sections { why });
        }
        let numbers = Numbers::new(corners, sections);
        if !numbers.differ(corners) {
            let mut of_vertex = vec![0; corners.vertex_count as usize];
            for (vertex, section) in numbers.vertices.iter().zip(&numbers.sections) {
                of_vertex[*vertex as usize] = *section;
            }
            return Ok(Vertices { sections: self.push_sections(&of_vertex)?, ..Vertices::default() });
        }
        let mut out = Vertices { sections: self.push_sections(&numbers.sections)?, ..Vertices::default() };
        for (accessor, bounded) in accessors(record) {
            let Some(copy) = raw.elements(accessor, &numbers.vertices, bounded) else { continue };
            let mut view = json!({ "target": gltf::json::buffer::Target::ArrayBuffer });
            if copy.stride != copy.size {
                view["byteStride"] = json!(copy.stride);
            }
            let block = Block { accessor: copy.accessor, view, bytes: copy.bytes };
            out.copies.insert(accessor, self.push(block)?);
        }
        out.indices = Some(self.push_indices(&numbers)?);
        Ok(out)
    }

    fn push_sections(&mut self, sections: &[u32]) -> Result<usize, AssetError> {
        // f32 is what every tool and GPU takes as an attribute, and exact up to 2^24.
        let bytes = sections.iter().flat_map(|section| (*section as f32).to_le_bytes()).collect();
        let accessor = json!({ "componentType": gltf::json::accessor::ComponentType::F32.as_gl_enum(),
            "count": sections.len(), "type": "SCALAR" });
        self.push(Block { accessor, view: json!({ "target": gltf::json::buffer::Target::ArrayBuffer }), bytes })
    }

    fn push_indices(&mut self, numbers: &Numbers) -> Result<usize, AssetError> {
        use gltf::json::accessor::ComponentType;
        let corners = &numbers.corners;
        let (component, bytes): (_, Vec<u8>) = if numbers.vertices.len() <= MAX_U16_VERTICES {
            (ComponentType::U16, corners.iter().flat_map(|corner| (*corner as u16).to_le_bytes()).collect())
        } else {
            (ComponentType::U32, corners.iter().flat_map(|corner| corner.to_le_bytes()).collect())
        };
        let accessor = json!({ "componentType": component.as_gl_enum(), "count": corners.len(), "type": "SCALAR" });
        self.push(Block { accessor, view: json!({ "target": gltf::json::buffer::Target::ElementArrayBuffer }), bytes })
    }

    fn push(&mut self, block: Block) -> Result<usize, AssetError> {
        self.total += block.bytes.len() as u64;
        if self.total > MAX_FILE_BYTES {
            let why = format!("the labels need more than the {MAX_FILE_BYTES} bytes that a GLB holds");
            return Err(AssetError::Sections { why });
        }
        self.blocks.push(block);
        Ok(self.blocks.len() - 1)
    }
}

/// The sections of the triangles of each primitive.
fn by_primitive(request: &AssetRequest<'_>) -> Result<BTreeMap<(usize, usize), Vec<u32>>, AssetError> {
    let (origins, section_of) = (request.origins, request.section_of);
    let fault = |why: String| Err(AssetError::Sections { why });
    if origins.len() != section_of.len() || origins.is_empty() {
        return fault(format!("{} for {} triangles of the scene", section_of.len(), origins.len()));
    }
    let count = request.set.model_sections();
    let mut primitives: BTreeMap<(usize, usize), Vec<u32>> = BTreeMap::new();
    for (triangle, (origin, &section)) in origins.iter().zip(section_of).enumerate() {
        if section as usize >= count {
            return fault(format!("triangle {triangle} is in section {section}, but there are {count}"));
        }
        let sections = primitives.entry((origin.mesh as usize, origin.primitive as usize)).or_default();
        let at = origin.triangle as usize;
        if sections.len() <= at {
            sections.resize(at + 1, NONE);
        }
        if sections[at] != NONE && sections[at] != section {
            let [a, b] = [sections[at], section];
            return fault(format!("copies of {origin:?} are in {a} and {b}: all copies of a mesh share their labels"));
        }
        sections[at] = section;
    }
    match primitives.iter().find(|(_, sections)| sections.contains(&NONE)) {
        Some(((mesh, primitive), _)) => fault(format!("mesh {mesh}, primitive {primitive}: a triangle has none")),
        None => Ok(primitives),
    }
}

/// The accessors of a primitive's vertices, and whether they are positions.
fn accessors(record: &Value) -> BTreeMap<usize, Bounded> {
    let targets = record.get("targets").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let mut found = BTreeMap::new();
    for attributes in record.get("attributes").into_iter().chain(targets).filter_map(Value::as_object) {
        for (name, index) in attributes.iter().filter(|(name, _)| *name != SECTION_ATTRIBUTE) {
            let Some(index) = index.as_u64() else { continue };
            let bounded = found.entry(index as usize).or_insert(Bounded::No);
            if name == "POSITION" {
                *bounded = Bounded::Yes;
            }
        }
    }
    found
}

/// New numbers of a primitive's vertices.
struct Numbers {
    /// The old vertex of each new one: those that are used in their order, then the additional ones.
    vertices: Vec<u32>,
    /// The section of each new one.
    sections: Vec<u32>,
    /// New vertices of the corners.
    corners: Vec<u32>,
    /// Vertices that are used.
    used: usize,
}

impl Numbers {
    fn new(corners: &Corners, sections: &[u32]) -> Self {
        let mut vertices = corners.vertices.clone();
        vertices.sort_unstable();
        vertices.dedup();
        let used = vertices.len();
        let mut section_of = vec![NONE; used];
        let mut more: HashMap<(usize, u32), u32> = HashMap::new();
        let mut renumbered = Vec::with_capacity(corners.vertices.len());
        for (corner, vertex) in corners.vertices.iter().enumerate() {
            // Every used vertex is in the list.
            let rank = vertices[..used].binary_search(vertex).unwrap_or_default();
            // Corners behind the last whole triangle go with any section.
            let Some(&section) = sections.get(corner / 3) else {
                renumbered.push(rank as u32);
                continue;
            };
            // The first section that uses a vertex keeps it.
            if section_of[rank] == NONE {
                section_of[rank] = section;
            }
            if section_of[rank] == section {
                renumbered.push(rank as u32);
                continue;
            }
            let number = *more.entry((rank, section)).or_insert_with(|| {
                vertices.push(*vertex);
                section_of.push(section);
                vertices.len() as u32 - 1
            });
            renumbered.push(number);
        }
        let sections = section_of.into_iter().map(|section| if section == NONE { 0 } else { section }).collect();
        Self { vertices, sections, corners: renumbered, used }
    }

    /// Must vertices get new numbers? Where no two sections share one they need not, but they may where the primitive
    /// uses few of many.
    fn differ(&self, corners: &Corners) -> bool {
        self.vertices.len() > self.used || corners.vertex_count > (1 + UNUSED_PER_USED) * self.used as u64
    }
}
