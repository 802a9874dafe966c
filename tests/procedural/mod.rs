//! A scene and planes built in code: smooth, faceted, single-sided, double-sided, textured and cut-out surfaces,
//! away from the origin and not of unit size.

use glam::{DVec3, Vec2, Vec3};
use shadowfit::scene::{Material, Scene};
use shadowfit_solver::{
    mesh::{Cutout, Sides},
    plane::{BakedPlane, Encoding, OPAQUE, OccluderTexture, ShadowPlane, Side},
};
use std::{f32::consts::TAU, sync::Arc};

/// Where the scene lies in model space.
const CENTRE_MODEL: DVec3 = DVec3::new(40.0, -3.0, 7.5);
const SCALE: f64 = 6.0;

const KNOT: u32 = 0;
const TEXTURED: u32 = 1;
const CUT_OUT: u32 = 2;

/// A torus knot, a box and a sphere above a textured plate, and an upright cut-out plate.
pub fn scene() -> Scene {
    let mut scene = Scene {
        images: vec![Arc::new(checkers()), Arc::new(holes())],
        materials: vec![
            material([0.85, 0.45, 0.25, 1.0], None, None),
            material([1.0; 4], Some(0), None),
            material([0.5, 0.8, 0.5, 1.0], Some(1), Some(0.5)),
        ],
        ..Scene::default()
    };
    scene.soup.cutouts.push(Arc::new(cutout(&scene.images[1])));
    surface(&mut scene, [240, 24], KNOT, |a, b| torus_knot(a * TAU, b * TAU));
    surface(&mut scene, [32, 16], KNOT, |a, b| {
        let (longitude, latitude) = (a * TAU, (b - 0.5) * TAU / 2.0);
        let n = Vec3::new(latitude.cos() * longitude.cos(), latitude.sin(), -latitude.cos() * longitude.sin());
        (Vec3::new(0.62, -0.35, 0.45) + 0.17 * n, n)
    });
    cuboid(&mut scene, Vec3::new(-0.6, -0.4, 0.45), Vec3::new(0.16, 0.14, 0.12));
    quad(&mut scene, Vec3::new(-0.8, -0.6, 0.8), Vec3::X * 1.6, Vec3::Z * -1.6, (TEXTURED, Sides::Front));
    quad(&mut scene, Vec3::new(-0.75, -0.55, -0.6), Vec3::X * 0.7, Vec3::Y * 0.8, (CUT_OUT, Sides::Both));
    scene
}

/// `scene` of one horizontal square of side 2 around the origin, facing up.
pub fn ground(sides: Sides) -> Scene {
    let mut scene = Scene { materials: vec![material([1.0; 4], None, None)], ..Scene::default() };
    let corners = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|[x, z]| DVec3::new(x, 0.0, z));
    for [i, j, k] in [[0, 1, 2], [0, 2, 3]] {
        let corners = [corners[i], corners[j], corners[k]];
        push(&mut scene, corners, [Vec3::Y; 3], [Vec2::ZERO; 3], (0, sides));
    }
    scene
}

/// Seven planes through the unit sphere with blobs on them, of every side and several sizes.
pub fn planes() -> Vec<BakedPlane> {
    let mut random = Random(17);
    (0..7)
        .map(|i| {
            let normal = random.direction();
            let u = normal.any_orthonormal_vector();
            let v = normal.cross(u);
            let (width, height) = (random.between(0.8, 1.9), random.between(0.8, 1.9));
            let centre = normal * random.between(-0.35, 0.35);
            let plane = ShadowPlane { origin: centre - 0.5 * (width * u + height * v), u: u * width, v: v * height };
            let texture = blobs(&mut random, 40 + 13 * i, 120 - 11 * i);
            let side = [Side::Both, Side::Front, Side::Back, Side::Both][i % 4];
            BakedPlane { plane, texture, tint: OPAQUE, side, bias: 0.004 }
        })
        .collect()
}

/// Smooth blobs, open at the border.
fn blobs(random: &mut Random, width: usize, height: usize) -> OccluderTexture {
    let blobs: Vec<(Vec2, f32)> = (0..6)
        .map(|_| (Vec2::new(random.between(0.2, 0.8), random.between(0.2, 0.8)), random.between(0.06, 0.18)))
        .collect();
    let mut texels = vec![0; width * height];
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let ab = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let distance = blobs.iter().map(|(centre, r)| ab.distance(*centre) - r).fold(f32::MAX, f32::min);
            let edge = (0.5 - distance / 0.05).clamp(0.0, 1.0);
            texels[y * width + x] = (255.0 * edge * edge * (3.0 - 2.0 * edge)).round() as u8;
        }
    }
    OccluderTexture { width, height, encoding: Encoding::Coverage, texels }
}

