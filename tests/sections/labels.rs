//! Labels that are wrong, and requests that cannot be written.

use crate::{build::Model, for_validator, meshes, round_trip, set, write_sections};
use serde_json::{Value, json};
use shadowfit::{
    asset::read,
    gltf_file::{EXTENSION, SECTION_ATTRIBUTE},
    scene::{Scene, load},
};
use std::fs;

/// A GLB of a grid of three sections and its JSON, in which something may be broken.
fn written() -> (Value, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("m.glb");
    fs::write(&input, meshes::halves().glb()).unwrap();
    let section = |origin: shadowfit::scene::Origin| if origin.primitive == 0 { 1 } else { origin.triangle % 3 };
    let trip = round_trip(&input, &folder.path().join("out"), 3, section);
    (trip.after, trip.bin)
}

fn load_json(json: &Value, bin: &[u8]) -> Result<Scene, String> {
    let model = Model { json: json.clone(), bin: bin.to_vec() };
    model.load().map_err(|error| error.to_string())
}

#[test]
fn wrong_labels_name_the_place() {
    let (json, bin) = written();
    let primitives = "/meshes/0/primitives";
    let label = format!("{primitives}/0/extensions/{EXTENSION}/section");
    for (value, why) in [(json!(3), "3, but there are 3 sections"), (json!(-1), "-1"), (json!("a"), "\"a\"")] {
        let mut broken = json.clone();
        *broken.pointer_mut(&label).unwrap() = value;
        let error = load_json(&broken, &bin).unwrap_err();
        assert!(error.contains(&label) && error.contains(why), "{error}");
    }
    let mut broken = json.clone();
    broken["meshes"][0]["primitives"][0]["extensions"][EXTENSION] = json!({});
    let error = load_json(&broken, &bin).unwrap_err();
    assert!(error.contains(&label) && error.contains("missing"), "{error}");
    // Numbers in the attribute: out of range, not whole, not the same at three corners.
    let accessor = json["meshes"][0]["primitives"][1]["attributes"][SECTION_ATTRIBUTE].as_u64().unwrap();
    let view = json["accessors"][accessor as usize]["bufferView"].as_u64().unwrap() as usize;
    let offset = json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
    for wrong in [3.0_f32, -1.0, 0.5, f32::NAN, f32::INFINITY, 1e30] {
        let mut bytes = bin.clone();
        bytes[offset..offset + 4].copy_from_slice(&wrong.to_le_bytes());
        let error = load_json(&json, &bytes).unwrap_err();
        assert!(error.contains(&format!("/accessors/{accessor}")), "{wrong}: {error}");
    }
    let mut bytes = bin.clone();
    let other = 1.0 - f32::from_le_bytes(bin[offset..offset + 4].try_into().unwrap()).min(1.0);
    bytes[offset..offset + 4].copy_from_slice(&other.to_le_bytes());
    assert!(load_json(&json, &bytes).unwrap_err().contains("at the vertices"));
    let mut broken = json.clone();
    broken["accessors"][accessor as usize]["count"] = json!(3);
    assert!(load_json(&broken, &bin).unwrap_err().contains(&format!("/accessors/{accessor}/count")));
}

#[test]
fn without_a_label_a_triangle_is_in_no_section_of_several() {
    let (json, bin) = written();
    let mut unlabelled = json.clone();
    unlabelled["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("extensions");
    let scene = load_json(&unlabelled, &bin).unwrap();
    let none = scene.section_of.iter().filter(|section| **section == 3).count();
    assert_eq!(none, meshes::triangles().len() / 6);
    // Of one section it is in that, and in a file without planes labels mean nothing.
    let sets = format!("/extensions/{EXTENSION}/sets/0/sections");
    for sections in [json!([[0]]), json!([])] {
        let mut one = json.clone();
        *one.pointer_mut(&sets).unwrap() = sections;
        assert!(load_json(&one, &bin).unwrap().section_of.iter().all(|section| *section == 0));
    }
    let mut stripped = json;
    stripped.as_object_mut().unwrap().remove("extensions");
    assert!(load_json(&stripped, &bin).unwrap().section_of.iter().all(|section| *section == 0));
}

#[test]
fn sections_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (input, out) = (folder.path().join("m.glb"), folder.path().join("out"));
    fs::write(&input, meshes::copies().glb()).unwrap();
    let scene = load(&input).unwrap();
    let count = scene.origins.len();
    let refused = |section_of: &[u32], why: &str| {
        let error = write_sections((&input, &out), &scene, (3, section_of)).unwrap_err();
        assert!(error.to_string().contains(why), "{error}");
        assert_eq!((error.exit_code(), out.exists()), (4, false));
    };
    refused(&vec![0; count - 1], "triangles of the scene");
    refused(&[], "triangles of the scene");
    refused(&vec![3; count], "triangle 0 is in section 3, but there are 3");
    let mut differing = vec![0; count];
    differing[count / 4 + 5] = 1;
    refused(&differing, "all copies of a mesh share their labels");
}

#[test]
fn equal_textures_are_stored_once() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("m.glb");
    fs::write(&input, meshes::grid().glb()).unwrap();
    let scene = load(&input).unwrap();
    let mut shared = set(3);
    let (first, fourth) = (shared.planes[0].texture.clone(), shared.planes[3].texture.clone());
    for (i, plane) in shared.planes.iter_mut().enumerate() {
        plane.texture = if i % 2 == 0 { first.clone() } else { fourth.clone() };
    }
    let section_of: Vec<u32> = scene.origins.iter().map(|origin| origin.triangle % 3).collect();
    let bounds = shadowfit::asset::Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::ONE };
    let request = shadowfit::asset::AssetRequest {
        input: &input,
        out_dir: &for_validator("shared"),
        stem: "m",
        frame: &crate::FRAME,
        bounds,
        set: &shared,
        origins: &scene.origins,
        section_of: &section_of,
    };
    let written = shadowfit::asset::write(&request).unwrap();
    let area = |texture: &shadowfit_solver::plane::OccluderTexture| texture.texels.len() as u64;
    assert!(written.texture_bytes <= 3 * area(&first).max(area(&fourth)), "{}", written.texture_bytes);
    let back = read(&written.model).unwrap();
    assert!(back.planes.iter().zip(&shared.planes).all(|(a, b)| a.texture == b.texture));
}
