//! The graphics device, the table of shaders, and reading pictures back.
//!
//! Headless: no window, no surface. The best adapter wins: discrete, integrated, virtual, then software (lavapipe).

use super::RenderError;
pub use super::layout::{StructLayout, struct_layouts};
use std::{
    fmt::Write,
    sync::{Arc, Mutex, PoisonError},
};

/// One pass: a file of `shaders/`, joined with the snippets it needs.
#[derive(Clone, Copy, Debug)]
pub struct Shader {
    /// The pass, as its file is called.
    pub name: &'static str,
    /// File names and texts: snippets first, the pass last.
    pub parts: &'static [(&'static str, &'static str)],
}

impl Shader {
    /// The WGSL module.
    #[must_use]
    pub fn source(&self) -> String {
        self.parts.iter().map(|(_, text)| *text).collect::<Vec<_>>().join("\n")
    }
}

macro_rules! parts {
    ($($file:literal),*) => {
        &[$(($file, include_str!(concat!("../../shaders/", $file)))),*]
    };
}

macro_rules! forward {
    ($name:literal, $($file:literal),*) => {
        Shader { name: $name, parts: parts!["frame.wgsl", "surface.wgsl", "forward.wgsl", $($file),*] }
    };
}

/// The model without shadows, or in the ambient light alone.
pub const CONSTANT_VISIBILITY: Shader = forward!("constant_visibility", "constant_visibility.wgsl");
/// The model with shadow planes.
pub const OCCLUDER_PLANES: Shader = forward!("occluder_planes", "planes.wgsl", "occluder_planes.wgsl");
/// The same with coordinates interpolated from the vertices.
pub const VERTEX_COORDINATES: Shader = Shader {
    name: "vertex_coordinates",
    parts: parts!["frame.wgsl", "surface.wgsl", "planes.wgsl", "vertex_coordinates.wgsl"],
};
/// The model with shadow planes, with lines where the planes cut it.
pub const PLANE_CUTS: Shader =
    forward!("plane_cuts", "planes.wgsl", "occluder_planes.wgsl", "rectangles.wgsl", "plane_cuts.wgsl");
/// The planes drawn through the model.
pub const PLANE_RECTANGLES: Shader = Shader {
    name: "plane_rectangles",
    parts: parts!["frame.wgsl", "planes.wgsl", "rectangles.wgsl", "plane_rectangles.wgsl"],
};
/// The casters' depth from a light.
pub const DEPTH: Shader = Shader { name: "depth", parts: parts!["frame.wgsl", "surface.wgsl", "depth.wgsl"] };
/// The model with a shadow map.
pub const SHADOW_MAP: Shader = forward!("shadow_map", "light_views.wgsl", "shadow_map.wgsl");
/// Shadow volumes into the stencil.
pub const STENCIL_VOLUMES: Shader =
    Shader { name: "stencil_volumes", parts: parts!["frame.wgsl", "volumes.wgsl", "stencil_volumes.wgsl"] };
/// Where the silhouette, as a light sees it, passes through the texels of a map.
pub const SILHOUETTE_POINTS: Shader = Shader { name: "silhouette_points", parts: parts!["silhouette_points.wgsl"] };
/// The model with a shadow silhouette map.
pub const SILHOUETTE_MAP: Shader = forward!("silhouette_map", "light_views.wgsl", "silhouette_map.wgsl");
/// The casters flattened onto a plane.
pub const PLANAR: Shader = Shader { name: "planar", parts: parts!["frame.wgsl", "surface.wgsl", "planar.wgsl"] };
/// Where the casters are, as a light sees them.
pub const SILHOUETTE: Shader =
    Shader { name: "silhouette", parts: parts!["frame.wgsl", "surface.wgsl", "depth.wgsl", "silhouette.wgsl"] };
/// The ground with that silhouette projected onto it.
pub const PROJECTIVE_TEXTURE: Shader = forward!("projective_texture", "light_views.wgsl", "projective_texture.wgsl");
/// The ground with a soft shadow.
pub const SOFT_PLANAR: Shader = forward!("soft_planar", "soft_planar.wgsl");
/// Shadow volumes into a float target.
pub const TRANSPARENT_VOLUMES: Shader =
    Shader { name: "transparent_volumes", parts: parts!["frame.wgsl", "volumes.wgsl", "transparent_volumes.wgsl"] };
/// The model in the light that these leave.
pub const TRANSPARENT: Shader = forward!("transparent", "transparent.wgsl");
/// The model with visibility precomputed at its vertices.
pub const VERTEX_VISIBILITY: Shader = forward!("vertex_visibility", "vertex_visibility.wgsl");
/// All passes.
pub const SHADERS: &[Shader] = &[
    CONSTANT_VISIBILITY,
    OCCLUDER_PLANES,
    VERTEX_COORDINATES,
    PLANE_CUTS,
    PLANE_RECTANGLES,
    DEPTH,
    SHADOW_MAP,
    PLANAR,
    SILHOUETTE,
    PROJECTIVE_TEXTURE,
    SOFT_PLANAR,
    STENCIL_VOLUMES,
    SILHOUETTE_POINTS,
    SILHOUETTE_MAP,
    TRANSPARENT_VOLUMES,
    TRANSPARENT,
    VERTEX_VISIBILITY,
];

/// Features that some technique uses, asked for where the adapter has them.
const WANTED: wgpu::Features = wgpu::Features::DEPTH_CLIP_CONTROL
    .union(wgpu::Features::DEPTH32FLOAT_STENCIL8)
    .union(wgpu::Features::FLOAT32_BLENDABLE)
    .union(wgpu::Features::FLOAT32_FILTERABLE)
    .union(wgpu::Features::TIMESTAMP_QUERY)
    .union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS);

