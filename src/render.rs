//! Frames of a model with its self-shadows: one forward pass, no shadow map.
//!
//! In: a [`Scene`](crate::scene::Scene) whose triangles know their sections, a set of baked planes in unit space, a
//! [`Camera`] and a [`Light`]. Out: an RGBA
//! picture. Two renderers draw the same frame: [`turntable`] with wgpu and [`cpu`] with traced camera rays, for
//! machines without an adapter. Their shading constants are the ones below; `tests/parity.rs` compares them.
//!
//! Not guaranteed: equal bytes between the two, or between two drivers (silhouettes, rounding of the last bit).

mod atlas;
mod bindings;
mod camera;
mod casting;
pub mod cpu;
mod depth_pass;
pub mod field;
mod forward;
pub mod gpu;
mod layout;
mod light_map;
mod light_view;
pub mod occluder_planes;
pub mod perspective_shadow_map;
pub mod planar;
mod plane_view;
pub mod projective_texture;
pub mod ray_traced;
pub mod receiver;
pub mod shadow_map;
mod silhouette;
pub mod silhouette_map;
mod silhouette_points;
pub mod soft_planar;
pub mod stage;
pub mod stencil_volumes;
pub mod technique;
pub mod timing;
pub mod transparent;
pub mod turntable;
pub mod unshadowed;
mod upload;
pub mod vertex_visibility;
mod view_matrices;
pub mod volume;
mod volume_pass;

pub use camera::Camera;
use glam::{Vec3, Vec4};

/// Share of the base colour that a surface shows without direct light.
pub const AMBIENT: f32 = 0.25;
/// Share of the base colour that direct light at normal incidence adds; with [`AMBIENT`] exactly 1, no clipping.
pub const DIFFUSE: f32 = 0.75;
/// Background of the `shaded` and `planes` frames, linear RGB: a light grey-blue that no shadow can be taken for.
pub const BACKGROUND_LINEAR: [f32; 3] = [0.72, 0.76, 0.80];

/// What a frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Mode {
    /// Lambert shading with ambient light, sRGB.
    Shaded,
    /// Linear bytes for measurements. R: 255 V where the geometric normal faces the light, else 0. G: 255 where it
    /// faces the light. B: 255 where the model covers the pixel. The background is 0.
    Mask,
    /// The shaded model with the shadow planes drawn through it, one colour a plane.
    Planes,
}

/// Samples per pixel of the silhouettes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub enum Antialias {
    /// One sample, at the pixel's centre.
    #[default]
    Off,
    /// Four samples, at the standard positions.
    Msaa4,
}

impl Antialias {
    /// Number of samples.
    #[must_use]
    pub fn samples(self) -> u32 {
        match self {
            Self::Off => 1,
            Self::Msaa4 => 4,
        }
    }
}

/// Where the light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// From infinitely far.
    Directional {
        /// Unit vector from the surface towards the light, the same in model and unit space.
        to_light: Vec3,
    },
    /// From a point; it does not fall off with distance.
    Point {
        /// Where it is, unit space.
        position: Vec3,
    },
}

impl Light {
    /// Vector from `p_unit` towards the light; its length is 1 or the distance.
    #[must_use]
    pub fn towards(&self, p_unit: Vec3) -> Vec3 {
        match *self {
            Self::Directional { to_light } => to_light,
            Self::Point { position } => position - p_unit,
        }
    }

    /// As a homogeneous point: (direction towards the light, 0), or (position, 1).
    #[must_use]
    pub fn homogeneous(&self) -> Vec4 {
        match *self {
            Self::Directional { to_light } => to_light.extend(0.0),
            Self::Point { position } => position.extend(1.0),
        }
    }

    /// The direction that picks the active lists: towards the light from the model's middle, the centre of unit space.
    #[must_use]
    pub fn from_centre(&self) -> Vec3 {
        self.towards(Vec3::ZERO).normalize_or_zero()
    }
}

/// How a frame is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameOptions {
    /// Width and height, 1 to the adapter's limit (8192 and more everywhere).
    pub size_px: [u32; 2],
    /// What it shows.
    pub mode: Mode,
    /// Silhouette quality; [`Antialias::Msaa4`] costs up to four times the memory and little time on a GPU.
    pub antialias: Antialias,
}

impl Default for FrameOptions {
    fn default() -> Self {
        Self { size_px: [1024, 1024], mode: Mode::Shaded, antialias: Antialias::Off }
    }
}

/// One frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRequest {
    /// From where.
    pub camera: Camera,
    /// Lit from where.
    pub light: Light,
    /// Drawn how.
    pub options: FrameOptions,
}

/// Why there is no frame.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// No graphics adapter: draw with [`cpu`] instead.
    #[error("no graphics adapter (wgpu found none; a software one is in the package mesa-vulkan-drivers)")]
    NoAdapter,
    /// Adapters exist, but none gives a usable device.
    #[error("no usable graphics device: {reason}")]
    Device {
        /// What each adapter answered.
        reason: String,
    },
    /// Something does not fit into the adapter's limits.
    #[error("{what} need {needed}, the adapter allows {limit}: draw this model with the CPU renderer")]
    TooLarge {
        /// What.
        what: &'static str,
        /// How much (bytes or texels).
        needed: u64,
        /// How much is allowed.
        limit: u64,
    },
    /// A width or height that cannot be drawn.
    #[error("a frame of {width} x {height} pixels cannot be drawn (1 to {limit} each)")]
    FrameSize {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Pixels.
        limit: u32,
    },
    /// A technique needs what the adapter, the light or the planes do not give.
    #[error("{technique} needs {feature}, and that is not given")]
    Unsupported {
        /// Who.
        technique: &'static str,
        /// What.
        feature: &'static str,
    },
    /// The CPU renderer does not draw this mode.
    #[error("{0:?} frames need a graphics adapter")]
    NeedsAdapter(Mode),
    /// The driver reported an error.
    #[error("the graphics driver reported: {reason}")]
    Driver {
        /// Its text.
        reason: String,
    },
}

/// sRGB byte of a linear value in 0..1 (IEC 61966-2-1).
fn srgb_from_linear(x: f32) -> u8 {
    let x = x.clamp(0.0, 1.0);
    let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

/// Linear value 0..1 of an sRGB byte.
pub(crate) fn linear_from_srgb(byte: u8) -> f32 {
    let x = f32::from(byte) / 255.0;
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trips_every_byte() {
        for byte in 0..=255 {
            assert_eq!(srgb_from_linear(linear_from_srgb(byte)), byte);
        }
    }
}
