//! What the fragment shader computes, on the CPU: the twin of `shaders/planes.wgsl`, name for name.
//!
//! Source: Coleman, "Fast Self-Shadowing Using Occluder Textures" (2006), eq. 2-8, rearranged: for a fixed light
//! direction the texture coordinates and the distance to the plane are affine in the receiver, three rows a plane.
//!
//! For a receiver p, light direction l (unit, towards the light), plane (o, u, v), N = u x v, n = N/|N|:
//! `s = n.(o-p) / n.l`, `q = p + s l`, `a = (q-o).(v x N)/|N|^2`, `b = (q-o).(N x u)/|N|^2`.
//!
//! A light of angular radius r has soft edges where textures are distance fields: at distance s its cone cuts an ellipse
//! of half axes `s tan r` and `s tan r / |n.l|` from the plane, taken as the circle of equal area; over that width to
//! each side the field's value goes from light to shadow (distance widens the filter: Fernando, "Percentage-Closer Soft
//! Shadows", 2005). Where the surface's own horizon cuts the light, [`horizon`] is the share above it.
//!
//! Mask errors of fits with preset `balanced` against a traced light of radius 0.27 / 1 / 3 / 6 degrees (12 frames of the
//! teapot, 3 of the plate over ground, 256 x 256): teapot hard 0.0022 / 0.0043 / 0.0106 / 0.0208, soft 0.0019 / 0.0023 /
//! 0.0037 / 0.0062; plate hard 0.0003 / 0.0010 / 0.0030 / 0.0057, soft 0.0001 / 0.0002 / 0.0006 / 0.0015. On other frames of
//! the teapot, 6 degrees: hard 0.0143, without the horizon 0.0112, with it 0.0049. There, without the horizon, fields
//! transformed anew over 16 texels when they are loaded gained next to nothing (0.0110): the teapot's texels are coarse
//! (0.021 in the median), two of them wider than most penumbrae. At 0.27 degrees they lost (plate 0.0007 instead of
//! 0.0001: their borders are not those that the descent of `field` placed). The darkest plane instead of the product:
//! 0.0047.
//!
//! Not guaranteed: penumbrae wider than [`crate::plane::SDF_TEXELS`] to each side, those of occluders thinner than they,
//! and any of coverage textures and point lights: their edges stay as they are.

use crate::plane::{BakedPlane, BakedSet, Encoding, OccluderTexture, SDF_BORDER, SDF_PER_TEXEL, ShadowPlane, Side};
use glam::{Vec2, Vec3, Vec4};

/// A plane whose `|n.l|` is below this casts nothing under that light. At 0.002 (0.11 degrees) a plane across
/// the whole model is seen under less than 1/4 texel of 128, and the rows' rounding (f32 eps / 0.002 = 6e-5 of
/// the rectangle) is still 1/100 of a texel; a hundred times larger would visibly drop grazing shadows.
pub const EDGE_ON: f32 = 0.002;

/// Soft edges are at least so wide to each side, in units of a field's value: a byte, below which there is no distance.
pub const MIN_SPREAD: f32 = 1.0 / 255.0;

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
    (s > bias && on_rectangle(a, b)).then_some((a, b))
}

fn on_rectangle(a: f32, b: f32) -> bool {
    (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b)
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
    let value = value(texture, a, b);
    match texture.encoding {
        Encoding::Coverage => value,
        Encoding::Sdf => f32::from(u8::from(value >= SDF_BORDER)),
    }
}

/// The same with soft edges, `spread` to each side in units of a field's value, at any `(a, b)`: beyond the centres of
/// the outermost texels, and beyond the rectangle, a field goes on falling.
#[must_use]
pub fn sample_soft(texture: &OccluderTexture, a: f32, b: f32, spread: f32) -> f32 {
    let (w, h) = (texture.width as f32, texture.height as f32);
    let at = Vec2::new(a * w, b * h);
    let beyond = (at - at.clamp(Vec2::splat(0.5), Vec2::new(w, h) - 0.5)).length() * SDF_PER_TEXEL;
    match texture.encoding {
        Encoding::Coverage if on_rectangle(a, b) => value(texture, a, b),
        // The outermost texels are open: nothing is left of them where the field has fallen by the spread.
        Encoding::Sdf if beyond < spread => {
            smoothstep(SDF_BORDER - spread, SDF_BORDER + spread, value(texture, a, b) - beyond)
        }
        _ => 0.0,
    }
}

