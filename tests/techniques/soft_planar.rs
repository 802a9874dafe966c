//! Soft planar shadows: against the reference under an area light, error falls with the samples; a penumbra is as wide as
//! the light seen through the caster's edge.

use crate::{
    golden,
    stages::{Case, golden as compare, ground_errors, keep, mask, plates_over_ground},
};
use glam::Vec3;
use shadowfit::{
    masks::difference,
    render::{
        FrameRequest, Light, Mode, RenderError,
        ray_traced::AreaLight,
        soft_planar::{SoftPlanar, SoftPlanarOptions},
    },
};

const EYE: Vec3 = Vec3::new(1.0, 3.0, 2.0);
/// Samples along each edge of the reference's light.
const MANY: usize = 16;
/// Half the angle of directional lights.
const HALF_ANGLE_RAD: f32 = 0.15;

fn soft(case: &Case, half_edges: [Vec3; 2], side: u32) -> Result<SoftPlanar, RenderError> {
    let (receiver, half_angle_rad, size_texels) = (case.receiver(), HALF_ANGLE_RAD, 512);
    SoftPlanar::new(&case.stage, SoftPlanarOptions { receiver, half_edges, half_angle_rad, side, size_texels })
}

/// The mask traced with many samples of `area`, and the drawn one.
fn masks(
    case: &mut Case,
    request: &FrameRequest,
    area: &AreaLight,
    technique: &mut SoftPlanar,
) -> [image::RgbaImage; 2] {
    let view = case.traced.look(request).expect("traced");
    let traced = case.traced.soft_picture(&view, area, MANY).expect("traced");
    let drawn = case.stage.render(technique, request).expect("drawn");
    [traced, drawn]
}

#[test]
fn error_falls_with_the_samples() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 0.5, 0.4), (Vec3::new(0.2, 0.8, 0.1), 0.1)]));
    let area = AreaLight { centre: Vec3::new(0.4, 2.0, 0.3), half_edges: [Vec3::X * 0.4, Vec3::new(0.0, 0.1, 0.3)] };
    let request = mask(EYE, Vec3::ZERO, area.middle());
    let ground = case.ground_seen(&request);
    let errors = [1, 4, 16].map(|side| {
        let mut technique = soft(&case, area.half_edges, side).expect("it fits");
        let masks = masks(&mut case, &request, &area, &mut technique);
        keep(&masks[1], &format!("soft planar {side}.png"));
        keep(&difference(&masks[0], &masks[1]), &format!("soft planar {side}.difference.png"));
        ground_errors(&masks, &ground).iter().sum::<f64>()
    });
    // With the reference's own samples only the texels are left.
    assert!(errors[0] > 0.015 && errors[1] < errors[0] / 3.0 && errors[2] < errors[1] / 3.0, "{errors:?}");
    assert!(errors[2] < 1e-3, "{errors:?}");
}

#[test]
fn a_directional_light_has_an_angular_size() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 0.5, 0.4)]));
    let to_light = Vec3::new(0.3, 0.9, 0.2).normalize();
    let area = AreaLight::distant(to_light, HALF_ANGLE_RAD);
    let request = mask(EYE, Vec3::ZERO, Light::Directional { to_light });
    let ground = case.ground_seen(&request);
    let mut technique = soft(&case, [Vec3::ZERO; 2], 8).expect("it fits");
    let masks = masks(&mut case, &request, &area, &mut technique);
    let errors = ground_errors(&masks, &ground);
    assert!(errors.iter().sum::<f64>() < 3e-3, "{errors:?}");
}

