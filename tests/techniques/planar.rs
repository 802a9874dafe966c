//! Planar shadows: exact on the ground but for the pixels of borders, whatever the light and wherever casters lie; none on
//! the casters themselves.

use crate::{
    golden,
    stages::{
        Case, WORLD, directional, empty, golden as compare, gpu, ground, ground_errors, keep, mask, plates_over_ground,
        quad, wrong_off_borders,
    },
};
use glam::{Quat, Vec2, Vec3};
use shadowfit::{
    masks::MaskErrors,
    render::{
        Antialias, FrameRequest, Light, Mode,
        planar::{Planar, PlanarOptions},
        projective_texture::{ProjectiveTexture, ProjectiveTextureOptions},
        receiver::Receiver,
        soft_planar::{SoftPlanar, SoftPlanarOptions},
        stage::{DrawCalls, Placement, Stage},
        technique::Technique,
        unshadowed::Unshadowed,
    },
    scene::Scene,
};
use std::collections::BTreeSet;

const EYE: Vec3 = Vec3::new(1.0, 3.0, 2.0);

fn planar(case: &Case) -> Planar {
    Planar::new(&case.stage, PlanarOptions { receiver: case.receiver() })
}

fn point(x: f32, y: f32, z: f32) -> Light {
    Light::Point { position: Vec3::new(x, y, z) }
}

/// Pixels of the ground that are wrong off borders, and the share of it in (traced) shadow.
fn wrong_and_blocked(case: &mut Case, request: &FrameRequest, name: &str) -> (usize, f64) {
    let ground = case.ground_seen(request);
    let masks = case.masks(&mut planar(case), request);
    keep(&masks[1], &format!("planar {name}.png"));
    keep(&shadowfit::masks::difference(&masks[0], &masks[1]), &format!("planar {name}.difference.png"));
    // The borders' own errors: pixels whose centre lies within rounding of an edge.
    let errors = ground_errors(&masks, &ground);
    assert!(errors.iter().sum::<f64>() < 5e-4, "{name}: {errors:?}");
    let seen = ground.iter().filter(|g| **g).count() as f64;
    let blocked = masks[0].pixels().zip(&ground).filter(|(p, on)| **on && p.0[..2] == [0, 255]).count() as f64;
    (wrong_off_borders(&masks, &ground), blocked / seen)
}

#[test]
fn exact_on_the_ground_under_any_light() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 0.5, 0.4)]));
    for (name, light) in [
        ("high", directional(0.3, 1.0, 0.2)),
        ("low", directional(1.0, 0.4, -0.3)),
        ("near point", point(0.2, 0.9, 0.1)),
        ("far point", point(-2.0, 5.0, 1.0)),
    ] {
        let (wrong, blocked) = wrong_and_blocked(&mut case, &mask(EYE, Vec3::ZERO, light), name);
        assert!(wrong == 0 && blocked > 0.01, "{name}: {wrong} wrong, {blocked} in shadow");
    }
}

#[test]
fn casters_keep_their_light_where_they_shadow_each_other() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 0.8, 0.2), (Vec3::Y * 0.4, 0.4)]));
    let request = mask(EYE, Vec3::ZERO, directional(0.3, 1.0, 0.2));
    let ground = case.ground_seen(&request);
    let masks = case.masks(&mut planar(&case), &request);
    let pixels = masks[0].pixels().zip(masks[1].pixels()).zip(&ground).filter(|(_, on)| !**on);
    let missed = pixels.filter(|((t, d), _)| t.0[1] == 255 && t.0[0] == 0 && d.0[0] == 255).count();
    let blocked = masks[0].pixels().zip(&ground).filter(|(t, on)| !**on && t.0[..2] == [0, 255]).count();
    assert!(missed == blocked && blocked > 100, "{missed} of {blocked}");
}

#[test]
fn overlapping_shadows_are_no_darker() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::new(-0.1, 0.3, 0.0), 0.3), (Vec3::new(0.1, 0.6, 0.0), 0.3)]));
    let mut request = mask(EYE, Vec3::ZERO, directional(-0.7, 1.0, -0.6));
    let (wrong, blocked) = wrong_and_blocked(&mut case, &request, "overlap");
    assert!(wrong == 0 && blocked > 0.05, "{wrong} {blocked}");
    let ground = case.ground_seen(&request);
    request.options.mode = Mode::Shaded;
    let picture = case.stage.render(&mut planar(&case), &request).expect("drawn");
    keep(&picture, "planar overlap shaded.png");
    let colors: BTreeSet<[u8; 4]> = picture.pixels().zip(&ground).filter(|(_, on)| **on).map(|(p, _)| p.0).collect();
    // One material, one direction, one normal: lit and in shadow, but for silhouettes where the two renderers differ.
    assert_eq!(colors.len(), 2, "{colors:?}");
    let ambient = (shadowfit::render::AMBIENT.powf(1.0 / 2.4) * 1.055 - 0.055) * 255.0;
    let darkest = colors.first().expect("two").map(f32::from);
    assert!((darkest[0] - ambient).abs() < 1.5, "{darkest:?} is not the ambient light alone, {ambient}");
}

