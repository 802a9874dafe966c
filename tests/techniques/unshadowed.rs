//! No shadow at all: every blocked pixel is missed, and none is false.

use crate::stages::{Case, directional, mask, plate_over_ground};
use glam::Vec3;
use shadowfit::render::unshadowed::Unshadowed;

#[test]
fn misses_all_shadow_and_draws_none() {
    let mut case = Case::new(plate_over_ground());
    let mut technique = Unshadowed::new(&case.stage);
    let request = mask(Vec3::new(1.0, 3.0, 2.0), Vec3::ZERO, directional(1.0, 0.8, 0.2));
    let [traced, _] = case.masks(&mut technique, &request);
    let covered = traced.pixels().filter(|p| p.0[2] == 255).count();
    let blocked = traced.pixels().filter(|p| p.0[1] == 255 && p.0[0] == 0).count();
    let [missed, falsely] = case.errors(&mut technique, &request);
    assert!((missed - blocked as f64 / covered as f64).abs() < 1e-3, "{missed} of {blocked} in {covered}");
    assert!(missed > 0.02 && falsely == 0.0, "{missed} {falsely}");
}
