//! Shadow silhouette maps: straight edges and corners in texels that a shadow map draws as steps, no acne, and a teapot
//! whose silhouette is finer than the texels.

use crate::{
    golden,
    stages::{Case, WORLD, box_on_ground, directional, empty, golden as compare, gpu, keep, mask, quad},
};
use glam::{Quat, Vec3};
use shadowfit::{
    masks::{MaskErrors, difference},
    render::{
        FrameRequest, Light, RenderError,
        ray_traced::RayTraced,
        shadow_map::{ShadowMap, ShadowMapOptions},
        silhouette_map::SilhouetteMap,
        stage::{Placement, Stage},
        technique::Technique,
    },
    scene::Scene,
};

/// A shadow map and a silhouette map of equal size.
fn maps(case: &Case, size_texels: u32) -> [Box<dyn Technique>; 2] {
    let plain = ShadowMap::new(&case.stage, ShadowMapOptions { size_texels, kernel_texels: 1 }).expect("it fits");
    let silhouette = SilhouetteMap::new(&case.stage, case.traced.scene(), &case.world, size_texels).expect("it fits");
    [Box::new(plain), Box::new(silhouette)]
}

/// Corners of the plate of [`turned_plate`], in turn.
fn plate() -> [Vec3; 4] {
    let turn = Quat::from_rotation_y(0.41);
    [(-0.4, 0.4), (0.4, 0.4), (0.4, -0.4), (-0.4, -0.4)].map(|(x, z)| turn * Vec3::new(x, 0.5, z))
}

/// A plate over a ground of side 3, turned by an odd angle.
fn turned_plate() -> Scene {
    let [a, b, _, d] = plate();
    let mut scene = empty();
    quad(&mut scene, a, b - a, d - a);
    quad(&mut scene, Vec3::new(-1.5, 0.0, 1.5), Vec3::X * 3.0, Vec3::Z * -3.0);
    scene
}

/// Sizes of maps and lights.
fn frames() -> impl Iterator<Item = (u32, Light)> {
    let lights = [directional(0.3, 1.0, 0.2), directional(-0.5, 1.0, 0.6), directional(0.1, 1.0, -0.8)];
    [32, 64, 128].into_iter().flat_map(move |size| lights.map(|light| (size, light)))
}

/// A frame of the plate's shadow on the ground, about 200 pixels a unit.
fn shadow_request(light: Light) -> FrameRequest {
    let to_light = light.from_centre();
    let shadow = Vec3::Y * 0.5 - to_light * (0.5 / to_light.y);
    let mut request = mask(shadow + Vec3::new(0.2, 1.2, 1.6), shadow, light);
    request.options.size_px = [512, 512];
    request
}

/// Wrong pixels among those for which `counts` says so.
fn wrong(
    case: &mut Case,
    technique: &mut dyn Technique,
    request: &FrameRequest,
    counts: impl Fn(usize) -> bool + Sync,
) -> f64 {
    let [traced, drawn] = case.masks(technique, request);
    keep(&difference(&traced, &drawn), &format!("{}.difference.png", technique.name()));
    let errors = MaskErrors::where_seen(&traced, &drawn, counts);
    assert!(errors.covered > 100.0, "the camera sees next to nothing");
    errors.wrong()
}

#[test]
fn a_straight_slanted_edge_is_four_times_nearer_than_with_a_shadow_map() {
    let mut case = Case::new(turned_plate());
    for (size, light) in frames() {
        let request = shadow_request(light);
        let [plain, silhouette] =
            maps(&case, size).map(|mut technique| wrong(&mut case, &mut *technique, &request, |_| true));
        eprintln!("{size} {light:?}: shadow map {plain}, silhouette map {silhouette} pixels");
        assert!(silhouette < 0.25 * plain, "{size} {light:?}: {silhouette}, shadow map {plain}");
    }
}

