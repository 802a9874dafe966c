//! Perspective shadow maps on the field of 200 instances: what the warp gains, and that nothing is left of it under a
//! light that faces the viewer.

use crate::{
    golden,
    stages::{Case, WORLD, box_on_ground, directional, golden as compare, gpu, keep, mask},
};
use glam::Vec3;
use shadowfit::{
    masks::{MaskErrors, difference, side_by_side},
    render::{
        Antialias, Camera, FrameOptions, FrameRequest, Light, Mode,
        field::field,
        perspective_shadow_map::PerspectiveShadowMap,
        ray_traced::RayTraced,
        shadow_map::{ShadowMap, ShadowMapOptions},
        stage::Stage,
        technique::Technique,
    },
    scene::load,
};
use shadowfit_solver::mesh::Mesh;
use std::path::Path;

const OPTIONS: ShadowMapOptions = ShadowMapOptions { size_texels: 1024, kernel_texels: 1 };

struct Field {
    stage: Stage,
    traced: RayTraced,
    camera: Camera,
}

/// 200 instances of a body with one concave corner.
fn field_of_200() -> Field {
    let scene = load(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/models/t_shape.glb"))).expect("a model");
    let frame = Mesh::new(&scene.soup).expect("a model").frame;
    let (placements, camera) = field(200, 1);
    let stage = Stage::new(gpu(), &scene, &frame, &placements).expect("it fits");
    let matrices: Vec<_> = placements.iter().map(|placement| placement.world_from_unit()).collect();
    let traced = RayTraced::new(scene.instanced(&matrices, &frame), &WORLD).expect("a model");
    Field { stage, traced, camera }
}

/// Wrong shares of the covered pixels of a plain map and a warped one of equal size, over some lights.
fn errors(name: &str, field: &mut Field, lights: &[Vec3]) -> [f64; 2] {
    let mut plain = ShadowMap::new(&field.stage, OPTIONS).expect("it fits");
    let mut warped = PerspectiveShadowMap::new(&field.stage, OPTIONS).expect("it fits");
    let mut sums = [MaskErrors::default(); 2];
    for (number, to_light) in lights.iter().enumerate() {
        let light = Light::Directional { to_light: to_light.normalize() };
        let options = FrameOptions { size_px: [448, 448], mode: Mode::Mask, antialias: Antialias::Off };
        let request = FrameRequest { camera: field.camera, light, options };
        let view = field.traced.look(&request).expect("traced");
        let traced = field.traced.picture(&view).expect("traced");
        let techniques: [&mut dyn Technique; 2] = [&mut plain, &mut warped];
        let drawn = techniques.map(|technique| field.stage.render(technique, &request).expect("drawn"));
        let differences = drawn.each_ref().map(|drawn| difference(&traced, drawn));
        keep(&side_by_side(&differences.each_ref()), &format!("perspective shadow map, {name} {number}.png"));
        for (sum, drawn) in sums.iter_mut().zip(&drawn) {
            *sum = sum.plus(MaskErrors::between(&traced, drawn));
        }
    }
    let shares = sums.map(|sum| sum.share(sum.wrong()));
    eprintln!("{name}: plain {:.5}, perspective {:.5}, ratio {:.2}", shares[0], shares[1], shares[1] / shares[0]);
    shares
}

#[test]
fn gains_under_light_across_the_view_and_nothing_under_light_along_it() {
    let mut field = field_of_200();
    // Towards a light that faces the viewer, give or take three degrees.
    let view = field.camera.forward();
    let around = [Vec3::ZERO, 0.05 * Vec3::X, -0.05 * Vec3::X, 0.05 * Vec3::Y, -0.05 * Vec3::Y];
    let above = errors("above", &mut field, &[Vec3::new(0.2, 1.0, 0.1), Vec3::new(-0.3, 1.0, 0.2)]);
    let beside = errors("beside", &mut field, &[Vec3::new(1.0, 0.6, 0.2), Vec3::new(-1.0, 0.4, -0.1)]);
    let facing = errors("facing", &mut field, &around.map(|offset| view + offset));
    assert!(above[1] < 0.8 * above[0], "{above:?}");
    assert!(beside[1] < 0.85 * beside[0], "{beside:?}");
    assert!(facing[1] > 0.9 * facing[0], "{facing:?}");
}

#[test]
fn a_ground_beyond_the_casters_receives() {
    let mut case = Case::new(box_on_ground());
    let mut technique = PerspectiveShadowMap::new(&case.stage, OPTIONS).expect("it fits");
    for light in [directional(0.3, 1.0, 0.2), directional(1.0, 0.25, 0.4), directional(-0.2, 0.3, -1.0)] {
        for eye in [Vec3::new(1.5, 2.0, 2.0), Vec3::new(0.3, 0.3, 1.4), Vec3::new(0.4, 0.1, 0.4)] {
            let errors = case.errors(&mut technique, &mask(eye, Vec3::new(0.0, 0.2, 0.0), light));
            assert!(errors.iter().sum::<f64>() < 0.005, "{light:?} {eye}: {errors:?}");
        }
    }
}

#[test]
fn a_point_light_has_the_faces_of_the_shadow_map() {
    let mut case = Case::new(box_on_ground());
    let request = mask(Vec3::new(1.5, 2.5, 2.0), Vec3::ZERO, Light::Point { position: Vec3::new(0.6, 0.9, 0.3) });
    let mut plain = ShadowMap::new(&case.stage, OPTIONS).expect("it fits");
    let mut warped = PerspectiveShadowMap::new(&case.stage, OPTIONS).expect("it fits");
    let [plain, warped] = [case.masks(&mut plain, &request), case.masks(&mut warped, &request)];
    assert!(plain == warped);
}

#[test]
fn golden_picture() {
    let mut case = Case::new(box_on_ground());
    let options = ShadowMapOptions { size_texels: 256, kernel_texels: 2 };
    let mut technique = PerspectiveShadowMap::new(&case.stage, options).expect("it fits");
    compare(&mut case, &mut technique, &golden::request());
}
