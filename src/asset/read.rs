//! `STEM.shadow.glb`, any glTF with the extension, or the sidecar -> [`ShadowSet`]; and plane files.
//!
//! Every index, region, word and number is checked before it is used, and a complaint names the JSON pointer.
//! In glTF the planes lie in the space of the frame node, the one node that carries `{"set": i}`; its transform
//! and those of the nodes above it are applied, so that a tool may move the whole model.

use super::{
    AssetError, Bounds, Channel, EXTENSION, ModelGround, ModelPlane, Rectangle, ShadowSet, atlas,
    extension::{is_unit, stranger},
    files,
    pointer::At,
};
use crate::{
    gltf_file::{GltfFile, UriError},
    scene,
};
use glam::{DAffine3, DVec3};
use image::{ImageFormat, ImageReader, RgbImage};
use serde::Deserialize;
use serde_json::Value;
use shadowfit_solver::plane::{ActiveLists, Encoding, OPAQUE, OccluderTexture, SectionLists, Side};
use std::{collections::BTreeMap, io::Cursor, path::Path};

/// A ground may rise by this much per metre and still be level: quaternions of f32 turn by 1e-7 too much.
const LEVEL_TOLERANCE: f64 = 1e-6;

/// Reads the shadow planes of a GLB, a glTF or a sidecar.
///
/// # Errors
/// The file cannot be read or is none of these; no set of planes, or more than one; anything in it that is
/// wrong, with its JSON pointer.
pub fn read(path: &Path) -> Result<ShadowSet, AssetError> {
    let bytes = files::read(path)?;
    let file = GltfFile::new(path, &bytes).map_err(|fault| AssetError::invalid(path, fault))?;
    let root = At::root(path, file.root());
    let mut atlases = Atlases { file: &file, root: root.clone(), decoded: BTreeMap::new() };
    if root.optional("asset").is_none() {
        // The sidecar is already in model space.
        let sets = root.member("sets")?;
        return match sets.elements()?.as_slice() {
            [set] => read_set(set, &mut atlases),
            others => Err(sets.error(format!("one set expected, found {}", others.len()))),
        };
    }
    file.check_version().map_err(|fault| AssetError::invalid(path, fault))?;
    let (index, model_from_frame) = frame_node(&file, &root)?;
    let sets = root.member("extensions")?.member(EXTENSION)?.member("sets")?.elements()?;
    let at = index.follow(&sets)?;
    let mut set = read_set(&at, &mut atlases)?;
    if model_from_frame != DAffine3::IDENTITY {
        if set.ground.is_some() && !keeps_level(&model_from_frame) {
            return Err(at.member("ground")?.error("not level where the node with the planes puts it".into()));
        }
        set.transform(&model_from_frame);
    }
    Ok(set)
}

fn read_set(at: &At<'_>, atlases: &mut Atlases<'_>) -> Result<ShadowSet, AssetError> {
    let box_at = at.member("bounds")?;
    let bounds = Bounds { min: box_at.member("min")?.parse()?, max: box_at.member("max")?.parse()? };
    if !bounds.is_box() {
        return Err(box_at.error("min is above max".into()));
    }
    let entries = at.member("planes")?.elements()?;
    let planes = entries.iter().map(|entry| read_plane(entry, atlases)).collect::<Result<Vec<_>, _>>()?;
    let sections_at = at.member("sections")?;
    let sections: SectionLists =
        sections_at.elements()?.iter().map(|section| section.indices(entries.len())).collect::<Result<_, _>>()?;
    if sections.is_empty() {
        return Err(sections_at.error("one section is needed at least".into()));
    }
    let active = at.optional("active").map(|active| read_active(&active, &sections)).transpose()?;
    let ground = at.optional("ground").map(|ground| read_ground(&ground, sections.len())).transpose()?;
    Ok(ShadowSet { bounds, planes, sections, active, ground })
}

/// A ground, whose section is the last of `sections` and not the only one.
fn read_ground(at: &At<'_>, sections: usize) -> Result<ModelGround, AssetError> {
    let section_at = at.member("section")?;
    let section: u32 = section_at.parse()?;
    if section == 0 || section as usize + 1 != sections {
        return Err(
            section_at.error(format!("{section}, but the ground's is the last of {sections}, behind the model's"))
        );
    }
    let ground = ModelGround { height: at.member("height")?.parse()?, half_extent: at.member("halfExtent")?.parse()? };
    match ground.fault() {
        Some((member, why)) => Err(at.member(member)?.error(why.into())),
        None => Ok(ground),
    }
}

