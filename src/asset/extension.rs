//! The extension's root object: baked planes as the files spell them.
//!
//! Model space, metres, f64 in the shortest spelling that stands for a number; directions are f32 in theirs, so that
//! they come back to the last bit.

use super::{AssetError, AssetRequest, Bounds, Channel, ModelGround, Rectangle, atlas::Layout};
use glam::{DVec3, Vec3};
use serde::Serialize;
use serde_json::ser::{Formatter, Serializer};
use shadowfit_solver::plane::{BakedSet, Encoding, OPAQUE, SectionLists, Side};
use std::io::{self, Write};

/// A direction may be longer or shorter than 1 by this much: numbers that a person wrote with three decimals pass, a
/// direction that was never normalised does not.
pub(super) const UNIT_TOLERANCE: f64 = 2e-3;

/// The extension's root object, and the whole of the sidecar.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Extension {
    /// One set a model.
    pub sets: Vec<PlaneSet>,
}

/// The planes of one model, as the file spells them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlaneSet {
    /// Box of the receivers at bake time.
    pub bounds: Bounds,
    /// All planes.
    pub planes: Vec<PlaneEntry>,
    /// Indices into `planes`, one list a section.
    pub sections: SectionLists,
    /// Shorter lists per light direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub active: Option<ActiveEntry>,
    /// The ground that receives shadow too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground: Option<GroundEntry>,
}

/// A level square below the model, centred below the middle of `bounds`; it receives shadow and casts none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct GroundEntry {
    /// Its section: the last one, which no primitive belongs to.
    pub section: u32,
    /// Where it lies along +Y, metres.
    pub height: f64,
    /// Half of its side, metres.
    pub half_extent: f64,
}

/// Which planes each section reads under which light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ActiveEntry {
    /// Unit vectors towards the light.
    pub directions: Vec<Vec3>,
    /// Per direction and section the indices of planes.
    pub lists: Vec<SectionLists>,
}

/// One plane, as the file spells it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct PlaneEntry {
    /// Where texel (0, 0) starts.
    pub origin: DVec3,
    /// Edge along the texture's rows, full length.
    pub u_axis: DVec3,
    /// Edge along the texture's columns, full length.
    pub v_axis: DVec3,
    /// The atlas.
    pub occluder_texture: TextureRef,
    /// `[x, y, width, height]` in the atlas, texels.
    pub region: [u32; 4],
    /// The atlas's channel.
    pub channel: Channel,
    /// What a texel means.
    pub encoding: Encoding,
    /// Which receivers the plane serves.
    pub side: Side,
    /// A receiver nearer than this along the ray is not shadowed, metres.
    pub bias: f64,
    /// The share of each linear colour that it takes where its texture blocks; without one, all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tint: Option<[f64; 3]>,
}

/// Which picture holds a texture: `{"index": 0}` in glTF, `{"uri": ".."}` in the sidecar.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum TextureRef {
    /// Index into the document's `textures`.
    Index(usize),
    /// Percent-encoded path relative to the sidecar.
    Uri(String),
}

impl Extension {
    /// The request's planes; `texture` names an atlas.
    ///
    /// # Errors
    /// A plane that no file can hold, lists that do not fit the planes, or a box that is none.
    pub(super) fn new(
        request: &AssetRequest<'_>,
        layout: &Layout,
        texture: impl Fn(usize) -> TextureRef,
    ) -> Result<Self, AssetError> {
        let bounds = request.bounds;
        if !bounds.is_box() {
            return Err(AssetError::Bounds { bounds });
        }
        check_lists(request.set)?;
        let mut planes = Vec::with_capacity(request.set.planes.len());
        for (plane, (baked, place)) in request.set.planes.iter().zip(&layout.placements).enumerate() {
            let rectangle = Rectangle::from_unit_space(&baked.plane, request.frame);
            let bias = f64::from(baked.bias) * request.frame.radius;
            let bias_fault = (!(bias.is_finite() && bias >= 0.0)).then_some(("bias", "not a finite number from 0 up"));
            if let Some((member, why)) = rectangle.fault().or(bias_fault) {
                return Err(AssetError::Plane { plane, why: format!("{member}: {why}") });
            }
            planes.push(PlaneEntry {
                origin: rectangle.origin,
                u_axis: rectangle.u_axis,
                v_axis: rectangle.v_axis,
                occluder_texture: texture(place.atlas),
                region: [place.x, place.y, baked.texture.width as u32, baked.texture.height as u32],
                channel: place.channel,
                encoding: baked.texture.encoding,
                side: baked.side,
                bias,
                tint: (baked.tint != OPAQUE).then(|| baked.tint.map(spelled)),
            });
        }
        let entry = |active: &shadowfit_solver::plane::ActiveLists| ActiveEntry {
            directions: active.directions.clone(),
            lists: active.lists.clone(),
        };
        let (sections, active) = (request.set.sections.clone(), request.set.active.as_ref().map(entry));
        let ground = ground_entry(request)?;
        Ok(Self { sets: vec![PlaneSet { bounds, planes, sections, active, ground }] })
    }

