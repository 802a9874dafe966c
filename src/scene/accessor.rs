//! Accessors: typed elements in the buffers.
//!
//! In: an accessor's index. Out: an [`Accessor`] that decodes one element at a time, so that a small file with a
//! huge `count` costs no memory. Opening checks once that every element lies inside its buffer view and every
//! view inside its buffer; decoding afterwards only checks the element's number.
//!
//! Covers strides, sparse accessors, accessors without a buffer view (zeros), and integers, normalised or not
//! (`KHR_mesh_quantization`; glTF 2.0 specification, sections 3.6 and 3.11). Alignment is not demanded: elements
//! are read bytewise.

use super::{
    Fault,
    buffers::Buffers,
    document::{self, Document, Listed},
    extensions,
};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type, VALID_INDEX_TYPES};
use serde_json::json;

/// A document with its buffers.
pub(super) struct Data<'a> {
    /// The JSON.
    pub document: &'a Document,
    /// The bytes.
    pub buffers: &'a Buffers<'a>,
}

/// The number in the first bytes; `None` where there are too few.
fn decode(component: ComponentType, bytes: &[u8], normalized: bool) -> Option<f64> {
    use ComponentType as C;
    let (value, largest) = match component {
        C::I8 => (f64::from(i8::from_le_bytes(*bytes.first_chunk()?)), f64::from(i8::MAX)),
        C::U8 => (f64::from(u8::from_le_bytes(*bytes.first_chunk()?)), f64::from(u8::MAX)),
        C::I16 => (f64::from(i16::from_le_bytes(*bytes.first_chunk()?)), f64::from(i16::MAX)),
        C::U16 => (f64::from(u16::from_le_bytes(*bytes.first_chunk()?)), f64::from(u16::MAX)),
        C::U32 => (f64::from(u32::from_le_bytes(*bytes.first_chunk()?)), f64::from(u32::MAX)),
        C::F32 => return Some(f64::from(f32::from_le_bytes(*bytes.first_chunk()?))),
    };
    Some(if normalized { (value / largest).max(-1.0) } else { value })
}

/// What the components of an accessor may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// Any number; integers as `normalized` says.
    Number,
    /// u8, u16 or u32, never normalised.
    Index,
}

/// An opened accessor.
#[derive(Debug)]
pub(super) struct Accessor<'a> {
    /// Index in the document.
    pub index: usize,
    /// Number of elements.
    pub count: u64,
    component: ComponentType,
    width: usize,
    size: usize,
    normalized: bool,
    base: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
}

/// Elements at equal distances, all of them inside `bytes`.
#[derive(Debug)]
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Strided<'a> {
    fn element(&self, i: u64) -> Option<&'a [u8]> {
        self.bytes.get(usize::try_from(i).ok()?.checked_mul(self.stride)?..)
    }
}

/// Elements that replace those of the base. `indices` ascend.
#[derive(Debug)]
struct Sparse<'a> {
    indices: Vec<u64>,
    values: Strided<'a>,
}

impl Accessor<'_> {
    /// The JSON pointer.
    pub(super) fn pointer(&self) -> String {
        format!("/accessors/{}", self.index)
    }

    /// Bytes of an element.
    pub(super) fn element_size(&self) -> usize {
        self.size
    }

    /// Are the components floating-point numbers?
    pub(super) fn is_float(&self) -> bool {
        self.component == ComponentType::F32
    }

    /// The bytes of element `i`; `None` past the end, and where no buffer view gives any (they are zeros).
    pub(super) fn bytes(&self, i: u64) -> Option<&[u8]> {
        if i >= self.count {
            return None;
        }
        let replaced = self.sparse.as_ref().and_then(|sparse| {
            let at = sparse.indices.binary_search(&i).ok()?;
            sparse.values.element(at as u64)
        });
        replaced.or_else(|| self.base.as_ref().and_then(|base| base.element(i)))?.get(..self.size)
    }

    /// Least and largest components of some elements, as stored: integers not normalised.
    pub(super) fn bounds(&self, elements: &[u32]) -> Option<[[f64; 3]; 2]> {
        let raw = |i: u32| {
            let bytes = self.bytes(u64::from(i));
            let component = |c: usize| match bytes {
                Some(bytes) => decode(self.component, bytes.get(c * self.component.size()..)?, false),
                None => Some(0.0),
            };
            Some([component(0)?, component(1)?, component(2)?])
        };
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for &i in elements {
            for (c, x) in raw(i)?.into_iter().enumerate() {
                bounds[0][c] = bounds[0][c].min(x);
                bounds[1][c] = bounds[1][c].max(x);
            }
        }
        Some(bounds)
    }

    /// The first `N` components of element `i`, or `None` past the end.
    pub(super) fn get<const N: usize>(&self, i: u64) -> Option<[f64; N]> {
        if i >= self.count || N > self.width {
            return None;
        }
        let Some(bytes) = self.bytes(i) else { return Some([0.0; N]) };
        let mut element = [0.0; N];
        for (c, value) in element.iter_mut().enumerate() {
            *value = decode(self.component, bytes.get(c * self.component.size()..)?, self.normalized)?;
        }
        Some(element)
    }

    /// Element `i` of an accessor opened for [`Use::Index`].
    pub(super) fn get_index(&self, i: u64) -> Option<u64> {
        self.get::<1>(i).map(|[value]| value as u64)
    }
}

