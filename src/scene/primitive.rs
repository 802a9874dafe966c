//! Primitives: the triangles of a mesh, in mesh space and posed into model space.
//!
//! In: a primitive of the document. Out: a [`Primitive`] with opened accessors, which [`Primitive::emit`] writes
//! into the scene once for each pose. Corners are decoded, morphed, skinned and transformed one at a time: that
//! repeats work for shared vertices, but needs no memory that the file could inflate.

use super::{
    Fault, Notices, Origin, Scene,
    accessor::{Accessor, Data, Use},
    document,
    extensions::compression,
    materials::{Surface, Surfaces},
    sections::Label,
};
use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3};
use gltf::json::{accessor::Type, mesh::Mode};
use std::collections::BTreeMap;

/// Largest coordinate in model space, metres: the square of a distance beyond it overflows in the f32 of
/// shaders. A light year is 1e16 m.
pub const MAX_COORDINATE: f64 = 1e18;

/// A primitive that has triangles.
pub(super) struct Primitive<'a> {
    /// `Triangles`, `TriangleStrip` or `TriangleFan`.
    mode: Mode,
    /// Number of triangles.
    pub triangles: u64,
    /// What they are made of.
    pub surface: Surface,
    /// Index of the mesh, and of the primitive in it.
    pub index: [u32; 2],
    /// Sections of the triangles.
    pub label: Label<'a>,
    positions: Accessor<'a>,
    normals: Option<Accessor<'a>>,
    uvs: Option<Accessor<'a>>,
    indices: Option<Accessor<'a>>,
    targets: Vec<Target<'a>>,
    skinning: Vec<Influences<'a>>,
}

/// Displacements of a morph target.
struct Target<'a> {
    positions: Option<Accessor<'a>>,
    normals: Option<Accessor<'a>>,
}

/// Four joints and their weights a vertex (JOINTS_n, WEIGHTS_n).
struct Influences<'a> {
    joints: Accessor<'a>,
    weights: Accessor<'a>,
}

/// How a mesh stands in model space.
pub(super) struct Pose<'a> {
    /// Index of the node.
    pub node: usize,
    /// The node's transform; skinned primitives ignore it.
    pub transform: Transform,
    /// Weights of the morph targets.
    pub weights: &'a [f64],
    /// Model space from mesh space for each joint of the node's skin.
    pub joints: Option<&'a [DAffine3]>,
}

/// A transform of points and normals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transform {
    model_from_mesh: DAffine3,
    normal_from_mesh: DMat3,
    is_mirrored: bool,
}

impl Transform {
    pub(super) fn new(model_from_mesh: DAffine3) -> Self {
        // The cofactors are the inverse transpose times the determinant. They exist for flat scales too; the
        // matrix is scaled first so that they neither overflow nor vanish.
        let m = model_from_mesh.matrix3;
        let size = m.to_cols_array().iter().fold(0.0_f64, |size, x| size.max(x.abs()));
        let m = if size > 0.0 { m * (1.0 / size) } else { m };
        let cofactors = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        let is_mirrored = m.determinant() < 0.0;
        let normal_from_mesh = if is_mirrored { cofactors * -1.0 } else { cofactors };
        Self { model_from_mesh, normal_from_mesh, is_mirrored }
    }
}

/// The corners of triangle `t` in the list of corners; winding of strips and fans: glTF 2.0 specification, section
/// 3.7.2.1.
pub(super) fn corner_numbers(mode: Mode, t: u64) -> [u64; 3] {
    match mode {
        Mode::TriangleStrip => [t, t + 1 + t % 2, t + 2 - t % 2],
        Mode::TriangleFan => [t + 1, t + 2, 0],
        _ => [3 * t, 3 * t + 1, 3 * t + 2],
    }
}

/// The number of triangles that so many corners make.
pub(super) fn triangle_count(mode: Mode, corners: u64) -> u64 {
    if mode == Mode::Triangles { corners / 3 } else { corners.saturating_sub(2) }
}

/// A corner in model space.
struct Corner {
    position: DVec3,
    normal: Option<DVec3>,
    uv: Vec2,
    is_mirrored: bool,
}

