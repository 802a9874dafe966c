//! Shadow volumes of a triangle soup: which triangles face a light, and which edges are extruded how often.
//!
//! In: triangles in unit space, each of a *class* (the triangles of one class weigh the same), and a light. Out: a
//! [`Volume`], whose light caps, sides and dark caps together are the border of all points in shadow, each as often as
//! triangles lie between it and the light.
//!
//! Method: every triangle, closed or not, wound either way, casts a volume of its own: itself, turned so that it faces
//! the light, and its three edges extruded away from the light to infinity (and, under a point light, itself there). The
//! sides on one edge cancel by direction; what is left is the edge's *cap count*, 0 wherever two triangles continue each
//! other, 2 on the outline of a closed body, any number where many meet. Edges are the same where their corners are
//! equal bit for bit. Sources: Bergeron, "A General Version of Crow's Shadow Volumes", 1986; Aldridge and Woods, "Robust,
//! Geometry-Independent Shadow Volumes", 2004; Kim, Kim and Turk, "A Shadow-Volume Algorithm for Opaque and Transparent
//! Nonmanifold Casters", 2008, whose triangles are oriented where these turn to the light.
//!
//! Guaranteed: the border is closed whatever the rounding of [`Casters::volume`] says about a triangle edge-on to the
//! light, so no shadow leaks to infinity. Not guaranteed: cut-out textures, which cast as if they had no holes; a volume
//! knows no texels.
//!
//! A light is one homogeneous point in unit space: (direction towards it, 0) or (position, 1).

use crate::scene::Scene;
use glam::{DVec3, DVec4, Vec3, Vec4};
use shadowfit_solver::mesh::{Frame, turn_key};
use std::collections::{HashMap, HashSet};

/// The triangles that cast, and which edges they share.
#[derive(Clone, Debug)]
pub struct Casters {
    corners: Vec<[Vec3; 3]>,
    /// (n, -n.a) of each triangle: a light lies before its front where the product with it is positive. In f64: products
    /// of f32 coordinates are exact there.
    planes: Vec<DVec4>,
    class_of: Vec<u32>,
    edges: Vec<Edge>,
    /// Those of an edge stand together, sorted by class.
    uses: Vec<Use>,
    /// Which of `bodies` a triangle is of.
    body_of: Vec<u32>,
    bodies: Vec<Body>,
}

/// Triangles that hang together by edges.
#[derive(Clone, Copy, Debug)]
struct Body {
    /// 1 or -1 if only triangles cast whose front or back faces the light; 0: all.
    side: i32,
    low: Vec3,
    high: Vec3,
}

/// Two points that some triangle connects.
#[derive(Clone, Copy, Debug)]
struct Edge {
    points: [u32; 2],
    first_use: usize,
}

/// A triangle at an edge.
#[derive(Clone, Copy, Debug)]
struct Use {
    triangle: u32,
    class: u32,
    /// From its corner number `k` to the next.
    k: u32,
    /// 1 where that is from the edge's start to its end, else -1.
    along: i32,
}

/// The volume under one light.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Volume {
    /// Triangles that face the light as they are wound. Each is a light cap, and its dark cap at infinity under a point
    /// light.
    pub towards: Vec<u32>,
    /// Triangles that face it when turned round.
    pub away: Vec<u32>,
    /// Edges to extrude.
    pub sides: Vec<Side>,
}

/// An edge to extrude: the quad (end, start, extruded start, extruded end) faces outwards, `count` times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Side {
    /// Corner `k` of a triangle of the class that casts: `3 triangle + k`.
    pub start: u32,
    /// Another corner of that triangle.
    pub end: u32,
    /// At least 1.
    pub count: u32,
}

impl Casters {
    /// The casters of a scene in the unit space of `frame`: all triangles but the ground and copies of others. `class_of`
    /// tells the class of a material. Also, of each caster, its triangle in the scene.
    #[must_use]
    pub fn of_scene(scene: &Scene, frame: &Frame, class_of: impl Fn(usize) -> u32) -> (Self, Vec<u32>) {
        let mut seen = HashSet::new();
        let (mut corners, mut classes, mut source) = (Vec::new(), Vec::new(), Vec::new());
        for (triangle, corners_model) in scene.soup.corners_model.iter().enumerate() {
            let corners_unit = corners_model.map(|p| frame.unit_from_model(p));
            if !scene.is_ground(triangle) && seen.insert(turn_key(&corners_unit)) {
                corners.push(corners_unit);
                classes.push(class_of(scene.material_of[triangle] as usize));
                source.push(triangle as u32);
            }
        }
        (Self::new(&corners, &classes), source)
    }

