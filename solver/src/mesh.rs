//! The model as the method sees it: triangles at unit scale, and rays against them.
//!
//! In: a [`Soup`] of triangles in model space (f64, metres). Out: a [`Mesh`] in *unit space*, the model space
//! moved and uniformly scaled so that the bounding box is centred on the origin and the farthest corner lies at
//! distance 1, with a BVH over it. Everything in this crate but [`Frame`] works in unit space, so a model far
//! from the origin, tiny or huge, meets the same numbers.
//!
//! Rays: watertight triangle test (Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection") on an
//! eight-wide BVH (obvhs). Guaranteed: a ray never slips through an edge or vertex that two triangles share.
//! Not guaranteed: the side of a hit closer than [`BOX_PADDING`] to the ray's origin.

mod traversal;
mod watertight;

use glam::{DVec3, Vec2, Vec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    cwbvh::{CwBvh, builder::build_cwbvh},
    ray::{Ray, RayHit},
};
use serde::{Deserialize, Serialize};
use std::{collections::HashSet, sync::Arc, time::Duration};
use traversal::any_hit;
use watertight::WatertightRay;

/// Boxes grow by this much, in unit space. Below `2.4e-7` an axis-aligned ray on a box face is lost, since the
/// traversal replaces 1/0 by 1/eps; above `1e-5` boxes of dense scans overlap and rays get slower.
pub const BOX_PADDING: f32 = 4.0 * f32::EPSILON;

/// The BVH's own space is unit space times this power of two (exact): its nodes ignore hits nearer than 1e-4
/// units of ray length, which this makes 1e-7 of the model's radius.
const BVH_SCALE: f32 = 1024.0;

/// A point on a triangle is off by at most this much per axis, unit space. gamma(7) of corners up to 1 is 3.5 eps, the
/// rest covers coplanar neighbours, whose corners are rounded too. A bound that shrank with the point's own coordinates
/// (8 eps |p|) made a level plate through the centre shadow itself in 4 pairs of 10; at 1e-5 the contact shadows of
/// parts of 1e-4 of the model would detach.
pub const POINT_ERROR: f32 = 8.0 * f32::EPSILON;

/// Which sides of a triangle are drawn, and so receive shadow. Every triangle blocks light from both.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Sides {
    /// The side from which the corners run counter-clockwise.
    Front,
    /// Both sides (glTF `doubleSided`).
    Both,
}

/// A cut-out texture: where its alpha is below the cutoff there is no surface.
#[derive(Clone, Debug)]
pub struct Cutout {
    /// Texels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Alpha times the material's factor, `[row][column]`, row 0 at v = 0.
    pub alpha: Vec<u8>,
    /// Alpha below this (0 to 255) is a hole.
    pub cutoff: f32,
    /// True where u, v repeat outside 0..1 (glTF REPEAT), false where they clamp. `[u, v]`.
    pub repeat: [bool; 2],
}

impl Cutout {
    /// Is there surface at texture coordinate `uv`? Nearest texel.
    #[must_use]
    pub fn is_solid(&self, uv: Vec2) -> bool {
        let texel = |x: f32, n: usize, repeat: bool| {
            let x = if repeat { x - x.floor() } else { x.clamp(0.0, 1.0) };
            ((x * n as f32) as usize).min(n - 1)
        };
        let (x, y) = (texel(uv.x, self.width, self.repeat[0]), texel(uv.y, self.height, self.repeat[1]));
        f32::from(self.alpha[y * self.width + x]) >= self.cutoff
    }
}

/// Triangles in model space, as a reader delivers them. The vectors have one entry a triangle.
#[derive(Clone, Debug, Default)]
pub struct Soup {
    /// Corners in metres, counter-clockwise seen from the front.
    pub corners_model: Vec<[DVec3; 3]>,
    /// Drawn sides.
    pub sides: Vec<Sides>,
    /// Index into `cutouts`, where the triangle's material is a cut-out.
    pub cutout: Vec<Option<u32>>,
    /// Texture coordinates of the corners for the cut-out (zeros where there is none).
    pub cutout_uv: Vec<[Vec2; 3]>,
    /// Cut-out textures.
    pub cutouts: Vec<Arc<Cutout>>,
}

