//! A projective texture: on the ground errors at borders only, which shrink with the texel; none on the casters; and the
//! false shadow that a texture without depth must draw.

use crate::{
    golden,
    stages::{Case, directional, golden as compare, ground_errors, keep, mask, plates_over_ground},
};
use glam::Vec3;
use shadowfit::render::{
    FrameRequest, Light, RenderError,
    projective_texture::{ProjectiveTexture, ProjectiveTextureOptions},
};

const EYE: Vec3 = Vec3::new(1.0, 3.0, 2.0);

fn projective(case: &Case, size_texels: u32) -> ProjectiveTexture {
    ProjectiveTexture::new(&case.stage, ProjectiveTextureOptions { size_texels }).expect("it fits")
}

/// Missed and false shadow on the ground.
fn on_ground(case: &mut Case, size_texels: u32, (request, name): (&FrameRequest, &str)) -> [f64; 2] {
    let ground = case.ground_seen(request);
    let masks = case.masks(&mut projective(case, size_texels), request);
    keep(&masks[1], &format!("projective texture {name} {size_texels}.png"));
    let difference = shadowfit::masks::difference(&masks[0], &masks[1]);
    keep(&difference, &format!("projective texture {name} {size_texels}.difference.png"));
    ground_errors(&masks, &ground)
}

#[test]
fn error_shrinks_with_the_texel() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 0.5, 0.4)]));
    // Turned, so that no edge is parallel to the texels.
    let request = mask(EYE, Vec3::ZERO, directional(-0.5, 1.0, -0.2));
    let errors = [16, 64, 256].map(|size| on_ground(&mut case, size, (&request, "plate")).iter().sum::<f64>());
    // The border is 3.2 long, the ground that is seen some 9 square units, a texel 1 / size wide: a quarter is wrong.
    assert!(errors[0] < 0.01 && errors[1] < errors[0] / 2.5 && errors[2] < errors[1] / 2.5, "{errors:?}");
}

#[test]
fn a_model_stands_in_its_shadow() {
    let mut case = Case::on_ground("teapot.glb");
    let request = mask(Vec3::new(1.2, 2.0, 3.0), Vec3::ZERO, directional(-0.8, 1.0, -0.3));
    let [missed, falsely] = on_ground(&mut case, 512, (&request, "teapot"));
    assert!(missed + falsely < 0.003, "{missed} {falsely}");
}

#[test]
fn the_model_has_no_self_shadow() {
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 0.8, 0.2), (Vec3::Y * 0.4, 0.4)]));
    let request = mask(EYE, Vec3::ZERO, directional(0.3, 1.0, 0.2));
    let ground = case.ground_seen(&request);
    let masks = case.masks(&mut projective(&case, 256), &request);
    let pixels = masks[0].pixels().zip(masks[1].pixels()).zip(&ground).filter(|(_, on)| !**on);
    let missed = pixels.filter(|((t, d), _)| t.0[..2] == [0, 255] && d.0[0] == 255).count();
    let blocked = masks[0].pixels().zip(&ground).filter(|(t, on)| !**on && t.0[..2] == [0, 255]).count();
    assert!(missed == blocked && blocked > 100, "{missed} of {blocked}");
}

#[test]
fn a_point_light_projects_to_all_sides_and_never_back() {
    let light = Light::Point { position: Vec3::new(0.1, 0.5, 0.2) };
    for eye in [EYE, Vec3::new(-2.0, 0.6, 0.3)] {
        let request = mask(eye, Vec3::ZERO, light);
        let mut around = Case::new(plates_over_ground(&[(Vec3::new(0.2, 0.25, 0.1), 0.2), (Vec3::Y * 0.9, 0.4)]));
        let errors = on_ground(&mut around, 256, (&request, "point light"));
        assert!(errors.iter().sum::<f64>() < 0.005, "{errors:?}");
        let mut behind = Case::new(plates_over_ground(&[(Vec3::Y * 0.8, 0.4)]));
        assert_eq!(on_ground(&mut behind, 256, (&request, "behind the light")), [0.0, 0.0]);
    }
}

#[test]
fn a_caster_below_the_ground_casts_onto_it_from_behind() {
    // Light from straight above: the lower plate would fill [-0.6, 0.6]^2 of the ground, [-0.2, 0.2]^2 is in shadow
    // already.
    let mut case = Case::new(plates_over_ground(&[(Vec3::Y * 0.5, 0.2), (Vec3::Y * -0.5, 0.6)]));
    let request = mask(Vec3::new(0.0, 4.0, 0.01), Vec3::ZERO, directional(0.0, 1.0, 0.0));
    let [missed, falsely] = on_ground(&mut case, 256, (&request, "below"));
    // The plate hides what is within 0.2 * 4 / 3.5 of the middle; the frame is 3.87 wide, the ground 3.
    let expected = (1.44 - 0.457_f64.powi(2)) / (9.0 - 0.457_f64.powi(2));
    assert!(missed < 0.002 && (falsely - expected).abs() < 0.005, "{missed} {falsely} {expected}");
}

#[test]
fn a_texture_beyond_the_adapter_is_an_error() {
    let case = Case::new(plates_over_ground(&[(Vec3::Y * 0.5, 0.4)]));
    let options = ProjectiveTextureOptions { size_texels: 1 << 20 };
    assert!(matches!(ProjectiveTexture::new(&case.stage, options), Err(RenderError::TooLarge { .. })));
}

#[test]
fn golden_picture() {
    let mut case = Case::of_box_on_its_ground();
    let mut technique = projective(&case, 256);
    compare(&mut case, &mut technique, &golden::request());
}
