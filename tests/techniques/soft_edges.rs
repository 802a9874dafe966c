//! Occluder planes with soft edges against the traced area light: better than hard edges wherever the light has a size.

use crate::{
    fits,
    stages::{SIZE_PX, gpu, keep},
};
use glam::Vec3;
use shadowfit::{
    asset,
    masks::MaskErrors,
    render::{
        Antialias, Camera, FrameOptions, FrameRequest, Light, Mode,
        occluder_planes::OccluderPlanes,
        ray_traced::{AreaLight, RayTraced},
        stage::{Placement, Stage},
        technique::Technique,
    },
    scene,
};
use shadowfit_solver::{lights::LightDomain, mesh::Mesh, plane::BakedSet};
use std::path::PathBuf;

/// Samples along a side of the area light: 36 steps of light.
const SAMPLES: usize = 6;

/// Half the side of a square is so much of the radius of a disc of equal area.
const HALF_SIDE_OF_DISC: f32 = 0.886_226_9;

/// A fitted model on the device and traced.
struct Fitted {
    set: BakedSet,
    stage: Stage,
    traced: RayTraced,
}

impl Fitted {
    fn new(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fits::fit(&fits::request(&fits::model(&format!("{name}.glb")), folder.path(), fits::least())).unwrap();
        let written: PathBuf = folder.path().join(format!("{name}.shadow.glb"));
        let scene = scene::load(&written).unwrap();
        let frame = Mesh::new(&scene.soup).unwrap().frame;
        let set = asset::read(&written).unwrap().in_unit_space(&frame);
        let stage = Stage::new(gpu(), &scene, &frame, &[Placement::IDENTITY]).unwrap();
        Self { set, stage, traced: RayTraced::new(scene, &frame).unwrap() }
    }

    /// Mask errors of hard and soft edges under lights of that radius.
    fn errors(&mut self, name: &str, lights: &[Vec3], radius_rad: f32) -> [f64; 2] {
        let mut techniques = [0.0, radius_rad].map(|r| OccluderPlanes::soft(&self.stage, &self.set, r).unwrap());
        let mut sums = [MaskErrors::default(); 2];
        for (view, &to_light) in lights.iter().enumerate() {
            let camera = Camera::turntable(1.1 * view as f32, [0.5, 0.2, 0.8][view % 3]);
            let request = FrameRequest {
                camera,
                light: Light::Directional { to_light },
                options: FrameOptions { size_px: SIZE_PX, mode: Mode::Mask, antialias: Antialias::Off },
            };
            let area = AreaLight::distant(to_light, (HALF_SIDE_OF_DISC * radius_rad.tan()).atan());
            let view = self.traced.look(&request).unwrap();
            let expected = self.traced.soft_picture(&view, &area, SAMPLES).unwrap();
            for (technique, sum) in techniques.iter_mut().zip(&mut sums) {
                let drawn = self.stage.render(technique, &request).unwrap();
                *sum = sum.plus(MaskErrors::between(&expected, &drawn));
                keep(&drawn, &format!("{name}, {}.png", technique.name()));
                keep(&expected, &format!("{name}, area light.png"));
            }
        }
        sums.map(|sum| sum.share(sum.missed + sum.false_))
    }
}

/// The plate's penumbra is `s tan r` to each side; its field reaches 2 texels, which a light of 6 degrees exceeds.
#[test]
fn a_plate_has_the_penumbra_of_the_area_light() {
    let mut plate = Fitted::new("plate_over_ground");
    let lights = [Vec3::new(0.3, 0.8, 0.4), Vec3::new(-0.6, 0.5, 0.1), Vec3::new(0.1, 0.9, -0.7)].map(Vec3::normalize);
    for (radius_deg, gain) in [(1.0f32, 1.4), (3.0, 1.4), (6.0, 1.4)] {
        let [hard, soft] = plate.errors("plate", &lights, radius_deg.to_radians());
        println!("plate, {radius_deg} degrees: hard {hard:.5}, soft {soft:.5}");
        assert!(soft * gain < hard, "{radius_deg}: hard {hard}, soft {soft}");
    }
}

/// What is left is the fit's own error, that of hard shadow.
#[test]
fn a_round_body_is_closer_to_the_area_light() {
    let mut teapot = Fitted::new("teapot");
    let lights = LightDomain::Sphere.directions(6, 77);
    for (radius_deg, gain) in [(0.27f32, 1.0), (1.0, 1.15), (3.0, 1.5), (6.0, 2.0)] {
        let [hard, soft] = teapot.errors("teapot", &lights, radius_deg.to_radians());
        println!("teapot, {radius_deg} degrees: hard {hard:.5}, soft {soft:.5}");
        assert!(soft * gain < hard, "{radius_deg}: hard {hard}, soft {soft}");
    }
}
