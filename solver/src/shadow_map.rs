//! The shadow map, as a reference to compare planes with on the same pairs.
//!
//! One map a light, as a renderer would draw it: an orthographic view along the light, fitted to the model (the
//! smallest square around it in a fixed pair of axes), N x N texels, each the height of the topmost surface at its
//! centre. Every triangle casts from both sides; holes of cut-out textures do not. A receiver reads the texel that it
//! projects to, unfiltered (Williams, "Casting Curved Shadows on Curved Surfaces", 1978), with one rule for the bias:
//! `texel * tan(angle between normal and light)`, by which a plane's height can differ between a texel's centre and
//! any point in it (at most 0.71 of that), and no constant bias besides what rounding needs.
//!
//! Not what a tuned renderer would do: no filter, no cascades, no map fitted to what the camera sees.

use crate::{
    mesh::{Mesh, POINT_ERROR},
    metrics::{LightError, Metrics, collect},
    receivers::Receivers,
    visibility::{LightPairs, Pairs},
};
use glam::{Vec2, Vec3};

/// Sizes that [`equivalent_size`] measures, smallest first.
pub const SIZES: [usize; 6] = [64, 128, 256, 512, 1024, 2048];

/// The slope that the bias grows with is at most this (88 degrees). At 5 grazing surfaces shadow themselves: the
/// teapot of three.js at 512 and 1024 texels has errors 0.042, 0.037 instead of 0.021, 0.011; from 100 on nothing
/// changes any more (0.022, 0.011), since what faces the light so little weighs next to nothing.
pub const MAX_SLOPE: f32 = 30.0;

/// Heights of a point and of its own surface differ by this much through rounding alone: both are off by
/// [`POINT_ERROR`] per axis, and a dot product of three adds as much again.
const ROUNDING: f32 = 6.0 * POINT_ERROR;

/// A triangle whose projection has less than this area, in texels, covers no texel's centre but by rounding.
const LEAST_TEXELS: f32 = 1e-6;

/// Heights of the topmost surface above a plane across the light.
struct ShadowMap {
    size: usize,
    /// Axes of the map and the light, orthonormal.
    axes: [Vec3; 3],
    /// Corner of the map along the first two axes.
    low: Vec2,
    /// Side of a texel, unit space.
    texel: f32,
    /// `[row][column]`; minus infinity where there is nothing.
    height: Vec<f32>,
}

impl ShadowMap {
    fn draw(mesh: &Mesh, light: Vec3, size: usize) -> Self {
        let (t, b) = light.any_orthonormal_pair();
        let corners = || mesh.corners.iter().flatten().map(|p| Vec2::new(t.dot(*p), b.dot(*p)));
        let (low, high) = corners().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let side = (high - low).max_element();
        let low = 0.5 * (low + high) - Vec2::splat(0.5 * side);
        let height = vec![f32::NEG_INFINITY; size * size];
        let mut map = Self { size, axes: [t, b, light], low, texel: side / size as f32, height };
        for triangle in 0..mesh.triangle_count() as u32 {
            map.draw_triangle(mesh, triangle);
        }
        map
    }

    /// A point in texels, and its height.
    fn project(&self, p: Vec3) -> Vec3 {
        let [t, b, light] = self.axes;
        Vec3::new((t.dot(p) - self.low.x) / self.texel, (b.dot(p) - self.low.y) / self.texel, light.dot(p))
    }

    fn draw_triangle(&mut self, mesh: &Mesh, triangle: u32) {
        let corners = mesh.corners[triangle as usize].map(|p| self.project(p));
        let [p, q, r] = corners;
        let (e1, e2) = ((q - p).truncate(), (r - p).truncate());
        let area = e1.perp_dot(e2);
        // Seen edge-on.
        if area.abs() < LEAST_TEXELS {
            return;
        }
        let inv_area = 1.0 / area;
        let (low, high) = (p.min(q).min(r), p.max(q).max(r));
        for row in centres(low.y, high.y, self.size) {
            let y = row as f32 + 0.5;
            let (left, right) = span(&corners, y);
            for column in centres(left, right, self.size) {
                let to = Vec2::new(column as f32 + 0.5, y) - p.truncate();
                let (wq, wr) = (to.perp_dot(e2) * inv_area, e1.perp_dot(to) * inv_area);
                // Slivers amplify rounding: no point of a triangle lies outside its own heights.
                let height = (p.z + wq * (q.z - p.z) + wr * (r.z - p.z)).clamp(low.z, high.z);
                let texel = &mut self.height[row * self.size + column];
                if height > *texel && mesh.is_solid(triangle, Vec3::new(1.0 - wq - wr, wq, wr)) {
                    *texel = height;
                }
            }
        }
    }

