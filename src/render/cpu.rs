//! The CPU twin of [`super::turntable`]: the same frames by camera rays, for machines without an adapter.
//!
//! Rays find the surface (`Mesh::nearest`), `solver::shade` predicts its visibility, in the order and with the
//! constants of the shaders. [`Primary`] holds what a camera sees, so that many lights, or another source of
//! visibility (the traced reference), share the rays. Rows run in parallel; the bytes do not depend on threads.
//!
//! Not drawn: [`Mode::Planes`].

use super::{
    AMBIENT, Antialias, BACKGROUND_LINEAR, Camera, DIFFUSE, FrameRequest, Light, Mode, RenderError, linear_from_srgb,
    srgb_from_linear,
};
use crate::scene::Scene;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;
use shadowfit_solver::{
    mesh::{Mesh, Sides},
    plane::BakedSet,
    shade,
};
use std::sync::LazyLock;

/// Sample positions in a pixel, by [`Antialias`]: the centre, or those that Vulkan and Direct3D prescribe for four.
const CENTRE: [Vec2; 1] = [Vec2::splat(0.5)];
const MSAA4: [Vec2; 4] =
    [Vec2::new(0.375, 0.125), Vec2::new(0.875, 0.375), Vec2::new(0.125, 0.625), Vec2::new(0.625, 0.875)];

/// Widths and heights up to this are drawn, as on most adapters.
const MAX_SIDE_PX: u32 = 16384;

/// What a camera ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimaryHit {
    /// Triangle of the mesh (not of the scene: see `Mesh::source`).
    pub triangle: u32,
    /// Weights of its corners.
    pub barycentric: Vec3,
    /// The point, unit space.
    pub p_unit: Vec3,
    /// Geometric normal of the side that faces the camera.
    pub normal: Vec3,
    /// Is that the front?
    pub front: bool,
}

/// What a camera sees: traced once, shaded under many lights.
#[derive(Clone, Debug)]
pub struct Primary {
    size_px: [u32; 2],
    antialias: Antialias,
    /// `[row][column][sample]`.
    hits: Vec<Option<PrimaryHit>>,
}

impl Primary {
    /// Traces the camera rays of a frame; single-sided triangles are invisible from behind, and holes of cut-out
    /// textures are looked through.
    ///
    /// # Errors
    /// [`RenderError::FrameSize`].
    pub fn trace(mesh: &Mesh, camera: &Camera, size_px: [u32; 2], antialias: Antialias) -> Result<Self, RenderError> {
        let [width, height] = size_px;
        if width.min(height) == 0 || width.max(height) > MAX_SIDE_PX {
            return Err(RenderError::FrameSize { width, height, limit: MAX_SIDE_PX });
        }
        let offsets: &[Vec2] = match antialias {
            Antialias::Off => &CENTRE,
            Antialias::Msaa4 => &MSAA4,
        };
        let row = |y: u32| {
            let pixels = (0..width).flat_map(move |x| offsets.iter().map(move |o| (x as f32 + o.x, y as f32 + o.y)));
            pixels.map(move |(px, py)| hit(mesh, camera.ray(px, py, size_px)))
        };
        let hits = (0..height).into_par_iter().flat_map_iter(row).collect();
        Ok(Self { size_px, antialias, hits })
    }

    /// What the samples meet, `[row][column][sample]`.
    #[must_use]
    pub fn hits(&self) -> &[Option<PrimaryHit>] {
        &self.hits
    }

