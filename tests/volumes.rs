//! Shadow volumes on the CPU. The border of a volume, crossed by rays, encloses a point as often as triangles lie between
//! it and the light.

use glam::{DMat4, DVec3, DVec4, Vec3, Vec4};
use shadowfit::render::volume::{Casters, Volume};
use std::collections::BTreeMap;

/// Rays that pass an edge nearer than this (a share of the triangle) may count either way.
const MARGIN: f64 = 1e-6;

/// A small generator (Numerical Recipes' 64-bit LCG).
struct Random(u64);

impl Random {
    fn signed(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u32 << 23) as f32 - 1.0
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}

type Triangles = Vec<[Vec3; 3]>;

fn quad(origin: Vec3, u: Vec3, v: Vec3) -> Triangles {
    vec![[origin, origin + u, origin + u + v], [origin, origin + u + v, origin + v]]
}

/// Closed, wound outwards.
fn cube(half: f32) -> Triangles {
    let face = |axis: usize, sign: f32| {
        let [n, u, v] = [0, 1, 2].map(|i| Vec3::AXES[(axis + i) % 3] * half);
        quad(sign * n - u - sign * v, 2.0 * u, 2.0 * sign * v)
    };
    (0..6).flat_map(|i| face(i / 2, if i % 2 == 0 { 1.0 } else { -1.0 })).collect()
}

fn plate(height: f32, half: f32) -> Triangles {
    quad(Vec3::new(-half, height, half), Vec3::X * 2.0 * half, Vec3::Z * -2.0 * half)
}

/// Three triangles on one edge, one of them wound the other way.
fn fan() -> Triangles {
    let (a, b) = (Vec3::new(0.0, -0.6, 0.1), Vec3::new(0.1, 0.6, -0.1));
    [(0.7, 0.1), (-0.5, 0.4), (-0.1, -0.6)]
        .map(|(x, z)| [a, b, Vec3::new(x, 0.1, z)])
        .into_iter()
        .enumerate()
        .map(|(i, [a, b, c])| if i == 2 { [b, a, c] } else { [a, b, c] })
        .collect()
}

/// A plate that stands on another without sharing an edge with it, and a loose copy of one triangle turned round.
fn tee() -> Triangles {
    let mut out = plate(0.0, 0.6);
    out.extend(quad(Vec3::new(-0.5, 0.0, 0.05), Vec3::X, Vec3::Y * 0.7));
    let [a, b, c] = out[0];
    out.push([b, a, c]);
    out
}

fn scenes() -> Vec<(&'static str, Triangles)> {
    let overlapping = [plate(0.0, 0.5), plate(0.3, 0.4)].concat();
    vec![("box", cube(0.5)), ("plate", plate(0.1, 0.5)), ("plates", overlapping), ("fan", fan()), ("tee", tee())]
}

fn lights() -> Vec<Vec4> {
    vec![
        Vec3::new(0.2, 0.9, 0.3).extend(0.0),
        Vec3::new(-0.7, -0.4, 0.2).extend(0.0),
        Vec3::X.extend(0.0),
        Vec3::new(0.3, 1.4, -0.2).extend(1.0),
        Vec3::new(0.05, 0.2, 0.1).extend(1.0),
        Vec3::new(-0.9, -0.1, 0.8).extend(1.0),
    ]
}

/// How often the faces of a volume, one class at a time, are left by the ray from p, minus how often they are entered;
/// `None` where it passes an edge.
fn crossings(casters: &Casters, volume: &Volume, light: Vec4, (p, d): (DVec3, DVec3)) -> Option<BTreeMap<u32, i32>> {
    let corner = |i: u32| casters.corners()[i as usize / 3][i as usize % 3].as_dvec3().extend(1.0);
    let light = light.as_dvec4();
    let extruded = |q: DVec4| (light.w * q - light).truncate().extend(0.0);
    let mut faces = Vec::new();
    for (triangles, order) in [(&volume.towards, [0, 1, 2]), (&volume.away, [0, 2, 1])] {
        for &t in triangles {
            let [a, b, c] = order.map(|k| corner(3 * t + k));
            let class = casters.class_of()[t as usize];
            faces.push(([a, b, c], class, 1));
            faces.push(([c, b, a].map(extruded), class, 1));
        }
    }
    for side in &volume.sides {
        let [a, b] = [side.start, side.end].map(corner);
        let class = casters.class_of()[side.start as usize / 3];
        faces.push(([b, a, extruded(a)], class, side.count as i32));
        faces.push(([b, extruded(a), extruded(b)], class, side.count as i32));
    }
    let mut counts = BTreeMap::new();
    for (face, class, count) in faces {
        *counts.entry(class).or_default() += count * crossing(face, p, d)?;
    }
    Some(counts)
}

