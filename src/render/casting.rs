//! The planes of a set under a light -> the texels of `casting` in planes.wgsl: for each instance where the lists of its
//! sections lie, then the planes that they name, their rows computed for the light as that instance sees it.
//!
//! A list is contiguous, and a plane that several sections read is written for each of them: a fragment then follows no
//! index. Instances have blocks of equal size, computed in parallel: the same bytes at any number of threads.

use super::{
    Light, RenderError,
    atlas::Slot,
    gpu::Gpu,
    layout::{CastingTexels, SlotTexel, plane_and_duals},
    stage::Placement,
};
use glam::Vec4;
use rayon::prelude::*;
use shadowfit_solver::{
    plane::{BakedSet, SectionLists},
    shade::{self, PlaneRows},
};

/// One texel.
type Texel = [u32; 4];

/// Texels of a plane without its tint, which has one more in sets where some plane lets light pass.
const UNTINTED_TEXELS: usize = size_of::<CastingTexels>() / size_of::<Texel>();

/// Texels of a row of the texture: 200 instances of the largest sets make some hundred rows, far below every adapter's
/// limit of 2048 and up, and a row that is not used up wastes at most 16 KB.
const ROW_TEXELS: usize = 1024;

/// What a plane's texels have in common under all lights.
#[derive(Clone, Copy, Debug)]
struct Prepared {
    directional: shade::CastingPlane,
    /// The plane's equation and the rows of its edges' duals.
    point_light: [Vec4; 3],
    slot: SlotTexel,
    /// Share of each linear colour that it takes where it blocks, one byte each.
    tint: u32,
}

/// The texture of what casts.
#[derive(Debug)]
pub(crate) struct Casting {
    planes: Vec<Prepared>,
    sections: usize,
    plane_texels: usize,
    instance_texels: usize,
    texture: wgpu::Texture,
    pub view: wgpu::TextureView,
    texels: Vec<Texel>,
    instances: usize,
    light_radius_rad: f32,
}

impl Casting {
    /// For `instances` instances that read `set`, whose textures lie in `slots`, under directional lights of an angular
    /// radius.
    pub fn new(
        gpu: &Gpu,
        (set, light_radius_rad): (&BakedSet, f32),
        slots: &[Slot],
        instances: usize,
    ) -> Result<Self, RenderError> {
        let planes = set.planes.iter().zip(slots).map(|(baked, slot)| {
            let [equation, a, b] = plane_and_duals(&baked.plane);
            Prepared {
                directional: shade::CastingPlane::new(&baked.plane, baked.side),
                point_light: [a, b, equation],
                slot: SlotTexel::new(baked, slot),
                tint: u32::from_le_bytes([baked.tint[0], baked.tint[1], baked.tint[2], 0]),
            }
        });
        let plane_texels = UNTINTED_TEXELS + usize::from(set.is_tinted());
        let sections = set.sections.len();
        let instance_texels = sections + 1 + plane_texels * longest(set);
        let rows = (instances * instance_texels).div_ceil(ROW_TEXELS).max(1);
        let limit = gpu.limits().max_texture_dimension_2d;
        if rows > limit as usize {
            let what = "the planes that all instances read (rows of 1024 texels)";
            return Err(RenderError::TooLarge { what, needed: rows as u64, limit: limit.into() });
        }
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("casting"),
            size: wgpu::Extent3d { width: ROW_TEXELS as u32, height: rows as u32, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let texels = vec![[0; 4]; rows * ROW_TEXELS];
        Ok(Self {
            planes: planes.collect(),
            sections,
            plane_texels,
            instance_texels,
            texture,
            view,
            texels,
            instances,
            light_radius_rad,
        })
    }

    /// The pipeline constants of planes.wgsl that tell where a texel is.
    pub fn constants(&self) -> [(&'static str, f64); 4] {
        let constants = [
            ("SECTIONS", self.sections),
            ("PLANE_TEXELS", self.plane_texels),
            ("INSTANCE_TEXELS", self.instance_texels),
            ("ROW_TEXELS", ROW_TEXELS),
        ];
        constants.map(|(name, value)| (name, value as f64))
    }

    /// Bytes of the texture.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.texels[..])
    }

    /// Does some instance ask for planes in a section (by its label) under the light of the last update? A light of some
    /// size has a soft horizon everywhere.
    pub fn is_asked(&self, label: u32) -> bool {
        if self.light_radius_rad > 0.0 {
            return true;
        }
        let section = (label as usize).min(self.sections);
        let blocks = self.texels.chunks_exact(self.instance_texels).take(self.instances);
        blocks.map(|block| block[section]).any(|[start, end, ..]| start < end)
    }

    /// Computes the texels under `light` (world space) and sends them.
    pub fn update(&mut self, gpu: &Gpu, set: &BakedSet, placements: &[Placement], light: &Light) {
        let (planes, sections, stride) = (&self.planes, self.sections, self.instance_texels);
        let plane_texels = self.plane_texels;
        let under = |plane: usize, light: &Light| match *light {
            Light::Directional { to_light } if self.light_radius_rad > 0.0 => {
                let texels = planes[plane].under(light)?;
                let softening = shade::softening(&set.planes[plane], to_light, self.light_radius_rad);
                Some(CastingTexels { slot: texels.slot.with_softening(softening), ..texels })
            }
            _ => planes[plane].under(light),
        };
        let blocks = self.texels.par_chunks_exact_mut(stride).zip(placements).enumerate();
        blocks.for_each(|(instance, (block, placement))| {
            let light = placement.light_unit(light);
            let lists = set.lists(light.from_centre());
            let mut end = sections + 1;
            for section in 0..=sections {
                let start = end;
                for &plane in lists.get(section).map_or(&[][..], Vec::as_slice) {
                    if let Some(casting) = under(plane as usize, &light) {
                        block[end..end + UNTINTED_TEXELS].copy_from_slice(bytemuck::cast_slice(&[casting]));
                        if plane_texels > UNTINTED_TEXELS {
                            block[end + UNTINTED_TEXELS] = [planes[plane as usize].tint, 0, 0, 0];
                        }
                        end += plane_texels;
                    }
                }
                let [start, end] = [start, end].map(|texel| (instance * stride + texel) as u32);
                block[section] = [start, end, 0, 0];
            }
        });
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some((ROW_TEXELS * size_of::<Texel>()) as u32),
            rows_per_image: None,
        };
        let bytes = bytemuck::cast_slice(&self.texels);
        gpu.queue.write_texture(self.texture.as_image_copy(), bytes, layout, self.texture.size());
    }
}

impl Prepared {
    /// The plane under a light (unit space), or `None` where it casts nothing.
    fn under(&self, light: &Light) -> Option<CastingTexels> {
        let rows = match *light {
            Light::Directional { to_light } => {
                let PlaneRows { a, b, s } = self.directional.rows(to_light)?;
                [a, b, s]
            }
            Light::Point { .. } => self.point_light,
        };
        CastingTexels::checked(rows, self.slot)
    }
}

/// All lists that a light may choose.
pub(crate) fn choices(set: &BakedSet) -> impl Iterator<Item = &SectionLists> {
    let active = set.active.as_ref().filter(|active| !active.lists.is_empty());
    active.map_or(std::slice::from_ref(&set.sections), |active| &active.lists).iter()
}

/// Planes in all lists of a set, under the light where there are most.
fn longest(set: &BakedSet) -> usize {
    choices(set).map(|lists| lists.iter().map(Vec::len).sum()).max().unwrap_or(0)
}