/// The bilinear value 0..1 of a texture.
fn value(texture: &OccluderTexture, a: f32, b: f32) -> f32 {
    let (w, h) = (texture.width, texture.height);
    let x = (a * w as f32 - 0.5).clamp(0.0, (w - 1) as f32);
    let y = (b * h as f32 - 0.5).clamp(0.0, (h - 1) as f32);
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    let tap = |x: usize, y: usize| f32::from(texture.texels[y * w + x]);
    let row = |y: usize| tap(x0, y) + fx * (tap(x1, y) - tap(x0, y));
    (row(y0) + fy * (row(y1) - row(y0))) / 255.0
}

fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The rows of all planes of a set under one directional light.
#[must_use]
pub fn set_rows(set: &BakedSet, l: Vec3) -> Vec<Option<PlaneRows>> {
    set.planes.iter().map(|baked| plane_rows(&baked.plane, baked.side, l)).collect()
}

/// What a plane leaves of the light `v`, per colour, where its texture blocks the share `blocked`.
#[must_use]
pub fn dimmed(v: Vec3, baked: &BakedPlane, blocked: f32) -> Vec3 {
    v * (1.0 - blocked * share(baked.tint))
}

/// A tint as shares.
#[must_use]
pub fn share(tint: [u8; 3]) -> Vec3 {
    Vec3::from_array(tint.map(|byte| f32::from(byte) / 255.0))
}

/// Predicted visibility V~ in 0..1, per colour, of a receiver at `p` under a directional light: the product over the
/// planes of its section's `list` of `1 - T(a, b) tint`, left as soon as nothing is left. `rows` is aligned with `planes`.
#[must_use]
pub fn visibility(planes: &[BakedPlane], rows: &[Option<PlaneRows>], list: &[u32], p: Vec3) -> Vec3 {
    let mut v = Vec3::ONE;
    for &index in list {
        let (baked, rows) = (&planes[index as usize], &rows[index as usize]);
        let Some(rows) = rows else { continue };
        if let Some((a, b)) = crossing(rows, baked.bias, p) {
            v = dimmed(v, baked, sample(&baked.texture, a, b));
            if v == Vec3::ZERO {
                break;
            }
        }
    }
    v
}

/// How fast the edges of a plane's shadow soften under a directional light in direction `l` of an angular radius:
/// their spread to each side, in units of a field's value, per distance from the plane. Not finite where the
/// rectangle has no area.
#[must_use]
pub fn softening(baked: &BakedPlane, l: Vec3, angular_radius_rad: f32) -> f32 {
    let (plane, texture) = (&baked.plane, &baked.texture);
    let area = plane.u.cross(plane.v).length() * plane.normal().dot(l).abs();
    let texels_per_distance = angular_radius_rad.tan() * ((texture.width * texture.height) as f32 / area).sqrt();
    texels_per_distance * SDF_PER_TEXEL
}

/// Spread of the edges at distance `s` from the plane.
#[must_use]
pub fn spread(softening: f32, s: f32) -> f32 {
    (softening * s).clamp(MIN_SPREAD, SDF_BORDER)
}

/// Share of a light that stands above the horizon of the surface itself; `sine` is that of the light's angular radius.
#[must_use]
pub fn horizon(n_dot_l: f32, sine: f32) -> f32 {
    smoothstep(-sine, sine, n_dot_l)
}

/// [`visibility`] with soft edges; `softening` is aligned with `planes`.
#[must_use]
pub fn visibility_soft(
    planes: &[BakedPlane],
    (rows, softening): (&[Option<PlaneRows>], &[f32]),
    list: &[u32],
    p: Vec3,
) -> Vec3 {
    let blocked = |index: usize| {
        let (baked, rows, p) = (&planes[index], rows[index].as_ref()?, p.extend(1.0));
        let (a, b, s) = (rows.a.dot(p), rows.b.dot(p), rows.s.dot(p));
        (s > baked.bias).then(|| (baked, sample_soft(&baked.texture, a, b, spread(softening[index], s))))
    };
    let blocking = list.iter().filter_map(|&index| blocked(index as usize));
    blocking.fold(Vec3::ONE, |v, (baked, blocked)| dimmed(v, baked, blocked))
}

/// Predicted visibility of a receiver at `p` under a point light at `c`; the list is that of the direction from the
/// model's middle to the light.
#[must_use]
pub fn visibility_point_light(planes: &[BakedPlane], list: &[u32], c: Vec3, p: Vec3) -> Vec3 {
    let planes = list.iter().map(|&index| &planes[index as usize]);
    planes.fold(Vec3::ONE, |v, baked| match crossing_point_light(baked, c, p) {
        Some((a, b)) if v != Vec3::ZERO => dimmed(v, baked, sample(&baked.texture, a, b)),
        _ => v,
    })
}
