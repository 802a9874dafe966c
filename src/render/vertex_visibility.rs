//! Technique: visibility precomputed at the vertices (P. Sloan, J. Kautz, J. Snyder, "Precomputed Radiance Transfer", 2002;
//! H. Landis, "Production-Ready Global Illumination", 2002), as `solver::vertex_visibility` traces and fits it.
//!
//! One forward pass. Each side of a vertex has 16 coefficients, or a bent normal with its cone; the vertex stage evaluates
//! them towards the light, the fragment stage puts the border where the interpolated value passes 1/2. A light may
//! move, turn or be a point: nothing is done again. The model may not be deformed.
//!
//! Not guaranteed: shadows finer than the triangles that they fall on, or than order 4 resolves.

use super::{
    FrameRequest, RenderError,
    bindings::{STORAGE, group, layout},
    forward::{Forward, ForwardOptions},
    gpu::VERTEX_VISIBILITY,
    layout::Vertex,
    stage::{Begin, Part, Stage, Targets},
    technique::{Cost, Technique},
    upload::vertices,
};
use crate::scene::Scene;
use shadowfit_solver::{
    mesh::Mesh,
    vertex_visibility::{self as traced, SideVisibility, VertexSide, VisibilityOptions},
};
use wgpu::util::DeviceExt;

/// What is kept of the sky that a vertex sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    /// Spherical harmonics of order 4: 64 bytes a side.
    Harmonics,
    /// A bent normal and its accessibility: 16 bytes a side.
    BentNormal,
}

/// How visibility is precomputed and read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexVisibilityOptions {
    /// What is kept.
    pub kept: Kept,
    /// Half the width of the border between light and shadow, in units of the prediction, above 0: from 0.5, clamped as
    /// published, soft, to 0.05, as hard as the vertices tell it.
    pub edge: f32,
    /// How it is traced.
    pub trace: VisibilityOptions,
}

impl Default for VertexVisibilityOptions {
    fn default() -> Self {
        Self { kept: Kept::Harmonics, edge: 0.05, trace: VisibilityOptions::default() }
    }
}

/// Draws the model with what its vertices see.
#[derive(Debug)]
pub struct VertexVisibility {
    options: VertexVisibilityOptions,
    buffer_bytes: usize,
    group: wgpu::BindGroup,
    forward: Forward,
}

impl VertexVisibility {
    /// Traces the vertices of `scene`, which the stage was made from; `mesh` is made from it too.
    ///
    /// # Errors
    /// The coefficients exceed the adapter's limits, or the driver reports an error.
    pub fn new(
        stage: &Stage,
        (scene, mesh): (&Scene, &Mesh),
        options: VertexVisibilityOptions,
    ) -> Result<Self, RenderError> {
        let (sides, numbers) = sides(scene, mesh);
        let found = traced::precompute(mesh, &sides, &options.trace);
        let rows: Vec<f32> = match options.kept {
            Kept::Harmonics => found.distinct.iter().flat_map(|side| side.coefficients).collect(),
            Kept::BentNormal => found.distinct.iter().flat_map(cone).collect(),
        };
        let numbers: Vec<[u32; 2]> =
            numbers.iter().map(|sides| sides.map(|side| found.index_of[side as usize])).collect();
        let gpu = &stage.gpu;
        let limit = gpu.limits().max_storage_buffer_binding_size;
        let needed = size_of_val(&*rows).max(size_of_val(&*numbers)) as u64;
        if needed > limit {
            return Err(RenderError::TooLarge { what: "the vertices' visibilities", needed, limit });
        }
        let buffer = |contents| {
            let usage = wgpu::BufferUsages::STORAGE;
            let descriptor = wgpu::util::BufferInitDescriptor { label: Some("visibility"), contents, usage };
            gpu.device.create_buffer_init(&descriptor)
        };
        let buffers = [buffer(bytemuck::cast_slice(&rows)), buffer(bytemuck::cast_slice(&numbers))];
        let layout = layout(gpu, "visibility", &[(wgpu::ShaderStages::VERTEX, STORAGE); 2]);
        let group = group(gpu, &layout, &buffers.each_ref().map(wgpu::Buffer::as_entire_binding));
        let is_bent = f64::from(u8::from(options.kept == Kept::BentNormal));
        let options_of_pass = ForwardOptions {
            entry_points: ["vs_vertex_visibility", "fs_shaded", "fs_mask"],
            constants: vec![("BENT_NORMAL", is_bent), ("EDGE", f64::from(options.edge))],
            ..Default::default()
        };
        let forward = Forward::new(stage, &VERTEX_VISIBILITY, Some(&layout), options_of_pass);
        gpu.check()?;
        let buffer_bytes = size_of_val(&*rows) + size_of_val(&*numbers);
        Ok(Self { options, buffer_bytes, group, forward })
    }
}

/// The sides to trace, in the mesh's space, and for each vertex of the stage the numbers of its front and back; a
/// single-sided triangle's back, which nobody sees, is its front.
fn sides(scene: &Scene, mesh: &Mesh) -> (Vec<VertexSide>, Vec<[u32; 2]>) {
    let (vertices, looks) = vertices(scene, &mesh.frame);
    let (mut sides, mut numbers) = (Vec::new(), Vec::with_capacity(vertices.len()));
    for (look, range) in looks.iter().flat_map(|(look, sections)| sections.iter().map(move |(_, range)| (look, range)))
    {
        for Vertex { p, shading_normal, .. } in &vertices[range.start as usize..range.end as usize] {
            let front = sides.len() as u32;
            sides.push(VertexSide { p: *p, normal: *shading_normal });
            if look.double_sided {
                sides.push(VertexSide { p: *p, normal: -*shading_normal });
            }
            numbers.push([front, sides.len() as u32 - 1]);
        }
    }
    (sides, numbers)
}

fn cone(side: &SideVisibility) -> [f32; 4] {
    side.bent_normal.extend(side.cone_cosine()).to_array()
}

impl Technique for VertexVisibility {
    fn name(&self) -> String {
        let kept = match self.options.kept {
            Kept::Harmonics => "harmonics",
            Kept::BentNormal => "bent normals",
        };
        format!("vertex {kept}, edge {}", self.options.edge)
    }

    fn update(&mut self, _: &Stage, _: &FrameRequest, _: &mut wgpu::CommandEncoder) -> Result<(), RenderError> {
        Ok(())
    }

    fn draw(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        targets: &Targets,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
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
            texture_bytes: 0,
            buffer_bytes: self.buffer_bytes,
            on_light_change: "nothing".to_string(),
        }
    }
}
