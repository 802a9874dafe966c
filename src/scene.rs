//! glTF -> [`Scene`]: the triangles of a file in model space, with what the renderer needs to draw them.

use glam::{Vec2, Vec3};
use serde::Serialize;
use shadowfit_solver::mesh::Soup;
use std::sync::Arc;

/// How a surface looks; only what Lambert shading needs.
#[derive(Clone, Debug)]
pub struct Material {
    /// Linear RGBA factor.
    pub base_color: [f32; 4],
    /// Index into [`Scene::images`] of the sRGB base colour texture.
    pub image: Option<usize>,
    /// Do texture coordinates repeat (true) or clamp, along u and v?
    pub repeat: [bool; 2],
    /// Fragments with alpha below this (0..1) are discarded (alphaMode MASK).
    pub alpha_cutoff: Option<f32>,
}

/// Something in the file that the fit does not use.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Skipped {
    /// What: "lines", "skin", "zero-area triangles", ...
    pub what: String,
    /// How many.
    pub count: usize,
    /// Why, and what was done instead.
    pub why: String,
}

/// A glTF file as triangles. `normals`, `uvs`, `material_of` and the vectors of `soup` have one entry a triangle.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Triangles in model space.
    pub soup: Soup,
    /// Shading normals of the corners, model space, unit.
    pub normals: Vec<[Vec3; 3]>,
    /// Base colour texture coordinates of the corners.
    pub uvs: Vec<[Vec2; 3]>,
    /// Index into `materials`.
    pub material_of: Vec<u32>,
    /// Materials; index 0 is always there.
    pub materials: Vec<Material>,
    /// Decoded base colour images, sRGB.
    pub images: Vec<Arc<image::RgbaImage>>,
    /// All that was left out, counted.
    pub skipped: Vec<Skipped>,
}
