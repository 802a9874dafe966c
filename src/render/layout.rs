//! The structs that Rust and WGSL share, byte for byte, and the table by which a test compares them. What their members
//! mean stands in the shaders.

use super::atlas::Slot;
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3, Vec4};
use shadowfit_solver::{
    plane::{BakedPlane, Encoding, ShadowPlane, Side},
    shade::{self, PlaneRows},
};
use std::mem::offset_of;

/// `Frame` of frame.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Frame {
    pub clip_from_world: Mat4,
    pub light: Vec4,
    pub eye: Vec4,
}

/// `Instance` of frame.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Instance {
    pub clip_from_unit: Mat4,
    pub world_from_unit: Mat4,
    pub light: Vec4,
}

/// `OccluderSlot` of planes.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct OccluderSlot {
    pub region: Vec4,
    pub layer: u32,
    pub channel: u32,
    pub encoding: u32,
    pub padding: u32,
}

impl From<&Slot> for OccluderSlot {
    fn from(slot: &Slot) -> Self {
        let ([x, y], [w, h]) = (slot.corner, slot.size);
        let region = Vec4::from_array([x, y, w, h].map(|n| n as f32));
        let encoding = match slot.encoding {
            Encoding::Coverage => 0,
            Encoding::Sdf => 1,
        };
        Self { region, layer: slot.layer, channel: slot.channel, encoding, padding: 0 }
    }
}

/// `CastingPlane` of planes.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct CastingPlane {
    pub a: Vec4,
    pub b: Vec4,
    pub s: Vec4,
    pub slot: OccluderSlot,
    pub bias: f32,
    pub side: u32,
    pub softening: f32,
    pub tint: u32,
}

impl CastingPlane {
    /// The plane under a directional light of an angular radius, or `None` where it casts nothing.
    pub fn directional(baked: &BakedPlane, slot: &Slot, to_light: Vec3, radius_rad: f32) -> Option<Self> {
        let PlaneRows { a, b, s } = shade::plane_rows(&baked.plane, baked.side, to_light)?;
        Some(Self {
            softening: shade::softening(baked, to_light, radius_rad),
            ..Self::checked([a, b, s], baked, slot)?
        })
    }

    /// The plane under a point light, or `None` where it has no area.
    pub fn point_light(baked: &BakedPlane, slot: &Slot) -> Option<Self> {
        let [equation, a, b] = plane_and_duals(&baked.plane);
        if equation.truncate() == Vec3::ZERO { None } else { Self::checked([a, b, equation], baked, slot) }
    }

    /// Rows that are not finite (a plane of nearly no area) never reach the shader: it may not branch on NaN.
    fn checked([a, b, s]: [Vec4; 3], baked: &BakedPlane, slot: &Slot) -> Option<Self> {
        let side = match baked.side {
            Side::Both => 0,
            Side::Front => 1,
            Side::Back => 2,
        };
        let [red, green, blue] = baked.tint;
        let tint = u32::from_le_bytes([red, green, blue, 0]);
        let plane = Self { a, b, s, slot: slot.into(), bias: baked.bias, side, softening: 0.0, tint };
        (a.is_finite() && b.is_finite() && s.is_finite() && baked.bias.is_finite()).then_some(plane)
    }
}

/// The equation (n, -n.o) of a plane and the rows of its edges' duals: dot with (p, 1).
fn plane_and_duals(plane: &ShadowPlane) -> [Vec4; 3] {
    let (dual_a, dual_b) = shade::duals(plane);
    [plane.normal(), dual_a, dual_b].map(|row| row.extend(-row.dot(plane.origin)))
}

/// `Rectangle` of rectangles.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Rectangle {
    pub origin: Vec4,
    pub u: Vec4,
    pub v: Vec4,
    pub plane: Vec4,
    pub a: Vec4,
    pub b: Vec4,
    pub color: Vec4,
    pub slot: OccluderSlot,
}

impl Rectangle {
    /// The rectangle in a linear colour.
    pub fn new(plane: &ShadowPlane, slot: &Slot, color_linear: Vec3) -> Self {
        let [equation, a, b] = plane_and_duals(plane);
        Self {
            origin: plane.origin.extend(1.0),
            u: plane.u.extend(0.0),
            v: plane.v.extend(0.0),
            plane: equation,
            a,
            b,
            color: color_linear.extend(1.0),
            slot: slot.into(),
        }
    }

    /// Centre, unit space.
    pub fn centre(&self) -> Vec3 {
        (self.origin + 0.5 * (self.u + self.v)).truncate()
    }
}

/// `SilhouetteEdge` of silhouette_points.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct SilhouetteEdge {
    pub a: Vec4,
    pub b: Vec4,
}

/// `Material` of surface.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Material {
    pub base_color: Vec4,
    pub alpha_cutoff: f32,
    pub repeat_u: u32,
    pub repeat_v: u32,
    pub padding: u32,
}

/// `Vertex` of surface.wgsl: a vertex buffer, so the shader's struct has locations instead of offsets.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Vertex {
    pub p: Vec3,
    pub geometric_normal: Vec3,
    pub shading_normal: Vec3,
    pub uv: glam::Vec2,
    pub material: u32,
    pub section: u32,
}

/// Attributes of [`Vertex`], in the order of their locations.
pub const VERTEX_ATTRIBUTES: [wgpu::VertexAttribute; 6] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32x2, 4 => Uint32, 5 => Uint32];

/// How Rust lays out a struct of the shaders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StructLayout {
    /// Its name in WGSL.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// Name and offset of each member but the padding.
    pub members: Vec<(&'static str, usize)>,
}

macro_rules! layout {
    ($name:ident { $($member:ident),* }) => {
        StructLayout {
            name: stringify!($name),
            size: size_of::<$name>(),
            members: vec![$((stringify!($member), offset_of!($name, $member))),*],
        }
    };
}

/// All structs that live in buffers, as Rust lays them out.
#[must_use]
pub fn struct_layouts() -> Vec<StructLayout> {
    vec![
        layout!(Frame { clip_from_world, light, eye }),
        layout!(Instance { clip_from_unit, world_from_unit, light }),
        layout!(OccluderSlot { region, layer, channel, encoding }),
        layout!(CastingPlane { a, b, s, slot, bias, side, softening, tint }),
        layout!(Rectangle { origin, u, v, plane, a, b, color, slot }),
        layout!(SilhouetteEdge { a, b }),
        layout!(Material { base_color, alpha_cutoff, repeat_u, repeat_v }),
    ]
}
