//! Technique: shadow planes with occluder textures (S. Coleman, "Fast Self-Shadowing Using Occluder Textures", 2006).
//!
//! One forward pass. The affine rows of each plane (thesis eq. 2-8, see `solver::shade`) are computed on the CPU once
//! per light and instance, and the lists of the sections chosen; a plane that casts nothing under that light is in none
//! of them, so it costs no fragment anything. Under a directional light of some size edges are soft where textures are
//! distance fields; for a light without size nothing is asked, so that hard edges pay nothing.

use super::{
    FrameRequest, Light, Mode, RenderError,
    atlas::{Atlas, Slot},
    bindings::{SAMPLER, STORAGE, buffer, group, layout, texture},
    forward::{Forward, ForwardOptions},
    gpu::{Gpu, OCCLUDER_PLANES},
    layout::CastingPlane,
    plane_view::PlaneView,
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
};
use shadowfit_solver::{
    plane::{BakedSet, SDF_BORDER, SDF_PER_TEXEL, SectionLists},
    shade::{EDGE_ON, MIN_SPREAD},
};
use std::collections::BTreeSet;
use wgpu::util::{DeviceExt, TextureDataOrder};

/// Draws the model with the shadows of a baked set.
#[derive(Debug)]
pub struct OccluderPlanes {
    set: BakedSet,
    /// Angular radius of directional lights; 0: hard edges.
    light_radius_rad: f32,
    /// One a plane.
    slots: Vec<Slot>,
    atlas_bytes: usize,
    casting: wgpu::Buffer,
    lists: wgpu::Buffer,
    occluders: wgpu::TextureView,
    sampler: wgpu::Sampler,
    group: wgpu::BindGroup,
    forward: Forward,
    /// What mode `planes` draws over the model; made when first needed.
    view: Option<PlaneView>,
}

impl OccluderPlanes {
    /// Uploads the planes of `set` (unit space of the stage's model).
    ///
    /// # Errors
    /// Their textures exceed the adapter's limits, or the driver reports an error.
    pub fn new(stage: &Stage, set: &BakedSet) -> Result<Self, RenderError> {
        Self::soft(stage, set, 0.0)
    }

    /// The same with soft edges: directional lights have this angular radius (the sun: 0.0047), 0 to pi/4.
    ///
    /// # Errors
    /// As of [`OccluderPlanes::new`].
    pub fn soft(stage: &Stage, set: &BakedSet, light_radius_rad: f32) -> Result<Self, RenderError> {
        let gpu = &stage.gpu;
        let limits = gpu.limits();
        let textures: Vec<_> = set.planes.iter().map(|baked| &baked.texture).collect();
        let atlas = Atlas::pack(&textures, limits.max_texture_dimension_2d, limits.max_texture_array_layers)?;
        let occluders = upload_atlas(gpu, &atlas);
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("occluders"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let (count, storage) = (stage.placements().len(), wgpu::BufferUsages::STORAGE);
        let casting = buffer::<CastingPlane>(gpu, "casting", count * most_planes(set), storage);
        let per_instance = 2 * (set.sections.len() + 1) + longest(set);
        let lists = buffer::<u32>(gpu, "lists", 1 + count * per_instance, storage);
        let fragment = wgpu::ShaderStages::FRAGMENT;
        let array = texture(wgpu::TextureViewDimension::D2Array);
        let bindings = [(fragment, STORAGE), (fragment, array), (fragment, SAMPLER), (fragment, STORAGE)];
        let group_layout = layout(gpu, "planes", &bindings);
        let options = ForwardOptions { constants: forward_constants(set, light_radius_rad), ..Default::default() };
        let forward = Forward::new(stage, &OCCLUDER_PLANES, Some(&group_layout), options);
        let group = group(gpu, &group_layout, &resources((&casting, &lists), &occluders, &sampler));
        gpu.check()?;
        let (set, slots, atlas_bytes) = (set.clone(), atlas.slots, atlas.rgba.len());
        Ok(Self {
            set,
            light_radius_rad,
            slots,
            atlas_bytes,
            casting,
            lists,
            occluders,
            sampler,
            group,
            forward,
            view: None,
        })
    }

    /// The planes and where their textures lie.
    pub(crate) fn planes(&self) -> (&BakedSet, &[Slot]) {
        (&self.set, &self.slots)
    }

    /// The pipeline constants of planes.wgsl and occluder_planes.wgsl.
    pub(crate) fn forward_constants(&self) -> Vec<(&'static str, f64)> {
        forward_constants(&self.set, self.light_radius_rad)
    }

    /// Bindings 0 to 3 of group 2.
    pub(crate) fn resources(&self) -> [wgpu::BindingResource<'_>; 4] {
        resources((&self.casting, &self.lists), &self.occluders, &self.sampler)
    }

    /// The planes that cast in each instance under its light and are read by some section, and `lists` of planes.wgsl.
    fn casting_under(&self, stage: &Stage, light: &Light) -> (Vec<CastingPlane>, Vec<u32>) {
        let (sections, instances) = (self.set.sections.len(), stage.placements().len());
        let (mut casting, mut ranges, mut lists) = (Vec::new(), vec![sections as u32], Vec::new());
        let start = 1 + 2 * instances * (sections + 1);
        // Several sections may read a plane: its rows are made once.
        let mut number_of: Vec<Option<Option<u32>>> = Vec::new();
        for placement in stage.placements() {
            let light = placement.light_unit(light);
            let chosen = self.set.lists(light.from_centre());
            number_of.clear();
            number_of.resize(self.set.planes.len(), None);
            for section in 0..=sections {
                ranges.push((start + lists.len()) as u32);
                for &plane in chosen.get(section).map_or(&[][..], Vec::as_slice) {
                    let number = number_of[plane as usize].get_or_insert_with(|| {
                        casting.push(self.casting_plane(plane as usize, &light)?);
                        Some(casting.len() as u32 - 1)
                    });
                    lists.extend(*number);
                }
                ranges.push((start + lists.len()) as u32);
            }
        }
        ranges.extend(lists);
        (casting, ranges)
    }

    fn casting_plane(&self, index: usize, light_unit: &Light) -> Option<CastingPlane> {
        let (baked, slot) = (&self.set.planes[index], &self.slots[index]);
        match *light_unit {
            Light::Directional { to_light } => CastingPlane::directional(baked, slot, to_light, self.light_radius_rad),
            Light::Point { .. } => CastingPlane::point_light(baked, slot),
        }
    }
}

impl Technique for OccluderPlanes {
    fn name(&self) -> String {
        match self.light_radius_rad {
            0.0 => "occluder planes".to_string(),
            radius_rad => format!("occluder planes, light radius {:.2} deg", radius_rad.to_degrees()),
        }
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        _: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let (casting, lists) = self.casting_under(stage, &request.light);
        stage.gpu.queue.write_buffer(&self.casting, 0, bytemuck::cast_slice(&casting));
        stage.gpu.queue.write_buffer(&self.lists, 0, bytemuck::cast_slice(&lists));
        Ok(())
    }

