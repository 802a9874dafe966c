//! What the fragment shader computes, on the CPU: the twin of `shaders/planes.wgsl`, name for name.
//!
//! Source: Coleman, "Fast Self-Shadowing Using Occluder Textures" (2006), eq. 2-8, rearranged: for a fixed light
//! direction the texture coordinates and the distance to the plane are affine in the receiver, three rows a plane.
//!
//! For a receiver p, light direction l (unit, towards the light), plane (o, u, v), N = u x v, n = N/|N|:
//! `s = n.(o-p) / n.l`, `q = p + s l`, `a = (q-o).(v x N)/|N|^2`, `b = (q-o).(N x u)/|N|^2`.

use crate::plane::{BakedPlane, BakedSet, Encoding, OccluderTexture, SDF_BORDER, ShadowPlane, Side};
use glam::{Vec3, Vec4};

/// A plane whose `|n.l|` is below this casts nothing under that light. At 0.002 (0.11 degrees) a plane across
/// the whole model is seen under less than 1/4 texel of 128, and the rows' rounding (f32 eps / 0.002 = 6e-5 of
/// the rectangle) is still 1/100 of a texel; a hundred times larger would visibly drop grazing shadows.
pub const EDGE_ON: f32 = 0.002;

/// The affine rows of one plane under one directional light; dot with `(p, 1)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneRows {
    /// Texture coordinate along u; 0..1 on the rectangle.
    pub a: Vec4,
    /// Texture coordinate along v; 0..1 on the rectangle.
    pub b: Vec4,
    /// Distance from the receiver to the plane towards the light.
    pub s: Vec4,
}

/// The duals of a rectangle's edges: `a = (q-o).dual_a`, `b = (q-o).dual_b`. Not finite where the rectangle has no
/// area.
#[must_use]
pub fn duals(plane: &ShadowPlane) -> (Vec3, Vec3) {
    let n = plane.u.cross(plane.v);
    let inv = 1.0 / n.length_squared();
    (plane.v.cross(n) * inv, n.cross(plane.u) * inv)
}

/// What the rows of a plane have in common under all lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CastingPlane {
    pub(crate) side: Side,
    pub(crate) normal: Vec3,
    pub(crate) duals: [Vec3; 2],
    /// The origin's dot products with the three vectors.
    pub(crate) origin: [f32; 3],
}

impl CastingPlane {
    /// Prepares `plane` for [`CastingPlane::rows`].
    #[must_use]
    pub fn new(plane: &ShadowPlane, side: Side) -> Self {
        let (normal, (dual_a, dual_b)) = (plane.normal(), duals(plane));
        let origin = [normal, dual_a, dual_b].map(|v| v.dot(plane.origin));
        Self { side, normal, duals: [dual_a, dual_b], origin }
    }

    /// Rows under a light in direction `l`, or `None` where the plane casts nothing: edge-on, without area, or all its
    /// receivers are on the side that `side` leaves out (a receiver is in front when the light is behind).
    #[must_use]
    pub fn rows(&self, l: Vec3) -> Option<PlaneRows> {
        let n_dot_l = self.normal.dot(l);
        let served = match self.side {
            Side::Both => true,
            Side::Front => n_dot_l < 0.0,
            Side::Back => n_dot_l > 0.0,
        };
        // The comparison is written so that NaN (a broken plane or light) casts nothing.
        if !(served && n_dot_l.abs() >= EDGE_ON) {
            return None;
        }
        // s(p) = (n.o - n.p) / n.l; a(p) = (p - o).dual_a + s(p) l.dual_a.
        let [n_dot_o, a_dot_o, b_dot_o] = self.origin;
        let s = (-self.normal / n_dot_l).extend(n_dot_o / n_dot_l);
        let row = |dual: Vec3, dual_dot_o: f32| dual.extend(-dual_dot_o) + s * l.dot(dual);
        Some(PlaneRows { a: row(self.duals[0], a_dot_o), b: row(self.duals[1], b_dot_o), s })
    }
}

/// Rows of `plane` under a light in direction `l`; see [`CastingPlane::rows`].
#[must_use]
pub fn plane_rows(plane: &ShadowPlane, side: Side, l: Vec3) -> Option<PlaneRows> {
    CastingPlane::new(plane, side).rows(l)
}