impl<'a> Primitive<'a> {
    /// Opens a primitive; `None` where it has no triangles (counted).
    ///
    /// # Errors
    /// An accessor that is wrong, an unknown mode, or compressed data.
    pub(super) fn open(
        data: &Data<'a>,
        record: &document::Primitive,
        pointer: &str,
        surfaces: &mut Surfaces<'_>,
        notices: &mut Notices,
    ) -> Result<Option<Self>, Fault> {
        let mode = match &record.mode {
            Some(mode) => mode.get(&format!("{pointer}/mode"))?,
            None => Mode::Triangles,
        };
        match mode {
            Mode::Points => return Ok(skip(notices, "points", "they have no area: not drawn, no shadow")),
            Mode::Lines | Mode::LineLoop | Mode::LineStrip => {
                return Ok(skip(notices, "lines", "they have no area: not drawn, no shadow"));
            }
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => {}
        }
        let Some(position_index) = record.attributes.get("POSITION") else {
            return Ok(skip(notices, "primitives without POSITION", "nothing to draw"));
        };
        if let Some(name) = compression(&record.extensions) {
            let has_copy = data.document.accessors.get(*position_index).is_none_or(|a| a.buffer_view.is_some());
            if !has_copy {
                return Err(Fault::unsupported(&[name]));
            }
        }
        let attributes = Attributes { data, record: &record.attributes, pointer: format!("{pointer}/attributes") };
        let positions = data.accessor(*position_index, &attributes.key("POSITION"), Type::Vec3, Use::Number)?;
        let user = format!("{pointer}/indices");
        let indices = record.indices.map(|i| data.accessor(i, &user, Type::Scalar, Use::Index)).transpose()?;
        let corners = indices.as_ref().map_or(positions.count, |indices| indices.count);
        if corners < 3 {
            return Ok(skip(notices, "primitives with less than three corners", "no triangle to draw"));
        }
        let triangles = triangle_count(mode, corners);
        if mode == Mode::Triangles && corners % 3 != 0 {
            notices.add("incomplete triangles", 1, "the last corners of a primitive do not make three");
        }
        let surface = surfaces.surface(record.material, &format!("{pointer}/material"), notices)?;
        let count = positions.count;
        let uvs = match surface.uv {
            Some(uv) => attributes.open(&format!("TEXCOORD_{}", uv.set), Type::Vec2, count)?,
            None => None,
        };
        if surface.uv.is_some() && uvs.is_none() {
            notices.add("textured primitives without coordinates", 1, "the corner texel is used for all of them");
        }
        if record.attributes.contains_key("COLOR_0") {
            notices.add("vertex colours", 1, "drawn without them");
        }
        let normals = attributes.open("NORMAL", Type::Vec3, count)?;
        let targets = open_targets(data, record, pointer, count)?;
        let skinning = open_skinning(&attributes, count)?;
        let (index, label) = ([0; 2], Label::default());
        Ok(Some(Self { mode, triangles, surface, index, label, positions, normals, uvs, indices, targets, skinning }))
    }

    /// Number of vertices.
    pub(super) fn vertices(&self) -> u64 {
        self.positions.count
    }

    /// Does the primitive have morph targets?
    pub(super) fn is_morphed(&self) -> bool {
        !self.targets.is_empty()
    }

    /// Writes the triangles in that pose into the scene.
    ///
    /// # Errors
    /// An index past the vertices, or a number that is not finite or larger than [`MAX_COORDINATE`].
    pub(super) fn emit(&self, pose: &Pose<'_>, scene: &mut Scene, notices: &mut Notices) -> Result<(), Fault> {
        if !self.surface.is_visible {
            let why = "the material's alpha lies below its cutoff: dropped";
            notices.add("invisible triangles", self.triangles as usize, why);
            return Ok(());
        }
        for t in 0..self.triangles {
            let numbers = corner_numbers(self.mode, t);
            let [a, b, c] = numbers.map(|number| self.corner(number, pose, notices));
            let (a, b, c) = (a?, b?, c?);
            let mirrored = [&a, &b, &c].iter().filter(|corner| corner.is_mirrored).count();
            push(scene, &self.surface, if mirrored >= 2 { [a, c, b] } else { [a, b, c] });
            let [mesh, primitive] = self.index;
            scene.origins.push(Origin { mesh, primitive, triangle: t as u32 });
            scene.section_of.push(self.label.section(numbers.map(|number| self.vertex(number)))?);
        }
        Ok(())
    }

