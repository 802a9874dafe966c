//! Technique: shadow planes with occluder textures (S. Coleman, "Fast Self-Shadowing Using Occluder Textures", 2006).
//!
//! One forward pass. The affine rows of each plane (thesis eq. 2-8, see `solver::shade`) are computed on the CPU once
//! per light and instance, and the lists of the sections chosen; a plane that casts nothing under that light is in none
//! of them, so it costs no fragment anything. Under a directional light of some size edges are soft where textures are
//! distance fields; for a light without size nothing is asked, so that hard edges pay nothing.
//!
//! What it costs on lavapipe (Mesa 22.3, LLVM 15, 8 lanes) against `none`: CPU time of interleaved frames of 1024 x 1024
//! (40 of one instance, 24 filling the frame, 5 to 9 of 100), median of the ratios, light still / moving; the teapot in
//! 144 sections, 774 planes, lists of at most 4 and 0.67 on average:
//!
//! | technique | turntable | one, filling the frame | 100 instances | 100, vertices alone |
//! |---|---|---|---|---|
//! | coordinates per fragment | 1.30 / 1.31 | 1.58 / 1.62 | 1.32 / 1.25 | 0.97 / 0.97 |
//! | coordinates per vertex | 1.24 / 1.26 | 1.28 / 1.25 | 1.61 / 1.63 | 1.38 / 1.41 |
//! | shadow map 512, nearest | 1.44 / 1.83 | 1.56 / 1.70 | 1.14 / 1.80 | 1.06 / 1.70 |
//!
//! The machine was shared: the same cell differs by up to 0.1 between runs. Per vertex wins where fragments are many and
//! loses where vertices are (as the thesis found): the vertex stage is 47 % of the shader time of `none` at 100
//! instances.
//!
//! Why, from samples and the disassembly of the compiled shaders:
//! - An `if` masks lanes and jumps over nothing; a loop looks whether lanes are left only at its end. A fragment whose
//!   list is empty paid for one plane: `none` 18.7 ms, all lists empty 29.0 ms, the true lists 31.8 ms. So where the
//!   adapter is software, sections that read no plane in any instance are drawn by the pipeline without (60 draws instead
//!   of one): empty lists cost 1.00.
//! - A load from a storage buffer is a loop over the lanes: some hundred executed instructions a number (counted by hand:
//!   8 turns of 12), 25 numbers a plane. A texel is 148 instructions for four numbers of 8 lanes: planes are texels. 1.64
//!   became 1.50.
//! - Every fragment of every technique looked for holes (four loads, one texel): a pipeline constant now leaves that out
//!   where no image cuts any; `none` took 0.86 of its time.
//! - The coordinates of vertices move through variables: as arrays indexed by the loop's counter, which each lane counts
//!   for itself, they cost 1.54 on the turntable.
//!
//! Rejected: the light and the base colour as flat attributes of vertices: `none` 0.84 of its time for one instance but
//! 1.14 at 100 (4 frames), since the vertex stage then gathers six numbers more.

use super::{
    FrameRequest, Light, Mode, RenderError,
    atlas::{Atlas, Slot},
    bindings::{Binding, INTEGERS, SAMPLER, group, layout, texture},
    casting::{Casting, choices},
    forward::{Forward, ForwardOptions},
    gpu::{CONSTANT_VISIBILITY, Gpu, OCCLUDER_PLANES, VERTEX_COORDINATES},
    layout::SlotTexel,
    plane_view::PlaneView,
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
};
use shadowfit_solver::{
    plane::{BakedSet, SDF_BORDER, SDF_PER_TEXEL},
    shade::{EDGE_ON, MIN_SPREAD},
};
use wgpu::util::{DeviceExt, TextureDataOrder};

/// Name of the variant with coordinates at vertices.
const PER_VERTEX: &str = "occluder planes, per vertex";

/// Bindings 0 to 2 of group 2, those of planes.wgsl.
pub(crate) const BINDINGS: [Binding; 3] = [
    (wgpu::ShaderStages::VERTEX_FRAGMENT, INTEGERS),
    (wgpu::ShaderStages::FRAGMENT, texture(wgpu::TextureViewDimension::D2Array)),
    (wgpu::ShaderStages::FRAGMENT, SAMPLER),
];

/// Where the coordinates on the planes are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Coordinates {
    PerFragment,
    PerVertex,
}

/// Most planes of a list whose coordinates are computed at vertices; MOST of vertex_coordinates.wgsl. The model's own
/// attributes and two locations a plane leave room for no fifth among the 15 that every adapter has.
const MOST_AT_VERTICES: usize = 4;