/// A graphics device. Cheap to clone; all clones are the same device.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    adapter_name: String,
    is_software: bool,
    failure: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the best adapter that gives a device.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`] where there is none, [`RenderError::Device`] where none is usable. In both cases
    /// [`super::cpu`] draws the same frames.
    pub fn new() -> Result<Self, RenderError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        if adapters.is_empty() {
            return Err(RenderError::NoAdapter);
        }
        adapters.sort_by_key(rank);
        let mut reason = String::new();
        for adapter in &adapters {
            match Self::open(adapter) {
                Ok(gpu) => return Ok(gpu),
                // Writing to a string cannot fail.
                Err(error) => _ = write!(reason, "{}: {error}; ", adapter.get_info().name),
            }
        }
        Err(RenderError::Device { reason })
    }

    fn open(adapter: &wgpu::Adapter) -> Result<Self, wgpu::RequestDeviceError> {
        let available = adapter.limits();
        // Modest needs, but models and atlases as large as the adapter can take.
        let required_limits = wgpu::Limits {
            max_buffer_size: available.max_buffer_size,
            max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
            max_texture_array_layers: available.max_texture_array_layers,
            max_storage_buffers_per_shader_stage: available.max_storage_buffers_per_shader_stage,
            ..wgpu::Limits::downlevel_defaults().using_resolution(available)
        };
        let required_features = adapter.features() & WANTED;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("shadowfit"),
            required_features,
            required_limits,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))?;
        // wgpu's default handler panics; keep the first error for the caller instead.
        let failure = Arc::new(Mutex::new(None));
        let first = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        let info = adapter.get_info();
        let is_software = info.device_type == wgpu::DeviceType::Cpu;
        let adapter_name = format!("{} ({})", info.name, info.backend);
        Ok(Self { device, queue, adapter_name, is_software, failure })
    }

    /// Name of the adapter and its interface, for reports: `llvmpipe (LLVM 15.0.6, 256 bits) (vulkan)`.
    #[must_use]
    pub fn adapter_name(&self) -> &str {
        &self.adapter_name
    }

    /// Are shaders run by the CPU?
    pub(crate) fn is_software(&self) -> bool {
        self.is_software
    }

    pub(crate) fn limits(&self) -> wgpu::Limits {
        self.device.limits()
    }

    /// Has the device these features?
    pub(crate) fn has(&self, features: wgpu::Features) -> bool {
        self.device.features().contains(features)
    }

    /// Compiles a pass.
    pub(crate) fn module(&self, shader: &Shader) -> wgpu::ShaderModule {
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(shader.name),
            source: wgpu::ShaderSource::Wgsl(shader.source().into()),
        })
    }

    /// The first error that the driver reported since the last call.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        match self.failure.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(reason) => Err(RenderError::Driver { reason }),
            None => Ok(()),
        }
    }

    /// Waits for the device to end its work.
    pub(crate) fn wait(&self) -> Result<(), RenderError> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        waited.map_err(|error| RenderError::Driver { reason: error.to_string() })?;
        self.check()
    }

    /// Submits `commands` and waits until `readback` holds the picture that they copy there.
    pub(crate) fn submit_and_read(
        &self,
        commands: wgpu::CommandBuffer,
        readback: &Readback,
    ) -> Result<image::RgbaImage, RenderError> {
        self.queue.submit([commands]);
        self.check()?;
        let driver = |reason: String| RenderError::Driver { reason };
        readback.buffer.map_async(wgpu::MapMode::Read, .., |_| ());
        self.wait()?;
        let picture = {
            let bytes = readback.buffer.get_mapped_range(..).map_err(|error| driver(error.to_string()))?;
            readback.picture(&bytes)
        };
        readback.buffer.unmap();
        self.check()?;
        picture.ok_or_else(|| driver("the picture read back is too short".into()))
    }
}

fn rank(adapter: &wgpu::Adapter) -> (u8, bool) {
    let info = adapter.get_info();
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    (kind, info.backend == wgpu::Backend::Gl)
}

/// A buffer that a picture is copied into, row by row.
#[derive(Clone, Debug)]
pub(crate) struct Readback {
    size_px: [u32; 2],
    buffer: wgpu::Buffer,
}

impl Readback {
    pub(crate) fn new(gpu: &Gpu, size_px: [u32; 2]) -> Self {
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: u64::from(row_bytes(size_px[0])) * u64::from(size_px[1]),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Self { size_px, buffer }
    }

    /// Records the copy of an RGBA8 texture.
    pub(crate) fn copy_from(&self, texture: &wgpu::Texture, encoder: &mut wgpu::CommandEncoder) {
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(row_bytes(self.size_px[0])),
            rows_per_image: None,
        };
        let destination = wgpu::TexelCopyBufferInfo { buffer: &self.buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), destination, texture.size());
    }

    fn picture(&self, bytes: &[u8]) -> Option<image::RgbaImage> {
        let [width, height] = self.size_px;
        let mut pixels = Vec::with_capacity(4 * width as usize * height as usize);
        for row in bytes.chunks_exact(row_bytes(width) as usize) {
            pixels.extend_from_slice(&row[..4 * width as usize]);
        }
        image::RgbaImage::from_raw(width, height, pixels)
    }
}

/// Bytes of a row of RGBA8 pixels in a buffer.
fn row_bytes(width_px: u32) -> u32 {
    (4 * width_px).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}
