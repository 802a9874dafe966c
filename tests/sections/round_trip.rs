//! Every kind of mesh, with labels that cut through it.

use crate::build::Model;
use crate::{
    RoundTrip, for_validator,
    meshes::{self, VERTICES},
    round_trip,
};
use serde_json::{Value, json};
use shadowfit::{
    asset::check_input,
    gltf_file::SECTION_ATTRIBUTE,
    scene::{Origin, load},
};
use shadowfit_solver::sampling::hash;
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

/// Three sections in stripes of four triangles.
fn striped(origin: Origin) -> u32 {
    origin.triangle / 4 % 3
}

/// Writes a model of three sections for the validator and checks what must hold for all.
fn check(name: &str, model: &Model) -> RoundTrip {
    check_with(name, model, striped)
}

fn check_with(name: &str, model: &Model, section: impl Fn(Origin) -> u32) -> RoundTrip {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("m.glb");
    fs::write(&input, model.glb()).unwrap();
    round_trip(&input, &for_validator(name), 3, section)
}

/// Pairs of a vertex and a section that uses it, in the input's primitive 0.
fn uses(trip: &RoundTrip) -> usize {
    let corners = meshes::triangles();
    let section = |corner: usize| trip.scene.section_of[corner / 3];
    corners.iter().enumerate().map(|(i, vertex)| (*vertex, section(i))).collect::<BTreeSet<_>>().len()
}

fn accessor<'a>(trip: &'a RoundTrip, attribute: &str) -> &'a Value {
    let primitive = &trip.after["meshes"][0]["primitives"][0];
    let index = primitive["attributes"][attribute].as_u64().unwrap_or_else(|| panic!("no {attribute}: {primitive}"));
    &trip.after["accessors"][index as usize]
}

/// Component `i` of an accessor with bytes of its own.
fn bytes<'a>(trip: &'a RoundTrip, accessor: &Value) -> &'a [u8] {
    let view = &trip.after["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let [offset, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
    &trip.bin[offset..offset + length]
}

#[test]
fn an_indexed_grid_stores_a_vertex_once_a_section() {
    let trip = check("grid", &meshes::grid());
    let count = uses(&trip);
    assert!(count > VERTICES + 10, "{count} uses: nothing to duplicate");
    for attribute in ["POSITION", "NORMAL", "COLOR_0", "_NUMBER", SECTION_ATTRIBUTE] {
        assert_eq!(accessor(&trip, attribute)["count"], json!(count), "{attribute}");
    }
    assert_eq!(accessor(&trip, "COLOR_0")["normalized"], json!(true));
    // The vertices of the input come first, in their order; the others repeat one of them.
    let numbers: Vec<f32> = bytemuck::pod_collect_to_vec(bytes(&trip, accessor(&trip, "_NUMBER")));
    assert!(numbers[..VERTICES].iter().enumerate().all(|(i, number)| *number == i as f32));
    assert!(numbers[VERTICES..].iter().all(|number| (*number as usize) < VERTICES));
    let old = trip.before["accessors"][0].clone();
    assert_eq!([&accessor(&trip, "POSITION")["min"], &accessor(&trip, "POSITION")["max"]], [&old["min"], &old["max"]]);
}

#[test]
fn strips_and_fans_become_lists() {
    for (name, mode, indexed) in
        [("strip", 5, true), ("strip-bare", 5, false), ("fan", 6, true), ("fan-bare", 6, false)]
    {
        let trip = check(name, &meshes::band(mode, 23, indexed));
        let primitive = &trip.after["meshes"][0]["primitives"][0];
        assert_eq!(primitive["mode"], json!(4), "{name}");
        let indices = primitive["indices"].as_u64().unwrap() as usize;
        assert_eq!(trip.after["accessors"][indices]["count"], json!(63), "{name}");
    }
}

#[test]
fn loose_triangles_only_get_the_attribute() {
    let trip = check("loose", &meshes::loose(20));
    let mut expected = trip.before["meshes"][0]["primitives"][0].clone();
    expected["attributes"][SECTION_ATTRIBUTE] = json!(1);
    assert_eq!(trip.after["meshes"][0]["primitives"][0], expected);
    // So do indexed ones where no vertex lies between sections: whole rows are far apart here.
    let mut model = meshes::grid();
    let rows: Vec<u16> = meshes::triangles().chunks(36).step_by(2).flatten().copied().collect();
    let indices = model.shorts(crate::build::USHORT, "SCALAR", rows.len(), &rows);
    model.primitive()["indices"] = json!(indices);
    let trip = check_with("rows", &model, |origin| origin.triangle / 12);
    assert_eq!(trip.after["meshes"][0]["primitives"][0]["indices"], json!(indices));
    assert_eq!(accessor(&trip, SECTION_ATTRIBUTE)["count"], json!(VERTICES));
}

