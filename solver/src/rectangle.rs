//! From unbounded planes to rectangles: first around the model's cross-section, then tight around what blocks.

use crate::plane::ShadowPlane;
use glam::{Quat, Vec2, Vec3};

/// Rotations tried between 0 and 90 degrees when a rectangle is fitted: 2.5 degrees apart, where the area of a
/// long thin shape is within 5 % of the best.
const ROTATIONS: usize = 36;

/// Each side of a rectangle may cut off this share of the votes for blocking: a few stray texels far out would
/// otherwise halve the resolution of all the others.
const TRIM: f64 = 5e-4;

/// Shift in unit space that goes with a tilt of one radian: moves the rim of a plane about as far as the tilt does.
const SHIFT_PER_TILT: f32 = 0.5;

/// Bins of the histograms that decide where to cut; the cut is exact to 1/1024 of the untrimmed rectangle.
const BINS: usize = 1024;

/// The rectangle around the cut of the plane `normal . p = offset` through the box `low..high`; `None` where the
/// plane misses the box.
#[must_use]
pub fn around_section(low: Vec3, high: Vec3, normal: Vec3, offset: f32) -> Option<ShadowPlane> {
    let (t, b) = normal.any_orthonormal_pair();
    let corner = |i: usize| {
        Vec3::new(
            if i & 1 == 0 { low.x } else { high.x },
            if i & 2 == 0 { low.y } else { high.y },
            if i & 4 == 0 { low.z } else { high.z },
        )
    };
    let (mut least, mut most, mut cuts) = (Vec2::INFINITY, Vec2::NEG_INFINITY, 0);
    for i in 0..8 {
        for axis in [1, 2, 4].into_iter().filter(|axis| i & axis == 0) {
            let (p, q) = (corner(i), corner(i | axis));
            let (hp, hq) = (normal.dot(p) - offset, normal.dot(q) - offset);
            if (hp > 0.0) == (hq > 0.0) {
                continue;
            }
            let cut = p + (q - p) * (hp / (hp - hq));
            let cut = Vec2::new(cut.dot(t), cut.dot(b));
            (least, most, cuts) = (least.min(cut), most.max(cut), cuts + 1);
        }
    }
    let size = most - least;
    (cuts >= 3 && size.min_element() > 0.0).then(|| ShadowPlane {
        origin: normal * offset + t * least.x + b * least.y,
        u: t * size.x,
        v: b * size.y,
    })
}

/// The rectangle in the plane of `plane`, turned for the least area, tight around the texels (`width` a row) with
/// positive votes. `None` where there is none.
#[must_use]
pub fn tight_around(plane: &ShadowPlane, votes: &[f32], width: usize) -> Option<ShadowPlane> {
    let height = votes.len() / width;
    let (lu, lv) = (plane.u.length(), plane.v.length());
    let (eu, ev) = (plane.u / lu, plane.v / lv);
    // Texel centres with what they are worth, in the rectangle's own metric.
    let centre = |i: usize| {
        let (x, y) = ((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
        Vec2::new(x / width as f32 * lu, y / height as f32 * lv)
    };
    let texels: Vec<(Vec2, f64)> =
        votes.iter().enumerate().filter(|(_, v)| **v > 0.0).map(|(i, v)| (centre(i), f64::from(*v))).collect();
    if texels.is_empty() {
        return None;
    }
    let texel = Vec2::new(lu / width as f32, lv / height as f32);
    let (axis, least, most) = (0..ROTATIONS)
        .map(|k| {
            let axis = Vec2::from_angle(k as f32 / ROTATIONS as f32 * std::f32::consts::FRAC_PI_2);
            let half = 0.5 * Vec2::new((axis * texel).abs().element_sum(), (axis.perp() * texel).abs().element_sum());
            let (x0, x1) = extent(&texels, axis);
            let (y0, y1) = extent(&texels, axis.perp());
            (axis, Vec2::new(x0, y0) - half, Vec2::new(x1, y1) + half)
        })
        .min_by(|a, b| (a.2 - a.1).element_product().total_cmp(&(b.2 - b.1).element_product()))?;
    let (du, dv) = (eu * axis.x + ev * axis.y, ev * axis.x - eu * axis.y);
    let size = most - least;
    Some(ShadowPlane { origin: plane.origin + du * least.x + dv * least.y, u: du * size.x, v: dv * size.y })
}

/// The rectangle turned about its middle, around its v or u edge, or moved along its normal.
#[must_use]
pub fn shifted(plane: &ShadowPlane, direction: usize, tilt: f32) -> ShadowPlane {
    let middle = plane.origin + 0.5 * (plane.u + plane.v);
    let (axis, shift) = match direction {
        0 => (plane.u, Vec3::ZERO),
        1 => (plane.v, Vec3::ZERO),
        _ => (Vec3::ZERO, plane.normal() * (tilt * SHIFT_PER_TILT)),
    };
    let turn = Quat::from_scaled_axis(axis.normalize_or_zero() * tilt);
    let (u, v) = (turn * plane.u, turn * plane.v);
    ShadowPlane { origin: middle + shift - 0.5 * (u + v), u, v }
}

/// The rectangle with `room` (a share of its size) added at each side.
#[must_use]
pub fn enlarged(plane: &ShadowPlane, room: f32) -> ShadowPlane {
    let (u, v) = (plane.u * (1.0 + 2.0 * room), plane.v * (1.0 + 2.0 * room));
    ShadowPlane { origin: plane.origin - room * (plane.u + plane.v), u, v }
}

/// Least and largest coordinate along `axis` of the texels, with [`TRIM`] of their votes cut off at either end.
fn extent(texels: &[(Vec2, f64)], axis: Vec2) -> (f32, f32) {
    let coordinates = || texels.iter().map(|(p, _)| p.dot(axis));
    let (low, high) = coordinates().fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
    let width = (high - low).max(f32::MIN_POSITIVE);
    let mut bins = vec![0.0f64; BINS];
    for (p, votes) in texels {
        let bin = ((p.dot(axis) - low) / width * BINS as f32) as usize;
        bins[bin.min(BINS - 1)] += votes;
    }
    let limit = bins.iter().sum::<f64>() * TRIM;
    let cut = |order: &mut dyn Iterator<Item = usize>| {
        let mut lost = 0.0;
        order
            .take_while(|&i| {
                lost += bins[i];
                lost <= limit
            })
            .count()
    };
    let (skip_low, skip_high) = (cut(&mut (0..BINS)), cut(&mut (0..BINS).rev()));
    let step = width / BINS as f32;
    (low + skip_low as f32 * step, high - skip_high as f32 * step)
}
