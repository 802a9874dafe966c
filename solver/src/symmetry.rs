//! Symmetry: does a plane mirror the model onto itself, shadows and all?
//!
//! In: a mesh, a pilot sample of traced pairs, the light domain. Out: the mirror plane, if there is one. Method: candidates
//! are the planes square to the model's axes through the middle of its box (the only ones that map the box onto itself)
//! and square to the principal axes through the centroid of the surface (Minovic, Ishikawa, Kato, "Symmetry
//! Identification of a 3-D Object Represented by Octree", 1993). The surface is looked for where a receiver's image
//! lies, and then the only thing that matters is measured: the visibility V(p, l) against V(image of p, image of l).
//!
//! Not found: mirrors of parts, rotations, and more than one plane; a model with two is served by the better one.

use crate::{
    lights::LightDomain,
    mesh::{Mesh, ray_origin},
    plane::{Ground, PlacedPlane, ShadowPlane, Side},
    receivers::Receivers,
    visibility::{LightPairs, Pairs, mean},
};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// A plane that mirrors: `normal . p = offset`, unit space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror {
    normal: Vec3,
    offset: f32,
}

/// A candidate with what was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The plane.
    pub mirror: Mirror,
    /// Weight of the pairs whose receiver has no surface like it at its image, as a share of all light.
    pub unmatched: f64,
    /// Weight of the other pairs whose visibility differs from their image's, as a share of the shadow.
    pub disagreement: f64,
}

/// Most disagreement of a mirror. Planes fitted to both halves are wrong about half of it, at most 0.005 of the shadow;
/// the best fits leave 0.04 and more. Thirteen models drawn as a mirror gave 0.0000 to 0.0038 (an airliner 0.0025, a teapot
/// whose diagonals run all one way 0.0003), a lantern whose handle hangs to one side 0.016, a truck 0.019.
pub const MAX_DISAGREEMENT: f64 = 0.01;

/// Largest share of the light that falls where the other half has no such surface. The same models gave 0.000 to 0.010;
/// the truck, with its load to one side, 0.28.
pub const MAX_UNMATCHED: f64 = 0.02;

/// Farthest that the surface may lie from where a receiver's image is expected, unit space: half a texel of a plane of
/// 128 across a section. Patches with diagonals that all run one way are up to this far from their image: at 0.001 a
/// car's bonnet, 6 % of its light, was missing. At 0.01 plates are taken for each other's images, and shadows differ.
const TOLERANCE: f32 = 3e-3;

/// Smallest cosine between a surface's normal and the image of the receiver's: 8 degrees, for the same patches.
const SAME_NORMAL: f32 = 0.99;

/// Receivers that are mirrored: with the pilot's lights some 60,000 pairs, a third of them blocked.
const RECEIVERS: usize = 2048;

/// A domain whose axis is turned by the mirror by less than twice this (radians) is its own image.
const DOMAIN_TOLERANCE: f32 = 1e-3;

/// Principal axes nearer to one of the model's than this (cosine; 0.8 degrees) are no other candidates.
const OTHER_AXIS: f64 = 0.9999;

/// Two directions of a list and its image that would lie nearer than this share of their spacing become one on the plane.
const MERGED_SHARE: f32 = 0.5;

impl Mirror {
    /// The plane `normal . p = offset`; `normal` is a unit vector.
    #[must_use]
    pub fn new(normal: Vec3, offset: f32) -> Self {
        Self { normal, offset }
    }

    /// Unit normal; it points to the near half.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Distance of the plane from the origin along the normal.
    #[must_use]
    pub fn offset(&self) -> f32 {
        self.offset
    }

    /// The image of a point. Exact, and its own inverse to the bit, where the normal is an axis and the offset 0.
    #[must_use]
    pub fn point(&self, p: Vec3) -> Vec3 {
        p - self.normal * (2.0 * (self.normal.dot(p) - self.offset))
    }

    /// The image of a vector.
    #[must_use]
    pub fn vector(&self, v: Vec3) -> Vec3 {
        v - self.normal * (2.0 * self.normal.dot(v))
    }

    /// Does the point lie in the half that the normal points away from?
    #[must_use]
    pub fn is_far(&self, p: Vec3) -> bool {
        self.normal.dot(p) < self.offset
    }