/// 1 where the ray leaves through the face (its front looks along the ray), -1 where it enters, else 0. A face is the
/// cone of its homogeneous corners; one at infinity is met at the end of all rays.
fn crossing([a, b, c]: [DVec4; 3], p: DVec3, d: DVec3) -> Option<i32> {
    let is_infinite = [a, b, c].iter().all(|corner| corner.w == 0.0);
    let last = if is_infinite { DVec4::W } else { -d.extend(0.0) };
    let matrix = DMat4::from_cols(a, b, c, last);
    let determinant = matrix.determinant();
    if determinant.abs() < 1e-12 {
        return Some(0);
    }
    let end = if is_infinite { d.extend(1.0) } else { p.extend(1.0) };
    let DVec4 { x, y, z, w: t } = matrix.inverse() * end;
    let weights = [x, y, z];
    if t > MARGIN && weights.iter().all(|w| *w > MARGIN) {
        return Some(if determinant > 0.0 { 1 } else { -1 });
    }
    let is_near = t > -MARGIN && weights.iter().all(|w| *w > -MARGIN);
    if is_near { None } else { Some(0) }
}

/// Triangles of each class between p and the light, by a loop; `None` near an edge.
fn blocking(casters: &Casters, p: DVec3, light: Vec4) -> Option<BTreeMap<u32, i32>> {
    let light = light.as_dvec4();
    let to_light = light.truncate() - light.w * p;
    let mut counts = BTreeMap::new();
    for (corners, class) in casters.corners().iter().zip(casters.class_of()) {
        let corners = corners.map(|corner| corner.as_dvec3().extend(1.0));
        // Beyond a point light nothing blocks.
        let behind = light.w == 1.0 && crossing(corners, light.truncate(), to_light)? != 0;
        let hit = crossing(corners, p, to_light)? != 0 && !behind;
        *counts.entry(*class).or_default() += i32::from(hit);
    }
    Some(counts)
}

#[test]
fn a_volume_contains_a_point_as_often_as_triangles_block_it() {
    for (name, triangles) in scenes() {
        // Two classes, so that sides of one must not cancel those of the other.
        let class_of: Vec<u32> = (0..triangles.len() as u32).map(|t| u32::from(t % 3 == 0)).collect();
        for classes in [vec![0; triangles.len()], class_of] {
            let casters = Casters::new(&triangles, &classes);
            for light in lights() {
                let volume = casters.volume(light);
                let mut random = Random(5);
                let (mut decided, mut shadowed) = (0, 0);
                for _ in 0..2_000 {
                    let (p, d) = (random.point().as_dvec3(), random.point().as_dvec3());
                    let Some(expected) = blocking(&casters, p, light) else { continue };
                    let Some(found) = crossings(&casters, &volume, light, (p, d)) else { continue };
                    for (class, count) in &expected {
                        let found = found.get(class).copied().unwrap_or_default();
                        assert_eq!(found, *count, "{name}, light {light}: class {class} at {p} along {d}");
                    }
                    let total: i32 = expected.values().sum();
                    assert_eq!(casters.blockers(p.as_vec3(), light), total as u32, "{name}, light {light}: {p}");
                    decided += 1;
                    shadowed += usize::from(total > 0);
                }
                // An edge-on plate casts nothing.
                let casts = shadowed > 20 || volume.sides.is_empty();
                assert!(decided > 1_900 && casts, "{name}, light {light}: {shadowed} of {decided}");
            }
        }
    }
}

