//! The structs that Rust and WGSL share, byte for byte, and the table by which a test compares them. What their members
//! mean stands in the shaders.

use super::atlas::Slot;
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3, Vec4};
use shadowfit_solver::{
    plane::{BakedPlane, Encoding, ShadowPlane, Side},
    shade,
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

/// A texel that planes.wgsl makes an `OccluderSlot` of, and what else a plane has beside its rows.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct SlotTexel {
    pub region: [u16; 4],
    /// From the lowest bit: side (2 bits), encoding (1), channel (2), layer (11), the upper half of the softening.
    pub bits: u32,
    pub bias: f32,
}

impl SlotTexel {
    /// Layers that its 11 bits can tell apart.
    pub const LAYERS: u32 = 1 << 11;

    /// Of a plane whose texture lies in `slot`; edges do not soften.
    pub fn new(baked: &BakedPlane, slot: &Slot) -> Self {
        let ([x, y], [w, h]) = (slot.corner, slot.size);
        let side = match baked.side {
            Side::Both => 0,
            Side::Front => 1,
            Side::Back => 2,
        };
        let encoding = match slot.encoding {
            Encoding::Coverage => 0,
            Encoding::Sdf => 1,
        };
        Self {
            region: [x, y, w, h].map(|texels| texels as u16),
            bits: side | encoding << 2 | slot.channel << 3 | slot.layer << 5,
            bias: baked.bias,
        }
    }
}

/// The texels that planes.wgsl makes a `CastingPlane` of.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct CastingTexels {
    pub a: Vec4,
    pub b: Vec4,
    pub s: Vec4,
    pub slot: SlotTexel,
}

impl SlotTexel {
    /// The same with edges that soften, rounded to 8 bits: a penumbra is 0.2 % too wide or narrow.
    pub fn with_softening(self, softening: f32) -> Self {
        Self { bits: self.bits | softening.to_bits().saturating_add(1 << 15) & 0xffff_0000, ..self }
    }
}

impl CastingTexels {
    /// Rows that are not finite (a plane of nearly no area) never reach the shader: it may not branch on NaN.
    pub fn checked([a, b, s]: [Vec4; 3], slot: SlotTexel) -> Option<Self> {
        let finite = a.is_finite() && b.is_finite() && s.is_finite() && slot.bias.is_finite();
        finite.then_some(Self { a, b, s, slot })
    }
}

/// The equation (n, -n.o) of a plane and the rows of its edges' duals: dot with (p, 1).
pub fn plane_and_duals(plane: &ShadowPlane) -> [Vec4; 3] {
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
    pub slot: SlotTexel,
}

impl Rectangle {
    /// The rectangle in a linear colour.
    pub fn new(baked: &BakedPlane, slot: &Slot, color_linear: Vec3) -> Self {
        let plane = &baked.plane;
        let [equation, a, b] = plane_and_duals(plane);
        Self {
            origin: plane.origin.extend(1.0),
            u: plane.u.extend(0.0),
            v: plane.v.extend(0.0),
            plane: equation,
            a,
            b,
            color: color_linear.extend(1.0),
            slot: SlotTexel::new(baked, slot),
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
        layout!(Rectangle { origin, u, v, plane, a, b, color, slot }),
        layout!(SilhouetteEdge { a, b }),
        layout!(Material { base_color, alpha_cutoff, repeat_u, repeat_v }),
    ]
}