#[test]
fn primitives_that_share_vertices_get_those_that_they_use() {
    let trip = check("halves", &meshes::halves());
    let counts = [0, 1].map(|i| {
        let attributes = &trip.after["meshes"][0]["primitives"][i]["attributes"];
        trip.after["accessors"][attributes["POSITION"].as_u64().unwrap() as usize]["count"].as_u64().unwrap()
    });
    assert!(counts.iter().all(|count| *count < VERTICES as u64 + 10), "{counts:?}");
    // One of them whole: it keeps its vertices and gets a label.
    let trip = check_with("half", &meshes::halves(), |origin| if origin.primitive == 0 { 2 } else { striped(origin) });
    let first = &trip.after["meshes"][0]["primitives"][0];
    assert_eq!(first["extensions"], json!({"SHADOWFIT_node_shadow_planes": {"section": 2}}));
    assert_eq!(first["attributes"], trip.before["meshes"][0]["primitives"][0]["attributes"]);
}

#[test]
fn morph_targets_and_sparse_accessors_follow() {
    let trip = check("morphed", &meshes::morphed());
    let count = accessor(&trip, "POSITION")["count"].clone();
    for target in trip.after["meshes"][0]["primitives"][0]["targets"].as_array().unwrap() {
        let accessor = &trip.after["accessors"][target["POSITION"].as_u64().unwrap() as usize];
        assert_eq!((&accessor["count"], accessor.get("sparse")), (&count, None));
    }
    let trip = check("moved", &meshes::moved());
    assert_eq!(accessor(&trip, "POSITION").get("sparse"), None);
    check("skinned", &meshes::skinned());
}

#[test]
fn quantised_vertices_keep_their_bytes() {
    let trip = check("quantised", &meshes::quantised());
    for (attribute, stride, size) in [("POSITION", 8, 6), ("NORMAL", 4, 3)] {
        let old = &trip.before["accessors"]
            [trip.before["meshes"][0]["primitives"][0]["attributes"][attribute].as_u64().unwrap() as usize];
        let new = accessor(&trip, attribute);
        assert_eq!((&new["componentType"], &new["normalized"]), (&old["componentType"], &json!(true)));
        let view = &trip.after["bufferViews"][new["bufferView"].as_u64().unwrap() as usize];
        assert_eq!(view["byteStride"], json!(stride));
        let (old, new) = (bytes(&trip, old), bytes(&trip, new));
        for i in 0..VERTICES {
            let at = i * stride..i * stride + size;
            assert_eq!(old[at.clone()], new[at], "{attribute} {i}");
        }
    }
}

#[test]
fn copies_share_their_labels() {
    let trip = check("copies", &meshes::copies());
    assert_eq!(trip.scene.section_of.len(), 4 * meshes::triangles().len() / 3);
}

#[test]
fn many_vertices_need_wide_indices() {
    // 180 x 360 vertices fit into 16 bits, one more for each section at a vertex does not.
    let (width, height) = (180, 360);
    let mut model = Model::empty();
    let values: Vec<[f32; 3]> =
        (0..width * height).map(|i| [(i % width) as f32, ((i * 7) % 5) as f32, (i / width) as f32]).collect();
    let position = meshes::points(&mut model, &values);
    model.mesh(json!({"POSITION": position}));
    let cell = |i: usize| {
        let a = (i / (width - 1) * width + i % (width - 1)) as u16;
        let w = width as u16;
        [a, a + w, a + 1, a + 1, a + w, a + w + 1]
    };
    let triangles: Vec<u16> = (0..(width - 1) * (height - 1)).flat_map(cell).collect();
    let indices = model.shorts(crate::build::USHORT, "SCALAR", triangles.len(), &triangles);
    model.primitive()["indices"] = json!(indices);
    model.push("nodes", json!({"mesh": 0}));
    meshes::scene(&mut model);
    let trip = check_with("wide", &model, |origin| origin.triangle / 2 % 3);
    let indices = trip.after["meshes"][0]["primitives"][0]["indices"].as_u64().unwrap() as usize;
    assert_eq!(trip.after["accessors"][indices]["componentType"], json!(crate::build::UINT));
}

