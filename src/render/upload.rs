//! A scene -> vertex buffer, materials and base colour textures on the device, sorted into few draws.

use super::{
    RenderError,
    bindings::group,
    gpu::Gpu,
    layout::{Material, Vertex},
};
use crate::scene::Scene;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use shadowfit_solver::{
    lights::LightDomain,
    mesh::{Frame, Sides},
};
use std::{
    collections::{BTreeMap, BTreeSet},
    ops::Range,
};
use wgpu::util::{DeviceExt, TextureDataOrder};

/// What a draw has in common: cull mode and textures. The order of the draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Look {
    ground: bool,
    transparent: bool,
    /// Both sides are drawn.
    pub double_sided: bool,
    has_holes: bool,
    image: Option<usize>,
    repeat: [bool; 2],
}

/// Directions in which a model's extreme corners are sought.
const EXTREME_DIRECTIONS: usize = 512;

/// The vertices of each section, by its label.
type Sections = Vec<(u32, Range<u32>)>;

/// One draw.
#[derive(Clone, Debug)]
pub struct Batch {
    /// Of the ground: receives and does not cast.
    pub ground: bool,
    /// Light passes it ([`Material::transmittance`](crate::scene::Material)).
    pub transparent: bool,
    /// Both sides are drawn.
    pub double_sided: bool,
    /// Its image cuts holes.
    pub has_holes: bool,
    /// Group 1 of the forward pass.
    pub bind_group: wgpu::BindGroup,
    /// In [`Model::vertices`], section by section: its label and its triangles' corners.
    sections: Sections,
}

impl Batch {
    /// The vertices of the sections that `wanted` picks by their labels, in as few runs as there can be.
    pub fn runs(&self, wanted: impl Fn(u32) -> bool) -> Vec<Range<u32>> {
        let mut runs: Vec<Range<u32>> = Vec::new();
        for (_, vertices) in self.sections.iter().filter(|(section, _)| wanted(*section)) {
            match runs.last_mut() {
                Some(last) if last.end == vertices.start => last.end = vertices.end,
                _ => runs.push(vertices.clone()),
            }
        }
        runs
    }
}

/// A scene on the device.
#[derive(Clone, Debug)]
pub struct Model {
    /// All triangles, unindexed, sorted by batch and section.
    pub vertices: wgpu::Buffer,
    /// Draws.
    pub batches: Vec<Batch>,
    /// The corners of the casters that lie farthest in some of [`EXTREME_DIRECTIONS`] directions, unit space: what a
    /// light's view must hold.
    pub extremes: Vec<Vec3>,
    /// The box of all triangles, the ground's too, unit space: least and greatest corner.
    pub bounds: [Vec3; 2],
}

impl Model {
    /// Uploads `scene` in the unit space of `frame`. Triangles keep their order within a batch's section, so that of
    /// two equal ones the first wins the depth test, as it does in the BVH.
    pub fn upload(
        gpu: &Gpu,
        material: &wgpu::BindGroupLayout,
        scene: &Scene,
        frame: &Frame,
    ) -> Result<Self, RenderError> {
        let (vertices, looks) = vertices(scene, frame);
        let extremes = extremes(&vertices, &looks);
        let bounds = vertices.iter().fold([Vec3::MAX, Vec3::MIN], |[low, high], v| [low.min(v.p), high.max(v.p)]);
        let bytes: &[u8] = bytemuck::cast_slice(&vertices);
        let limit = gpu.limits().max_buffer_size;
        if bytes.len() as u64 > limit {
            return Err(RenderError::TooLarge { what: "the triangles' bytes", needed: bytes.len() as u64, limit });
        }
        let vertices = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("triangles"),
            contents: bytes,
            usage: wgpu::BufferUsages::VERTEX,
        });
        let materials = upload_materials(gpu, scene);
        let mut images = BTreeMap::new();
        let mut batches = Vec::new();
        for (look, sections) in looks {
            let view = match images.entry(look.image) {
                std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
                std::collections::btree_map::Entry::Vacant(entry) => {
                    entry.insert(upload_image(gpu, look.image.map(|i| &*scene.images[i]))?)
                }
            };
            let bind_group = bind(gpu, material, &materials, view, look.repeat);
            let Look { ground, transparent, double_sided, has_holes, .. } = look;
            batches.push(Batch { ground, transparent, double_sided, has_holes, bind_group, sections });
        }
        Ok(Self { vertices, batches, extremes, bounds })
    }
}

