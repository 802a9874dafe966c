//! Stencil shadow volumes: wrong at most in pixels on borders, wherever eye, light and planes of the camera are; and wrong
//! where theory says so once a step is left out.

use crate::stages::{
    Case, SIZE_PX, WORLD, box_on_ground, cuboid, directional, empty, gpu, keep, mask, plate_over_ground, quad,
};
use glam::{Quat, Vec3};
use shadowfit::{
    masks::MaskErrors,
    render::{
        Antialias, Camera, FrameOptions, FrameRequest, Light, Mode,
        ray_traced::RayTraced,
        stage::{Placement, Stage},
        stencil_volumes::{Counting, StencilVolumes},
        volume::Casters,
    },
    scene::Scene,
};

/// Share of pixels that may be wrong: borders are drawn and traced by other arithmetic, and a pixel's centre may lie within
/// rounding of one. The scenes have borders some 1000 pixels long among 40,000 that are covered.
const AT_BORDERS: f64 = 0.0005;
/// A share of pixels that no border has.
const AREA: f64 = 0.02;

const RIGHT: [Counting; 2] = [Counting::ZPass, Counting::ZFail];

/// Wrong pixels, share of the covered ones.
fn error(scene: &Scene, counting: Counting, request: &FrameRequest) -> f64 {
    let mut case = Case::new(scene.clone());
    let mut technique = StencilVolumes::new(&case.stage, scene, &WORLD, counting).expect("it fits");
    case.errors(&mut technique, request).iter().sum()
}

fn assert_right(name: &str, scene: &Scene, countings: &[Counting], request: &FrameRequest) {
    for &counting in countings {
        let error = error(scene, counting, request);
        assert!(error < AT_BORDERS, "{name}, {counting:?}, {:?}: {error}", request.light);
    }
}

/// Plates that share edges in threes, cross each other, hang in the air, wound either way.
fn soup() -> Scene {
    let mut scene = empty();
    quad(&mut scene, Vec3::new(-1.5, 0.0, 1.5), Vec3::X * 3.0, Vec3::Z * -3.0);
    quad(&mut scene, Vec3::new(-0.4, 0.0, 0.1), Vec3::X * 0.8, Vec3::Y * 0.6);
    quad(&mut scene, Vec3::new(-0.4, 0.6, 0.1), Vec3::X * 0.8, Vec3::new(0.0, 0.2, 0.5));
    quad(&mut scene, Vec3::new(-0.4, 0.6, 0.1), Vec3::new(0.0, 0.2, -0.5), Vec3::X * 0.8);
    quad(&mut scene, Vec3::new(0.1, 0.2, -0.4), Vec3::new(0.1, 0.5, 0.0), Vec3::new(0.0, 0.3, 0.9));
    cuboid(&mut scene, Vec3::new(-0.7, 0.35, 0.4), Vec3::new(0.15, 0.1, 0.2));
    scene
}

fn lights() -> [Light; 5] {
    let point = |x, y, z| Light::Point { position: Vec3::new(x, y, z) };
    [
        directional(0.3, 1.0, 0.2),
        directional(-0.8, 0.3, 0.5),
        directional(0.2, 0.15, -1.0),
        point(0.5, 1.2, 0.4),
        // Low, in the midst of the casters: nearer than some of them.
        point(-0.3, 0.45, -0.3),
    ]
}

#[test]
fn both_counts_are_right_on_solids_and_soups() {
    for (name, scene) in [("plate", plate_over_ground()), ("box", box_on_ground()), ("soup", soup())] {
        for light in lights() {
            let request = mask(Vec3::new(1.3, 2.0, 1.9), Vec3::new(0.0, 0.2, 0.0), light);
            assert_right(name, &scene, &RIGHT, &request);
        }
    }
}

#[test]
fn z_pass_fails_with_the_eye_in_the_shadow_unless_it_is_counted() {
    let scene = plate_over_ground();
    for light in [directional(0.1, 1.0, 0.05), Light::Point { position: Vec3::new(0.05, 1.5, 0.0) }] {
        // Below the plate, looking out of its shadow.
        let request = mask(Vec3::new(0.15, 0.4, 0.2), Vec3::new(-0.8, 0.0, -0.7), light);
        assert_right("below", &scene, &RIGHT, &request);
        let wrong = error(&scene, Counting::ZPassOutside, &request);
        assert!(wrong > 0.5, "{light:?}: {wrong}");
    }
}