    /// The vertex of corner `number` of the list of corners.
    fn vertex(&self, number: u64) -> u64 {
        match &self.indices {
            Some(indices) => indices.get_index(number).unwrap_or(u64::MAX),
            None => number,
        }
    }

    /// Corner `number` of the list of corners, posed.
    fn corner(&self, number: u64, pose: &Pose<'_>, notices: &mut Notices) -> Result<Corner, Fault> {
        let vertex = self.vertex(number);
        let Some(position) = self.positions.get::<3>(vertex) else {
            let pointer = self.indices.as_ref().map_or_else(|| self.positions.pointer(), Accessor::pointer);
            let reason = format!("index {vertex} at {number}, but there are {} vertices", self.positions.count);
            return Err(Fault::new(pointer, reason));
        };
        let mut position = finite(position, &self.positions, vertex)?;
        let mut normal = self.normals.as_ref().and_then(|normals| normals.get::<3>(vertex)).map(DVec3::from);
        // Morph: add the weighted displacements.
        for (target, weight) in self.targets.iter().zip(pose.weights).filter(|(_, weight)| **weight != 0.0) {
            if let Some(deltas) = &target.positions {
                position += *weight * finite(deltas.get(vertex).unwrap_or_default(), deltas, vertex)?;
            }
            if let (Some(deltas), Some(normal)) = (&target.normals, &mut normal) {
                *normal += *weight * DVec3::from(deltas.get::<3>(vertex).unwrap_or_default());
            }
        }
        // Skin, or place.
        let skinned = pose.joints.map(|joints| self.skinned(vertex, joints)).transpose()?.flatten();
        let transform = skinned.unwrap_or(pose.transform);
        let position = transform.model_from_mesh.transform_point3(position);
        if !(position.is_finite() && position.abs().max_element() <= MAX_COORDINATE) {
            let at = self.positions.pointer();
            let reason = format!("vertex {vertex} of {at} lands at {position}, beyond {MAX_COORDINATE:e} metres");
            return Err(Fault::new(format!("/nodes/{}", pose.node), reason));
        }
        Ok(Corner {
            position,
            normal: normal.and_then(|normal| (transform.normal_from_mesh * normal).try_normalize()),
            uv: self.uv(vertex, notices),
            is_mirrored: transform.is_mirrored,
        })
    }

    /// Texture coordinates of a vertex, transformed; zero where there are none.
    fn uv(&self, vertex: u64, notices: &mut Notices) -> Vec2 {
        let (Some(uvs), Some(source)) = (&self.uvs, &self.surface.uv) else { return Vec2::ZERO };
        let uv = DVec2::from(uvs.get::<2>(vertex).unwrap_or_default());
        let uv = source.texture_from_mesh.transform_point2(uv).as_vec2();
        if uv.is_finite() {
            return uv;
        }
        notices.add("texture coordinates", 1, "not finite numbers: (0, 0) is used");
        Vec2::ZERO
    }

    /// The blend of the joints' matrices at a vertex, or `None` where no joint has weight.
    fn skinned(&self, vertex: u64, joints: &[DAffine3]) -> Result<Option<Transform>, Fault> {
        let (mut linear, mut translation, mut total) = (DMat3::ZERO, DVec3::ZERO, 0.0);
        for influences in &self.skinning {
            let numbers = influences.joints.get::<4>(vertex).unwrap_or_default();
            let weights = influences.weights.get::<4>(vertex).unwrap_or_default();
            for (number, weight) in numbers.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0) {
                let Some(joint) = joints.get(number as usize) else {
                    let reason = format!("joint {number} at vertex {vertex}, but the skin has {}", joints.len());
                    return Err(Fault::new(influences.joints.pointer(), reason));
                };
                linear += joint.matrix3 * weight;
                translation += joint.translation * weight;
                total += weight;
            }
        }
        // Weights should add up to one; quantised ones do so only nearly.
        if !(total > 0.0 && total.is_finite()) {
            return Ok(None);
        }
        let blended = DAffine3 { matrix3: linear * (1.0 / total), translation: translation / total };
        Ok(Some(Transform::new(blended)))
    }
}