/// The vertices in the order of [`Model::vertices`], three a triangle, in the unit space of `frame`, and what they draw.
pub fn vertices(scene: &Scene, frame: &Frame) -> (Vec<Vertex>, Vec<(Look, Sections)>) {
    let mut triangles_of: BTreeMap<Look, Vec<usize>> = BTreeMap::new();
    for (triangle, &material) in scene.material_of.iter().enumerate() {
        let material = &scene.materials[material as usize];
        let ground = scene.is_ground(triangle);
        let double_sided = scene.soup.sides[triangle] == Sides::Both;
        // Without an image the repeat mode has no effect: one batch.
        let repeat = if material.image.is_some() { material.repeat } else { [false; 2] };
        triangles_of
            .entry(Look {
                ground,
                transparent: material.transmittance.is_some(),
                double_sided,
                has_holes: material.alpha_cutoff.is_some(),
                image: material.image,
                repeat,
            })
            .or_default()
            .push(triangle);
    }
    let mut vertices = Vec::with_capacity(3 * scene.material_of.len());
    let mut looks = Vec::with_capacity(triangles_of.len());
    for (look, mut triangles) in triangles_of {
        triangles.sort_by_key(|&triangle| scene.section_of[triangle]);
        let mut sections = Vec::new();
        for triangles in triangles.chunk_by(|&a, &b| scene.section_of[a] == scene.section_of[b]) {
            let first = vertices.len() as u32;
            vertices.extend(triangles.iter().flat_map(|&triangle| triangle_vertices(scene, frame, triangle)));
            sections.push((scene.section_of[triangles[0]], first..vertices.len() as u32));
        }
        looks.push((look, sections));
    }
    (vertices, looks)
}

fn extremes(vertices: &[Vertex], looks: &[(Look, Sections)]) -> Vec<Vec3> {
    let casters = looks.iter().filter(|(look, _)| !look.ground);
    let corners: Vec<Vec3> = casters
        .flat_map(|(_, sections)| sections)
        .flat_map(|(_, range)| &vertices[range.start as usize..range.end as usize])
        .map(|vertex| vertex.p)
        .collect();
    let farthest = |direction: &Vec3| {
        let best = corners.iter().enumerate().max_by(|a, b| a.1.dot(*direction).total_cmp(&b.1.dot(*direction)));
        best.map(|(index, _)| index)
    };
    let directions = LightDomain::Sphere.directions(EXTREME_DIRECTIONS, 0);
    let found: BTreeSet<usize> = directions.par_iter().filter_map(farthest).collect();
    found.into_iter().map(|index| corners[index]).collect()
}

fn triangle_vertices(scene: &Scene, frame: &Frame, triangle: usize) -> [Vertex; 3] {
    let corners = scene.soup.corners_model[triangle].map(|p| frame.unit_from_model(p));
    // As Mesh computes it: slivers keep a normal.
    let [u, v] = [corners[1], corners[2]].map(|p| (p - corners[0]).as_dvec3());
    let geometric_normal = u.cross(v).normalize_or_zero().as_vec3();
    std::array::from_fn(|corner| Vertex {
        p: corners[corner],
        geometric_normal,
        shading_normal: finite_or(scene.normals[triangle][corner], geometric_normal),
        uv: scene.uvs[triangle][corner],
        material: scene.material_of[triangle],
        section: scene.section_of[triangle],
    })
}

fn finite_or(normal: Vec3, fallback: Vec3) -> Vec3 {
    if normal.is_finite() && normal != Vec3::ZERO { normal } else { fallback }
}

fn upload_materials(gpu: &Gpu, scene: &Scene) -> wgpu::Buffer {
    let material = |material: &crate::scene::Material| Material {
        base_color: Vec4::from_array(material.base_color),
        alpha_cutoff: material.alpha_cutoff.unwrap_or(-1.0),
        repeat_u: u32::from(material.repeat[0]),
        repeat_v: u32::from(material.repeat[1]),
        padding: 0,
    };
    let materials: Vec<Material> = scene.materials.iter().map(material).collect();
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("materials"),
        contents: bytemuck::cast_slice(&materials),
        usage: wgpu::BufferUsages::STORAGE,
    })
}

/// Uploads an sRGB image, or one white texel for materials without.
fn upload_image(gpu: &Gpu, image: Option<&image::RgbaImage>) -> Result<wgpu::TextureView, RenderError> {
    let (width, height) = image.map_or((1, 1), image::RgbaImage::dimensions);
    let limit = gpu.limits().max_texture_dimension_2d;
    if width.max(height) > limit {
        let needed = u64::from(width.max(height));
        return Err(RenderError::TooLarge { what: "the sides of base colour images", needed, limit: limit.into() });
    }
    let descriptor = wgpu::TextureDescriptor {
        label: Some("base colour"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8UnormSrgb,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    };
    let texels = image.map_or(&[255; 4][..], |image| image.as_raw());
    let texture = gpu.device.create_texture_with_data(&gpu.queue, &descriptor, TextureDataOrder::LayerMajor, texels);
    Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
}

fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    materials: &wgpu::Buffer,
    view: &wgpu::TextureView,
    repeat: [bool; 2],
) -> wgpu::BindGroup {
    let [u, v] = repeat.map(|r| if r { wgpu::AddressMode::Repeat } else { wgpu::AddressMode::ClampToEdge });
    let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        address_mode_u: u,
        address_mode_v: v,
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    });
    let view = wgpu::BindingResource::TextureView(view);
    group(gpu, layout, &[materials.as_entire_binding(), view, wgpu::BindingResource::Sampler(&sampler)])
}