/// Does the transform map level planes to level ones, and up to up?
fn keeps_level(transform: &DAffine3) -> bool {
    let matrix = &transform.matrix3;
    let [across, up] = [matrix.x_axis.y.abs().max(matrix.z_axis.y.abs()), matrix.y_axis.y];
    up > 0.0 && across <= LEVEL_TOLERANCE * up
}

fn read_active(at: &At<'_>, sections: &SectionLists) -> Result<ActiveLists, AssetError> {
    let mut directions = Vec::new();
    for direction in at.member("directions")?.elements()? {
        let vector: DVec3 = direction.parse()?;
        if !is_unit(vector) {
            return Err(direction.error(format!("of length {}, not 1", vector.length())));
        }
        directions.push(vector.as_vec3());
    }
    if directions.is_empty() {
        return Err(at.member("directions")?.error("one direction is needed at least".into()));
    }
    let lists_at = at.member("lists")?;
    let per_direction = lists_at.elements()?;
    if per_direction.len() != directions.len() {
        return Err(lists_at.error(format!("{} lists for {} directions", per_direction.len(), directions.len())));
    }
    let lists = per_direction.iter().map(|lists| read_lists(lists, sections)).collect::<Result<_, _>>()?;
    Ok(ActiveLists { directions, lists })
}

/// One list a section, each a part of its section's.
fn read_lists(at: &At<'_>, sections: &SectionLists) -> Result<SectionLists, AssetError> {
    let found = at.elements()?;
    if found.len() != sections.len() {
        return Err(at.error(format!("{} lists for {} sections", found.len(), sections.len())));
    }
    let list = |(section, list): (usize, &At<'_>)| {
        let part: Vec<u32> = list.indices(usize::MAX)?;
        match stranger(&part, &sections[section]) {
            None => Ok(part),
            Some(i) => {
                let why = format!("plane {} is not in the list of section {section}", part[i]);
                Err(list.elements()?[i].error(why))
            }
        }
    };
    found.iter().enumerate().map(list).collect()
}

fn read_plane(at: &At<'_>, atlases: &mut Atlases<'_>) -> Result<ModelPlane, AssetError> {
    let rectangle = Rectangle {
        origin: at.member("origin")?.parse()?,
        u_axis: at.member("uAxis")?.parse()?,
        v_axis: at.member("vAxis")?.parse()?,
    };
    if let Some((member, why)) = rectangle.fault() {
        return Err(at.member(member)?.error(why.into()));
    }
    let encoding: Encoding = at.member("encoding")?.parse()?;
    let side: Side = at.member("side")?.parse()?;
    let bias: f64 = at.member("bias")?.parse()?;
    if !(bias.is_finite() && bias >= 0.0) {
        return Err(at.member("bias")?.error("not a finite number from 0 up".into()));
    }
    let channel: Channel = at.member("channel")?.parse()?;
    let atlas = atlases.get(&at.member("occluderTexture")?)?;
    let texture = crop(atlas, &at.member("region")?, (channel, encoding))?;
    let tint = at.optional("tint").map_or(Ok(OPAQUE), |tint| read_tint(&tint))?;
    Ok(ModelPlane { rectangle, texture, tint, side, bias })
}

/// Shares of three colours, rounded to 255ths.
fn read_tint(at: &At<'_>) -> Result<[u8; 3], AssetError> {
    let shares: [f64; 3] = at.parse()?;
    if shares.iter().all(|share| (0.0..=1.0).contains(share)) {
        Ok(shares.map(|share| (255.0 * share).round() as u8))
    } else {
        Err(at.error("not three shares from 0 to 1".into()))
    }
}

/// One channel of a region of an atlas.
fn crop(
    atlas: &RgbImage,
    region: &At<'_>,
    (channel, encoding): (Channel, Encoding),
) -> Result<OccluderTexture, AssetError> {
    let [x, y, w, h]: [u32; 4] = region.parse()?;
    let inside = |start: u32, size: u32, limit: u32| start.checked_add(size).is_some_and(|end| end <= limit);
    if !inside(x, w, atlas.width()) || !inside(y, h, atlas.height()) {
        return Err(region.error(format!("not inside the texture of {} x {}", atlas.width(), atlas.height())));
    }
    let texels = (y..y + h).flat_map(|row| (x..x + w).map(move |column| (column, row)));
    let texels = texels.map(|(column, row)| atlas.get_pixel(column, row)[channel as usize]).collect();
    let texture = OccluderTexture { width: w as usize, height: h as usize, encoding, texels };
    atlas::checked_size(&texture).map_err(|why| region.error(why))?;
    Ok(texture)
}