#[test]
fn a_penumbra_is_as_wide_as_the_light_through_the_edge() {
    let (light_height, half_light, side) = (2.0, 0.25, 24);
    for height in [0.2, 0.4, 0.8] {
        let mut case = Case::new(plates_over_ground(&[(Vec3::Y * height, 0.5)]));
        let mut technique = soft(&case, [Vec3::X * half_light, Vec3::Z * 0.01], side).expect("it fits");
        // Straight down from below the plate, onto where its edge at x = 0.5 casts.
        let middle = Vec3::X * 0.5 * light_height / (light_height - height);
        let eye = middle + Vec3::new(0.0, 0.15, 0.0001);
        let mut request = mask(eye, middle, Light::Point { position: Vec3::Y * light_height });
        request.options.size_px = [1024, 256];
        let drawn = case.stage.render(&mut technique, &request).expect("drawn");
        keep(&drawn, &format!("soft planar penumbra {height}.png"));
        let grey = (0..1024).filter(|&x| (3..252).contains(&drawn.get_pixel(x, 128).0[0])).count() as f32;
        // The frame's shorter side sees an angle of 0.9.
        let drawn_width = grey * eye.y * 2.0 * 0.45_f32.tan() / 256.0;
        // From the first to the last sample: the centres of `side` equal parts.
        let between_samples = 2.0 * half_light * (1.0 - 1.0 / side as f32);
        let expected = between_samples * height / (light_height - height);
        // The ground is 3 wide. Each end is a texel's centre and spreads over half a texel by the filter.
        let texel = 3.0 / 512.0;
        assert!((drawn_width - expected).abs() < 1.5 * texel, "{height}: {drawn_width} for {expected}");
    }
}

#[test]
fn a_model_stands_in_its_soft_shadow() {
    let mut case = Case::on_ground("teapot.glb");
    let area = AreaLight { centre: Vec3::new(1.5, 2.5, 0.7), half_edges: [Vec3::X * 0.3, Vec3::Z * 0.3] };
    let mut request = mask(Vec3::new(1.2, 2.0, 3.0), Vec3::ZERO, area.middle());
    let ground = case.ground_seen(&request);
    let mut technique = soft(&case, area.half_edges, 4).expect("it fits");
    let view = case.traced.look(&request).expect("traced");
    let masks = [
        case.traced.soft_picture(&view, &area, 4).expect("traced"),
        case.stage.render(&mut technique, &request).expect("drawn"),
    ];
    keep(&difference(&masks[0], &masks[1]), "soft planar teapot.difference.png");
    let [missed, falsely] = ground_errors(&masks, &ground);
    assert!(missed + falsely < 3e-3, "{missed} {falsely}");
    request.options.mode = Mode::Shaded;
    keep(&case.stage.render(&mut technique, &request).expect("drawn"), "soft planar teapot shaded.png");
}

#[test]
fn nothing_below_the_receiver_or_above_the_light_casts() {
    let half_edges = [Vec3::X * 0.3, Vec3::Z * 0.3];
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * -0.3, 0.6), (Vec3::Y * 1.2, 0.6)]));
    let mut technique = soft(&case, half_edges, 3).expect("it fits");
    let request = mask(EYE, Vec3::ZERO, Light::Point { position: Vec3::Y * 0.8 });
    let ground = case.ground_seen(&request);
    let drawn = case.stage.render(&mut technique, &request).expect("drawn");
    assert!(drawn.pixels().zip(&ground).all(|(p, on)| !on || p.0 == [255; 4] || p.0[2] == 0));
}

#[test]
fn samples_behind_the_receiver_give_no_light() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 5.0, 0.1)]));
    // A third of the light stands below the ground.
    let half_edges = [Vec3::X * 0.1, Vec3::Y * 0.3];
    let area = AreaLight { centre: Vec3::new(-2.0, 0.1, 0.0), half_edges };
    let mut technique = soft(&case, half_edges, 3).expect("it fits");
    let request = mask(EYE, Vec3::ZERO, area.middle());
    let ground = case.ground_seen(&request);
    let drawn = case.stage.render(&mut technique, &request).expect("drawn");
    assert!(drawn.pixels().zip(&ground).all(|(p, on)| !on || p.0 == [170, 255, 255, 255] || p.0[2] == 0));
}

#[test]
fn more_samples_than_half_floats_count_are_an_error() {
    let case = Case::new(plates_over_ground(&[(Vec3::Y * 0.5, 0.4)]));
    let half_edges = [Vec3::X * 0.1, Vec3::Z * 0.1];
    assert!(soft(&case, half_edges, 45).is_ok());
    assert!(matches!(soft(&case, half_edges, 46), Err(RenderError::TooLarge { .. })));
}

#[test]
fn golden_picture() {
    let mut case = Case::of_box_on_its_ground();
    let mut technique = soft(&case, [Vec3::ZERO; 2], 4).expect("it fits");
    compare(&mut case, &mut technique, &golden::request());
}
