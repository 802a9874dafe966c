//! Perspective shadow maps on the field of 200 instances.

use crate::stages::{Case, directional, gpu};
use glam::{DVec3, Vec3};
use shadowfit::{
    render::{
        Antialias, FrameOptions, FrameRequest, Light, Mode,
        field::field,
        perspective_shadow_map::PerspectiveShadowMap,
        ray_traced::RayTraced,
        shadow_map::{ShadowMap, ShadowMapOptions},
        stage::Stage,
    },
    scene::load,
};
use shadowfit_solver::mesh::{Frame, Mesh};

#[test]
fn gain() {
    let scene = load(std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/models/t_shape.glb"))).expect("a model");
    let frame = Mesh::new(&scene.soup).expect("a model").frame;
    let (placements, camera) = field(200, 1);
    let stage = Stage::new(gpu(), &scene, &frame, &placements).expect("it fits");
    let matrices: Vec<_> = placements.iter().map(|p| p.world_from_unit()).collect();
    let world = Frame { centre_model: DVec3::ZERO, radius: 1.0 };
    let traced = RayTraced::new(scene.instanced(&matrices, &frame), &world).expect("a model");
    let mut case = Case { stage, traced };
    let options = FrameOptions { size_px: [768, 768], mode: Mode::Mask, antialias: Antialias::Off };
    let facing = -camera.forward();
    let lights = [
        ("above", directional(0.2, 1.0, 0.1)),
        ("side", directional(1.0, 0.6, 0.2)),
        ("low side", directional(1.0, 0.2, -0.3)),
        ("facing 0", Light::Directional { to_light: facing }),
        ("facing 2", Light::Directional { to_light: (facing + 0.03 * Vec3::X).normalize() }),
        ("facing 6", Light::Directional { to_light: (facing + 0.1 * Vec3::X).normalize() }),
        ("behind 0", Light::Directional { to_light: -facing }),
        ("behind 6", Light::Directional { to_light: (-facing + 0.1 * Vec3::X).normalize() }),
    ];
    for size_texels in [512, 1024] {
        let options_map = ShadowMapOptions { size_texels, kernel_texels: 1 };
        let mut plain = ShadowMap::new(&case.stage, options_map).expect("it fits");
        let mut warped = PerspectiveShadowMap::new(&case.stage, options_map).expect("it fits");
        for (name, light) in lights {
            let request = FrameRequest { camera, light, options };
            let [a, b] = [case.errors(&mut plain, &request), case.errors(&mut warped, &request)];
            let [t, d] = case.masks(&mut warped, &request);
            let [_, e] = case.masks(&mut plain, &request);
            crate::stages::keep(&shadowfit::masks::side_by_side(&[&shadowfit::masks::difference(&t, &e), &shadowfit::masks::difference(&t, &d)]), &format!("psm {size_texels} {name}.png"));
            eprintln!("{size_texels} {name}: plain {a:.4?} warped {b:.4?}, ratio {:.2}", (a[0] + a[1]) / (b[0] + b[1]));
        }
    }
}