    /// The image of a plane. Its `u x v` points to the other side of it than the image of the normal does.
    #[must_use]
    pub fn placed(&self, placed: &PlacedPlane) -> PlacedPlane {
        let ShadowPlane { origin, u, v } = placed.plane;
        let plane = ShadowPlane { origin: self.point(origin), u: self.vector(u), v: self.vector(v) };
        let side = match placed.side {
            Side::Both => Side::Both,
            Side::Front => Side::Back,
            Side::Back => Side::Front,
        };
        PlacedPlane { plane, side, bias: placed.bias }
    }

    /// About as many directions, equally dense, that are their own image together: those of the near half, those next
    /// to the plane moved into it, then the images of the others. `solid_angle` is that of all.
    #[must_use]
    pub fn closed(&self, directions: &[Vec3], solid_angle: f64) -> Vec<Vec3> {
        let spacing = (solid_angle / directions.len().max(1) as f64).sqrt() as f32;
        let near = |l: &Vec3| {
            let height = self.normal.dot(*l);
            let merged = 2.0 * height < MERGED_SHARE * spacing;
            let l = if merged { (*l - self.normal * height).normalize_or(*l) } else { *l };
            (height >= 0.0).then_some((l + Vec3::ZERO, merged))
        };
        let half: Vec<(Vec3, bool)> = directions.iter().filter_map(near).collect();
        let images = half.iter().filter(|(_, merged)| !merged).map(|(l, _)| self.vector(*l) + Vec3::ZERO);
        half.iter().map(|(l, _)| *l).chain(images).collect()
    }

    /// Is every direction's image in the domain, too?
    fn keeps(&self, domain: LightDomain) -> bool {
        match domain {
            LightDomain::Sphere => true,
            LightDomain::Hemisphere => self.normal.y.abs() < DOMAIN_TOLERANCE,
            LightDomain::Cone { axis, .. } => self.normal.dot(axis).abs() < DOMAIN_TOLERANCE,
        }
    }
}

/// The plane that mirrors the mesh, its shadow and the lights onto themselves, and the ground, if there is one: that
/// is its own image where the half space of lights that it sees is.
#[must_use]
pub fn find(mesh: &Mesh, pilot: (&Receivers, &Pairs), domain: LightDomain, ground: Option<&Ground>) -> Option<Mirror> {
    let keeps_ground = |mirror: &Mirror| ground.is_none() || mirror.keeps(LightDomain::Hemisphere);
    let mirrors = candidates(mesh).into_iter().filter(|mirror| mirror.keeps(domain) && keeps_ground(mirror));
    let measured = mirrors.map(|mirror| measure(mesh, pilot, mirror));
    let holds = |m: &Measured| m.unmatched <= MAX_UNMATCHED && m.disagreement <= MAX_DISAGREEMENT;
    let best = measured.filter(holds).reduce(|a, b| if b.disagreement < a.disagreement { b } else { a });
    best.map(|best| best.mirror)
}

/// Planes that may mirror the mesh.
#[must_use]
pub fn candidates(mesh: &Mesh) -> Vec<Mirror> {
    let mut mirrors: Vec<Mirror> = Vec3::AXES.iter().map(|axis| Mirror::new(*axis, 0.0)).collect();
    let (centroid, axes) = principal_axes(mesh);
    let is_other = |axis: &DVec3| axis.abs().max_element() < OTHER_AXIS;
    let through = |axis: DVec3| Mirror::new(axis.as_vec3().normalize(), axis.dot(centroid) as f32);
    mirrors.extend(axes.into_iter().filter(is_other).map(through));
    mirrors
}