impl<'a> Data<'a> {
    /// Opens accessor `index`, which `user` (a JSON pointer) refers to. `kind` is the wanted `type`.
    ///
    /// # Errors
    /// An index, type or component that is wrong, bytes outside the buffer, or compressed data.
    pub(super) fn accessor(&self, index: usize, user: &str, kind: Type, usage: Use) -> Result<Accessor<'a>, Fault> {
        let Some(record) = self.document.accessors.get(index) else {
            return Err(Fault::index(user, index, "accessors", self.document.accessors.len()));
        };
        let pointer = format!("/accessors/{index}");
        let type_pointer = format!("{pointer}/type");
        let found = record.kind.get(&type_pointer)?;
        if found != kind {
            return Err(Fault::new(type_pointer, format!("{}, but {user} needs {}", json!(found), json!(kind))));
        }
        let width = kind.multiplicity();
        let component = component(&record.component_type, &format!("{pointer}/componentType"), usage)?;
        let size = element_size(kind, component);
        let base = match record.buffer_view {
            Some(view) => Some(self.strided(&Range {
                user: format!("{pointer}/bufferView"),
                owner: pointer.clone(),
                view,
                offset: record.byte_offset,
                count: record.count,
                size,
                strided: true,
            })?),
            None => None,
        };
        let sparse = record.sparse.as_ref().map(|s| self.sparse(s, &pointer, record.count, size)).transpose()?;
        let normalized = record.normalized && usage == Use::Number;
        Ok(Accessor { index, count: record.count, component, width, size, normalized, base, sparse })
    }

    /// Opens the sparse part of the accessor at `pointer`, whose elements have `size` bytes.
    fn sparse(&self, record: &document::Sparse, pointer: &str, count: u64, size: usize) -> Result<Sparse<'a>, Fault> {
        let at = format!("{pointer}/sparse/indices");
        let component = record.indices.component_type.get(&format!("{at}/componentType"))?.0;
        let numbers = self.strided(&Range {
            user: format!("{at}/bufferView"),
            owner: at.clone(),
            view: record.indices.buffer_view,
            offset: record.indices.byte_offset,
            count: record.count,
            size: component.size(),
            strided: false,
        })?;
        let owner = format!("{pointer}/sparse/values");
        let values = self.strided(&Range {
            user: format!("{owner}/bufferView"),
            owner,
            view: record.values.buffer_view,
            offset: record.values.byte_offset,
            count: record.count,
            size,
            strided: false,
        })?;
        // The count is honest now: that many numbers are in the buffer.
        let mut indices: Vec<u64> = Vec::new();
        for i in 0..record.count {
            let index = numbers.element(i).and_then(|bytes| decode(component, bytes, false)).unwrap_or(0.0) as u64;
            if index >= count {
                return Err(Fault::new(at, format!("index {index} at {i}, but the accessor has {count} elements")));
            }
            if indices.last().is_some_and(|last| *last >= index) {
                return Err(Fault::new(at, format!("index {index} at {i} does not ascend")));
            }
            indices.push(index);
        }
        Ok(Sparse { indices, values })
    }

    /// The bytes of elements, checked to lie inside their view, and that inside its buffer.
    fn strided(&self, range: &Range) -> Result<Strided<'a>, Fault> {
        let bytes = self.view(range.view, &range.user)?;
        let size = range.size as u64;
        let stride = match self.document.buffer_views.get(range.view).and_then(|view| view.byte_stride) {
            // Zero means "tight", as it did in glTF 1.0.
            Some(stride) if range.strided && stride > 0 => stride,
            _ => size,
        };
        if stride < size {
            let reason = format!("{stride}, but an element of {} has {size} bytes", range.owner);
            return Err(Fault::new(format!("/bufferViews/{}/byteStride", range.view), reason));
        }
        let needed = match range.count {
            0 => Some(range.offset),
            count => (count - 1)
                .checked_mul(stride)
                .and_then(|bytes| bytes.checked_add(size))
                .and_then(|bytes| bytes.checked_add(range.offset)),
        };
        if needed.is_none_or(|needed| needed > bytes.len() as u64) {
            let needed = needed.map_or_else(|| "more than 2^64".to_owned(), |n| n.to_string());
            let reason = format!(
                "{} elements from byte {} need {needed} bytes, but bufferView {} has {}",
                range.count,
                range.offset,
                range.view,
                bytes.len()
            );
            // Where even the first element does not fit, the offset is to blame.
            let fits_one = range.offset.checked_add(size).is_some_and(|end| end <= bytes.len() as u64);
            let field = match (fits_one, range.owner.ends_with("indices") || range.owner.ends_with("values")) {
                (false, _) => format!("{}/byteOffset", range.owner),
                (true, false) => format!("{}/count", range.owner),
                (true, true) => range.owner.clone(),
            };
            return Err(Fault::new(field, reason));
        }
        let bytes = bytes.get(range.offset as usize..).unwrap_or_default();
        Ok(Strided { bytes, stride: stride as usize })
    }

    /// The bytes of buffer view `index`, which `user` (a JSON pointer) refers to.
    ///
    /// # Errors
    /// An index or a range outside its list or buffer, or compressed data.
    pub(super) fn view(&self, index: usize, user: &str) -> Result<&'a [u8], Fault> {
        let views = &self.document.buffer_views;
        let Some(view) = views.get(index) else { return Err(Fault::index(user, index, "bufferViews", views.len())) };
        let pointer = format!("/bufferViews/{index}");
        let Some(buffer) = self.document.buffers.get(view.buffer) else {
            return Err(Fault::index(
                &format!("{pointer}/buffer"),
                view.buffer,
                "buffers",
                self.document.buffers.len(),
            ));
        };
        let Some(bytes) = self.buffers.get(view.buffer) else {
            let compressed = extensions::compression(&view.extensions).or(extensions::compression(&buffer.extensions));
            return Err(compressed.map_or_else(
                || Fault::new(format!("/buffers/{}", view.buffer), "has no uri, and the file no BIN chunk for it"),
                |name| Fault::unsupported(&[name]),
            ));
        };
        let length = bytes.len() as u64;
        let Some(end) = view.byte_offset.checked_add(view.byte_length).filter(|end| *end <= length) else {
            let reason = format!(
                "bytes {} to {} + {} do not lie in buffer {} of {length} bytes",
                view.byte_offset, view.byte_offset, view.byte_length, view.buffer
            );
            let field = if view.byte_offset > length { "byteOffset" } else { "byteLength" };
            return Err(Fault::new(format!("{pointer}/{field}"), reason));
        };
        Ok(bytes.get(view.byte_offset as usize..end as usize).unwrap_or_default())
    }
}

