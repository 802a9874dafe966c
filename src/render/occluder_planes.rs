//! Technique: shadow planes with occluder textures (S. Coleman, "Fast Self-Shadowing Using Occluder Textures", 2006).
//!
//! One forward pass. The affine rows of each plane (thesis eq. 2-8, see `solver::shade`) are computed on the CPU once
//! per light and instance, and the lists of the sections chosen; a plane that casts nothing under that light is in none
//! of them, so it costs no fragment anything.

use super::{
    FrameRequest, Mode, RenderError,
    atlas::{Atlas, Slot},
    bindings::{Binding, INTEGERS, SAMPLER, group, layout, texture},
    casting::Casting,
    forward::{Forward, ForwardOptions},
    gpu::{CONSTANT_VISIBILITY, Gpu, OCCLUDER_PLANES},
    plane_view::PlaneView,
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
};
use shadowfit_solver::{
    plane::{BakedSet, SDF_BORDER},
    shade::EDGE_ON,
};
use wgpu::util::{DeviceExt, TextureDataOrder};

/// Bindings 0 to 2 of group 2, those of planes.wgsl.
pub(crate) const BINDINGS: [Binding; 3] = [
    (wgpu::ShaderStages::VERTEX_FRAGMENT, INTEGERS),
    (wgpu::ShaderStages::FRAGMENT, texture(wgpu::TextureViewDimension::D2Array)),
    (wgpu::ShaderStages::FRAGMENT, SAMPLER),
];

/// Draws the model with the shadows of a baked set.
#[derive(Debug)]
pub struct OccluderPlanes {
    set: BakedSet,
    /// One a plane.
    slots: Vec<Slot>,
    atlas_bytes: usize,
    casting: Casting,
    constants: Vec<(&'static str, f64)>,
    occluders: wgpu::TextureView,
    sampler: wgpu::Sampler,
    group: wgpu::BindGroup,
    /// Draws the sections that read no plane under this light.
    bare: Forward,
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
        let casting = Casting::new(gpu, set, &atlas.slots, stage.placements().len())?;
        let constants = [("EDGE_ON", f64::from(EDGE_ON)), ("SDF_BORDER", f64::from(SDF_BORDER))];
        let constants: Vec<_> = constants.into_iter().chain(casting.constants()).collect();
        let group_layout = layout(gpu, "planes", &BINDINGS);
        let options = ForwardOptions { constants: vec![("VISIBILITY", 1.0)], ..Default::default() };
        let bare = Forward::new(stage, &CONSTANT_VISIBILITY, None, options);
        let options = ForwardOptions { constants: constants.clone(), ..Default::default() };
        let forward = Forward::new(stage, &OCCLUDER_PLANES, Some(&group_layout), options);
        let group = group(gpu, &group_layout, &resources(&casting, &occluders, &sampler));
        gpu.check()?;
        let (set, slots, atlas_bytes) = (set.clone(), atlas.slots, atlas.rgba.len());
        Ok(Self { set, slots, atlas_bytes, casting, constants, occluders, sampler, group, bare, forward, view: None })
    }

    /// The planes and where their textures lie.
    pub(crate) fn planes(&self) -> (&BakedSet, &[Slot]) {
        (&self.set, &self.slots)
    }

    /// The pipeline constants of planes.wgsl.
    pub(crate) fn constants(&self) -> &[(&'static str, f64)] {
        &self.constants
    }

    /// Bindings 0 to 2 of group 2.
    pub(crate) fn resources(&self) -> [wgpu::BindingResource<'_>; 3] {
        resources(&self.casting, &self.occluders, &self.sampler)
    }
}

impl Technique for OccluderPlanes {
    fn name(&self) -> String {
        "occluder planes".to_string()
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        _: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        self.casting.update(&stage.gpu, &self.set, stage.placements(), &request.light);
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
        let casting = &self.casting;
        self.bare.draw_sections(stage, request, targets, (&mut pass, Part::All, &|label| !casting.is_read(label)));
        pass.set_bind_group(2, &self.group, &[]);
        self.forward.draw_sections(stage, request, targets, (&mut pass, Part::All, &|label| casting.is_read(label)));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        Cost {
            passes: 1,
            draw_calls: stage.calls_over(&|label| self.casting.is_read(label))
                + stage.calls_over(&|label| !self.casting.is_read(label)),
            update_passes: 0,
            update_draw_calls: 0,
            texture_bytes: self.atlas_bytes + self.casting.bytes(),
            buffer_bytes: 0,
            on_light_change: "three rows a casting plane and the sections' lists, per instance, on the CPU".to_string(),
        }
    }
}

fn resources<'a>(
    casting: &'a Casting,
    occluders: &'a wgpu::TextureView,
    sampler: &'a wgpu::Sampler,
) -> [wgpu::BindingResource<'a>; 3] {
    let [casting, occluders] = [&casting.view, occluders].map(wgpu::BindingResource::TextureView);
    [casting, occluders, wgpu::BindingResource::Sampler(sampler)]
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
