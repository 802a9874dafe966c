//! The techniques of a comparison, each at the settings that a user would choose among.

use super::{
    CompareOptions,
    bench::{Bench, World},
    errors::SOFT_HALF_ANGLE_RAD,
};
use crate::{
    render::{
        RenderError,
        occluder_planes::OccluderPlanes,
        perspective_shadow_map::PerspectiveShadowMap,
        planar::{Planar, PlanarOptions},
        projective_texture::{ProjectiveTexture, ProjectiveTextureOptions},
        receiver::Receiver,
        shadow_map::{ShadowMap, ShadowMapOptions},
        silhouette_map::SilhouetteMap,
        soft_planar::{SoftPlanar, SoftPlanarOptions},
        stage::Stage,
        stencil_volumes::{Counting, StencilVolumes},
        technique::Technique,
        transparent::{Accumulation, TransparentVolumes},
        unshadowed::Unshadowed,
        vertex_visibility::{Kept, VertexVisibility, VertexVisibilityOptions},
    },
    scene::Scene,
};
use glam::Vec3;
use shadowfit_solver::{
    mesh::{Frame, Mesh},
    plane::BakedSet,
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
    /// Shadow maps warped by the camera.
    PerspectiveShadowMap,
    /// Shadow maps that know where the silhouette runs through their texels.
    SilhouetteMap,
    /// Stencil shadow volumes, z-pass and z-fail.
    StencilVolumes,
    /// Visibility precomputed at the vertices.
    VertexVisibility,
    /// Shadow maps with wide kernels and shadow planes with soft edges, against an area light.
    SoftEdge,
    /// Casters flattened onto the ground.
    Planar,
    /// The casters' silhouette projected onto the ground.
    ProjectiveTexture,
    /// The mean of many flattened shadows on the ground, against an area light.
    SoftPlanar,
    /// Shadow volumes of casters that let light pass.
    TransparentVolumes,
}

/// What a technique's frames are compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// Traced hard shadows, tinted by what lets light pass.
    Hard,
    /// Traced soft shadows of a distant light of some size.
    Soft,
}

/// Sizes of shadow maps that are measured unfiltered.
const MAP_SIZES: [u32; 6] = [128, 256, 512, 1024, 2048, 4096];

/// Sizes and kernels of filtered maps: those of the soft edge among them, to tell what they cost where shadows are hard.
const FILTERED: [(u32, u32); 6] = [(512, 2), (512, 5), (1024, 2), (1024, 5), (1024, 9), (1024, 17)];

/// Sizes of the maps of other techniques.
const OTHER_SIZES: [u32; 3] = [256, 512, 1024];

/// Kernels of the soft edge, texels of a map of [`SOFT_SIZE`].
const SOFT_KERNELS: [u32; 4] = [1, 5, 9, 17];

/// Size of the soft edge's map and of the soft planar texture.
const SOFT_SIZE: u32 = 1024;

/// Samples a side of soft planar shadows.
const SOFT_SIDES: [u32; 3] = [1, 4, 8];

/// Radii of the light that planes are told in the soft edge: none, and that of the disc that has the area of the
/// references' square.
const SOFT_RADII_RAD: [f32; 2] = [0.0, SOFT_HALF_ANGLE_RAD * std::f32::consts::FRAC_2_SQRT_PI];

/// What is kept at vertices, and the edges: as hard as may be, and as soft as published.
const KEPT_AT_VERTICES: [(Kept, f32); 3] = [(Kept::Harmonics, 0.05), (Kept::Harmonics, 0.5), (Kept::BentNormal, 0.05)];

/// Size of the maps in the scaling tests.
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

/// What a technique is made for.
#[derive(Clone, Copy)]
pub(super) struct Subject<'a> {
    pub stage: &'a Stage,
    pub scene: &'a Scene,
    pub mesh: &'a Mesh,
    pub frame: &'a Frame,
}

type Made = Result<Box<dyn Technique>, RenderError>;

