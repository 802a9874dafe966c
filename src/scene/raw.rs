//! Primitives as the file stores them, for a writer that gives their vertices new numbers.
//!
//! In: a document. Out: the vertex of every corner in the order in which [`super::load`] makes triangles, and copies
//! of chosen elements of an accessor byte for byte, sparse ones resolved. Elements of vertex attributes start at
//! multiples of four bytes (glTF 2.0 specification, section 3.6.2.4).

use super::{
    Fault,
    accessor::{Data, Use},
    buffers::Buffers,
    document::Document,
    primitive::{corner_numbers, triangle_count},
};
use crate::gltf_file::{GltfFile, Invalid};
use gltf::json::{accessor::Type, mesh::Mode};
use serde_json::{Value, json};

/// A document with its buffers.
pub(crate) struct RawFile<'a> {
    document: Document,
    buffers: Buffers<'a>,
}

/// The corners of a primitive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Corners {
    /// Vertices, three a triangle; then those that make no whole triangle.
    pub vertices: Vec<u32>,
    /// Number of triangles.
    pub triangles: usize,
    /// Elements of POSITION.
    pub vertex_count: u64,
}

/// Elements of an accessor, copied.
#[derive(Clone, Debug)]
pub(crate) struct Elements {
    /// The new accessor's members but `bufferView`.
    pub accessor: Value,
    /// Bytes from one element to the next.
    pub stride: usize,
    /// Bytes of one element.
    pub size: usize,
    /// The elements.
    pub bytes: Vec<u8>,
}

impl<'a> RawFile<'a> {
    /// Opens the document and loads its buffers.
    ///
    /// # Errors
    /// What [`super::load`] finds wrong with either.
    pub(crate) fn load(file: &GltfFile<'a>) -> Result<Self, Invalid> {
        let document = Document::parse(file.root()).map_err(Invalid::from)?;
        let buffers = Buffers::load(file, &document).map_err(Invalid::from)?;
        Ok(Self { document, buffers })
    }

    /// The corners of a primitive that has triangles.
    ///
    /// # Errors
    /// There is none, or it is not as the specification wants it.
    pub(crate) fn corners(&self, mesh: usize, primitive: usize) -> Result<Corners, Invalid> {
        let pointer = format!("/meshes/{mesh}/primitives/{primitive}");
        self.open_corners(mesh, primitive, &pointer).map_err(Invalid::from)
    }

    fn open_corners(&self, mesh: usize, primitive: usize, pointer: &str) -> Result<Corners, Fault> {
        let missing = || Fault::new(pointer, "no such primitive with triangles");
        let record = self.document.meshes.get(mesh).and_then(|mesh| mesh.primitives.get(primitive));
        let record = record.ok_or_else(missing)?;
        let mode = match &record.mode {
            Some(mode) => mode.get(&format!("{pointer}/mode"))?,
            None => Mode::Triangles,
        };
        let data = self.data();
        let position = *record.attributes.get("POSITION").ok_or_else(missing)?;
        let positions = data.accessor(position, pointer, Type::Vec3, Use::Number)?;
        let user = format!("{pointer}/indices");
        let indices = record.indices.map(|i| data.accessor(i, &user, Type::Scalar, Use::Index)).transpose()?;
        let count = indices.as_ref().map_or(positions.count, |indices| indices.count);
        let triangles = triangle_count(mode, count);
        // Strips and fans leave no corner over.
        let rest = if mode == Mode::Triangles { 3 * triangles..count } else { 0..0 };
        let numbers = (0..triangles).flat_map(|t| corner_numbers(mode, t)).chain(rest);
        let vertex = |number: u64| match &indices {
            Some(indices) => indices.get_index(number),
            None => Some(number),
        };
        let outside = |vertex: Option<u64>| match vertex {
            Some(vertex) if vertex < positions.count => u32::try_from(vertex).map_err(|_| missing()),
            _ => Err(Fault::new(user.as_str(), format!("a vertex outside the {} of POSITION", positions.count))),
        };
        let vertices = numbers.map(|number| outside(vertex(number))).collect::<Result<_, _>>()?;
        Ok(Corners { vertices, triangles: triangles as usize, vertex_count: positions.count })
    }

    /// Elements of accessor `index`, zeros past its end; `None` where it cannot be read. `bounded` adds `min` and
    /// `max`, which only three-dimensional ones can have here.
    pub(crate) fn elements(&self, index: usize, vertices: &[u32], bounded: Bounded) -> Option<Elements> {
        let record = self.document.accessors.get(index)?;
        let kind = record.kind.known()?;
        let accessor = self.data().accessor(index, "", kind, Use::Number).ok()?;
        let size = accessor.element_size();
        let stride = size.next_multiple_of(4);
        let mut bytes = Vec::with_capacity(stride * vertices.len());
        for &vertex in vertices {
            let start = bytes.len();
            bytes.extend_from_slice(accessor.bytes(u64::from(vertex)).unwrap_or_default());
            bytes.resize(start + stride, 0);
        }
        let code = record.component_type.known()?.0.as_gl_enum();
        let mut copy = json!({ "componentType": code, "count": vertices.len(), "type": kind });
        if record.normalized {
            copy["normalized"] = json!(true);
        }
        if bounded == Bounded::Yes && kind == Type::Vec3 {
            let bounds = accessor.bounds(vertices)?;
            // Bounds are spelled like the components: integers without a point.
            let spelled = |x: f64| if accessor.is_float() { json!(x) } else { json!(x as i64) };
            // JSON has no infinity. A morph target that is never used may have one.
            if bounds.as_flattened().iter().all(|x| x.is_finite()) {
                copy["min"] = json!(bounds[0].map(spelled));
                copy["max"] = json!(bounds[1].map(spelled));
            }
        }
        Some(Elements { accessor: copy, stride, size, bytes })
    }

    fn data(&self) -> Data<'_> {
        Data { document: &self.document, buffers: &self.buffers }
    }
}

/// Must a copy say `min` and `max`? POSITION must.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bounded {
    /// Yes.
    Yes,
    /// No.
    No,
}