#[test]
fn vertices_go_beside_a_model_with_external_buffers() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = meshes::grid();
    fs::write(folder.path().join("old.bin"), &model.bin).unwrap();
    model.json["buffers"] = json!([{"uri": "old.bin", "byteLength": model.bin.len()}]);
    let input = folder.path().join("m.gltf");
    fs::write(&input, model.text()).unwrap();
    let out = for_validator("external");
    let trip = round_trip(&input, &out, 3, striped);
    assert_eq!(trip.written.buffer, Some(out.join("m.shadow.bin")));
    assert_eq!(trip.after["buffers"][1]["uri"], json!("m.shadow.bin"));
    assert!(trip.bin.is_empty());
}

#[test]
fn compressed_copies_of_the_old_vertices_go() {
    let mut model = meshes::grid();
    let draco = json!({"bufferView": 0, "attributes": {"POSITION": 0}});
    model.primitive()["extensions"] = json!({"KHR_draco_mesh_compression": draco, "EXT_other": {"a": 1.50}});
    model.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression", "EXT_other"]);
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("m.glb");
    fs::write(&input, model.glb()).unwrap();
    let trip = round_trip(&input, &folder.path().join("out"), 3, striped);
    let primitive = &trip.after["meshes"][0]["primitives"][0];
    assert_eq!(primitive["extensions"], json!({"EXT_other": {"a": 1.5}}));
}

#[test]
fn stale_labels_and_attributes_that_cannot_be_read_do_no_harm() {
    let mut model = meshes::grid();
    let stale = model.floats("SCALAR", &[77.0; VERTICES]);
    model.primitive()["attributes"][SECTION_ATTRIBUTE] = json!(stale);
    model.primitive()["attributes"]["_BROKEN"] = json!(999);
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("m.glb");
    fs::write(&input, model.glb()).unwrap();
    let trip = round_trip(&input, &folder.path().join("striped"), 3, striped);
    assert_eq!(trip.after["meshes"][0]["primitives"][0]["attributes"]["_BROKEN"], json!(999));
    round_trip(&input, &folder.path().join("whole"), 3, |_| 1);
    round_trip(&input, &folder.path().join("one"), 1, |_| 0);
}

/// A section by chance for every run of triangles.
fn by_chance(seed: u64, run: u32, count: u32) -> impl Fn(Origin) -> u32 {
    move |origin| {
        let stripe = u64::from(origin.triangle / run) << 20 | u64::from(origin.primitive) << 10;
        (hash(seed, stripe | u64::from(origin.mesh)) % u64::from(count)) as u32
    }
}

/// The project's own models with labels by chance: every triangle for itself, stripes, whole primitives.
#[test]
fn labels_by_chance_come_back() {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let mut names: Vec<_> = fs::read_dir(models).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.retain(|path| path.extension().is_some_and(|ending| ending == "glb"));
    names.sort();
    assert!(names.len() >= 5, "{names:?}");
    for (i, input) in names.iter().enumerate() {
        let name = input.file_stem().unwrap().to_str().unwrap();
        for (round, run) in [1, 7, 400].into_iter().enumerate() {
            let seed = (100 * i + round) as u64;
            let count = 2 + (hash(seed, 0) % 30) as u32;
            round_trip(input, &for_validator(&format!("{name}-{run}")), count, by_chance(seed, run, count));
        }
    }
}

/// The same with the models of `SHADOWFIT_CORPUS`, those that can be read.
#[test]
fn labels_by_chance_come_back_from_the_corpus() {
    let Some(corpus) = std::env::var_os("SHADOWFIT_CORPUS") else {
        println!("corpus: not run, SHADOWFIT_CORPUS is not set");
        return;
    };
    let (mut open, mut models) = (vec![PathBuf::from(corpus)], Vec::new());
    while let Some(folder) = open.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            match path.extension().and_then(|ending| ending.to_str()) {
                _ if path.is_dir() => open.push(path),
                Some("glb" | "gltf") => models.push(path),
                _ => {}
            }
        }
    }
    models.retain(|path| check_input(path).is_ok() && load(path).is_ok());
    models.sort();
    for (i, input) in models.iter().enumerate() {
        println!("{}", input.display());
        let folder = tempfile::tempdir().unwrap();
        round_trip(input, folder.path(), 9, by_chance(i as u64, 5, 9));
    }
    println!("corpus: {} models", models.len());
    assert!(!models.is_empty());
}