impl Subject<'_> {
    fn shadow_map(&self, (size_texels, kernel_texels): (u32, u32)) -> Made {
        Ok(Box::new(ShadowMap::new(self.stage, ShadowMapOptions { size_texels, kernel_texels })?))
    }

    fn perspective(&self, size_texels: u32) -> Made {
        Ok(Box::new(PerspectiveShadowMap::new(self.stage, ShadowMapOptions { size_texels, kernel_texels: 1 })?))
    }

    fn silhouette(&self, size_texels: u32) -> Made {
        Ok(Box::new(SilhouetteMap::new(self.stage, self.scene, self.frame, size_texels)?))
    }

    fn volumes(&self, counting: Counting) -> Made {
        Ok(Box::new(StencilVolumes::new(self.stage, self.scene, self.frame, counting)?))
    }

    fn vertices(&self, (kept, edge): (Kept, f32)) -> Made {
        let options = VertexVisibilityOptions { kept, edge, ..Default::default() };
        Ok(Box::new(VertexVisibility::new(self.stage, (self.scene, self.mesh), options)?))
    }

    fn projective(&self, size_texels: u32) -> Made {
        Ok(Box::new(ProjectiveTexture::new(self.stage, ProjectiveTextureOptions { size_texels })?))
    }

    fn soft_planar(&self, receiver: Receiver, side: u32) -> Made {
        let options = SoftPlanarOptions {
            receiver,
            half_edges: [Vec3::ZERO; 2],
            half_angle_rad: SOFT_HALF_ANGLE_RAD,
            side,
            size_texels: SOFT_SIZE,
        };
        Ok(Box::new(SoftPlanar::new(self.stage, options)?))
    }

    fn transparent(&self, accumulation: Accumulation) -> Made {
        Ok(Box::new(TransparentVolumes::new(self.stage, self.scene, self.frame, accumulation)?))
    }

    /// The settings of a family; the planes' are those of each set.
    fn techniques(&self, family: Family) -> Result<Vec<Box<dyn Technique>>, RenderError> {
        let receiver = Receiver::of_ground(self.scene, self.frame);
        match family {
            Family::None => Ok(vec![Box::new(Unshadowed::new(self.stage))]),
            Family::Planes => Ok(Vec::new()),
            Family::ShadowMap => {
                MAP_SIZES.map(|size| (size, 1)).into_iter().chain(FILTERED).map(|map| self.shadow_map(map)).collect()
            }
            Family::PerspectiveShadowMap => OTHER_SIZES.into_iter().map(|size| self.perspective(size)).collect(),
            Family::SilhouetteMap => OTHER_SIZES.into_iter().map(|size| self.silhouette(size)).collect(),
            Family::StencilVolumes => {
                [Counting::ZPass, Counting::ZFail].map(|how| self.volumes(how)).into_iter().collect()
            }
            Family::VertexVisibility => KEPT_AT_VERTICES.into_iter().map(|kept| self.vertices(kept)).collect(),
            Family::SoftEdge => SOFT_KERNELS.into_iter().map(|kernel| self.shadow_map((SOFT_SIZE, kernel))).collect(),
            Family::Planar => {
                let planar =
                    |receiver| -> Box<dyn Technique> { Box::new(Planar::new(self.stage, PlanarOptions { receiver })) };
                Ok(receiver.map(planar).into_iter().collect())
            }
            Family::ProjectiveTexture => OTHER_SIZES.into_iter().map(|size| self.projective(size)).collect(),
            Family::SoftPlanar => {
                let sides = receiver.into_iter().flat_map(|receiver| SOFT_SIDES.map(|side| (receiver, side)));
                sides.map(|(receiver, side)| self.soft_planar(receiver, side)).collect()
            }
            Family::TransparentVolumes => {
                let how = [Accumulation::Logarithms, Accumulation::Products];
                how.map(|how| self.transparent(how)).into_iter().collect()
            }
        }
    }

    /// What stands for a family in the scaling tests: one setting of each that shades the model itself. The planes' are
    /// those of each set.
    pub fn representative(&self, family: Family) -> Result<Option<Box<dyn Technique>>, RenderError> {
        Ok(Some(match family {
            Family::None => Box::new(Unshadowed::new(self.stage)),
            Family::ShadowMap => self.shadow_map((SCALED_MAP, 1))?,
            Family::PerspectiveShadowMap => self.perspective(SCALED_MAP)?,
            Family::SilhouetteMap => self.silhouette(SCALED_MAP)?,
            Family::StencilVolumes => self.volumes(Counting::ZFail)?,
            Family::VertexVisibility => self.vertices(KEPT_AT_VERTICES[0])?,
            Family::Planes
            | Family::SoftEdge
            | Family::Planar
            | Family::ProjectiveTexture
            | Family::SoftPlanar
            | Family::TransparentVolumes => return Ok(None),
        }))
    }
}

impl Family {
    /// Where it is measured; planes also on a ground, where one is fitted.
    pub(super) fn world(self) -> World {
        match self {
            Self::Planar | Self::ProjectiveTexture | Self::SoftPlanar => World::Ground,
            Self::TransparentVolumes => World::Glass,
            _ => World::Model,
        }
    }

    fn against(self) -> Against {
        match self {
            Self::SoftEdge | Self::SoftPlanar => Against::Soft,
            _ => Against::Hard,
        }
    }
}

/// The ways to draw a set of planes: hard with coordinates of fragments and of vertices (where no list is too long for
/// that), or without and with soft edges.
fn variants(family: Family, (stage, set): (&Stage, &BakedSet)) -> Result<Vec<OccluderPlanes>, RenderError> {
    match family {
        Family::Planes => {
            let per_vertex = match OccluderPlanes::per_vertex(stage, set) {
                Err(RenderError::Unsupported { .. }) => None,
                outcome => Some(outcome?),
            };
            Ok([OccluderPlanes::new(stage, set)?].into_iter().chain(per_vertex).collect())
        }
        Family::SoftEdge => SOFT_RADII_RAD.map(|radius| OccluderPlanes::soft(stage, set, radius)).into_iter().collect(),
        _ => Ok(Vec::new()),
    }
}

/// All settings of the families asked for.
pub(super) fn settings(bench: &Bench, options: &CompareOptions) -> Result<Vec<Setting>, RenderError> {
    let mut settings = Vec::new();
    for &family in &options.families {
        let (world, against) = (family.world(), family.against());
        let Some(stage) = bench.stage(world) else { continue };
        let traced = bench.traced(world);
        let subject = Subject { stage, scene: traced.scene(), mesh: traced.mesh(), frame: &bench.frame };
        // Names of soft techniques on the model tell what they are compared with: hard ones are there, too.
        let soft = (family == Family::SoftEdge).then_some("soft edge");
        let setting = |technique| Setting { family, world, against, technique, label: soft.map(str::to_string) };
        settings.extend(subject.techniques(family)?.into_iter().map(setting));
        for (set, planes) in bench.planes.iter().enumerate() {
            for world in [World::Planes(set), World::PlanesOnGround(set)] {
                let Some(stage) = bench.stage(world) else { continue };
                let on_ground = world.counts_ground().then_some("on the ground");
                let words: Vec<&str> = std::iter::once(&*planes.label).chain(soft).chain(on_ground).collect();
                for technique in variants(family, (stage, &planes.set))? {
                    let label = Some(words.join(", "));
                    settings.push(Setting { family, world, against, technique: Box::new(technique), label });
                }
            }
        }
    }
    Ok(settings)
}
