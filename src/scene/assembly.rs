//! Puts the scene together: every mesh of the default scene at each of its places.
//!
//! In: the document and its hierarchy. Out: the scene without its list of notices. Two rounds: the first opens
//! the meshes and adds up what they will take, so that a file which asks for too much is refused before any
//! memory is spent; the second writes the triangles.
//!
//! Places: the node's transform; times one a copy of `EXT_mesh_gpu_instancing`; for a skinned mesh the joints of
//! the static pose (glTF 2.0 specification, section 3.7.3: the node's own transform does not count).

use super::{
    Fault, Notices, Scene,
    accessor::{Accessor, Data, Use},
    document::{Instancing, Node, record},
    materials::Surfaces,
    nodes::{Hierarchy, placement},
    primitive::{Pose, Primitive, Transform},
    sections::Sections,
};
use crate::gltf_file::GltfFile;
use glam::{DAffine3, DMat3, DVec3};
use gltf::json::accessor::Type;
use std::collections::HashMap;

/// Most triangles after all copies: about 2 GB in a [`Scene`]. Ten times the largest scanned models that are
/// passed around; a file of 100 bytes can ask for a billion.
pub const MAX_TRIANGLES: u64 = 10_000_000;

/// Most pairs of a place and a primitive. A city of a million lamps passes; a list of nodes times a list of
/// empty primitives must not take hours.
pub const MAX_DRAWS: u64 = 1_000_000;

const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// A node that shows a mesh.
struct Place<'a> {
    node: usize,
    mesh: usize,
    copies: Option<Copies<'a>>,
}

/// The attributes of `EXT_mesh_gpu_instancing`.
struct Copies<'a> {
    count: u64,
    pointer: String,
    translation: Option<Accessor<'a>>,
    rotation: Option<Accessor<'a>>,
    scale: Option<Accessor<'a>>,
}

/// Reads all triangles of the default scene.
///
/// # Errors
/// Whatever is wrong with a record that the scene uses, no triangles, or more than the limits.
pub(super) fn assemble(
    file: &GltfFile<'_>,
    data: &Data<'_>,
    hierarchy: &Hierarchy,
    notices: &mut Notices,
) -> Result<Scene, Fault> {
    let mut surfaces = Surfaces::new(file, data);
    let sections = Sections::new(file.root());
    let mut meshes: Vec<Option<Vec<Primitive<'_>>>> = Vec::new();
    meshes.resize_with(data.document.meshes.len(), || None);
    // First round: open and count.
    let places = places(data, hierarchy)?;
    let (mut draws, mut triangles) = (0_u64, 0_u64);
    for place in &places {
        if meshes[place.mesh].is_none() {
            meshes[place.mesh] = Some(open_mesh((data, &sections), place.mesh, &mut surfaces, notices)?);
        }
        let primitives = meshes[place.mesh].as_deref().unwrap_or_default();
        let copies = place.copies.as_ref().map_or(1, |copies| copies.count);
        let each = primitives.iter().fold(0_u64, |sum, primitive| sum.saturating_add(primitive.triangles));
        draws = draws.saturating_add(copies.saturating_mul(primitives.len().max(1) as u64));
        triangles = triangles.saturating_add(copies.saturating_mul(each));
        let pointer = format!("/nodes/{}/mesh", place.node);
        check_limit(&pointer, "triangles", triangles, "MAX_TRIANGLES", MAX_TRIANGLES)?;
        check_limit(&pointer, "drawn primitives", draws, "MAX_DRAWS", MAX_DRAWS)?;
    }
    // Second round: write.
    let mut scene = Scene::default();
    let mut joints: HashMap<usize, Vec<DAffine3>> = HashMap::new();
    for place in &places {
        let skin = data.document.nodes[place.node].skin;
        if let Some(skin) = skin
            && !joints.contains_key(&skin)
        {
            joints.insert(skin, joint_transforms(data, hierarchy, skin, place.node)?);
        }
        let posed = Posed { data, hierarchy, place, joints: skin.and_then(|skin| joints.get(&skin)) };
        posed.draw(meshes[place.mesh].as_deref().unwrap_or_default(), &mut scene, notices)?;
    }
    if scene.soup.corners_model.is_empty() {
        let pointer = if data.document.meshes.is_empty() { "" } else { "/meshes" };
        return Err(Fault::new(pointer, "no triangles: the default scene shows no surface"));
    }
    notices.add("animations", data.document.animations, "ignored: the static pose is used");
    notices.add("other scenes", data.document.scenes.len().saturating_sub(1), "only the default scene is read");
    (scene.materials, scene.images, scene.soup.cutouts) = (surfaces.materials, surfaces.images, surfaces.cutouts);
    Ok(scene)
}

fn check_limit(pointer: &str, what: &str, value: u64, name: &str, limit: u64) -> Result<(), Fault> {
    if value <= limit {
        return Ok(());
    }
    Err(Fault::new(pointer, format!("{value} {what} up to here, but {name} = {limit}: simplify the model")))
}

/// The nodes with a mesh, in drawing order.
fn places<'a>(data: &Data<'a>, hierarchy: &Hierarchy) -> Result<Vec<Place<'a>>, Fault> {
    let mut places = Vec::new();
    for &node in &hierarchy.shown {
        let record = &data.document.nodes[node];
        let Some(mesh) = record.mesh else { continue };
        if mesh >= data.document.meshes.len() {
            return Err(Fault::index(&format!("/nodes/{node}/mesh"), mesh, "meshes", data.document.meshes.len()));
        }
        places.push(Place { node, mesh, copies: copies(data, record, node)? });
    }
    Ok(places)
}