    /// Finds the edges. `class_of` has one entry a triangle.
    #[must_use]
    pub fn new(corners: &[[Vec3; 3]], class_of: &[u32]) -> Self {
        let mut point_at = HashMap::new();
        // Adding 0.0 makes -0.0 and 0.0 one.
        let mut point =
            |p: Vec3, corner: u32| *point_at.entry((p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(corner);
        let points: Vec<[u32; 3]> = (0u32..)
            .zip(corners)
            .map(|(t, triangle)| std::array::from_fn(|k| point(triangle[k], 3 * t + k as u32)))
            .collect();
        let mut uses: Vec<_> = (0u32..).zip(&points).zip(class_of).flat_map(uses_of).collect();
        uses.sort_unstable_by_key(|&(ends, u)| (ends, u.class, u.triangle, u.along));
        let mut edges: Vec<Edge> = Vec::new();
        for (first_use, &(points, _)) in uses.iter().enumerate() {
            if edges.last().is_none_or(|edge| edge.points != points) {
                edges.push(Edge { points, first_use });
            }
        }
        let uses = uses.into_iter().map(|(_, u)| u).collect();
        let (body_of, bodies) = (vec![0; corners.len()], vec![Body { side: 0, low: Vec3::ZERO, high: Vec3::ZERO }]);
        let planes = corners.iter().map(plane).collect();
        Self { corners: corners.to_vec(), planes, class_of: class_of.to_vec(), edges, uses, body_of, bodies }
    }

    /// Lets closed bodies cast with one half of their triangles: those whose front faces the light, which is where a way to
    /// the light leaves the body; of bodies turned inside out, the others. Outlines then count once and not twice, and half
    /// of the caps are left. A body is what hangs together by edges; it is closed where each of its edges is run through
    /// as often one way as the other, and it is halved under lights outside of its bounding box. No point comes out of the
    /// shadow by this but those that an inside-out part of a body encloses. For opaque casters: it is no longer the number
    /// of surfaces that is counted.
    #[must_use]
    pub fn halved(mut self) -> Self {
        let mut forest = Forest { parent: (0..self.corners.len() as u32).collect() };
        for uses in self.uses_by_edge() {
            uses.windows(2).for_each(|pair| forest.join(pair[0].triangle, pair[1].triangle));
        }
        self.body_of = (0..self.corners.len() as u32).map(|triangle| forest.root(triangle)).collect();
        // Bodies are numbered by their roots: most numbers are of none.
        let mut volume = vec![0.0; self.corners.len()];
        let none = Body { side: 0, low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };
        self.bodies = vec![none; self.corners.len()];
        for (corners, &body) in self.corners.iter().zip(&self.body_of) {
            let [a, b, c] = corners.map(|corner| corner.as_dvec3());
            volume[body as usize] += a.dot(b.cross(c));
            let Body { low, high, .. } = &mut self.bodies[body as usize];
            (*low, *high) = corners.iter().fold((*low, *high), |(low, high), p| (low.min(*p), high.max(*p)));
        }
        self.bodies.iter_mut().zip(volume).for_each(|(body, volume)| body.side = sign(volume));
        let open = self.uses_by_edge().filter(|uses| uses.iter().map(|u| u.along).sum::<i32>() != 0);
        let open: Vec<u32> = open.map(|uses| self.body_of[uses[0].triangle as usize]).collect();
        open.into_iter().for_each(|body| self.bodies[body as usize].side = 0);
        self
    }

    /// The triangles at each edge.
    fn uses_by_edge(&self) -> impl Iterator<Item = &[Use]> {
        let ends = self.edges.iter().skip(1).map(|next| next.first_use).chain([self.uses.len()]);
        self.edges.iter().zip(ends).map(|(edge, end)| &self.uses[edge.first_use..end])
    }

    /// The side of a triangle that faces the light, 1 or -1; 0 where it casts nothing.
    fn facing(&self, triangle: usize, light: Vec4) -> i32 {
        let facing = sign(self.planes[triangle].dot(light.as_dvec4()));
        let Body { side, low, high } = self.bodies[self.body_of[triangle] as usize];
        let p = light.truncate();
        let is_in_box = light.w != 0.0 && p.cmpge(low).all() && p.cmple(high).all();
        if side == 0 || side == facing || is_in_box { facing } else { 0 }
    }

    /// Number of triangles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Does nothing cast?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// Corners of the triangles, unit space.
    #[must_use]
    pub fn corners(&self) -> &[[Vec3; 3]] {
        &self.corners
    }

    /// Class of each triangle.
    #[must_use]
    pub fn class_of(&self) -> &[u32] {
        &self.class_of
    }

    /// The volume under a light, as the module says. Triangles edge-on to the light cast nothing.
    #[must_use]
    pub fn volume(&self, light: Vec4) -> Volume {
        let facings: Vec<i32> = (0..self.corners.len()).map(|triangle| self.facing(triangle, light)).collect();
        let mut volume = Volume::default();
        for (triangle, &facing) in (0u32..).zip(&facings) {
            match facing {
                1 => volume.towards.push(triangle),
                -1 => volume.away.push(triangle),
                _ => {}
            }
        }
        for uses in self.uses_by_edge() {
            for uses in uses.chunk_by(|a, b| a.class == b.class) {
                let count: i32 = uses.iter().map(|u| u.along * facings[u.triangle as usize]).sum();
                let Use { triangle, k, along, .. } = uses[0];
                let [from, to] = [k, (k + 1) % 3].map(|k| 3 * triangle + k);
                let [start, end] = if along * count > 0 { [from, to] } else { [to, from] };
                if count != 0 {
                    volume.sides.push(Side { start, end, count: count.unsigned_abs() });
                }
            }
        }
        volume
    }

    /// Number of casting triangles between a point and the light: of volumes that contain it. A ray exactly through an edge or
    /// a corner counts as one beside it, the same one for all triangles there.
    #[must_use]
    pub fn blockers(&self, p: Vec3, light: Vec4) -> u32 {
        let to_light = (light.truncate() - light.w * p).as_dvec3();
        let reach = if light.w == 0.0 { f64::INFINITY } else { 1.0 };
        // Which side of the line from u to v the ray passes; where it meets the line, which side once it is moved along x,
        // then y, then z (Edelsbrunner and Muecke, "Simulation of Simplicity", 1990).
        let side = |u: DVec3, v: DVec3| {
            let moved = DVec3::AXES.map(|axis| (v - u).cross(axis));
            let sides = [u.cross(v), moved[0], moved[1], moved[2]].map(|normal| to_light.dot(normal));
            sides.into_iter().find(|side| *side != 0.0).is_some_and(|side| side > 0.0)
        };
        let blocks = |corners: &[Vec3; 3]| {
            let [a, b, c] = corners.map(|corner| (corner - p).as_dvec3());
            let normal = (b - a).cross(c - a);
            let t = a.dot(normal) / to_light.dot(normal);
            let first = side(a, b);
            side(b, c) == first && side(c, a) == first && t > 0.0 && t < reach
        };
        let casts = |triangle: &usize| self.facing(*triangle, light) != 0 && blocks(&self.corners[*triangle]);
        (0..self.corners.len()).filter(casts).count() as u32
    }
}

/// The three edges of a triangle; those of no length are none.
fn uses_of(((triangle, points), &class): ((u32, &[u32; 3]), &u32)) -> impl Iterator<Item = ([u32; 2], Use)> {
    let points = *points;
    (0..3).filter_map(move |k| {
        let [from, to] = [points[k], points[(k + 1) % 3]];
        let along = if from < to { 1 } else { -1 };
        (from != to).then_some(([from.min(to), from.max(to)], Use { triangle, class, k: k as u32, along }))
    })
}

fn plane(corners: &[Vec3; 3]) -> DVec4 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let normal = (b - a).cross(c - a);
    normal.extend(-normal.dot(a))
}

fn sign(x: f64) -> i32 {
    i32::from(x > 0.0) - i32::from(x < 0.0)
}

/// Triangles that hang together, as trees whose roots stand for them.
struct Forest {
    parent: Vec<u32>,
}

impl Forest {
    fn root(&mut self, triangle: u32) -> u32 {
        let mut root = triangle;
        while self.parent[root as usize] != root {
            // Half the way is cut for the next.
            let above = self.parent[self.parent[root as usize] as usize];
            self.parent[root as usize] = above;
            root = above;
        }
        root
    }

    fn join(&mut self, a: u32, b: u32) {
        let [a, b] = [a, b].map(|triangle| self.root(triangle));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}