    /// Shades what the camera sees. `visibility`, per colour, is asked only where the geometric normal faces the light.
    ///
    /// # Errors
    /// [`RenderError::NeedsAdapter`] for [`Mode::Planes`].
    pub fn picture(
        &self,
        (scene, mesh): (&Scene, &Mesh),
        mode: Mode,
        light: &Light,
        visibility: impl Fn(&PrimaryHit) -> Vec3 + Sync,
    ) -> Result<image::RgbaImage, RenderError> {
        let background = match mode {
            Mode::Mask => Vec4::ZERO,
            Mode::Shaded => Vec3::from_array(BACKGROUND_LINEAR).extend(1.0),
            Mode::Planes => return Err(RenderError::NeedsAdapter(mode)),
        };
        let sample = |hit: &Option<PrimaryHit>| match hit {
            None => background,
            Some(hit) if mode == Mode::Mask => mask(hit, light, &visibility),
            Some(hit) => shaded((scene, mesh), hit, light, &visibility).extend(1.0),
        };
        let samples = self.antialias.samples() as usize;
        let pixel = |hits: &[Option<PrimaryHit>]| {
            let mean = hits.iter().map(sample).sum::<Vec4>() / samples as f32;
            match mode {
                Mode::Mask => mean.to_array().map(|x| (255.0 * x).round() as u8),
                _ => {
                    let [r, g, b] = mean.truncate().to_array().map(srgb_from_linear);
                    [r, g, b, 255]
                }
            }
        };
        let pixels: Vec<[u8; 4]> = self.hits.par_chunks(samples).map(pixel).collect();
        let [width, height] = self.size_px;
        image::RgbaImage::from_raw(width, height, pixels.into_flattened()).ok_or(RenderError::FrameSize {
            width,
            height,
            limit: MAX_SIDE_PX,
        })
    }
}

fn hit(mesh: &Mesh, (origin, direction): (Vec3, Vec3)) -> Option<PrimaryHit> {
    let drawn = |triangle: u32, from_front: bool| from_front || mesh.sides[triangle as usize] == Sides::Both;
    let hit = mesh.nearest(origin, direction, drawn)?;
    let normal = mesh.normals[hit.triangle as usize];
    let front = normal.dot(direction) < 0.0;
    Some(PrimaryHit {
        triangle: hit.triangle,
        barycentric: hit.barycentric,
        p_unit: mesh.point(hit.triangle, hit.barycentric),
        normal: if front { normal } else { -normal },
        front,
    })
}

/// Twin of `fs_mask`.
fn mask(hit: &PrimaryHit, light: &Light, visibility: impl Fn(&PrimaryHit) -> Vec3) -> Vec4 {
    if hit.normal.dot(light.towards(hit.p_unit)) > 0.0 {
        Vec4::new(visibility(hit).dot(Vec3::splat(1.0 / 3.0)), 1.0, 1.0, 1.0)
    } else {
        Vec4::new(0.0, 0.0, 1.0, 1.0)
    }
}

/// Twin of `shade` in forward.wgsl: linear Lambert colour.
fn shaded(
    (scene, mesh): (&Scene, &Mesh),
    hit: &PrimaryHit,
    light: &Light,
    visibility: impl Fn(&PrimaryHit) -> Vec3,
) -> Vec3 {
    let triangle = mesh.source[hit.triangle as usize] as usize;
    let weights = hit.barycentric;
    let [n0, n1, n2] = scene.normals[triangle];
    let front_normal =
        (n0 * weights.x + n1 * weights.y + n2 * weights.z).normalize_or(mesh.normals[hit.triangle as usize]);
    let n = if hit.front { front_normal } else { -front_normal };
    let to_light = light.towards(hit.p_unit);
    let n_dot_l = n.dot(to_light.normalize_or_zero());
    let lit = n_dot_l > 0.0 && hit.normal.dot(to_light) > 0.0;
    let direct = if lit { n_dot_l * visibility(hit) } else { Vec3::ZERO };
    base_color(scene, triangle, weights) * (AMBIENT + DIFFUSE * direct)
}

/// Linear base colour at a point of a triangle of the scene.
fn base_color(scene: &Scene, triangle: usize, weights: Vec3) -> Vec3 {
    let material = &scene.materials[scene.material_of[triangle] as usize];
    let factor = Vec4::from_array(material.base_color).truncate();
    let Some(image) = material.image else { return factor };
    let [a, b, c] = scene.uvs[triangle];
    factor * bilinear(&scene.images[image], material.repeat, a * weights.x + b * weights.y + c * weights.z)
}

