//! The picture of each technique on one scene: a box on a ground, under a light from the side.

use crate::{
    stages::{Case, WORLD, box_on_ground, directional, golden, mask},
    vertex_visibility::plate_over_tiles,
};
use glam::Vec3;
use shadowfit::render::{
    FrameRequest,
    shadow_map::{ShadowMap, ShadowMapOptions},
    stencil_volumes::{Counting, StencilVolumes},
    transparent::{Accumulation, TransparentVolumes},
    unshadowed::Unshadowed,
    vertex_visibility::{VertexVisibility, VertexVisibilityOptions},
};

/// The frame of all pictures.
pub fn request() -> FrameRequest {
    mask(Vec3::new(0.9, 1.5, 1.2), Vec3::ZERO, directional(-0.8, 0.6, 0.5))
}

#[test]
fn unshadowed() {
    let mut case = Case::new(box_on_ground());
    let mut technique = Unshadowed::new(&case.stage);
    golden(&mut case, &mut technique, &request());
}

#[test]
fn shadow_map() {
    let mut case = Case::new(box_on_ground());
    let options = ShadowMapOptions { size_texels: 256, kernel_texels: 2 };
    let mut technique = ShadowMap::new(&case.stage, options).expect("it fits");
    golden(&mut case, &mut technique, &request());
}

#[test]
fn stencil_volumes() {
    let mut case = Case::new(box_on_ground());
    for counting in [Counting::ZPass, Counting::ZFail] {
        let mut technique = StencilVolumes::new(&case.stage, case.traced.scene(), &WORLD, counting).expect("it fits");
        golden(&mut case, &mut technique, &request());
    }
}

/// The box lets half of the light in, and half of that out again.
#[test]
fn transparent_volumes() {
    let mut scene = box_on_ground();
    let mut glass = scene.materials[0].clone();
    glass.transmittance = Some([0.5; 3]);
    scene.materials.push(glass);
    scene.material_of[..12].fill(1);
    let mut case = Case::new(scene);
    let added = Accumulation::Logarithms;
    let mut technique = TransparentVolumes::new(&case.stage, case.traced.scene(), &WORLD, added).expect("it fits");
    golden(&mut case, &mut technique, &request());
}

/// On a ground that has vertices.
#[test]
fn vertex_visibility() {
    let mut case = Case::new(plate_over_tiles(24));
    let models = (case.traced.scene(), case.traced.mesh());
    let mut technique =
        VertexVisibility::new(&case.stage, models, VertexVisibilityOptions::default()).expect("it fits");
    golden(&mut case, &mut technique, &request());
}