/// Where the ray from `p` crosses the plane: `(a, b)` if that is on the rectangle and beyond `bias`.
#[must_use]
pub fn crossing(rows: &PlaneRows, bias: f32, p: Vec3) -> Option<(f32, f32)> {
    let p = p.extend(1.0);
    let (a, b, s) = (rows.a.dot(p), rows.b.dot(p), rows.s.dot(p));
    let inside = s > bias && (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
    inside.then_some((a, b))
}

/// The same for a point light at `c`: the segment p-c must cross the plane. `bias` is a distance from p.
#[must_use]
pub fn crossing_point_light(baked: &BakedPlane, c: Vec3, p: Vec3) -> Option<(f32, f32)> {
    let plane = &baked.plane;
    let n = plane.normal();
    let to_light = c - p;
    let (n_dot_d, height) = (n.dot(to_light), n.dot(plane.origin - p));
    let served = match baked.side {
        Side::Both => true,
        Side::Front => n_dot_d < 0.0,
        Side::Back => n_dot_d > 0.0,
    };
    let length = to_light.length();
    // Between p and c, beyond the bias, not edge-on: decided by signs before anything is divided.
    let ahead = height * n_dot_d > 0.0 && height.abs() < n_dot_d.abs();
    if !(served && ahead && n_dot_d.abs() >= EDGE_ON * length) {
        return None;
    }
    let s = height / n_dot_d;
    let (dual_a, dual_b) = duals(plane);
    let q = p + s * to_light - plane.origin;
    let (a, b) = (q.dot(dual_a), q.dot(dual_b));
    let inside = s * length > baked.bias && (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
    inside.then_some((a, b))
}

/// How much of the light is blocked, 0..1, at `(a, b)` in 0..1: the bilinear value, taps clamped to the texture; of a
/// distance field, whether that reaches its border.
#[must_use]
pub fn sample(texture: &OccluderTexture, a: f32, b: f32) -> f32 {
    let (w, h) = (texture.width, texture.height);
    let x = (a * w as f32 - 0.5).clamp(0.0, (w - 1) as f32);
    let y = (b * h as f32 - 0.5).clamp(0.0, (h - 1) as f32);
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    let tap = |x: usize, y: usize| f32::from(texture.texels[y * w + x]);
    let row = |y: usize| tap(x0, y) + fx * (tap(x1, y) - tap(x0, y));
    let value = (row(y0) + fy * (row(y1) - row(y0))) / 255.0;
    match texture.encoding {
        Encoding::Coverage => value,
        Encoding::Sdf => f32::from(u8::from(value >= SDF_BORDER)),
    }
}

/// The rows of all planes of a set under one directional light.
#[must_use]
pub fn set_rows(set: &BakedSet, l: Vec3) -> Vec<Option<PlaneRows>> {
    set.planes.iter().map(|baked| plane_rows(&baked.plane, baked.side, l)).collect()
}

/// Predicted visibility V~ in 0..1 of a receiver at `p` under a directional light: the product over the planes of
/// its section's `list` of `1 - T(a, b)`, left as soon as one plane blocks. `rows` is aligned with `planes`.
#[must_use]
pub fn visibility(planes: &[BakedPlane], rows: &[Option<PlaneRows>], list: &[u32], p: Vec3) -> f32 {
    let mut v = 1.0;
    for &index in list {
        let (baked, rows) = (&planes[index as usize], &rows[index as usize]);
        let Some(rows) = rows else { continue };
        if let Some((a, b)) = crossing(rows, baked.bias, p) {
            v *= 1.0 - sample(&baked.texture, a, b);
            if v <= 0.0 {
                break;
            }
        }
    }
    v
}

/// Predicted visibility of a receiver at `p` under a point light at `c`; the list is that of the direction from the
/// model's middle to the light.
#[must_use]
pub fn visibility_point_light(planes: &[BakedPlane], list: &[u32], c: Vec3, p: Vec3) -> f32 {
    list.iter().map(|&index| &planes[index as usize]).fold(1.0, |v, baked| match crossing_point_light(baked, c, p) {
        Some((a, b)) if v > 0.0 => v * (1.0 - sample(&baked.texture, a, b)),
        _ => v,
    })
}
