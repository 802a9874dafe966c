//! Occluder planes: both ways to compute coordinates draw the same, and sections without planes cost nothing but draws.
//! Their errors are the business of parity.rs and of the fits' tests.

use crate::{
    procedural,
    stages::{gpu, keep},
};
use glam::{Quat, Vec3};
use shadowfit::{
    masks::MaskErrors,
    render::{
        Antialias, Camera, FrameOptions, FrameRequest, Light, Mode, RenderError,
        occluder_planes::OccluderPlanes,
        stage::{Placement, Stage},
        technique::Technique,
        unshadowed::Unshadowed,
    },
};
use shadowfit_solver::{mesh::Mesh, plane::BakedSet};

const LIGHTS: [Vec3; 3] = [Vec3::new(0.4, 0.8, 0.5), Vec3::new(-0.7, 0.3, 0.2), Vec3::new(0.1, 0.5, -0.9)];

/// The procedural scene twice, turned and apart, in seven sections; each list holds so many planes, but every third
/// none.
fn stage_and_set(planes_per_list: usize) -> (Stage, BakedSet) {
    let mut scene = procedural::scene();
    scene.section_of = (0..scene.section_of.len() as u32).map(|triangle| triangle / 16 % 7).collect();
    let frame = Mesh::new(&scene.soup).unwrap().frame;
    let turned = Placement { rotation: Quat::from_rotation_z(1.0), scale: 0.5, translation: Vec3::new(0.6, 0.5, 0.0) };
    let placements = [Placement { scale: 0.6, ..Placement::IDENTITY }, turned];
    let stage = Stage::new(gpu(), &scene, &frame, &placements).unwrap();
    let list = |section: usize| match section % 3 {
        2 => Vec::new(),
        _ => (0..planes_per_list).map(|plane| ((section + plane) % 7) as u32).collect(),
    };
    let sections = (0..7).map(list).collect();
    (stage, BakedSet { planes: procedural::planes(), sections, active: None, ground: None })
}

fn request(view: usize, light: Light) -> FrameRequest {
    FrameRequest {
        camera: Camera::turntable(1.1 * view as f32, 0.4),
        light,
        options: FrameOptions { size_px: [320, 320], mode: Mode::Mask, antialias: Antialias::Off },
    }
}

/// They differ by rounding alone: a pixel in a thousand, as the twins of parity.rs.
#[test]
fn coordinates_at_vertices_are_those_per_fragment() {
    let (mut stage, set) = stage_and_set(4);
    let mut per_fragment = OccluderPlanes::new(&stage, &set).unwrap();
    let mut per_vertex = OccluderPlanes::per_vertex(&stage, &set).unwrap();
    let mut none = Unshadowed::new(&stage);
    let (mut sum, mut shadow) = (MaskErrors::default(), MaskErrors::default());
    for (view, to_light) in LIGHTS.into_iter().enumerate() {
        let request = request(view, Light::Directional { to_light: to_light.normalize() });
        let expected = stage.render(&mut per_fragment, &request).unwrap();
        let drawn = stage.render(&mut per_vertex, &request).unwrap();
        keep(&drawn, &format!("{} {view}.png", per_vertex.name()));
        sum = sum.plus(MaskErrors::between(&expected, &drawn));
        shadow = shadow.plus(MaskErrors::between(&expected, &stage.render(&mut none, &request).unwrap()));
    }
    let (differs, missed) = (sum.share(sum.missed + sum.false_), shadow.share(shadow.missed));
    println!("differs {differs:.6}, shadow {missed:.4}");
    assert!(differs < 0.001, "{differs}");
    assert!(missed > 0.05, "the planes cast too little to test anything: {missed}");
}

#[test]
fn coordinates_at_vertices_refuse_what_they_cannot_draw() {
    let (mut stage, five) = stage_and_set(5);
    assert!(matches!(OccluderPlanes::per_vertex(&stage, &five), Err(RenderError::Unsupported { .. })));
    let mut four = OccluderPlanes::per_vertex(&stage, &stage_and_set(4).1).unwrap();
    let lamp = request(0, Light::Point { position: Vec3::new(0.9, 1.4, 0.8) });
    assert!(matches!(stage.render(&mut four, &lamp), Err(RenderError::Unsupported { .. })));
}

/// Planes in no list under this light leave the bytes of a frame without shadow.
#[test]
fn without_planes_nothing_is_drawn_but_the_model() {
    let (mut stage, mut set) = stage_and_set(3);
    set.sections.iter_mut().for_each(Vec::clear);
    let [mut empty, mut none]: [Box<dyn Technique>; 2] =
        [Box::new(OccluderPlanes::new(&stage, &set).unwrap()), Box::new(Unshadowed::new(&stage))];
    let request = request(1, Light::Directional { to_light: LIGHTS[0].normalize() });
    let [a, b] = [&mut empty, &mut none].map(|technique| stage.render(&mut **technique, &request).unwrap());
    assert!(a == b);
    assert_eq!(empty.cost(&stage).draw_calls, none.cost(&stage).draw_calls);
}