#[test]
fn parallel_rays_start_far_behind_the_eye() {
    let scene = plate_over_ground();
    // Nearly level, so that the light can stand behind the plate as seen from the eye, and above the ground.
    let camera = Camera::orthographic(0.2, 0.1);
    let plate = Vec3::new(0.0, 0.5, 0.0);
    let to_light = (plate - camera.eye()).normalize();
    for light in [Light::Directional { to_light }, Light::Point { position: plate + 0.6 * to_light }] {
        let request = FrameRequest { camera, ..mask(Vec3::ONE, Vec3::ZERO, light) };
        assert_right("orthographic", &scene, &RIGHT, &request);
    }
}

#[test]
fn z_pass_fails_where_the_near_plane_cuts_a_volume_unless_depth_is_clamped() {
    let scene = plate_over_ground();
    let light = directional(0.0, 1.0, 0.0);
    // The eye is beside the shadow, the border of the shadow between it and the near plane.
    let eye = Vec3::new(0.5, 0.25, 0.0);
    let camera = Camera::looking(eye, Vec3::new(-0.2, 0.0, 0.0), 0.9, [0.3, 4.0]);
    let request = FrameRequest { camera, ..mask(eye, Vec3::ZERO, light) };
    assert_right("near plane", &scene, &RIGHT, &request);
    let wrong = error(&scene, Counting::ZPassOutside, &request);
    assert!(wrong > AREA, "{wrong}");
}

#[test]
fn z_fail_needs_depth_clamping_where_a_caster_crosses_the_far_plane() {
    // A wall that begins before the far plane and ends behind it, lit from behind: its shadow comes forward.
    let mut scene = empty();
    quad(&mut scene, Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::Z * -4.0);
    quad(&mut scene, Vec3::new(-0.9, 0.0, 0.4), Vec3::new(1.4, 0.0, -2.4), Vec3::Y * 0.7);
    for light in [directional(-0.5, 0.6, -0.6), Light::Point { position: Vec3::new(-1.0, 1.5, -1.5) }] {
        let eye = Vec3::new(0.6, 1.2, 2.2);
        let camera = Camera::looking(eye, Vec3::new(0.0, 0.0, 0.5), 0.9, [0.1, 2.6]);
        let request = FrameRequest { camera, ..mask(eye, Vec3::ZERO, light) };
        // The tracer has no far plane: it may see more, which does not count.
        assert_right("far plane", &scene, &RIGHT, &request);
        let wrong = error(&scene, Counting::ZFailClipped, &request);
        assert!(wrong > AREA, "{light:?}: {wrong}");
    }
}

#[test]
fn a_ground_receives_and_does_not_cast() {
    let mut scene = empty();
    cuboid(&mut scene, Vec3::new(0.1, 0.3, 0.0), Vec3::new(0.3, 0.1, 0.2));
    quad(&mut scene, Vec3::new(-0.5, 0.0, 0.2), Vec3::X * 0.2, Vec3::Y * 0.7);
    scene.stand_on_ground(&WORLD, 1.5);
    for light in lights() {
        let request = mask(Vec3::new(1.3, 2.0, 1.9), Vec3::new(0.0, 0.2, 0.0), light);
        assert_right("ground", &scene, &RIGHT, &request);
    }
    let casters = Casters::of_scene(&scene, &WORLD, |_| 0).0;
    assert_eq!(casters.len(), scene.soup.corners_model.len() - 2);
}

#[test]
fn a_caster_behind_the_light_casts_nothing() {
    let mut scene = plate_over_ground();
    quad(&mut scene, Vec3::new(-0.2, 0.9, 0.2), Vec3::X * 0.4, Vec3::Z * -0.4);
    // Between the plates: the lower one alone shadows the ground, the upper one nothing.
    let light = Light::Point { position: Vec3::new(0.3, 0.7, 0.1) };
    let request = mask(Vec3::new(1.3, 2.5, 1.9), Vec3::ZERO, light);
    assert_right("behind", &scene, &RIGHT, &request);
}

