//! The reference of all techniques: shadow rays through the BVH, under a light without size or an area light.
//!
//! In: a [`Scene`] and the frame of the space that cameras and lights are given in (world space of a
//! [`Stage`](super::stage::Stage)). Out: the same pictures and masks as the techniques draw.
//!
//! Under an area light the visibility of a point is the unweighted mean over the light's samples; which side faces the
//! light, and Lambert's cosine, are those of its centre. Not guaranteed: a sample count's noise; it is the same for all
//! pixels, so penumbrae show up to that many steps.

use super::{
    Camera, FrameRequest, Light, Mode, RenderError,
    cpu::{Primary, PrimaryHit},
};
use crate::scene::Scene;
use glam::Vec3;
use shadowfit_solver::mesh::{Frame, Mesh, MeshError, ray_origin};

/// A parallelogram that shines, world space. Far away it stands for a disc in the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaLight {
    /// Its middle.
    pub centre: Vec3,
    /// Half its edges.
    pub half_edges: [Vec3; 2],
}

impl AreaLight {
    /// A light like the sun: a square seen in direction `to_light`, `half_angle_rad` from its middle to its sides.
    #[must_use]
    pub fn distant(to_light: Vec3, half_angle_rad: f32) -> Self {
        // Far enough for the model (radius 1) to see it under one angle, near enough for f32.
        const DISTANCE: f32 = 1e3;
        let side = to_light.any_orthonormal_vector();
        let half = DISTANCE * half_angle_rad.tan();
        Self { centre: DISTANCE * to_light, half_edges: [half * side, half * to_light.cross(side)] }
    }

    /// The light without size in its middle.
    #[must_use]
    pub fn middle(&self) -> Light {
        Light::Point { position: self.centre }
    }

    /// `side` x `side` points, the centres of equal parts.
    #[must_use]
    pub fn samples(&self, side: usize) -> Vec<Vec3> {
        let step = |i: usize| (2.0 * i as f32 + 1.0) / side as f32 - 1.0;
        let point = |i: usize, j: usize| self.centre + step(i) * self.half_edges[0] + step(j) * self.half_edges[1];
        (0..side).flat_map(|j| (0..side).map(move |i| point(i, j))).collect()
    }
}

/// A scene with its BVH.
#[derive(Clone, Debug)]
pub struct RayTraced {
    scene: Scene,
    mesh: Mesh,
    /// Mesh space from world space: `scale * p + offset`.
    scale: f32,
    offset: Vec3,
}

/// What a camera sees, for many lights.
#[derive(Clone, Debug)]
pub struct View {
    primary: Primary,
    mode: Mode,
    /// World space.
    light: Light,
}

impl View {
    /// Pixels of the frame.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.primary.hits().len()
    }
}

impl RayTraced {
    /// Builds the BVH. `world` is the frame of world space: `p_model = centre + radius * p_world`.
    ///
    /// # Errors
    /// As of [`Mesh::new`].
    pub fn new(scene: Scene, world: &Frame) -> Result<Self, MeshError> {
        let mesh = scene.mesh()?;
        let scale = (world.radius / mesh.frame.radius) as f32;
        let offset = mesh.frame.unit_from_model(world.centre_model);
        Ok(Self { scene, mesh, scale, offset })
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Its mesh, in its own unit space.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Traces the camera rays of a request; [`RayTraced::picture`] shades them.
    ///
    /// # Errors
    /// [`RenderError::FrameSize`].
    pub fn look(&self, request: &FrameRequest) -> Result<View, RenderError> {
        let camera: Camera = request.camera.moved(self.scale, self.offset);
        let primary = Primary::trace(&self.mesh, &camera, request.options.size_px, request.options.antialias)?;
        Ok(View { primary, mode: request.options.mode, light: request.light })
    }

    /// The same view in another mode or under another light.
    #[must_use]
    pub fn relit(view: &View, mode: Mode, light: Light) -> View {
        View { primary: view.primary.clone(), mode, light }
    }

    /// Hard shadows of the view's light.
    ///
    /// # Errors
    /// [`RenderError::NeedsAdapter`] for [`Mode::Planes`].
    pub fn picture(&self, view: &View) -> Result<image::RgbaImage, RenderError> {
        let light = self.moved(view.light);
        let visibility = |hit: &PrimaryHit| Vec3::splat(f32::from(self.is_lit(hit, &light)));
        view.primary.picture((&self.scene, &self.mesh), view.mode, &light, visibility)
    }

    /// Hard shadows of the view's light where materials let light through ([`Material::transmittance`]): the product over
    /// all surfaces on the way, in masks the mean of its colours. [`RayTraced::picture`] takes such materials for opaque. What the
    /// camera would see through them is not drawn.
    ///
    /// [`Material::transmittance`]: crate::scene::Material::transmittance
    ///
    /// # Errors
    /// [`RenderError::NeedsAdapter`] for [`Mode::Planes`].
    pub fn transmitted_picture(&self, view: &View) -> Result<image::RgbaImage, RenderError> {
        let light = self.moved(view.light);
        let visibility = |hit: &PrimaryHit| self.transmitted(hit, &light);
        view.primary.picture((&self.scene, &self.mesh), view.mode, &light, visibility)
    }

    /// Soft shadows of `side` x `side` samples of an area light, in the place of the view's light; materials let light
    /// through as in [`RayTraced::transmitted_picture`].
    ///
    /// # Errors
    /// [`RenderError::NeedsAdapter`] for [`Mode::Planes`].
    pub fn soft_picture(&self, view: &View, light: &AreaLight, side: usize) -> Result<image::RgbaImage, RenderError> {
        let samples: Vec<Light> =
            light.samples(side).into_iter().map(|position| self.moved(Light::Point { position })).collect();
        let visibility = |hit: &PrimaryHit| {
            let arriving: Vec3 = samples.iter().map(|sample| self.transmitted(hit, sample)).sum();
            arriving / samples.len() as f32
        };
        view.primary.picture((&self.scene, &self.mesh), view.mode, &self.moved(light.middle()), visibility)
    }

    /// For each pixel of a frame without antialiasing: does the camera see the ground there?
    #[must_use]
    pub fn ground_seen(&self, view: &View) -> Vec<bool> {
        let is_ground = |hit: &PrimaryHit| self.scene.is_ground(self.mesh.source[hit.triangle as usize] as usize);
        view.primary.hits().iter().map(|hit| hit.as_ref().is_some_and(is_ground)).collect()
    }

    fn moved(&self, light: Light) -> Light {
        match light {
            Light::Directional { .. } => light,
            Light::Point { position } => Light::Point { position: self.scale * position + self.offset },
        }
    }

    /// `light` is in mesh space.
    fn is_lit(&self, hit: &PrimaryHit, light: &Light) -> bool {
        let origin = ray_origin(hit.p_unit, hit.normal);
        match *light {
            Light::Directional { to_light } => !self.mesh.is_blocked(origin, to_light),
            Light::Point { position } => !self.mesh.is_blocked_before(origin, position),
        }
    }

    /// The share of the light that arrives at a hit, per colour; `light` is in mesh space.
    fn transmitted(&self, hit: &PrimaryHit, light: &Light) -> Vec3 {
        let origin = ray_origin(hit.p_unit, hit.normal);
        let to_light = light.towards(origin);
        let distance = if light.homogeneous().w == 0.0 { f32::INFINITY } else { to_light.length() };
        self.mesh.transmitted(origin, to_light.normalize_or_zero(), distance)
    }
}
