//! The techniques of a comparison, each at the settings that a user would choose among.

use super::{
    CompareOptions,
    bench::{Bench, World},
    errors::SOFT_HALF_ANGLE_RAD,
};
use crate::render::{
    FrameRequest, RenderError,
    occluder_planes::OccluderPlanes,
    ray_traced::RayTraced,
    shadow_map::{ShadowMap, ShadowMapOptions},
    stage::Stage,
    technique::Technique,
    unshadowed::Unshadowed,
    vertex_visibility::{Kept, VertexVisibility, VertexVisibilityOptions},
};

/// A technique, whatever its setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// No shadow: the floor of all costs.
    None,
    /// Shadow planes with occluder textures.
    Planes,
    /// Shadow maps of several sizes and filters.
    ShadowMap,
    /// Shadow maps with wide kernels and shadow planes with soft edges, against an area light.
    SoftEdge,
    /// Visibility precomputed at the vertices.
    VertexVisibility,
}

/// What a technique's frames are compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// Traced hard shadows.
    Hard,
    /// Traced soft shadows of a distant light of some size.
    Soft,
}

/// Sizes of shadow maps that are measured unfiltered.
const MAP_SIZES: [u32; 6] = [128, 256, 512, 1024, 2048, 4096];

/// Sizes that are measured filtered too.
const FILTERED_SIZES: [u32; 2] = [512, 1024];

/// Kernels of the filtered maps.
const KERNELS: [u32; 2] = [2, 5];

/// Kernels of the soft edge, texels of a map of [`SOFT_SIZE`].
const SOFT_KERNELS: [u32; 4] = [1, 5, 9, 17];

/// Size of the soft edge's map.
const SOFT_SIZE: u32 = 1024;

/// Radii of the light that planes are told in the soft edge: none, and that of the disc that has the area of the
/// references' square.
const SOFT_RADII_RAD: [f32; 2] = [0.0, SOFT_HALF_ANGLE_RAD * std::f32::consts::FRAC_2_SQRT_PI];

/// What is kept at vertices, and the edges: as hard as may be, and as soft as published.
const KEPT_AT_VERTICES: [(Kept, f32); 3] = [(Kept::Harmonics, 0.05), (Kept::Harmonics, 0.5), (Kept::BentNormal, 0.05)];

/// Size of the shadow map in the scaling tests.
const SCALED_MAP: u32 = 512;

/// A technique at one setting, in its world.
pub(super) struct Setting {
    pub family: Family,
    pub world: World,
    pub against: Against,
    pub technique: Box<dyn Technique>,
    /// Beside the technique's own name: which planes.
    pub label: Option<String>,
}

impl Setting {
    /// Its name in tables.
    pub fn name(&self) -> String {
        match &self.label {
            Some(label) => format!("{}, {label}", self.technique.name()),
            None => self.technique.name(),
        }
    }
}

/// The settings of a family on `stage`, which shows what `traced` does; the planes' are those of each set.
pub(super) fn techniques(
    family: Family,
    (stage, traced): (&Stage, &RayTraced),
) -> Result<Vec<Box<dyn Technique>>, RenderError> {
    let map = |size_texels, kernel_texels| -> Result<Box<dyn Technique>, RenderError> {
        Ok(Box::new(ShadowMap::new(stage, ShadowMapOptions { size_texels, kernel_texels })?))
    };
    match family {
        Family::None => Ok(vec![Box::new(Unshadowed::new(stage))]),
        Family::Planes => Ok(Vec::new()),
        Family::ShadowMap => {
            let filtered = FILTERED_SIZES.into_iter().flat_map(|size| KERNELS.map(|kernel| (size, kernel)));
            MAP_SIZES
                .map(|size| (size, 1))
                .into_iter()
                .chain(filtered)
                .map(|(size, kernel)| map(size, kernel))
                .collect()
        }
        Family::SoftEdge => SOFT_KERNELS.map(|kernel| map(SOFT_SIZE, kernel)).into_iter().collect(),
        Family::VertexVisibility => {
            let kept =
                KEPT_AT_VERTICES.map(|(kept, edge)| VertexVisibilityOptions { kept, edge, ..Default::default() });
            kept.into_iter().map(|options| vertex_visibility((stage, traced), options)).collect()
        }
    }
}

fn vertex_visibility(
    (stage, traced): (&Stage, &RayTraced),
    options: VertexVisibilityOptions,
) -> Result<Box<dyn Technique>, RenderError> {
    Ok(Box::new(VertexVisibility::new(stage, (traced.scene(), traced.mesh()), options)?))
}

/// What stands for a family in the scaling tests: one setting of each that shades the model itself. The planes' are
/// those of each set.
pub(super) fn representative(
    family: Family,
    (stage, traced): (&Stage, &RayTraced),
) -> Result<Option<Box<dyn Technique>>, RenderError> {
    let options = ShadowMapOptions { size_texels: SCALED_MAP, kernel_texels: 1 };
    Ok(match family {
        Family::None => Some(Box::new(Unshadowed::new(stage))),
        Family::ShadowMap => Some(Box::new(ShadowMap::new(stage, options)?)),
        Family::VertexVisibility => Some(vertex_visibility((stage, traced), VertexVisibilityOptions::default())?),
        Family::Planes | Family::SoftEdge => None,
    })
}

impl Family {
    fn world(self) -> World {
        match self {
            Self::None | Self::Planes | Self::ShadowMap | Self::SoftEdge | Self::VertexVisibility => World::Model,
        }
    }

    fn against(self) -> Against {
        match self {
            Self::SoftEdge => Against::Soft,
            Self::None | Self::Planes | Self::ShadowMap | Self::VertexVisibility => Against::Hard,
        }
    }

    /// Radii of the light that its planes are told; none where it has no planes.
    fn plane_radii_rad(self) -> &'static [f32] {
        match self {
            Self::Planes => &SOFT_RADII_RAD[..1],
            Self::SoftEdge => &SOFT_RADII_RAD,
            Self::None | Self::ShadowMap | Self::VertexVisibility => &[],
        }
    }
}

/// All settings of the families asked for.
pub(super) fn settings(bench: &Bench, options: &CompareOptions) -> Result<Vec<Setting>, RenderError> {
    let mut settings = Vec::new();
    for &family in &options.families {
        let (world, against) = (family.world(), family.against());
        let made = techniques(family, (&bench.stages[world.stage()], bench.traced(world)))?;
        let soft = (against == Against::Soft).then_some("soft edge");
        let setting = |technique| Setting { family, world, against, technique, label: soft.map(str::to_string) };
        settings.extend(made.into_iter().map(setting));
        for &radius_rad in family.plane_radii_rad() {
            for (set, planes) in bench.planes.iter().enumerate() {
                let world = World::Planes(set);
                let technique = OccluderPlanes::soft(&bench.stages[world.stage()], &planes.set, radius_rad)?;
                let label = std::iter::once(&*planes.label).chain(soft).collect::<Vec<_>>().join(", ");
                settings.push(Setting { family, world, against, technique: Box::new(technique), label: Some(label) });
            }
        }
    }
    Ok(settings)
}

/// Draws a frame of a setting.
pub(super) fn draw(
    bench: &mut Bench,
    setting: &mut Setting,
    request: &FrameRequest,
) -> Result<image::RgbaImage, RenderError> {
    bench.stages[setting.world.stage()].render(&mut *setting.technique, request)
}