#[test]
fn halved_bodies_cast_on_the_same_points() {
    let moved = |body: Triangles, by: Vec3| -> Triangles { body.into_iter().map(|t| t.map(|p| p + by)).collect() };
    let inside_out = |body: Triangles| -> Triangles { body.into_iter().map(|[a, b, c]| [a, c, b]).collect() };
    let scenes: Vec<(&str, Triangles)> = vec![
        ("box", cube(0.5)),
        ("box inside out", inside_out(cube(0.5))),
        ("box in a box", [cube(0.7), cube(0.3)].concat()),
        ("boxes through each other", [cube(0.5), moved(cube(0.4), Vec3::new(0.3, 0.2, 0.1))].concat()),
        // They share an edge.
        ("boxes side by side", [cube(0.25), moved(cube(0.25), Vec3::new(0.5, 0.5, 0.0))].concat()),
        ("box and plate", [cube(0.3), plate(0.6, 0.5)].concat()),
        ("open box", cube(0.5)[2..].to_vec()),
    ];
    for (name, triangles) in scenes {
        let casters = Casters::new(&triangles, &vec![0; triangles.len()]);
        let halved = casters.clone().halved();
        for light in lights() {
            let (whole, volume) = (casters.volume(light), halved.volume(light));
            let caps = |volume: &Volume| volume.towards.len() + volume.away.len();
            if name.starts_with("box") && name != "box and plate" && light.w == 0.0 {
                assert_eq!(2 * caps(&volume), caps(&whole), "{name}, light {light}");
            }
            let mut random = Random(7);
            let mut decided = 0;
            for _ in 0..1_000 {
                let (p, d) = (random.point().as_dvec3(), random.point().as_dvec3());
                let Some(blocking) = blocking(&casters, p, light) else { continue };
                let Some(found) = crossings(&halved, &volume, light, (p, d)) else { continue };
                let (blocking, found) = (blocking[&0], found.get(&0).copied().unwrap_or_default());
                assert_eq!(found > 0, blocking > 0, "{name}, light {light}: {found} of {blocking} at {p}");
                assert_eq!(halved.blockers(p.as_vec3(), light) as i32, found, "{name}, light {light}: {p}");
                decided += 1;
            }
            assert!(decided > 900, "{name}, light {light}: {decided}");
        }
    }
}

#[test]
fn sides_are_counted_as_often_as_the_edges_are_borders() {
    let count = |triangles: &Triangles, light: Vec3| {
        let casters = Casters::new(triangles, &vec![0; triangles.len()]);
        let volume = casters.volume(light.extend(0.0));
        let sides: Vec<u32> = volume.sides.iter().map(|side| side.count).collect();
        (volume.towards.len(), volume.away.len(), sides)
    };
    // A closed body: its outline, six edges of the cube, counts for the lit and the dark half.
    let (towards, away, sides) = count(&cube(0.5), Vec3::new(0.5, 0.7, 0.6));
    assert_eq!((towards, away, sides), (6, 6, vec![2; 6]));
    // A light along an axis: four faces are edge-on and cast nothing.
    let (towards, away, sides) = count(&cube(0.5), Vec3::Y);
    assert_eq!((towards, away, sides), (2, 2, vec![1; 8]));
    // A plate has its border only, on either side of the light.
    assert_eq!(count(&plate(0.0, 1.0), Vec3::Y), (2, 0, vec![1; 4]));
    assert_eq!(count(&plate(0.0, 1.0), Vec3::NEG_Y), (0, 2, vec![1; 4]));
    // Three triangles on one edge, all on one side of it as the light sees them: it counts three times.
    let (a, b) = (Vec3::ZERO, Vec3::Z);
    let pages: Triangles = [0.0, 0.2, 0.4].map(|y| [a, b, Vec3::new(1.0, y, 0.5)]).to_vec();
    let (_, _, mut sides) = count(&pages, Vec3::Y);
    sides.sort_unstable();
    assert_eq!(sides, [1, 1, 1, 1, 1, 1, 3]);
}

#[test]
fn rays_through_shared_edges_and_corners_meet_one_triangle() {
    // The plate's diagonal and the corner where eight triangles meet.
    let casters = Casters::new(&plate(0.0, 1.0), &[0; 2]);
    for x in [-0.5, 0.0, 0.25] {
        let p = Vec3::new(x, -1.0, -x);
        assert_eq!(casters.blockers(p, Vec3::Y.extend(0.0)), 1, "{p}");
        assert_eq!(casters.blockers(p, Vec3::new(x, 1.0, -x).extend(1.0)), 1, "{p}");
        assert_eq!(casters.blockers(p, Vec3::new(x, -0.5, -x).extend(1.0)), 0, "{p}");
    }
    let quarters: Triangles = (0..8)
        .map(|i| {
            let at = |i: i32| {
                let angle = (i % 8) as f32 * std::f32::consts::FRAC_PI_4;
                Vec3::new(angle.cos(), 0.0, angle.sin())
            };
            if i % 3 == 0 { [Vec3::ZERO, at(i), at(i + 1)] } else { [at(i), Vec3::ZERO, at(i + 1)] }
        })
        .collect();
    let casters = Casters::new(&quarters, &[0; 8]);
    assert_eq!(casters.blockers(Vec3::NEG_Y, Vec3::Y.extend(0.0)), 1);
}