/// Where unit space lies in model space: `p_model = centre + radius * p_unit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Centre of the bounding box, metres.
    pub centre_model: DVec3,
    /// Distance of the farthest corner from the centre, metres.
    pub radius: f64,
}

impl Frame {
    /// Unit-space point of a model-space point.
    #[must_use]
    pub fn unit_from_model(&self, p_model: DVec3) -> Vec3 {
        ((p_model - self.centre_model) / self.radius).as_vec3()
    }

    /// Model-space point of a unit-space point.
    #[must_use]
    pub fn model_from_unit(&self, p_unit: Vec3) -> DVec3 {
        self.centre_model + p_unit.as_dvec3() * self.radius
    }
}

/// Why a soup is not a model.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// A corner is NaN or infinite.
    #[error("triangle {triangle} has a corner that is not a finite number")]
    NotFinite {
        /// Index in the soup.
        triangle: usize,
    },
    /// Nothing with an area is left.
    #[error("no triangle with an area ({zero_area} of {total} triangles have none)")]
    Empty {
        /// Triangles without area.
        zero_area: usize,
        /// Triangles in the soup.
        total: usize,
    },
}

/// The nearest surface along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Triangle of the [`Mesh`].
    pub triangle: u32,
    /// Distance in unit space.
    pub distance: f32,
    /// Weights of the three corners.
    pub barycentric: Vec3,
}

/// A checked model in unit space. The vectors have one entry a triangle that has an area.
#[derive(Clone)]
pub struct Mesh {
    /// Where unit space lies.
    pub frame: Frame,
    /// Corners in unit space.
    pub corners: Vec<[Vec3; 3]>,
    /// Unit normals of the front side.
    pub normals: Vec<Vec3>,
    /// Areas in unit space.
    pub areas: Vec<f32>,
    /// Drawn sides.
    pub sides: Vec<Sides>,
    /// Index of the triangle in the soup.
    pub source: Vec<u32>,
    /// Triangles dropped because they have no area.
    pub zero_area: usize,
    /// Triangles dropped because an earlier one has the same corners in the same turn.
    pub duplicates: usize,
    cutout: Vec<Option<Arc<Cutout>>>,
    cutout_uv: Vec<[Vec2; 3]>,
    /// The share of each linear colour that passes; `None`: nothing passes any triangle.
    transmittance: Option<Vec<Vec3>>,
    bvh: CwBvh,
}

impl std::fmt::Debug for Mesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Mesh").field("triangles", &self.corners.len()).field("frame", &self.frame).finish()
    }
}