#[test]
fn corners_are_points_of_the_silhouette() {
    let mut case = Case::new(turned_plate());
    for (size, light) in frames() {
        let request = shadow_request(light);
        let shadows = plate().map(|p| p - light.towards(p) * (p.y / light.towards(p).y));
        // Two texels around each corner's shadow; the light's view is some 3.3 wide.
        let reach = 2.0 * 3.3 / size as f32;
        let counts = |i: usize| {
            let width = request.options.size_px[0] as usize;
            let (px, py) = ((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
            let (origin, direction) = request.camera.ray(px, py, request.options.size_px);
            let p = origin - direction * (origin.y / direction.y);
            shadows.iter().any(|corner| corner.distance(p) < reach)
        };
        let [plain, silhouette] =
            maps(&case, size).map(|mut technique| wrong(&mut case, &mut *technique, &request, counts));
        eprintln!("corners, {size} {light:?}: shadow map {plain}, silhouette map {silhouette} pixels");
        // A corner that covers no centre of the depth map's texels is cut off: it was nowhere more than a fifth.
        assert!(silhouette < 0.25 * plain, "{size} {light:?}: {silhouette}, shadow map {plain}");
    }
}

#[test]
fn a_teapot_is_no_worse_than_with_a_shadow_map() {
    let mut case = Case::on_ground("teapot.glb");
    for size in [128, 256, 512] {
        let mut sums = [[0.0; 2]; 2];
        for light in [directional(0.3, 1.0, 0.2), directional(1.0, 0.5, 0.4), directional(-0.7, 0.6, 0.8)] {
            for eye in [Vec3::new(1.5, 1.4, 2.0), Vec3::new(-2.2, 0.9, 1.0)] {
                let request = mask(eye, Vec3::ZERO, light);
                let errors = maps(&case, size).map(|mut technique| case.errors(&mut *technique, &request));
                sums = std::array::from_fn(|i| std::array::from_fn(|j| sums[i][j] + errors[i][j] / 6.0));
            }
        }
        let [plain, silhouette] = sums;
        eprintln!("teapot {size}, missed and false: shadow map {plain:.6?}, silhouette map {silhouette:.6?}");
        assert!(silhouette.iter().sum::<f64>() < 0.5 * plain.iter().sum::<f64>(), "{size}: {silhouette:?} {plain:?}");
    }
}

#[test]
fn lit_surfaces_have_no_acne() {
    let mut case = Case::new(box_on_ground());
    for size in [128, 512] {
        for light in [directional(0.3, 1.0, 0.2), directional(1.0, 0.25, 0.4), directional(-0.2, 0.05, 1.0)] {
            let request = mask(Vec3::new(1.5, 2.0, 2.0), Vec3::ZERO, light);
            let [_, mut silhouette] = maps(&case, size);
            let errors = case.errors(&mut *silhouette, &request);
            assert!(errors[0] < 1e-3 && errors[1] < 1e-4, "{size} {light:?}: {errors:?}");
        }
    }
}

#[test]
fn a_point_light_has_six_faces() {
    let mut case = Case::new(box_on_ground());
    for position in [Vec3::new(0.6, 0.9, 0.3), Vec3::new(-0.9, 0.4, 0.1), Vec3::new(0.0, 0.8, -0.7)] {
        let request = mask(Vec3::new(1.5, 2.5, 2.0), Vec3::ZERO, Light::Point { position });
        let [plain, silhouette] = maps(&case, 128).map(|mut technique| {
            let errors = case.errors(&mut *technique, &request);
            errors.iter().sum::<f64>()
        });
        assert!(silhouette < 0.25 * plain, "{position}: {silhouette}, shadow map {plain}");
    }
}

#[test]
fn instances_have_a_silhouette_each() {
    // Two turned boxes on one ground: the second placement stands where the first one's ground ends.
    let scene = box_on_ground();
    let stand = |x: f32, turn: f32, scale: f32| Placement {
        rotation: Quat::from_rotation_y(turn),
        scale,
        translation: Vec3::new(x, 0.0, 0.0),
    };
    let placements = [stand(-1.1, 0.5, 0.5), stand(0.9, 1.2, 0.7)];
    let stage = Stage::new(gpu(), &scene, &WORLD, &placements).expect("it fits");
    let matrices = placements.map(|placement| placement.world_from_unit());
    let traced = RayTraced::new(scene.instanced(&matrices, &WORLD), &WORLD).expect("a model");
    let mut technique = SilhouetteMap::new(&stage, &scene, &WORLD, 256).expect("it fits");
    let mut case = Case { stage, traced, world: WORLD };
    let request = mask(Vec3::new(0.5, 2.5, 2.5), Vec3::ZERO, directional(-0.6, 0.7, 0.5));
    let errors = case.errors(&mut technique, &request);
    assert!(errors.iter().sum::<f64>() < 1e-3, "{errors:?}");
}

#[test]
fn a_map_beyond_the_adapter_is_an_error() {
    let case = Case::new(box_on_ground());
    let map = SilhouetteMap::new(&case.stage, case.traced.scene(), &WORLD, 1 << 20);
    assert!(matches!(map, Err(RenderError::TooLarge { .. })));
}

#[test]
fn golden_picture() {
    let mut case = Case::new(box_on_ground());
    let mut technique = SilhouetteMap::new(&case.stage, case.traced.scene(), &WORLD, 128).expect("it fits");
    compare(&mut case, &mut technique, &golden::request());
}
