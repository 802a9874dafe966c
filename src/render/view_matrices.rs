//! One matrix for each view and instance, for passes that draw the casters as a light sees them.

use super::{
    bindings::{STORAGE, buffer, group, layout},
    stage::Stage,
};
use glam::Mat4;

/// Matrices of the views of a frame; each view has its own bind group.
#[derive(Debug)]
pub(crate) struct ViewMatrices {
    pub layout: wgpu::BindGroupLayout,
    buffers: Vec<wgpu::Buffer>,
    groups: Vec<wgpu::BindGroup>,
}

impl ViewMatrices {
    /// For up to `views` views of a frame.
    pub fn new(stage: &Stage, views: usize) -> Self {
        let gpu = &stage.gpu;
        let layout = layout(gpu, "light matrices", &[(wgpu::ShaderStages::VERTEX, STORAGE)]);
        let count = stage.placements().len();
        let buffers: Vec<_> =
            (0..views).map(|_| buffer::<Mat4>(gpu, "light matrices", count, wgpu::BufferUsages::STORAGE)).collect();
        let groups = buffers.iter().map(|buffer| group(gpu, &layout, &[buffer.as_entire_binding()])).collect();
        Self { layout, buffers, groups }
    }

    /// Sends what `view` sees from world space; the bind group of it.
    pub fn send(&self, stage: &Stage, (view, clip_from_world): (usize, Mat4)) -> &wgpu::BindGroup {
        let matrices = per_instance(stage, &[clip_from_world]);
        stage.gpu.queue.write_buffer(&self.buffers[view], 0, bytemuck::cast_slice(&matrices));
        &self.groups[view]
    }

    /// Bytes of its buffers.
    pub fn bytes(&self) -> usize {
        self.buffers.iter().map(|buffer| buffer.size() as usize).sum()
    }
}

/// What each view makes of each instance's unit space, `[instance][view]`.
pub(crate) fn per_instance(stage: &Stage, clip_from_world: &[Mat4]) -> Vec<Mat4> {
    let of_instance = |placement: &super::stage::Placement| {
        let world_from_unit = placement.world_from_unit();
        clip_from_world.iter().map(move |&view| view * world_from_unit)
    };
    stage.placements().iter().flat_map(of_instance).collect()
}