/// Pictures of a document, decoded once each.
struct Atlases<'a> {
    file: &'a GltfFile<'a>,
    root: At<'a>,
    decoded: BTreeMap<String, RgbImage>,
}

impl Atlases<'_> {
    /// The picture that an `occluderTexture` names.
    fn get(&mut self, reference: &At<'_>) -> Result<&RgbImage, AssetError> {
        let name = reference.optional("uri").map_or_else(|| reference.member("index"), Ok)?;
        let key = name.parse::<Value>()?.to_string();
        if !self.decoded.contains_key(&key) {
            let png =
                if reference.optional("uri").is_some() { self.uri_bytes(&name)? } else { self.texture_bytes(&name)? };
            let picture = ImageReader::with_format(Cursor::new(png), ImageFormat::Png).decode();
            let picture = picture.map_err(|e| name.error(format!("cannot decode the texture: {e}")))?;
            self.decoded.insert(key.clone(), picture.into_rgb8());
        }
        self.decoded.get(&key).ok_or_else(|| name.error("the texture is missing".into()))
    }

    /// Bytes of the image of a glTF texture.
    fn texture_bytes(&self, index: &At<'_>) -> Result<Vec<u8>, AssetError> {
        let texture = index.follow(&self.root.optional_elements("textures")?)?;
        let image = texture.member("source")?.follow(&self.root.optional_elements("images")?)?;
        if let Some(uri) = image.optional("uri") {
            return self.uri_bytes(&uri);
        }
        let view = image.member("bufferView")?.follow(&self.root.optional_elements("bufferViews")?)?;
        let buffer_index = view.member("buffer")?;
        let buffer = buffer_index.follow(&self.root.optional_elements("buffers")?)?;
        // The binary chunk stands for buffer 0 only.
        let bin = if buffer_index.parse::<usize>()? == 0 { self.file.chunks().bin } else { None };
        let offset: usize = view.optional("byteOffset").map_or(Ok(0), |offset| offset.parse())?;
        let length: usize = view.member("byteLength")?.parse()?;
        let loaded;
        let bytes = match (buffer.optional("uri"), bin) {
            (Some(uri), _) => {
                loaded = self.uri_bytes(&uri)?;
                loaded.as_slice()
            }
            (None, Some(bin)) => bin,
            (None, None) => return Err(buffer.error("neither a uri nor a binary chunk".into())),
        };
        let range = offset..offset.saturating_add(length);
        let part = bytes.get(range).ok_or_else(|| view.error("not inside its buffer".into()))?;
        Ok(part.to_vec())
    }

    /// Contents of a `data:` URI or of a file below the document's folder.
    fn uri_bytes(&self, at: &At<'_>) -> Result<Vec<u8>, AssetError> {
        let uri: String = at.parse()?;
        self.file.fetch(&uri).map_err(|error| match error {
            UriError::Unreadable { file, source } => AssetError::Io { action: "read", path: file.path, source },
            UriError::Forbidden(why) | UriError::Damaged(why) => at.error(why),
        })
    }
}

/// The `set` of the frame node, and the transform from its space to model space.
fn frame_node<'a>(file: &GltfFile<'_>, root: &At<'a>) -> Result<(At<'a>, DAffine3), AssetError> {
    let nodes = root.optional_elements("nodes")?;
    let label = |node: &At<'a>| node.optional("extensions").and_then(|e| e.optional(EXTENSION));
    let frames: Vec<usize> = (0..nodes.len()).filter(|&i| label(&nodes[i]).is_some()).collect();
    let (frame, set) = match frames.as_slice() {
        [frame] => (*frame, nodes[*frame].member("extensions")?.member(EXTENSION)?.member("set")?),
        _ => return Err(root.error(format!("{} nodes carry {EXTENSION}, one expected", frames.len()))),
    };
    let transforms = scene::node_transforms(file).map_err(|fault| AssetError::invalid(file.path(), fault))?;
    let is_invertible = |transform: &&DAffine3| {
        let determinant = transform.matrix3.determinant();
        determinant.is_finite() && determinant != 0.0
    };
    let no_inverse = || nodes[frame].error("the node's transform has no inverse".into());
    let model_from_frame = transforms.get(frame).filter(is_invertible).ok_or_else(no_inverse)?;
    Ok((set, *model_from_frame))
}