/// Appends a triangle; corners without a usable normal get the geometric one.
fn push(scene: &mut Scene, surface: &Surface, corners: [Corner; 3]) {
    let positions = [corners[0].position, corners[1].position, corners[2].position];
    let [a, b, c] = positions;
    // Normalised edges: the product of tiny ones would vanish.
    let flat = (b - a).normalize_or_zero().cross((c - a).normalize_or_zero()).try_normalize();
    let flat = flat.unwrap_or(DVec3::Y);
    let uvs = [corners[0].uv, corners[1].uv, corners[2].uv];
    scene.soup.corners_model.push(positions);
    scene.soup.sides.push(surface.sides);
    scene.soup.cutout.push(surface.cutout);
    scene.soup.cutout_uv.push(if surface.cutout.is_some() { uvs } else { [Vec2::ZERO; 3] });
    scene.normals.push(corners.map(|corner| -> Vec3 { corner.normal.unwrap_or(flat).as_vec3() }));
    scene.uvs.push(uvs);
    scene.material_of.push(surface.material);
}

fn skip<T>(notices: &mut Notices, what: &str, why: &str) -> Option<T> {
    notices.add(what, 1, why);
    None
}

fn finite(values: [f64; 3], accessor: &Accessor<'_>, vertex: u64) -> Result<DVec3, Fault> {
    let values = DVec3::from(values);
    if values.is_finite() {
        return Ok(values);
    }
    Err(Fault::new(accessor.pointer(), format!("vertex {vertex} is {values}, not finite numbers")))
}

/// A map from attribute names to accessors.
struct Attributes<'d, 'a, 'r> {
    data: &'d Data<'a>,
    record: &'r BTreeMap<String, usize>,
    pointer: String,
}

impl<'a> Attributes<'_, 'a, '_> {
    fn key(&self, name: &str) -> String {
        format!("{}/{name}", self.pointer)
    }

    /// Opens the attribute, if there is one, and checks that it covers `count` vertices.
    fn open(&self, name: &str, kind: Type, count: u64) -> Result<Option<Accessor<'a>>, Fault> {
        let Some(index) = self.record.get(name) else { return Ok(None) };
        let accessor = self.data.accessor(*index, &self.key(name), kind, Use::Number)?;
        if accessor.count < count {
            let reason = format!("{} elements, but POSITION has {count}", accessor.count);
            return Err(Fault::new(format!("{}/count", accessor.pointer()), reason));
        }
        Ok(Some(accessor))
    }
}

fn open_targets<'a>(
    data: &Data<'a>,
    record: &document::Primitive,
    pointer: &str,
    count: u64,
) -> Result<Vec<Target<'a>>, Fault> {
    let target = |(i, record): (usize, &BTreeMap<String, usize>)| {
        let attributes = Attributes { data, record, pointer: format!("{pointer}/targets/{i}") };
        Ok(Target {
            positions: attributes.open("POSITION", Type::Vec3, count)?,
            normals: attributes.open("NORMAL", Type::Vec3, count)?,
        })
    };
    record.targets.iter().enumerate().map(target).collect()
}

fn open_skinning<'a>(attributes: &Attributes<'_, 'a, '_>, count: u64) -> Result<Vec<Influences<'a>>, Fault> {
    let mut sets = Vec::new();
    loop {
        let n = sets.len();
        let joints = attributes.open(&format!("JOINTS_{n}"), Type::Vec4, count)?;
        let weights = attributes.open(&format!("WEIGHTS_{n}"), Type::Vec4, count)?;
        match (joints, weights) {
            (Some(joints), Some(weights)) => sets.push(Influences { joints, weights }),
            _ => return Ok(sets),
        }
    }
}