    /// One line.
    pub(super) fn text(&self) -> Result<String, AssetError> {
        // Not through a `Value`: that would spell an f32 with the digits of an f64.
        serde_json::to_string(self).map_err(|error| AssetError::Sections { why: error.to_string() })
    }

    /// A line a plane and a section, for people and for diffs.
    pub(super) fn lines(&self) -> Result<Vec<u8>, AssetError> {
        let mut out = Vec::new();
        let lines = Lines { depth: 0, is_empty: true };
        let written = self.serialize(&mut Serializer::with_formatter(&mut out, lines));
        written.map_err(|error| AssetError::Sections { why: error.to_string() })?;
        out.push(b'\n');
        Ok(out)
    }
}

/// 255ths in the four digits that stand for them.
fn spelled(byte: u8) -> f64 {
    (f64::from(byte) / 255.0 * 1e4).round() / 1e4
}

/// The request's ground.
fn ground_entry(request: &AssetRequest<'_>) -> Result<Option<GroundEntry>, AssetError> {
    let Some((ground, section)) = request.set.ground_section() else { return Ok(None) };
    let ground = ModelGround::from_unit_space(&ground, request.frame);
    let fault = |why: String| Err(AssetError::Ground { why });
    if section == 0 {
        return fault("it has the only section, and the model none".into());
    }
    if let Some((member, why)) = ground.fault() {
        return fault(format!("{member}: {why}"));
    }
    let ModelGround { height, half_extent } = ground;
    Ok(Some(GroundEntry { section, height, half_extent }))
}

/// Lists that name planes which are not there, or are not part of their section's.
fn check_lists(set: &BakedSet) -> Result<(), AssetError> {
    let fault = |why: String| Err(AssetError::Sections { why });
    if set.sections.is_empty() {
        return fault("there is none, one is needed".into());
    }
    let count = set.planes.len();
    if let Some(index) = set.sections.iter().flatten().find(|index| **index as usize >= count) {
        return fault(format!("plane {index} in a list, but there are {count}"));
    }
    let Some(active) = &set.active else { return Ok(()) };
    let (directions, lists) = (active.directions.len(), active.lists.len());
    if directions == 0 || directions != lists {
        return fault(format!("{directions} directions with {lists} lists"));
    }
    if let Some(direction) = active.directions.iter().find(|direction| !is_unit(direction.as_dvec3())) {
        return fault(format!("the direction {direction} is not of length 1"));
    }
    for lists in &active.lists {
        if lists.len() != set.sections.len() {
            return fault(format!("{} active lists for {} sections", lists.len(), set.sections.len()));
        }
        let pairs = lists.iter().zip(&set.sections).enumerate();
        if let Some((section, _)) = pairs.into_iter().find(|(_, (part, whole))| stranger(part, whole).is_some()) {
            return fault(format!("an active list of section {section} has a plane that the section has not"));
        }
    }
    Ok(())
}

/// Of a direction in a file.
pub(super) fn is_unit(direction: DVec3) -> bool {
    (direction.length() - 1.0).abs() <= UNIT_TOLERANCE
}

/// The position of an element of `part` that is not in `whole`.
pub(super) fn stranger(part: &[u32], whole: &[u32]) -> Option<usize> {
    part.iter().position(|index| !whole.contains(index))
}

/// JSON with line breaks down to the elements of a set's lists, and none inside them.
struct Lines {
    depth: usize,
    is_empty: bool,
}

impl Lines {
    /// Root object, sets, set, lists.
    const OPEN_DEPTH: usize = 4;

    fn open<W: ?Sized + Write>(&mut self, out: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth += 1;
        self.is_empty = true;
        out.write_all(bracket)
    }

    fn close<W: ?Sized + Write>(&mut self, out: &mut W, bracket: &[u8]) -> io::Result<()> {
        let breaks = self.depth <= Self::OPEN_DEPTH && !self.is_empty;
        self.depth -= 1;
        if breaks {
            self.break_line(out)?;
        }
        self.is_empty = false;
        out.write_all(bracket)
    }

    fn item<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> io::Result<()> {
        self.is_empty = false;
        if !first {
            out.write_all(b",")?;
        }
        if self.depth <= Self::OPEN_DEPTH { self.break_line(out) } else { Ok(()) }
    }

    fn break_line<W: ?Sized + Write>(&self, out: &mut W) -> io::Result<()> {
        out.write_all(b"\n")?;
        (0..self.depth).try_for_each(|_| out.write_all(b"  "))
    }
}

impl Formatter for Lines {
    fn begin_array<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.open(out, b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.close(out, b"]")
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> io::Result<()> {
        self.item(out, first)
    }

    fn begin_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.open(out, b"{")
    }

    fn end_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.close(out, b"}")
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> io::Result<()> {
        self.item(out, first)
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        out.write_all(b": ")
    }
}