impl ShadowSet {
    /// Moves the set by an affine transform.
    fn transform(&mut self, transform: &DAffine3) {
        let determinant = transform.matrix3.determinant();
        for plane in &mut self.planes {
            let rectangle = &mut plane.rectangle;
            rectangle.origin = transform.transform_point3(rectangle.origin);
            rectangle.u_axis = transform.transform_vector3(rectangle.u_axis);
            rectangle.v_axis = transform.transform_vector3(rectangle.v_axis);
            // A bias has no direction: the mean scale is the best there is.
            plane.bias *= determinant.abs().cbrt();
            // A mirror turns u x v to the other side of the plane.
            plane.side = match plane.side {
                Side::Front if determinant < 0.0 => Side::Back,
                Side::Back if determinant < 0.0 => Side::Front,
                side => side,
            };
        }
        if let Some(active) = &mut self.active {
            // A direction towards the light is a vector of the frame's space like any other.
            for direction in &mut active.directions {
                *direction = transform.transform_vector3(direction.as_dvec3()).normalize().as_vec3();
            }
        }
        if let Some(ground) = &mut self.ground {
            let below = self.bounds.centre().with_y(ground.height);
            ground.height = transform.transform_point3(below).y;
            // Where the scale differs by axis the square becomes a parallelogram: one of the same area.
            let matrix = &transform.matrix3;
            let area = matrix.x_axis.x * matrix.z_axis.z - matrix.x_axis.z * matrix.z_axis.x;
            ground.half_extent *= area.abs().sqrt();
        }
        let Bounds { min, max } = self.bounds;
        let corner =
            |i: usize| DVec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { min[axis] } else { max[axis] }));
        let corners = (0..8).map(|i| transform.transform_point3(corner(i)));
        let (low, high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (min, max) = corners.fold((low, high), |(low, high), p| (low.min(p), high.max(p)));
        self.bounds = Bounds { min, max };
    }
}

/// A rectangle that a person placed.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelRectangle {
    /// What the person calls it.
    pub name: Option<String>,
    /// Where it lies.
    pub rectangle: Rectangle,
    /// Which receivers it serves.
    pub side: Side,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaneFile {
    #[serde(rename = "comment")]
    _comment: Option<String>,
    #[serde(rename = "planes")]
    _planes: Vec<Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
struct PlaneFileEntry {
    name: Option<String>,
    origin: DVec3,
    u_axis: DVec3,
    v_axis: DVec3,
    #[serde(default)]
    side: Side,
}

/// Most planes of a `--planes` file: they make one section, and a fit counts in one byte how many cover a pair.
pub const MAX_FILE_PLANES: usize = 255;

/// Reads the rectangles of a `--planes` file: `{"comment": "..", "planes": [{"name": "..", "origin": [x, y, z],
/// "uAxis": [..], "vAxis": [..], "side": "both|front|back"}]}`, model space, metres. `comment`, `name` and `side`
/// may be left out.
///
/// # Errors
/// The file cannot be read; an unknown member; axes that are parallel; more than [`MAX_FILE_PLANES`] planes.
pub fn read_plane_file(path: &Path) -> Result<Vec<ModelRectangle>, AssetError> {
    let bytes = files::read(path)?;
    let file = GltfFile::new(path, &bytes).map_err(|fault| AssetError::invalid(path, fault))?;
    let root = At::root(path, file.root());
    // The outer object is checked for unknown members; the planes one by one, so that each is named.
    let _: PlaneFile = root.parse()?;
    let planes = root.member("planes")?;
    let list = planes.elements()?;
    if list.len() > MAX_FILE_PLANES {
        return Err(planes.error(format!("{} planes; {MAX_FILE_PLANES} at most make one section", list.len())));
    }
    let mut rectangles = Vec::with_capacity(list.len());
    for at in list {
        let PlaneFileEntry { name, origin, u_axis, v_axis, side } = at.parse()?;
        let rectangle = Rectangle { origin, u_axis, v_axis };
        if let Some((member, why)) = rectangle.fault() {
            return Err(at.member(member)?.error(why.into()));
        }
        rectangles.push(ModelRectangle { name, rectangle, side });
    }
    Ok(rectangles)
}
