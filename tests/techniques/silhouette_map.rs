//! Shadow silhouette maps: straight edges and corners in texels that a shadow map draws as steps, no acne, and a teapot
//! whose silhouette is finer than the texels.

use crate::stages::{Case, WORLD, box_on_ground, directional, empty, keep, mask, quad};
use glam::{Quat, Vec3};
use shadowfit::{
    masks::{MaskErrors, difference},
    render::{
        FrameRequest, Light, RenderError,
        shadow_map::{ShadowMap, ShadowMapOptions},
        silhouette_map::SilhouetteMap,
        technique::Technique,
    },
    scene::Scene,
};
use shadowfit_solver::mesh::Frame;

/// A shadow map and a silhouette map of equal size.
fn maps(case: &Case, frame: &Frame, size_texels: u32) -> [Box<dyn Technique>; 2] {
    let plain = ShadowMap::new(&case.stage, ShadowMapOptions { size_texels, kernel_texels: 1 }).expect("it fits");
    let silhouette = SilhouetteMap::new(&case.stage, case.traced.scene(), frame, size_texels).expect("it fits");
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

const LIGHTS: [(f32, f32, f32); 3] = [(0.3, 1.0, 0.2), (-0.5, 1.0, 0.6), (0.1, 1.0, -0.8)];

/// A frame of the plate's shadow on the ground, about 200 pixels a unit.
fn shadow_request(light: Light) -> FrameRequest {
    let Light::Directional { to_light } = light else { unreachable!() };
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
    for size in [32, 64, 128] {
        for (x, y, z) in LIGHTS {
            let request = shadow_request(directional(x, y, z));
            let [plain, silhouette] =
                maps(&case, &WORLD, size).map(|mut technique| wrong(&mut case, &mut *technique, &request, |_| true));
            eprintln!("{size} {x} {y} {z}: shadow map {plain}, silhouette map {silhouette}");
        }
    }
}

#[test]
fn corners_are_points_of_the_silhouette() {
    let mut case = Case::new(turned_plate());
    for size in [32, 64, 128] {
        for (x, y, z) in LIGHTS {
            let light = directional(x, y, z);
            let request = shadow_request(light);
            let Light::Directional { to_light } = light else { unreachable!() };
            let [width, height] = request.options.size_px;
            let clip_from_world = request.camera.clip_from_world(request.options.size_px);
            // Two texels around each corner's shadow.
            let radius = 2.0 * 3.3 / size as f32;
            let near = plate().map(|p| p - to_light * (p.y / to_light.y));
            let counts = |i: usize| {
                let (px, py) = ((i as u32 % width) as f32 + 0.5, (i as u32 / width) as f32 + 0.5);
                let (origin, direction) = request.camera.ray(px, py, request.options.size_px);
                let p = origin - direction * (origin.y / direction.y);
                near.iter().any(|corner| corner.distance(p) < radius)
            };
            let _ = (clip_from_world, height);
            let [plain, silhouette] =
                maps(&case, &WORLD, size).map(|mut technique| wrong(&mut case, &mut *technique, &request, counts));
            eprintln!("corners {size} {x} {y} {z}: shadow map {plain}, silhouette map {silhouette}");
        }
    }
}

#[test]
fn a_teapot_is_no_worse_than_with_a_shadow_map() {
    let mut case = Case::of_model("teapot.glb");
    for size in [128, 256, 512] {
        let (mut plain, mut silhouette) = ([0.0; 2], [0.0; 2]);
        for light in [directional(0.3, 1.0, 0.2), directional(1.0, 0.5, 0.4), directional(-0.7, 0.6, 0.8)] {
            for eye in [Vec3::new(1.5, 1.4, 2.0), Vec3::new(-2.2, 0.9, 1.0)] {
                let mut request = mask(eye, Vec3::ZERO, light);
                request.options.size_px = [512, 512];
                let [a, b] = maps(&case, &case.world, size).map(|mut technique| case.errors(&mut *technique, &request));
                for i in 0..2 {
                    plain[i] += a[i] / 6.0;
                    silhouette[i] += b[i] / 6.0;
                }
            }
        }
        eprintln!("teapot {size}: shadow map {plain:?}, silhouette map {silhouette:?}");
    }
}

#[test]
fn lit_surfaces_have_no_acne() {
    let mut case = Case::new(box_on_ground());
    for size in [128, 512] {
        for light in [directional(0.3, 1.0, 0.2), directional(1.0, 0.25, 0.4), directional(-0.2, 0.05, 1.0)] {
            let request = mask(Vec3::new(1.5, 2.0, 2.0), Vec3::ZERO, light);
            let [plain, silhouette] =
                maps(&case, &WORLD, size).map(|mut technique| case.errors(&mut *technique, &request));
            eprintln!("box {size} {light:?}: shadow map {plain:?}, silhouette map {silhouette:?}");
        }
    }
}

#[test]
fn a_point_light_has_six_faces() {
    let mut case = Case::new(box_on_ground());
    for position in [Vec3::new(0.6, 0.9, 0.3), Vec3::new(-0.9, 0.4, 0.1), Vec3::new(0.0, 0.8, -0.7)] {
        let request = mask(Vec3::new(1.5, 2.5, 2.0), Vec3::ZERO, Light::Point { position });
        let [plain, silhouette] = maps(&case, &WORLD, 128).map(|mut technique| case.errors(&mut *technique, &request));
        eprintln!("point {position}: shadow map {plain:?}, silhouette map {silhouette:?}");
    }
}

#[test]
fn a_map_beyond_the_adapter_is_an_error() {
    let case = Case::new(box_on_ground());
    let map = SilhouetteMap::new(&case.stage, case.traced.scene(), &WORLD, 1 << 20);
    assert!(matches!(map, Err(RenderError::TooLarge { .. })));
}