/// What a candidate's images disagree about. Both shares are infinite where nothing is in shadow.
#[must_use]
pub fn measure(mesh: &Mesh, (receivers, pairs): (&Receivers, &Pairs), mirror: Mirror) -> Measured {
    let stride = (receivers.points.len() / RECEIVERS).max(1);
    let image = |i: usize| image_origin(mesh, (receivers.points[i], receivers.normals[i]), &mirror);
    let images: Vec<Option<Vec3>> = (0..receivers.points.len()).into_par_iter().step_by(stride).map(image).collect();
    let of_light = |light: &LightPairs| {
        let l = mirror.vector(light.light);
        let mut sums = Sums::default();
        let pairs = light.vote.iter().zip(&light.receiver).enumerate();
        for (i, (&vote, &receiver)) in pairs.filter(|(_, (_, r))| (**r as usize).is_multiple_of(stride)) {
            let weight = f64::from(vote.abs());
            sums.total += weight;
            match images[receiver as usize / stride] {
                None => sums.unmatched += weight,
                Some(origin) => {
                    sums.shadow += f64::from(vote.max(0.0));
                    let wrong = mesh.transmitted(origin, l, f32::INFINITY) - light.arriving(i);
                    sums.wrong += weight * f64::from(mean(wrong.abs()));
                }
            }
        }
        sums
    };
    let sums: Vec<Sums> = pairs.lights.par_iter().map(of_light).collect();
    let sum = |part: fn(&Sums) -> f64| sums.iter().map(part).sum::<f64>();
    let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { f64::INFINITY };
    Measured {
        mirror,
        unmatched: share(sum(|s| s.unmatched), sum(|s| s.total)),
        disagreement: share(sum(|s| s.wrong), sum(|s| s.shadow)),
    }
}

/// Weights of one light's pairs.
#[derive(Default)]
struct Sums {
    total: f64,
    unmatched: f64,
    /// Of those with an image.
    shadow: f64,
    /// Of those whose visibility is not their image's.
    wrong: f64,
}

/// Where rays start at the image of a receiver, if there is surface like it.
fn image_origin(mesh: &Mesh, (point, normal): (Vec3, Vec3), mirror: &Mirror) -> Option<Vec3> {
    let (point, normal) = (mirror.point(point), mirror.vector(normal));
    let is_alike = |triangle: u32, _| mesh.normals[triangle as usize].dot(normal).abs() > SAME_NORMAL;
    let hit = mesh.nearest(point + normal * TOLERANCE, -normal, is_alike)?;
    (hit.distance <= 2.0 * TOLERANCE).then(|| {
        let own = mesh.normals[hit.triangle as usize];
        let outward = if own.dot(normal) < 0.0 { -own } else { own };
        ray_origin(mesh.point(hit.triangle, hit.barycentric), outward)
    })
}

/// Centroid of the surface, and the eigenvectors of its covariance: of each triangle A/12 (9 mm' + aa' + bb' + cc'), where
/// m is its middle, a, b, c its corners.
fn principal_axes(mesh: &Mesh) -> (DVec3, [DVec3; 3]) {
    let outer = |p: DVec3| DMat3::from_cols(p * p.x, p * p.y, p * p.z);
    let (mut area, mut first, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
    for (corners, &a) in mesh.corners.iter().zip(&mesh.areas) {
        let (corners, a) = (corners.map(|p| p.as_dvec3()), f64::from(a));
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        area += a;
        first += a * middle;
        second += (corners.into_iter().map(outer).fold(outer(middle) * 9.0, |sum, m| sum + m)) * (a / 12.0);
    }
    let centroid = first / area;
    (centroid, eigenvectors(second * (1.0 / area) - outer(centroid)))
}

/// Eigenvectors of a symmetric matrix (Jacobi's method, 1846: off-diagonal elements are rotated away in turn). Eight
/// sweeps leave nothing of any 3 x 3 matrix: the convergence is quadratic.
fn eigenvectors(mut m: DMat3) -> [DVec3; 3] {
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..8 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if m.col(p)[q] == 0.0 {
                continue;
            }
            let angle = 0.5 * (2.0 * m.col(p)[q]).atan2(m.col(q)[q] - m.col(p)[p]);
            let (sin, cos) = angle.sin_cos();
            let mut turn = DMat3::IDENTITY;
            (turn.col_mut(p)[p], turn.col_mut(q)[q]) = (cos, cos);
            (turn.col_mut(q)[p], turn.col_mut(p)[q]) = (sin, -sin);
            m = turn.transpose() * m * turn;
            vectors *= turn;
        }
    }
    [vectors.x_axis, vectors.y_axis, vectors.z_axis]
}