/// Draws the model with the shadows of a baked set.
#[derive(Debug)]
pub struct OccluderPlanes {
    set: BakedSet,
    /// Angular radius of directional lights; 0: hard edges.
    light_radius_rad: f32,
    coordinates: Coordinates,
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
        Self::soft(stage, set, 0.0)
    }

    /// The same with coordinates that are interpolated from the vertices, as in the thesis. Point lights are refused:
    /// coordinates under them are not affine.
    ///
    /// # Errors
    /// As of [`OccluderPlanes::new`], and [`RenderError::Unsupported`] where a section reads more than 4 planes, or
    /// some plane has a tint.
    pub fn per_vertex(stage: &Stage, set: &BakedSet) -> Result<Self, RenderError> {
        if choices(set).flatten().any(|list| list.len() > MOST_AT_VERTICES) {
            return Err(RenderError::Unsupported { technique: PER_VERTEX, feature: "lists of at most 4 planes" });
        }
        if set.is_tinted() {
            return Err(RenderError::Unsupported { technique: PER_VERTEX, feature: "planes without tints" });
        }
        Self::with(stage, set, (0.0, Coordinates::PerVertex))
    }

    /// The same with soft edges: directional lights have this angular radius (the sun: 0.0047), 0 to pi/4.
    ///
    /// # Errors
    /// As of [`OccluderPlanes::new`].
    pub fn soft(stage: &Stage, set: &BakedSet, light_radius_rad: f32) -> Result<Self, RenderError> {
        Self::with(stage, set, (light_radius_rad, Coordinates::PerFragment))
    }

    fn with(
        stage: &Stage,
        set: &BakedSet,
        (light_radius_rad, coordinates): (f32, Coordinates),
    ) -> Result<Self, RenderError> {
        let gpu = &stage.gpu;
        let limits = gpu.limits();
        let textures: Vec<_> = set.planes.iter().map(|baked| &baked.texture).collect();
        let atlas = Atlas::pack(
            &textures,
            limits.max_texture_dimension_2d,
            limits.max_texture_array_layers.min(SlotTexel::LAYERS),
        )?;
        let occluders = upload_atlas(gpu, &atlas);
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("occluders"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let casting = Casting::new(gpu, (set, light_radius_rad), &atlas.slots, stage.placements().len())?;
        let mut constants: Vec<_> = CONSTANTS.map(|(name, value)| (name, f64::from(value))).to_vec();
        constants.extend(casting.constants());
        let group_layout = layout(gpu, "planes", &BINDINGS);
        let options = ForwardOptions { constants: vec![("VISIBILITY", 1.0)], ..Default::default() };
        let bare = Forward::new(stage, &CONSTANT_VISIBILITY, None, options);
        let mut options = ForwardOptions { constants: with_light(&constants, light_radius_rad), ..Default::default() };
        let mut shader = &OCCLUDER_PLANES;
        if coordinates == Coordinates::PerVertex {
            options.constants.clone_from(&constants);
            options.entry_points = ["vs_coordinates", "fs_coordinates_shaded", "fs_coordinates_mask"];
            shader = &VERTEX_COORDINATES;
        }
        let forward = Forward::new(stage, shader, Some(&group_layout), options);
        let group = group(gpu, &group_layout, &resources(&casting, &occluders, &sampler));
        gpu.check()?;
        let (set, slots, atlas_bytes) = (set.clone(), atlas.slots, atlas.rgba.len());
        Ok(Self {
            set,
            light_radius_rad,
            coordinates,
            slots,
            atlas_bytes,
            casting,
            constants,
            occluders,
            sampler,
            group,
            bare,
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
        with_light(&self.constants, self.light_radius_rad)
    }

    /// Those of planes.wgsl.
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
        match self.light_radius_rad {
            _ if self.coordinates == Coordinates::PerVertex => PER_VERTEX.to_string(),
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
        if self.coordinates == Coordinates::PerVertex && matches!(request.light, Light::Point { .. }) {
            return Err(RenderError::Unsupported { technique: PER_VERTEX, feature: "a directional light" });
        }
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
        let is_asked = |label| is_asked(stage, &self.casting, label);
        self.bare.draw_sections(stage, request, targets, (&mut pass, Part::All, &|label| !is_asked(label)));
        pass.set_bind_group(2, &self.group, &[]);
        self.forward.draw_sections(stage, request, targets, (&mut pass, Part::All, &is_asked));
        Ok(())
    }

    fn cost(&self, stage: &Stage) -> Cost {
        Cost {
            passes: 1,
            draw_calls: [true, false]
                .map(|asked| stage.calls_over(&|label| is_asked(stage, &self.casting, label) == asked))
                .iter()
                .sum(),
            update_passes: 0,
            update_draw_calls: 0,
            texture_bytes: self.atlas_bytes + self.casting.bytes(),
            buffer_bytes: 0,
            on_light_change: "three rows a casting plane and the sections' lists, per instance, on the CPU".to_string(),
        }
    }
}

/// Does the pipeline with planes draw that section? On graphics hardware all of them, by one call: it jumps over empty
/// lists.
fn is_asked(stage: &Stage, casting: &Casting, label: u32) -> bool {
    !stage.gpu.is_software() || casting.is_asked(label)
}

/// The pipeline constants of planes.wgsl that are constants of the solver.
const CONSTANTS: [(&str, f32); 4] =
    [("EDGE_ON", EDGE_ON), ("SDF_BORDER", SDF_BORDER), ("SDF_PER_TEXEL", SDF_PER_TEXEL), ("MIN_SPREAD", MIN_SPREAD)];

/// Those of planes.wgsl and of occluder_planes.wgsl.
fn with_light(constants: &[(&'static str, f64)], light_radius_rad: f32) -> Vec<(&'static str, f64)> {
    let mut all = constants.to_vec();
    all.push(("LIGHT_SINE", f64::from(light_radius_rad.sin())));
    all
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