/// A small generator (Numerical Recipes' 64-bit LCG): the test draws the same planes forever.
struct Random(u64);

impl Random {
    fn between(&mut self, low: f32, high: f32) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 40) as f32 / (1u32 << 24) as f32)
    }

    fn direction(&mut self) -> Vec3 {
        let (z, angle) = (self.between(-1.0, 1.0), self.between(0.0, TAU));
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * angle.cos(), r * angle.sin(), z)
    }
}

fn material(base_color: [f32; 4], image: Option<usize>, alpha_cutoff: Option<f32>) -> Material {
    Material { base_color, image, repeat: [true; 2], alpha_cutoff, transmittance: None }
}

fn checkers() -> image::RgbaImage {
    image::RgbaImage::from_fn(16, 16, |x, y| {
        image::Rgba(if (x / 4 + y / 4) % 2 == 0 { [225, 220, 205, 255] } else { [150, 165, 185, 255] })
    })
}

fn holes() -> image::RgbaImage {
    image::RgbaImage::from_fn(32, 32, |x, y| {
        let from_centre = Vec2::new(x as f32 - 15.5, y as f32 - 15.5).length();
        image::Rgba([255, 255, 255, if from_centre < 9.0 { 0 } else { 255 }])
    })
}

fn cutout(image: &image::RgbaImage) -> Cutout {
    let alpha = image.pixels().map(|pixel| pixel.0[3]).collect();
    Cutout { width: 32, height: 32, alpha, cutoff: 127.5, repeat: [true; 2] }
}

fn push(
    scene: &mut Scene,
    corners_model: [DVec3; 3],
    normals: [Vec3; 3],
    uvs: [Vec2; 3],
    (material, sides): (u32, Sides),
) {
    scene.soup.corners_model.push(corners_model);
    scene.soup.sides.push(sides);
    scene.soup.cutout.push((material == CUT_OUT).then_some(0));
    scene.soup.cutout_uv.push(uvs);
    scene.normals.push(normals);
    scene.uvs.push(uvs);
    scene.material_of.push(material);
    scene.section_of.push(0);
}

fn model(p: Vec3) -> DVec3 {
    CENTRE_MODEL + SCALE * p.as_dvec3()
}

/// A grid over (a, b) in the unit square -> (point, normal), drawn from the front only.
fn surface(scene: &mut Scene, cells: [usize; 2], material: u32, at: impl Fn(f32, f32) -> (Vec3, Vec3)) {
    let corner = |i: usize, j: usize| {
        let ab = Vec2::new(i as f32 / cells[0] as f32, j as f32 / cells[1] as f32);
        let (p, n) = at(ab.x, ab.y);
        (model(p), n, ab)
    };
    for i in 0..cells[0] {
        for j in 0..cells[1] {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            for [a, b, c] in [[a, b, c], [a, c, d]] {
                push(scene, [a.0, b.0, c.0], [a.1, b.1, c.1], [a.2, b.2, c.2], (material, Sides::Front));
            }
        }
    }
}

fn quad(scene: &mut Scene, origin: Vec3, u: Vec3, v: Vec3, look: (u32, Sides)) {
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let n = u.cross(v).normalize();
    for [i, j, k] in [[0, 1, 2], [0, 2, 3]] {
        let chosen = [corners[i], corners[j], corners[k]];
        let uvs = chosen.map(|(a, b)| Vec2::new(2.3 * a, 1.7 * b));
        push(scene, chosen.map(|(a, b)| model(origin + a * u + b * v)), [n; 3], uvs, look);
    }
}

fn cuboid(scene: &mut Scene, centre: Vec3, half: Vec3) {
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let pick = |i: usize| Vec3::AXES[(axis + i) % 3] * half[(axis + i) % 3];
            let (n, u, v) = (sign * pick(0), pick(1), sign * pick(2));
            quad(scene, centre + n - u - v, 2.0 * u, 2.0 * v, (KNOT, Sides::Front));
        }
    }
}

/// Point and normal of a (2, 3) torus knot; `along` and `around` in radians.
fn torus_knot(along: f32, around: f32) -> (Vec3, Vec3) {
    let centre = |t: f32| {
        let r = 0.36 + 0.14 * (3.0 * t).cos();
        Vec3::new(r * (2.0 * t).cos(), 0.05 + 0.3 * (3.0 * t).sin(), r * (2.0 * t).sin())
    };
    let p = centre(along);
    let tangent = (centre(along + 1e-2) - centre(along - 1e-2)).normalize();
    let side = tangent.cross(p).normalize();
    let n = side * around.cos() + side.cross(tangent) * around.sin();
    (p + 0.085 * n, n)
}