#[test]
fn shadow_does_not_fall_off_the_receiver() {
    let mut scene = empty();
    quad(&mut scene, Vec3::new(0.2, 0.4, 0.3), Vec3::X * 0.6, Vec3::Z * -0.6);
    ground(&mut scene, Vec2::splat(-0.5), Vec2::splat(0.5));
    let mut case = Case::new(scene);
    // The whole shadow spans 0.1 to 0.7 along x, the ground ends at 0.5.
    let mut request = mask(Vec3::new(0.3, 2.0, 1.5), Vec3::ZERO, directional(0.25, 1.0, 0.0));
    let (wrong, blocked) = wrong_and_blocked(&mut case, &request, "edge");
    assert!(wrong == 0 && blocked > 0.1, "{wrong} {blocked}");
    let ground = case.ground_seen(&request);
    request.options.mode = Mode::Shaded;
    let drawn = case.stage.render(&mut planar(&case), &request).expect("drawn");
    let mut unshadowed = Unshadowed::new(&case.stage);
    let plain = case.stage.render(&mut unshadowed, &request).expect("drawn");
    let changed = drawn.pixels().zip(plain.pixels()).zip(&ground).filter(|((d, p), on)| !**on && d != p).count();
    // Where the tracer sees the plate's or the ground's edge half a pixel elsewhere.
    assert!(changed <= 2, "{changed} pixels off the ground changed");
}

/// A plate that stands upright, from `low` to `high` over the ground.
fn upright(low: f32, high: f32) -> Scene {
    let mut scene = empty();
    quad(&mut scene, Vec3::new(-0.3, low, 0.1), Vec3::X * 0.6, Vec3::Y * (high - low));
    ground(&mut scene, Vec2::splat(-1.5), Vec2::splat(1.5));
    scene
}

#[test]
fn no_anti_shadow_of_casters_behind_the_light() {
    for (name, scene, light, blocks) in [
        ("above the light", plates_over_ground(&[(Vec3::Y * 0.8, 0.4)]), point(0.1, 0.4, 0.2), false),
        ("aside above the light", plates_over_ground(&[(Vec3::new(0.6, 0.8, 0.3), 0.3)]), point(-0.3, 0.5, 0.0), false),
        ("through the light's height", upright(0.1, 1.2), point(0.0, 0.5, 0.6), true),
        (
            "on both sides",
            plates_over_ground(&[(Vec3::Y * 0.9, 0.4), (Vec3::Y * 0.2, 0.1)]),
            point(0.1, 0.5, 0.2),
            true,
        ),
    ] {
        let mut case = Case::new(scene);
        for eye in [EYE, Vec3::new(-2.0, 0.6, 0.3), Vec3::new(0.2, 0.3, 2.5)] {
            let (wrong, blocked) = wrong_and_blocked(&mut case, &mask(eye, Vec3::ZERO, light), name);
            assert!(wrong == 0 && (blocked > 0.005) == blocks, "{name} from {eye}: {wrong} wrong, {blocked} in shadow");
        }
    }
}

#[test]
fn casters_below_the_plane_cast_nothing_on_it() {
    for (name, scene, blocks) in [
        ("below", plates_over_ground(&[(Vec3::Y * -0.5, 0.6)]), false),
        ("through the ground", upright(-0.6, 0.6), true),
    ] {
        let mut case = Case::new(scene);
        for light in [directional(0.2, 1.0, -0.5), point(0.2, 1.5, -0.8)] {
            let (wrong, blocked) = wrong_and_blocked(&mut case, &mask(EYE, Vec3::ZERO, light), name);
            assert!(wrong == 0 && (blocked > 0.005) == blocks, "{name}, {light:?}: {wrong} wrong, {blocked} in shadow");
        }
    }
}

#[test]
fn a_model_stands_in_its_shadow() {
    let mut case = Case::on_ground("teapot.glb");
    let mut request = mask(Vec3::new(1.2, 2.0, 3.0), Vec3::ZERO, directional(-0.8, 1.0, -0.3));
    let (wrong, blocked) = wrong_and_blocked(&mut case, &request, "teapot");
    assert!(wrong == 0 && blocked > 0.01, "{wrong} {blocked}");
    request.options.mode = Mode::Shaded;
    keep(&case.stage.render(&mut planar(&case), &request).expect("drawn"), "planar teapot shaded.png");
}