#[test]
fn instances_shadow_each_other() {
    let mut model = empty();
    cuboid(&mut model, Vec3::new(0.1, 0.0, 0.0), Vec3::new(0.6, 0.2, 0.3));
    quad(&mut model, Vec3::new(-0.5, 0.2, 0.2), Vec3::new(0.1, 0.4, 0.0), Vec3::new(0.0, 0.1, -0.5));
    let place = |angle, scale, x, y, z| Placement {
        rotation: Quat::from_axis_angle(Vec3::new(0.3, 0.9, 0.2).normalize(), angle),
        scale,
        translation: Vec3::new(x, y, z),
    };
    let placements =
        [place(0.4, 0.5, -0.5, 0.5, 0.2), place(2.0, 0.7, 0.4, -0.1, 0.1), place(-1.1, 0.4, 0.3, 0.6, -0.3)];
    // The same triangles in one traced scene.
    let mut together = empty();
    for placement in placements {
        let world_from_unit = placement.world_from_unit();
        for corners in &model.soup.corners_model {
            crate::stages::push(&mut together, corners.map(|p| world_from_unit.transform_point3(p.as_vec3())));
        }
    }
    let mut stage = Stage::new(gpu(), &model, &WORLD, &placements).expect("it fits");
    let traced = RayTraced::new(together, &WORLD).expect("a model");
    for light in lights() {
        for counting in RIGHT {
            let mut technique = StencilVolumes::new(&stage, &model, &WORLD, counting).expect("it fits");
            let request = mask(Vec3::new(1.3, 2.0, 1.9), Vec3::ZERO, light);
            let view = traced.look(&request).expect("traced");
            let expected = traced.picture(&view).expect("traced");
            let drawn = stage.render(&mut technique, &request).expect("drawn");
            keep(&drawn, "instances of volumes.png");
            keep(&shadowfit::masks::difference(&expected, &drawn), "instances of volumes.difference.png");
            let errors = MaskErrors::between(&expected, &drawn);
            assert!(errors.covered > 0.1 * f64::from(SIZE_PX[0] * SIZE_PX[1]), "{}", errors.covered);
            // Every border of three small bodies is nearer to the others than in a scene of one.
            let wrong = errors.share(errors.wrong());
            assert!(wrong < 2.0 * AT_BORDERS, "{counting:?} {light:?}: {wrong}");
        }
    }
}

#[test]
fn models_are_wrong_in_single_pixels_only() {
    for name in ["teapot", "aircraft"] {
        let path = format!("{}/models/{name}.glb", env!("CARGO_MANIFEST_DIR"));
        let scene = shadowfit::scene::load(std::path::Path::new(&path)).expect("our own model");
        let frame = shadowfit_solver::mesh::Mesh::new(&scene.soup).expect("a model").frame;
        let mut stage = Stage::new(gpu(), &scene, &frame, &[Placement::IDENTITY]).expect("it fits");
        let traced = RayTraced::new(scene.clone(), &frame).expect("a model");
        let mut blocked = 0;
        for (i, light) in lights().into_iter().enumerate() {
            let options = FrameOptions { size_px: [512, 512], mode: Mode::Mask, antialias: Antialias::Off };
            let camera = Camera::turntable(1.3 * i as f32, 0.9 - 0.4 * i as f32);
            let request = FrameRequest { camera, light, options };
            let expected = traced.picture(&traced.look(&request).expect("traced")).expect("traced");
            blocked += expected.pixels().filter(|pixel| pixel.0[1] == 255 && pixel.0[0] == 0).count();
            for counting in RIGHT {
                let mut technique = StencilVolumes::new(&stage, &scene, &frame, counting).expect("it fits");
                let drawn = stage.render(&mut technique, &request).expect("drawn");
                keep(&shadowfit::masks::difference(&expected, &drawn), &format!("volumes of {name} {i}.png"));
                let errors = MaskErrors::between(&expected, &drawn);
                let [missed, falsely] = [errors.missed, errors.false_].map(|pixels| errors.share(pixels));
                assert!(missed + falsely < AT_BORDERS, "{name}, {counting:?}, {light:?}: {missed} + {falsely}");
            }
        }
        assert!(blocked > 3_000, "{name}: {blocked} pixels in shadow");
    }
}
