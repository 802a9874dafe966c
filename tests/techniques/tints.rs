//! Occluder planes of panes against the light that is traced through them.

use crate::{
    fits,
    stages::{SIZE_PX, gpu, keep},
};
use glam::Vec3;
use serde_json::json;
use shadowfit::{
    asset,
    render::{
        Antialias, Camera, FrameOptions, FrameRequest, Light, Mode,
        occluder_planes::OccluderPlanes,
        ray_traced::RayTraced,
        stage::{Placement, Stage},
    },
    scene,
};
use shadowfit_solver::lights::LightDomain;
use std::{fs, path::PathBuf};

/// A level square of half size `half` around `(x, y, z)`: four corners.
fn square([x, y, z]: [f32; 3], half: f32) -> [[f32; 3]; 4] {
    [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|[a, b]| [x + a * half, y, z + b * half])
}

/// A grey ground, and above it a red pane and a grey plate side by side, as a glTF file.
fn panes(folder: &std::path::Path) -> PathBuf {
    let squares = [square([0.0; 3], 1.5), square([-0.5, 0.5, 0.0], 0.4), square([0.5, 0.5, 0.0], 0.4)];
    let mut bytes: Vec<u8> = squares.iter().flatten().flatten().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    fs::write(folder.join("panes.bin"), &bytes).unwrap();
    let view = |offset: usize, length: usize| json!({"buffer": 0, "byteOffset": offset, "byteLength": length});
    let positions = |i: usize, corners: &[[f32; 3]; 4]| {
        json!({"bufferView": i, "componentType": 5126, "count": 4, "type": "VEC3", "min": corners[3].map(f64::from)
            .iter().zip(corners[0]).map(|(a, b)| a.min(b.into())).collect::<Vec<f64>>(), "max": corners[1].map(f64::from)
            .iter().zip(corners[2]).map(|(a, b)| a.max(b.into())).collect::<Vec<f64>>()})
    };
    let mut accessors: Vec<_> = squares.iter().enumerate().map(|(i, corners)| positions(i, corners)).collect();
    accessors.push(json!({"bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR"}));
    let grey = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.8, 0.8, 1.0]}});
    let red = json!({"pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.1, 0.2, 0.6]}, "alphaMode": "BLEND"});
    let primitive = |i: usize| json!({"attributes": {"POSITION": i}, "indices": 3, "material": i});
    let document = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive(0), primitive(1), primitive(2)]}],
        "materials": [grey, red, grey],
        "accessors": accessors,
        "bufferViews": [view(0, 48), view(48, 48), view(96, 48), view(144, 12)],
        "buffers": [{"uri": "panes.bin", "byteLength": bytes.len()}],
    });
    let path = folder.join("panes.gltf");
    fs::write(&path, document.to_string()).unwrap();
    path
}

/// The traced picture where all pixels around one are as it is.
fn inside(picture: &image::RgbaImage, x: u32, y: u32) -> bool {
    let here = picture.get_pixel(x, y);
    let near = |d: u32| {
        let around = [(x - d, y), (x + d, y), (x, y - d), (x, y + d)];
        around.iter().all(|&(i, j)| (0..3).all(|c| picture.get_pixel(i, j).0[c].abs_diff(here.0[c]) <= 1))
    };
    near(1) && near(2) && near(3)
}

#[test]
fn the_shadow_of_a_pane_has_the_traced_colour() {
    let folder = tempfile::tempdir().unwrap();
    let model = panes(folder.path());
    let domain = LightDomain::Hemisphere;
    let request = fits::request(&model, &folder.path().join("out"), fits::least());
    let (report, _) = fits::fit(&fits::FitRequest { domain, domain_text: "hemisphere".into(), ..request }).unwrap();
    assert_eq!(report.planes, 2);
    // The texels of the least effort leave 0.021.
    assert!(report.held_out.shadow_error < 0.03, "{:?}", report.held_out);

    let written = folder.path().join("out/panes.shadow.glb");
    let scene = scene::load(&written).unwrap();
    let frame = scene.mesh().unwrap().frame;
    let set = asset::read(&written).unwrap().in_unit_space(&frame);
    let mut stage = Stage::new(gpu(), &scene, &frame, &[Placement::IDENTITY]).unwrap();
    let traced = RayTraced::new(scene, &frame).unwrap();
    let mut technique = OccluderPlanes::new(&stage, &set).unwrap();
    let (mut tinted, mut black) = (0, 0);
    for (i, l) in
        [Vec3::new(0.1, 1.0, 0.2), Vec3::new(-0.5, 0.8, 0.4), Vec3::new(0.6, 0.9, -0.6)].into_iter().enumerate()
    {
        let camera = Camera::turntable(0.3, 0.9);
        let light = Light::Directional { to_light: l.normalize() };
        let options = FrameOptions { size_px: SIZE_PX, mode: Mode::Shaded, antialias: Antialias::Off };
        let request = FrameRequest { camera, light, options };
        let expected = traced.transmitted_picture(&traced.look(&request).unwrap()).unwrap();
        let drawn = stage.render(&mut technique, &request).unwrap();
        keep(&drawn, &format!("tints {i} drawn.png"));
        keep(&expected, &format!("tints {i} traced.png"));
        let (mut wrong, mut all) = (0, 0);
        for (x, y, pixel) in drawn.enumerate_pixels() {
            let off_frame = x < 3 || y < 3 || x + 3 >= SIZE_PX[0] || y + 3 >= SIZE_PX[1];
            if off_frame || !inside(&expected, x, y) {
                continue;
            }
            let e = expected.get_pixel(x, y).0;
            all += 1;
            wrong += usize::from((0..3).any(|c| pixel.0[c].abs_diff(e[c]) > 2));
            // Grey 0.8 in the light that the pane leaves, and in none.
            tinted += usize::from(e[0] > e[1].saturating_add(20) && e[0] < 220);
            black += usize::from(e[..3].iter().all(|byte| *byte == e[0]) && e[0] < 140);
        }
        assert!(wrong * 500 < all, "light {i}: {wrong} of {all} pixels");
    }
    assert!(tinted > 1000 && black > 1000, "{tinted} {black}");
}