    /// Does the map shadow a receiver at `p` with that normal, which faces the light?
    fn blocks(&self, p: Vec3, normal: Vec3) -> bool {
        let at = self.project(p);
        let index = |x: f32| (x.max(0.0) as usize).min(self.size - 1);
        let cosine = normal.dot(self.axes[2]);
        let slope = ((1.0 - cosine * cosine).max(0.0).sqrt() / cosine).min(MAX_SLOPE);
        self.height[index(at.y) * self.size + index(at.x)] > at.z + self.texel * slope + ROUNDING
    }
}

/// The texels, of `size`, whose centres lie in `low..=high`.
fn centres(low: f32, high: f32, size: usize) -> std::ops::Range<usize> {
    let first = (low - 0.5).ceil().max(0.0);
    let end = (high - 0.5).floor() + 1.0;
    first as usize..(end.max(first) as usize).min(size)
}

/// Where the line at `y` is inside the triangle. Edges that triangles share give the same bits to both, so that no
/// texel between them stays open.
fn span(corners: &[Vec3; 3], y: f32) -> (f32, f32) {
    let mut span = (f32::INFINITY, f32::NEG_INFINITY);
    for i in 0..3 {
        let (p, q) = (corners[i], corners[(i + 1) % 3]);
        let (below, above) = if p.y <= q.y { (p, q) } else { (q, p) };
        if below.y <= y && y <= above.y && below.y < above.y {
            let x = below.x + (y - below.y) / (above.y - below.y) * (above.x - below.x);
            span = (span.0.min(x), span.1.max(x));
        }
    }
    span
}

/// Measures shadow maps of `size` x `size` texels, 1 and up, on `pairs` of `receivers`.
#[must_use]
pub fn measure(mesh: &Mesh, receivers: &Receivers, pairs: &Pairs, size: usize) -> Metrics {
    collect(pairs, |light: &LightPairs| {
        let map = ShadowMap::draw(mesh, light.light, size);
        LightError::of(light, |i| {
            let normal = receivers.normals[light.receiver[i] as usize];
            if map.blocks(light.point(i), normal) { Vec3::ZERO } else { Vec3::ONE }
        })
    })
}

/// Which shadow map is as good as something else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EquivalentSize {
    /// Even the smallest of [`SIZES`] is better.
    BelowAll,
    /// Texels a side, interpolated between the sizes measured.
    Texels(f64),
    /// Even the largest of [`SIZES`] is worse.
    AboveAll,
}

/// The size of the shadow map that has the `shadow_error` given, by measuring one of [`SIZES`] after the other until
/// the error is passed; between two sizes log error is taken as linear in log size.
#[must_use]
pub fn equivalent_size(mesh: &Mesh, receivers: &Receivers, pairs: &Pairs, shadow_error: f64) -> EquivalentSize {
    interpolated(SIZES.iter().map(|&size| (size, measure(mesh, receivers, pairs, size).shadow_error)), shadow_error)
}

/// The same from a curve of `(size, error)`, smallest size first; no more of it is read than needed.
#[must_use]
pub fn interpolated(curve: impl IntoIterator<Item = (usize, f64)>, shadow_error: f64) -> EquivalentSize {
    let mut before: Option<(usize, f64)> = None;
    for (size, error) in curve {
        if error > shadow_error {
            before = Some((size, error));
            continue;
        }
        let Some((coarse, above)) = before else { return EquivalentSize::BelowAll };
        // How far from the coarser to the finer; an error of zero lies infinitely far down: the finer size itself.
        let way = ((above / shadow_error).ln() / (above / error).ln()).clamp(0.0, 1.0);
        let way = if way.is_nan() { 1.0 } else { way };
        return EquivalentSize::Texels(coarse as f64 * (size as f64 / coarse as f64).powf(way));
    }
    EquivalentSize::AboveAll
}