/// Filtered linear colour of an sRGB image, as a sampler gives it.
fn bilinear(image: &image::RgbaImage, repeat: [bool; 2], uv: Vec2) -> Vec3 {
    static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|byte| linear_from_srgb(byte as u8)));
    let size = [image.width(), image.height()];
    // The two texels along an axis and the weight of the second.
    let taps = |axis: usize| {
        let n = size[axis] as f32;
        let x = if repeat[axis] { uv[axis] - uv[axis].floor() } else { uv[axis].clamp(0.0, 1.0) } * n - 0.5;
        let tap = |x: f32| if repeat[axis] { x.rem_euclid(n) } else { x.clamp(0.0, n - 1.0) } as u32;
        ([tap(x.floor()), tap(x.floor() + 1.0)], x - x.floor())
    };
    let ([x0, x1], fx) = taps(0);
    let ([y0, y1], fy) = taps(1);
    let texel = |x: u32, y: u32| {
        let [r, g, b, _] = image.get_pixel(x.min(size[0] - 1), y.min(size[1] - 1)).0;
        Vec3::new(LINEAR[r as usize], LINEAR[g as usize], LINEAR[b as usize])
    };
    let row = |y: u32| texel(x0, y).lerp(texel(x1, y), fx);
    row(y0).lerp(row(y1), fy)
}

/// Draws one scene without an adapter.
#[derive(Debug)]
pub struct Turntable<'a> {
    scene: &'a Scene,
    mesh: &'a Mesh,
    set: BakedSet,
    /// Of directional lights; 0: hard edges.
    light_radius_rad: f32,
    /// Of the last frame: a second light from the same camera traces nothing.
    primary: Option<(Camera, Primary)>,
}

impl<'a> Turntable<'a> {
    /// Draws `scene`, whose triangles `mesh` holds. There are no planes yet.
    #[must_use]
    pub fn new(scene: &'a Scene, mesh: &'a Mesh) -> Self {
        Self { scene, mesh, set: BakedSet::default(), light_radius_rad: 0.0, primary: None }
    }

    /// Replaces the planes (unit space) that cast in the frames to come.
    pub fn set_planes(&mut self, set: &BakedSet) {
        self.set_soft_planes(set, 0.0);
    }

    /// The same with soft edges under directional lights of an angular radius.
    pub fn set_soft_planes(&mut self, set: &BakedSet, light_radius_rad: f32) {
        self.set = set.clone();
        self.light_radius_rad = light_radius_rad;
    }

    /// Draws a frame.
    ///
    /// # Errors
    /// A size that cannot be drawn, or [`Mode::Planes`].
    pub fn render(&mut self, request: &FrameRequest) -> Result<image::RgbaImage, RenderError> {
        let options = request.options;
        let primary = match self.primary.take() {
            Some((camera, primary))
                if camera == request.camera
                    && (primary.size_px, primary.antialias) == (options.size_px, options.antialias) =>
            {
                primary
            }
            _ => Primary::trace(self.mesh, &request.camera, options.size_px, options.antialias)?,
        };
        let (_, primary) = self.primary.insert((request.camera, primary));
        let models = (self.scene, self.mesh);
        // The section's list; none where a triangle is in no section.
        let lists = self.set.lists(request.light.from_centre());
        let list = |hit: &PrimaryHit| {
            let section = self.scene.section_of[self.mesh.source[hit.triangle as usize] as usize];
            lists.get(section as usize).map_or(&[][..], Vec::as_slice)
        };
        let planes = &self.set.planes;
        match request.light {
            Light::Directional { to_light } if self.light_radius_rad > 0.0 => {
                let (rows, radius_rad) = (shade::set_rows(&self.set, to_light), self.light_radius_rad);
                let softening: Vec<f32> =
                    planes.iter().map(|baked| shade::softening(baked, to_light, radius_rad)).collect();
                let visibility = |hit: &PrimaryHit| {
                    shade::horizon(hit.normal.dot(to_light), radius_rad.sin())
                        * shade::visibility_soft(planes, (&rows, &softening), list(hit), hit.p_unit)
                };
                primary.picture(models, options.mode, &request.light, visibility)
            }
            Light::Directional { to_light } => {
                let rows = shade::set_rows(&self.set, to_light);
                let visibility = |hit: &PrimaryHit| shade::visibility(planes, &rows, list(hit), hit.p_unit);
                primary.picture(models, options.mode, &request.light, visibility)
            }
            Light::Point { position: c } => {
                let visibility = |hit: &PrimaryHit| shade::visibility_point_light(planes, list(hit), c, hit.p_unit);
                primary.picture(models, options.mode, &request.light, visibility)
            }
        }
    }
}