impl Mesh {
    /// Checks a soup, brings it to unit space and builds the BVH. Triangles without area and exact duplicates
    /// are dropped and counted.
    ///
    /// # Errors
    /// A corner that is not finite, or no triangle with an area.
    pub fn new(soup: &Soup) -> Result<Self, MeshError> {
        let frame = frame_of(soup)?;
        let mut kept = Kept::default();
        let mut seen = HashSet::new();
        let (mut zero_area, mut duplicates) = (0, 0);
        for (index, corners_model) in soup.corners_model.iter().enumerate() {
            let corners = corners_model.map(|p| frame.unit_from_model(p));
            let normal = (corners[1] - corners[0]).as_dvec3().cross((corners[2] - corners[0]).as_dvec3());
            let doubled_area = normal.length();
            if doubled_area == 0.0 {
                zero_area += 1;
            } else if !seen.insert(turn_key(&corners)) {
                duplicates += 1;
            } else {
                kept.corners.push(corners);
                kept.normals.push((normal / doubled_area).as_vec3());
                kept.areas.push((0.5 * doubled_area) as f32);
                kept.source.push(index as u32);
            }
        }
        if kept.corners.is_empty() {
            return Err(MeshError::Empty { zero_area, total: soup.corners_model.len() });
        }
        // Leaves in traversal order: neighbours in the tree are neighbours in memory.
        let boxes: Vec<Aabb> = kept.corners.iter().map(padded_box).collect();
        let mut bvh = build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Duration::default());
        let order = std::mem::take(&mut bvh.primitive_indices);
        let pick = |i: &u32| *i as usize;
        let source: Vec<u32> = order.iter().map(|i| kept.source[pick(i)]).collect();
        Ok(Self {
            frame,
            corners: order.iter().map(|i| kept.corners[pick(i)]).collect(),
            normals: order.iter().map(|i| kept.normals[pick(i)]).collect(),
            areas: order.iter().map(|i| kept.areas[pick(i)]).collect(),
            sides: source.iter().map(|i| soup.sides[pick(i)]).collect(),
            cutout: source.iter().map(|i| soup.cutout[pick(i)].map(|c| soup.cutouts[c as usize].clone())).collect(),
            cutout_uv: source.iter().map(|i| soup.cutout_uv[pick(i)]).collect(),
            source,
            zero_area,
            duplicates,
            transmittance: None,
            bvh,
        })
    }

    /// The same model where light passes surfaces: `transmittance` gives the share of each linear colour, 0 to 1, for a
    /// triangle of the soup.
    #[must_use]
    pub fn with_transmittance(self, transmittance: impl Fn(usize) -> Vec3) -> Self {
        let of_triangles: Vec<Vec3> = self.source.iter().map(|source| transmittance(*source as usize)).collect();
        let passes = of_triangles.iter().any(|share| *share != Vec3::ZERO);
        Self { transmittance: passes.then_some(of_triangles), ..self }
    }

    /// Does every triangle block all light?
    #[must_use]
    pub fn is_opaque(&self) -> bool {
        self.transmittance.is_none()
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.corners.len()
    }

    /// The point of a triangle with the given corner weights, unit space.
    #[must_use]
    pub fn point(&self, triangle: u32, barycentric: Vec3) -> Vec3 {
        let [a, b, c] = self.corners[triangle as usize];
        a * barycentric.x + b * barycentric.y + c * barycentric.z
    }

    /// Is there surface at that point of a triangle (not a hole of a cut-out texture)?
    #[must_use]
    pub fn is_solid(&self, triangle: u32, barycentric: Vec3) -> bool {
        let Some(cutout) = &self.cutout[triangle as usize] else { return true };
        let [a, b, c] = self.cutout_uv[triangle as usize];
        cutout.is_solid(a * barycentric.x + b * barycentric.y + c * barycentric.z)
    }

    /// Does anything block the ray from `origin` (see [`ray_origin`]) in direction `direction` (unit)?
    #[must_use]
    pub fn is_blocked(&self, origin: Vec3, direction: Vec3) -> bool {
        let watertight = WatertightRay::new(origin, direction);
        any_hit(
            &self.bvh,
            &bvh_ray(origin, direction),
            #[inline(always)]
            |i| {
                let hit = watertight.intersect(&self.corners[i as usize]);
                hit.is_some_and(|(_, barycentric)| self.is_solid(i, barycentric))
            },
        )
    }

    /// Does anything block the segment from `origin` (see [`ray_origin`]) to `end`?
    #[must_use]
    pub fn is_blocked_before(&self, origin: Vec3, end: Vec3) -> bool {
        let distance = (end - origin).length();
        let direction = (end - origin).normalize_or_zero();
        let watertight = WatertightRay::new(origin, direction);
        any_hit(
            &self.bvh,
            &bvh_ray(origin, direction),
            #[inline(always)]
            |i| {
                let hit = watertight.intersect(&self.corners[i as usize]);
                hit.is_some_and(|(t, barycentric)| t < distance && self.is_solid(i, barycentric))
            },
        )
    }

    /// The share of the light, per colour, that reaches `origin` (see [`ray_origin`]) from `distance` along `direction`
    /// (unit): the product of what all surfaces in between let pass, in any order. Infinitely far for a directional light.
    /// A ray exactly through an edge that two triangles share meets both.
    #[must_use]
    pub fn transmitted(&self, origin: Vec3, direction: Vec3, distance: f32) -> Vec3 {
        let watertight = WatertightRay::new(origin, direction);
        let mut product = Vec3::ONE;
        any_hit(
            &self.bvh,
            &bvh_ray(origin, direction),
            #[inline(always)]
            |i| {
                if let Some((t, barycentric)) = watertight.intersect(&self.corners[i as usize])
                    && t < distance
                    && self.is_solid(i, barycentric)
                {
                    product *= self.transmittance.as_ref().map_or(Vec3::ZERO, |shares| shares[i as usize]);
                }
                product == Vec3::ZERO
            },
        );
        product
    }

    /// The nearest surface from `origin` in direction `direction` (unit). `drawn` says whether a triangle counts
    /// when seen from its front (true) or back (false).
    #[must_use]
    pub fn nearest(&self, origin: Vec3, direction: Vec3, drawn: impl Fn(u32, bool) -> bool) -> Option<Hit> {
        let watertight = WatertightRay::new(origin, direction);
        let mut hit = RayHit::none();
        self.bvh.ray_traverse(bvh_ray(origin, direction), &mut hit, |_, i| {
            let from_front = self.normals[i].dot(direction) < 0.0;
            if !drawn(i as u32, from_front) {
                return f32::INFINITY;
            }
            match watertight.intersect(&self.corners[i]) {
                Some((t, barycentric)) if self.is_solid(i as u32, barycentric) => t * BVH_SCALE,
                _ => f32::INFINITY,
            }
        });
        let triangle = hit.primitive_id;
        let (distance, barycentric) = watertight.intersect(self.corners.get(triangle as usize)?)?;
        Some(Hit { triangle, distance, barycentric })
    }
}