    fn draw(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        targets: &Targets,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        if request.options.mode == Mode::Planes {
            let mut view = self.view.take().unwrap_or_else(|| PlaneView::new(stage, self));
            view.draw(stage, (request, self), targets, encoder);
            self.view = Some(view);
            return Ok(());
        }
        let mut pass = targets.begin(encoder, (request.options.mode, Begin::Clear));
        pass.set_bind_group(2, &self.group, &[]);
        self.forward.draw(stage, request, targets, (&mut pass, Part::All));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        Cost {
            passes: 1,
            draw_calls: stage.calls_per_pass(),
            update_passes: 0,
            update_draw_calls: 0,
            texture_bytes: self.atlas_bytes,
            buffer_bytes: (self.casting.size() + self.lists.size()) as usize,
            on_light_change: "three rows a casting plane and the sections' lists, per instance, on the CPU".to_string(),
        }
    }
}

/// The pipeline constants of planes.wgsl.
pub(crate) fn constants() -> [(&'static str, f64); 4] {
    [
        ("EDGE_ON", f64::from(EDGE_ON)),
        ("SDF_BORDER", f64::from(SDF_BORDER)),
        ("SDF_PER_TEXEL", f64::from(SDF_PER_TEXEL)),
        ("MIN_SPREAD", f64::from(MIN_SPREAD)),
    ]
}

fn forward_constants(set: &BakedSet, light_radius_rad: f32) -> Vec<(&'static str, f64)> {
    let mut all = constants().to_vec();
    all.push(("LIGHT_SINE", f64::from(light_radius_rad.sin())));
    all.push(("TINTED", f64::from(u8::from(set.is_tinted()))));
    all
}

fn resources<'a>(
    (casting, lists): (&'a wgpu::Buffer, &'a wgpu::Buffer),
    occluders: &'a wgpu::TextureView,
    sampler: &'a wgpu::Sampler,
) -> [wgpu::BindingResource<'a>; 4] {
    let (occluders, sampler) = (wgpu::BindingResource::TextureView(occluders), wgpu::BindingResource::Sampler(sampler));
    [casting.as_entire_binding(), occluders, sampler, lists.as_entire_binding()]
}

/// All lists that a light may choose.
fn choices(set: &BakedSet) -> impl Iterator<Item = &SectionLists> {
    set.active.iter().flat_map(|active| &active.lists).chain([&set.sections])
}

/// Indices in all lists of a set, under the light where there are most.
fn longest(set: &BakedSet) -> usize {
    choices(set).map(|lists| lists.iter().map(Vec::len).sum()).max().unwrap_or(0)
}

/// Planes that are in some list, under the light where there are most.
fn most_planes(set: &BakedSet) -> usize {
    choices(set).map(|lists| lists.iter().flatten().collect::<BTreeSet<_>>().len()).max().unwrap_or(0)
}

fn upload_atlas(gpu: &Gpu, atlas: &Atlas) -> wgpu::TextureView {
    let descriptor = wgpu::TextureDescriptor {
        label: Some("occluders"),
        size: wgpu::Extent3d { width: atlas.side, height: atlas.side, depth_or_array_layers: atlas.layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    };
    let texture =
        gpu.device.create_texture_with_data(&gpu.queue, &descriptor, TextureDataOrder::LayerMajor, &atlas.rgba);
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}
