//! Shadow maps: errors at borders only, which shrink with the texel; a point light through six faces.

use crate::stages::{Case, box_on_ground, directional, mask, plate_over_ground};
use glam::Vec3;
use shadowfit::render::{
    Light, RenderError,
    shadow_map::{ShadowMap, ShadowMapOptions},
};

fn shadow_map(case: &Case, size_texels: u32, kernel_texels: u32) -> ShadowMap {
    ShadowMap::new(&case.stage, ShadowMapOptions { size_texels, kernel_texels }).expect("it fits")
}

#[test]
fn error_shrinks_with_the_texel() {
    let mut case = Case::new(plate_over_ground());
    let request = mask(Vec3::new(1.0, 3.0, 2.0), Vec3::ZERO, directional(0.3, 1.0, 0.2));
    let errors = [64, 256, 1024].map(|size| {
        let [missed, falsely] = case.errors(&mut shadow_map(&case, size, 1), &request);
        missed + falsely
    });
    // The border is 3.2 long, the light's view 3.3 wide, the frame covers some 9 square units: a quarter of a texel.
    assert!(errors[0] < 0.02 && errors[1] < errors[0] / 2.5 && errors[2] < errors[1] / 2.0, "{errors:?}");
}

#[test]
fn lit_surfaces_have_no_acne_under_any_kernel() {
    let mut case = Case::new(box_on_ground());
    for (size, kernel) in [(128, 1), (512, 1), (512, 2), (512, 5)] {
        for light in [directional(0.3, 1.0, 0.2), directional(1.0, 0.25, 0.4), directional(-0.2, 0.05, 1.0)] {
            let request = mask(Vec3::new(1.5, 2.0, 2.0), Vec3::ZERO, light);
            let [_, falsely] = case.errors(&mut shadow_map(&case, size, kernel), &request);
            assert!(falsely < 0.03, "{size} {kernel} {light:?}: {falsely}");
        }
    }
}

#[test]
fn a_point_light_has_six_faces() {
    let mut case = Case::new(box_on_ground());
    let mut technique = shadow_map(&case, 512, 2);
    for position in [Vec3::new(0.6, 0.9, 0.3), Vec3::new(-0.9, 0.4, 0.1), Vec3::new(0.0, 0.8, -0.7)] {
        let request = mask(Vec3::new(1.5, 2.5, 2.0), Vec3::ZERO, Light::Point { position });
        let errors = case.errors(&mut technique, &request);
        assert!(errors.iter().sum::<f64>() < 0.01, "{position}: {errors:?}");
    }
}

#[test]
fn a_map_beyond_the_adapter_is_an_error() {
    let case = Case::new(box_on_ground());
    let options = ShadowMapOptions { size_texels: 1 << 20, kernel_texels: 1 };
    assert!(matches!(ShadowMap::new(&case.stage, options), Err(RenderError::TooLarge { .. })));
}