/// Elements asked of a buffer view.
struct Range {
    /// JSON pointer of the reference to the view.
    user: String,
    /// JSON pointer of the record that owns the elements.
    owner: String,
    /// Index of the view.
    view: usize,
    /// Bytes before the first element.
    offset: u64,
    /// Elements.
    count: u64,
    /// Bytes of one.
    size: usize,
    /// Does the view's stride apply?
    strided: bool,
}

/// Bytes of an element; the columns of matrices start at multiples of four (glTF 2.0 specification, section 3.6.2.4).
fn element_size(kind: Type, component: ComponentType) -> usize {
    let (columns, rows) = match kind {
        Type::Mat2 => (2, 2),
        Type::Mat3 => (3, 3),
        Type::Mat4 => (4, 4),
        vector => return vector.multiplicity() * component.size(),
    };
    columns * (rows * component.size()).next_multiple_of(4)
}

/// The component type, if `usage` allows it.
fn component(listed: &Listed<GenericComponentType>, pointer: &str, usage: Use) -> Result<ComponentType, Fault> {
    let component = listed.get(pointer)?.0;
    let code = component.as_gl_enum();
    if usage == Use::Index && !VALID_INDEX_TYPES.contains(&code) {
        return Err(Fault::new(pointer, format!("{code}, but indices are 5121, 5123 or 5125 (unsigned integers)")));
    }
    Ok(component)
}