#[derive(Default)]
struct Kept {
    corners: Vec<[Vec3; 3]>,
    normals: Vec<Vec3>,
    areas: Vec<f32>,
    source: Vec<u32>,
}

/// Bounding box centre and the distance of the farthest corner from it.
fn frame_of(soup: &Soup) -> Result<Frame, MeshError> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (triangle, corners) in soup.corners_model.iter().enumerate() {
        for p in corners {
            if !p.is_finite() {
                return Err(MeshError::NotFinite { triangle });
            }
            (low, high) = (low.min(*p), high.max(*p));
        }
    }
    let centre_model = 0.5 * (low + high);
    let radius = soup.corners_model.iter().flatten().map(|p| p.distance(centre_model)).fold(0.0, f64::max);
    if radius > 0.0 && radius.is_finite() {
        Ok(Frame { centre_model, radius })
    } else {
        let total = soup.corners_model.len();
        Err(MeshError::Empty { zero_area: total, total })
    }
}

/// The bits of the corners, starting at the smallest: equal for the same triangle in the same turn. Adding 0.0
/// makes -0.0 and 0.0 one.
#[must_use]
pub fn turn_key(corners: &[Vec3; 3]) -> [[u32; 3]; 3] {
    let bits = corners.map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits));
    let first = (0..3).min_by_key(|&i| bits[i]).unwrap_or(0);
    [bits[first], bits[(first + 1) % 3], bits[(first + 2) % 3]]
}

fn padded_box(corners: &[Vec3; 3]) -> Aabb {
    let [a, b, c] = *corners;
    let padding = Vec3::splat(BOX_PADDING);
    let low = (a.min(b).min(c) - padding) * BVH_SCALE;
    let high = (a.max(b).max(c) + padding) * BVH_SCALE;
    Aabb::new(low.into(), high.into())
}

/// The traversal's ray. Adding zero turns a component of -0.0 into 0.0: with -0.0 the octant test and the
/// reciprocal disagree about the sign and the ray misses the whole model.
fn bvh_ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray::new_inf(Vec3A::from(origin * BVH_SCALE), Vec3A::from(direction) + Vec3A::ZERO)
}

/// A ray's origin just outside the surface at `p` on the side of `normal`.
///
/// A point computed from barycentric weights lies within `gamma(7) (|b0 p0| + |b1 p1| + |b2 p2|)` of its triangle,
/// per axis (pbrt-v4, section 6.8.5). The corners count, not the point: where large corners cancel, a point near a
/// coordinate plane is as wrong as any other. No corner is farther than 1 from the centre, so [`POINT_ERROR`] bounds
/// all points. The origin moves along the normal by that bound projected on it, and every component is then rounded
/// away, so a ray that leaves the side it stands on cannot hit that side again.
#[must_use]
pub fn ray_origin(p: Vec3, normal: Vec3) -> Vec3 {
    let bound = Vec3::splat(POINT_ERROR);
    let offset = normal * normal.abs().dot(bound);
    let moved = p + offset;
    let away = |x: f32, d: f32| match d {
        d if d > 0.0 => x.next_up(),
        d if d < 0.0 => x.next_down(),
        _ => x,
    };
    Vec3::new(away(moved.x, offset.x), away(moved.y, offset.y), away(moved.z, offset.z))
}