/// The three techniques that know a ground alone, on the plane y = 0 from (-3, -1.5) to (3, 1.5).
fn on_wide_ground(stage: &Stage) -> [Box<dyn Technique>; 3] {
    let receiver = Receiver::new(Vec3::new(-3.0, 0.0, 1.5), [Vec3::X * 6.0, Vec3::NEG_Z * 3.0]).expect("an area");
    let half_edges = [Vec3::X * 0.2, Vec3::Z * 0.2];
    let soft = SoftPlanarOptions { receiver, half_edges, half_angle_rad: 0.1, side: 3, size_texels: 512 };
    let projective = ProjectiveTexture::new(stage, ProjectiveTextureOptions { size_texels: 512 });
    [
        Box::new(Planar::new(stage, PlanarOptions { receiver })),
        Box::new(projective.expect("it fits")),
        Box::new(SoftPlanar::new(stage, soft).expect("it fits")),
    ]
}

#[test]
fn instances_cast_onto_the_ground_of_each_other() {
    // Two tiles side by side, the right one turned, draw what one scene of both draws.
    let quarter = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
    let plate = Vec3::new(-0.3, 0.9, 0.2);
    let place = |x: f32, rotation: Quat| Placement { rotation, scale: 1.0, translation: Vec3::X * x };
    let placements = [place(-1.5, Quat::IDENTITY), place(1.5, quarter)];
    let mut tiles =
        Stage::new(gpu(), &plates_over_ground(&[(plate, 0.3)]), &WORLD, &placements).expect("the scene fits");
    let mut both = empty();
    for placement in placements {
        let centre = placement.world_from_unit().transform_point3(plate);
        quad(&mut both, centre + Vec3::new(-0.3, 0.0, 0.3), Vec3::X * 0.6, Vec3::Z * -0.6);
    }
    ground(&mut both, Vec2::new(-3.0, -1.5), Vec2::new(3.0, 1.5));
    let mut whole = Case::new(both);
    for light in [directional(1.0, 0.6, 0.1), point(0.4, 2.0, 0.3)] {
        let request = mask(Vec3::new(0.0, 5.0, 3.0), Vec3::ZERO, light);
        for (number, mut technique) in on_wide_ground(&whole.stage).into_iter().enumerate() {
            let expected = whole.stage.render(&mut *technique, &request).expect("drawn");
            for draw_calls in [DrawCalls::Instanced, DrawCalls::OnePerInstance] {
                tiles.draw_calls = draw_calls;
                let drawn = tiles.render(&mut *on_wide_ground(&tiles)[number], &request).expect("drawn");
                keep(&drawn, &format!("instances, {}.png", technique.name()));
                let errors = MaskErrors::between(&expected, &drawn);
                let dark = expected.pixels().filter(|p| p.0[1] == 255 && p.0[0] < 128).count() as f64;
                // A matrix of an instance rounds otherwise.
                assert!(errors.wrong() < 0.01 * dark && dark > 500.0, "{}: {errors:?} {dark}", technique.name());
            }
        }
    }
}

#[test]
fn a_light_in_the_plane_casts_nothing() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 0.5, 0.4)]));
    let mut technique = planar(&case);
    let request = mask(EYE, Vec3::ZERO, Light::Point { position: Vec3::X * 2.0 });
    let picture = case.stage.render(&mut technique, &request).expect("drawn");
    assert!(picture.pixels().any(|p| p.0[2] == 255));
    assert_eq!(technique.cost(&case.stage).draw_calls, case.stage.calls_per_pass());
}

#[test]
fn borders_are_antialiased() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 0.5, 0.4)]));
    let mut request = mask(EYE, Vec3::ZERO, directional(0.3, 1.0, 0.2));
    request.options.antialias = Antialias::Msaa4;
    let [missed, falsely] = case.errors(&mut planar(&case), &request);
    let drawn = case.stage.render(&mut planar(&case), &request).expect("drawn");
    let grey = drawn.pixels().filter(|p| p.0[1] == 255 && (1..255).contains(&p.0[0])).count();
    assert!(missed + falsely < 5e-4 && grey > 50, "{missed} {falsely}, {grey} grey pixels");
}

#[test]
fn golden_picture() {
    let mut case = Case::of_box_on_its_ground();
    let mut technique = planar(&case);
    compare(&mut case, &mut technique, &golden::request());
}
