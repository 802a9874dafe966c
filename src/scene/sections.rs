//! Labels: which section of a fitted asset each triangle belongs to.
//!
//! A primitive says `"extensions": {"SHADOWFIT_node_shadow_planes": {"section": i}}`, or has the vertex attribute
//! `_SHADOW_SECTION` where it holds several sections. Without a label it belongs to section 0 where there is one
//! section, and to none where there are several. Where the planes serve a ground, the last section is the ground's and no
//! primitive's. Labels in a file without shadow planes mean nothing.

use super::{
    Fault,
    accessor::{Accessor, Data, Use},
    document,
};
use crate::gltf_file::{EXTENSION, SECTION_ATTRIBUTE};
use gltf::json::accessor::Type;
use serde_json::Value;

/// The sections that a file has.
pub(super) struct Sections {
    /// Those that primitives may belong to.
    count: u32,
    /// What stands for none of them.
    none: u32,
}

/// The sections of a primitive's triangles.
pub(super) enum Label<'a> {
    /// One for all.
    Whole(u32),
    /// The attribute at their corners, below the number of sections.
    PerVertex(Accessor<'a>, u32),
}

impl Default for Label<'_> {
    fn default() -> Self {
        Self::Whole(0)
    }
}

impl Sections {
    /// Counts the sections of the set that the frame node names (the first, if none does). What else is in the set is
    /// the business of the asset's reader.
    pub(super) fn new(root: &Value) -> Self {
        let labels = |node: &Value| node.get("extensions")?.get(EXTENSION)?.get("set")?.as_u64();
        let nodes = root.get("nodes").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        let set = nodes.iter().find_map(labels).unwrap_or(0);
        let set = root.pointer(&format!("/extensions/{EXTENSION}/sets/{set}"));
        let sections = set.and_then(|set| set.get("sections")).and_then(Value::as_array);
        let none = sections.map_or(0, Vec::len).min(u32::MAX as usize) as u32;
        let ground = u32::from(set.is_some_and(|set| set.get("ground").is_some()));
        Self { count: none.saturating_sub(ground), none }
    }

    /// The label of the primitive at `pointer`, which has so many vertices.
    ///
    /// # Errors
    /// A label that is not the index of a section.
    pub(super) fn label<'a>(
        &self,
        data: &Data<'a>,
        record: &document::Primitive,
        (pointer, vertices): (&str, u64),
    ) -> Result<Label<'a>, Fault> {
        if self.count <= 1 {
            return Ok(Label::Whole(0));
        }
        if let Some(label) = record.extensions.get(EXTENSION) {
            let pointer = format!("{pointer}/extensions/{EXTENSION}/section");
            let section = label.get("section").ok_or_else(|| Fault::new(pointer.as_str(), "missing"))?;
            let index = section.as_u64().filter(|index| *index < u64::from(self.count));
            return match index {
                Some(index) => Ok(Label::Whole(index as u32)),
                None => Err(Fault::new(pointer, format!("{section}, but there are {} sections", self.count))),
            };
        }
        let Some(index) = record.attributes.get(SECTION_ATTRIBUTE) else { return Ok(Label::Whole(self.none)) };
        let user = format!("{pointer}/attributes/{SECTION_ATTRIBUTE}");
        let accessor = data.accessor(*index, &user, Type::Scalar, Use::Number)?;
        if accessor.count < vertices {
            let reason = format!("{} elements, but POSITION has {vertices}", accessor.count);
            return Err(Fault::new(format!("{}/count", accessor.pointer()), reason));
        }
        Ok(Label::PerVertex(accessor, self.count))
    }
}

impl Label<'_> {
    /// The section of the triangle with those vertices.
    ///
    /// # Errors
    /// The attribute is not the index of a section, or differs between the corners.
    pub(super) fn section(&self, vertices: [u64; 3]) -> Result<u32, Fault> {
        let (attribute, count) = match self {
            Self::Whole(section) => return Ok(*section),
            Self::PerVertex(attribute, count) => (attribute, *count),
        };
        let [a, b, c] = vertices.map(|vertex| attribute.get::<1>(vertex).map_or(f64::NAN, |[section]| section));
        let is_index = a.fract() == 0.0 && (0.0..f64::from(count)).contains(&a);
        if is_index && a == b && a == c {
            return Ok(a as u32);
        }
        let [i, j, k] = vertices;
        let reason = format!("{a}, {b}, {c} at the vertices {i}, {j}, {k}: one of the {count} sections is needed");
        Err(Fault::new(attribute.pointer(), reason))
    }
}