fn copies<'a>(data: &Data<'a>, node: &Node, index: usize) -> Result<Option<Copies<'a>>, Fault> {
    let Some(value) = node.extensions.get(INSTANCING) else { return Ok(None) };
    let pointer = format!("/nodes/{index}/extensions/{INSTANCING}");
    let instancing: Instancing = record(value, &pointer)?;
    let open = |name: &str, kind: Type| {
        let user = format!("{pointer}/attributes/{name}");
        instancing.attributes.get(name).map(|i| data.accessor(*i, &user, kind, Use::Number)).transpose()
    };
    let translation = open("TRANSLATION", Type::Vec3)?;
    let rotation = open("ROTATION", Type::Vec4)?;
    let scale = open("SCALE", Type::Vec3)?;
    let given = || [&translation, &rotation, &scale].into_iter().flatten();
    let Some(count) = given().map(|accessor| accessor.count).min() else { return Ok(None) };
    if given().any(|accessor| accessor.count != count) {
        return Err(Fault::new(format!("{pointer}/attributes"), "the accessors have different counts"));
    }
    Ok(Some(Copies { count, pointer, translation, rotation, scale }))
}

impl Copies<'_> {
    /// Node space from the space of copy `i`.
    fn transform(&self, i: u64) -> Result<DAffine3, Fault> {
        let three = |accessor: &Option<Accessor<'_>>, default: f64| {
            accessor.as_ref().and_then(|accessor| accessor.get::<3>(i)).map_or(DVec3::splat(default), DVec3::from)
        };
        let rotation = self.rotation.as_ref().and_then(|accessor| accessor.get::<4>(i));
        placement(three(&self.translation, 0.0), rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]), three(&self.scale, 1.0))
            .filter(|transform| transform.is_finite())
            .ok_or_else(|| Fault::new(self.pointer.as_str(), format!("copy {i} has no finite transform")))
    }
}

fn open_mesh<'a>(
    (data, sections): (&Data<'a>, &Sections),
    mesh: usize,
    surfaces: &mut Surfaces<'_>,
    notices: &mut Notices,
) -> Result<Vec<Primitive<'a>>, Fault> {
    let mut primitives = Vec::new();
    for (i, record) in data.document.meshes[mesh].primitives.iter().enumerate() {
        let pointer = format!("/meshes/{mesh}/primitives/{i}");
        if let Some(mut primitive) = Primitive::open(data, record, &pointer, surfaces, notices)? {
            primitive.index = [mesh as u32, i as u32];
            primitive.label = sections.label(data, record, (&pointer, primitive.vertices()))?;
            primitives.push(primitive);
        }
    }
    Ok(primitives)
}

/// A place with what its mesh depends on.
struct Posed<'a> {
    data: &'a Data<'a>,
    hierarchy: &'a Hierarchy,
    place: &'a Place<'a>,
    joints: Option<&'a Vec<DAffine3>>,
}

impl Posed<'_> {
    /// Writes the primitives, once a copy.
    fn draw(&self, primitives: &[Primitive<'_>], scene: &mut Scene, notices: &mut Notices) -> Result<(), Fault> {
        let place = self.place;
        let default_weights = &self.data.document.meshes[place.mesh].weights;
        let weights = self.data.document.nodes[place.node].weights.as_ref().unwrap_or(default_weights);
        if self.joints.is_some() {
            notices.add("skin", 1, "drawn with the joints in their static pose");
        }
        if primitives.iter().any(Primitive::is_morphed) {
            notices.add("morph targets", 1, "drawn with their default weights");
        }
        let model_from_node = self.hierarchy.model_from_node[place.node];
        for copy in 0..place.copies.as_ref().map_or(1, |copies| copies.count) {
            let model_from_mesh = match &place.copies {
                Some(copies) => model_from_node * copies.transform(copy)?,
                None => model_from_node,
            };
            let transform = Transform::new(model_from_mesh);
            let pose = Pose { node: place.node, transform, weights, joints: self.joints.map(Vec::as_slice) };
            for primitive in primitives {
                primitive.emit(&pose, scene, notices)?;
            }
        }
        Ok(())
    }
}

/// Model space from mesh space for each joint of a skin: the joint node's transform times its inverse bind
/// matrix.
fn joint_transforms(data: &Data<'_>, hierarchy: &Hierarchy, skin: usize, node: usize) -> Result<Vec<DAffine3>, Fault> {
    let Some(record) = data.document.skins.get(skin) else {
        return Err(Fault::index(&format!("/nodes/{node}/skin"), skin, "skins", data.document.skins.len()));
    };
    let user = format!("/skins/{skin}/inverseBindMatrices");
    let binds = record.inverse_bind_matrices.map(|i| data.accessor(i, &user, Type::Mat4, Use::Number)).transpose()?;
    let transform = |(i, joint): (usize, &usize)| {
        let Some(model_from_joint) = hierarchy.model_from_node.get(*joint) else {
            let pointer = format!("/skins/{skin}/joints/{i}");
            return Err(Fault::index(&pointer, *joint, "nodes", hierarchy.model_from_node.len()));
        };
        let Some(binds) = &binds else { return Ok(*model_from_joint) };
        let Some(m) = binds.get::<16>(i as u64) else {
            let reason = format!("{} matrices, but the skin has {} joints", binds.count, record.joints.len());
            return Err(Fault::new(format!("{}/count", binds.pointer()), reason));
        };
        let column = |c: usize| DVec3::new(m[4 * c], m[4 * c + 1], m[4 * c + 2]);
        let joint_from_mesh =
            DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) };
        if !joint_from_mesh.is_finite() {
            return Err(Fault::new(binds.pointer(), format!("matrix {i} is not finite numbers")));
        }
        Ok(*model_from_joint * joint_from_mesh)
    };
    record.joints.iter().enumerate().map(transform).collect()
}
