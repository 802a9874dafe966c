//! Files that break the rules: each must be an error that says where, and none may panic, hang or eat memory.

use super::build::{BYTE, FLOAT, Model, UBYTE, UINT, USHORT, glb, load_bytes, load_in};
use serde_json::{Value, json};
use shadowfit::scene::SceneError;
use tempfile::TempDir;

/// A triangle with indices, NORMAL, a texture, a child node, a scene, a sparse accessor and a skin: something
/// of everything that the reader reads.
fn rich() -> Model {
    let mut model = Model::triangle();
    let indices = model.accessor(UBYTE, "SCALAR", 3, &[0, 1, 2]);
    let normal = model.floats("VEC3", &[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    let joints = model.accessor(UBYTE, "VEC4", 3, &[0; 12]);
    let weights = model.floats("VEC4", &[1., 0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0.]);
    let texture = model.texture(&image::RgbaImage::from_pixel(1, 1, image::Rgba([255; 4])));
    model.textured(texture, json!({"alphaMode": "MASK"}));
    let (at, values) = (model.view(&[2]), model.view(&[0; 12]));
    model.json["accessors"][2]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": at, "componentType": UBYTE}, "values": {"bufferView": values}});
    model.primitive()["indices"] = json!(indices);
    model.primitive()["attributes"]["NORMAL"] = json!(normal);
    model.primitive()["attributes"]["JOINTS_0"] = json!(joints);
    model.primitive()["attributes"]["WEIGHTS_0"] = json!(weights);
    model.json["nodes"] = json!([{"children": [1]}, {"mesh": 0, "skin": 0, "rotation": [0, 0, 0, 1]}]);
    model.json["skins"] = json!([{"joints": [0]}]);
    model.json["scenes"] = json!([{"nodes": [0]}]);
    model.json["scene"] = json!(0);
    model
}

/// Name, change of the rich model, wanted pointer, wanted part of the reason.
type Case = (&'static str, fn(&mut Value), &'static str, &'static str);

const REFERENCES: [Case; 18] = [
    ("node cycle", |j| j["nodes"][1]["children"] = json!([0]), "/nodes/0", "cycle"),
    ("node is its own child", |j| j["nodes"] = json!([{"mesh": 0}, {"children": [1]}]), "/nodes/1", "cycle"),
    (
        "two parents",
        |j| j["nodes"] = json!([{"children": [2]}, {"children": [2]}, {"mesh": 0}]),
        "/nodes/1/children/0",
        "already a child of node 0",
    ),
    ("child twice", |j| j["nodes"][0]["children"] = json!([1, 1]), "/nodes/0/children/1", "already"),
    ("child out of range", |j| j["nodes"][0]["children"] = json!([9]), "/nodes/0/children/0", "2 elements"),
    ("scene root is a child", |j| j["scenes"][0]["nodes"] = json!([1]), "/scenes/0/nodes/0", "not a root"),
    ("root twice", |j| j["scenes"][0]["nodes"] = json!([0, 0]), "/scenes/0/nodes/1", "twice"),
    ("root out of range", |j| j["scenes"][0]["nodes"] = json!([7]), "/scenes/0/nodes/0", "2 elements"),
    ("scene out of range", |j| j["scene"] = json!(3), "/scene", "1 elements"),
    ("mesh out of range", |j| j["nodes"][1]["mesh"] = json!(1), "/nodes/1/mesh", "1 elements"),
    ("skin out of range", |j| j["nodes"][1]["skin"] = json!(1), "/nodes/1/skin", "1 elements"),
    ("joint node out of range", |j| j["skins"][0]["joints"] = json!([5]), "/skins/0/joints/0", "2 elements"),
    (
        "material out of range",
        |j| j["meshes"][0]["primitives"][0]["material"] = json!(1),
        "/meshes/0/primitives/0/material",
        "1, but /materials has 1 elements",
    ),
    (
        "texture out of range",
        |j| j["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = json!(4_294_967_296_u64),
        "/materials/0/pbrMetallicRoughness/baseColorTexture/index",
        "1 elements",
    ),
    ("image out of range", |j| j["textures"][0]["source"] = json!(1), "/textures/0/source", "1 elements"),
    ("sampler out of range", |j| j["textures"][0]["sampler"] = json!(1), "/textures/0/sampler", "0 elements"),
    (
        "accessor out of range",
        |j| j["meshes"][0]["primitives"][0]["indices"] = json!(99),
        "/meshes/0/primitives/0/indices",
        "99, but /accessors",
    ),
    ("view out of range", |j| j["accessors"][0]["bufferView"] = json!(99), "/accessors/0/bufferView", "99"),
];

const NUMBERS: [Case; 25] = [
    ("buffer out of range", |j| j["bufferViews"][0]["buffer"] = json!(9), "/bufferViews/0/buffer", "1 elements"),
    ("view too long", |j| j["bufferViews"][0]["byteLength"] = json!(9999), "/bufferViews/0/byteLength", "9999"),
    ("view too late", |j| j["bufferViews"][0]["byteOffset"] = json!(9999), "/bufferViews/0/byteOffset", "9999"),
    ("view overflows", |j| j["bufferViews"][0]["byteOffset"] = json!(u64::MAX), "/bufferViews/0/byteOffset", ""),
    ("buffer too short", |j| j["buffers"][0]["byteLength"] = json!(99999), "/buffers/0/byteLength", "99999"),
    ("stride too small", |j| j["bufferViews"][0]["byteStride"] = json!(4), "/bufferViews/0/byteStride", "12"),
    ("huge stride", |j| j["bufferViews"][0]["byteStride"] = json!(u64::MAX), "/accessors/0/count", "2^64"),
    ("huge count", |j| j["accessors"][0]["count"] = json!(4_294_967_295_u64), "/accessors/0/count", "4294967295"),
    ("largest count", |j| j["accessors"][0]["count"] = json!(u64::MAX), "/accessors/0/count", "2^64"),
    ("count negative", |j| j["accessors"][0]["count"] = json!(-3), "/accessors/0/count", "-3"),
    ("count missing", |j| drop(j["accessors"][0].as_object_mut().unwrap().remove("count")), "/accessors/0", "count"),
    ("offset too large", |j| j["accessors"][0]["byteOffset"] = json!(30), "/accessors/0/byteOffset", "36"),
    ("offset a string", |j| j["accessors"][0]["byteOffset"] = json!("0"), "/accessors/0/byteOffset", "string"),
    ("no such component", |j| j["accessors"][0]["componentType"] = json!(5124), "/accessors/0/componentType", "5124"),
    ("indices signed", |j| j["accessors"][1]["componentType"] = json!(BYTE), "/accessors/1/componentType", "unsigned"),
    ("indices float", |j| j["accessors"][1]["componentType"] = json!(FLOAT), "/accessors/1/componentType", "5126"),
    ("position VEC2", |j| j["accessors"][0]["type"] = json!("VEC2"), "/accessors/0/type", "VEC3"),
    ("type unknown", |j| j["accessors"][0]["type"] = json!("VEC9"), "/accessors/0/type", "VEC9"),
    ("normals too few", |j| j["accessors"][2]["count"] = json!(2), "/accessors/2/sparse/indices", "2 elements"),
    ("weights too few", |j| j["accessors"][4]["count"] = json!(2), "/accessors/4/count", "POSITION has 3"),
    (
        "sparse lies",
        |j| j["accessors"][2]["sparse"]["count"] = json!(4_000_000_000_u64),
        "/accessors/2/sparse/indices",
        "4000000000",
    ),
    (
        "sparse offset",
        |j| j["accessors"][2]["sparse"]["values"]["byteOffset"] = json!(8),
        "/accessors/2/sparse/values/byteOffset",
        "12",
    ),
    ("unknown mode", |j| j["meshes"][0]["primitives"][0]["mode"] = json!(7), "/meshes/0/primitives/0/mode", "7"),
    ("rotation zero", |j| j["nodes"][1]["rotation"] = json!([0, 0, 0, 0]), "/nodes/1/rotation", "no length"),
    ("alpha mode", |j| j["materials"][0]["alphaMode"] = json!("GLASS"), "/materials/0/alphaMode", "GLASS"),
];

const SHAPES: [Case; 9] = [
    (
        "matrix of 15",
        |j| j["nodes"][1]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0]),
        "/nodes/1/matrix",
        "16",
    ),
    (
        "matrix with perspective",
        |j| j["nodes"][0]["matrix"] = json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        "/nodes/0/matrix",
        "last row",
    ),
    (
        "transform overflows",
        |j| {
            j["nodes"][0]["scale"] = json!([1e200, 1, 1]);
            j["nodes"][1]["scale"] = json!([1e200, 1, 1]);
        },
        "/nodes/1",
        "finite",
    ),
    (
        "absurdly far",
        |j| {
            j["nodes"][1].as_object_mut().unwrap().remove("skin");
            j["nodes"][1]["translation"] = json!([0, 1e19, 0]);
        },
        "/nodes/1",
        "vertex 0",
    ),
    ("nodes not a list", |j| j["nodes"] = json!({"0": {}}), "/nodes", "not a list"),
    ("asset missing", |j| drop(j.as_object_mut().unwrap().remove("asset")), "/asset/version", "missing"),
    ("version 1", |j| j["asset"]["version"] = json!("1.0"), "/asset/version", "gltf-pipeline"),
    ("version 3 needed", |j| j["asset"]["minVersion"] = json!("2.1"), "/asset/minVersion", "2.1"),
    (
        "no data for a buffer",
        |j| j["buffers"] = json!([{"byteLength": 0, "uri": "data:,"}]),
        "/buffers/0/byteLength",
        "",
    ),
];

#[test]
fn each_fault_is_named() {
    rich().scene();
    for (name, change, pointer, part) in REFERENCES.iter().chain(&NUMBERS).chain(&SHAPES) {
        let mut model = rich();
        change(&mut model.json);
        match model.load() {
            Err(SceneError::Invalid { pointer: found, reason, path }) => {
                assert_eq!(found, *pointer, "{name}: {reason}");
                assert!(reason.contains(part), "{name}: {reason}");
                assert!(path.ends_with("model.glb"));
            }
            other => panic!("{name}: {other:?}"),
        }
    }
}

#[test]
fn the_text_names_file_place_and_remedy() {
    let mut model = rich();
    model.json["accessors"][0]["byteOffset"] = json!(30);
    let text = model.load().unwrap_err().to_string();
    for part in ["model.glb", "/accessors/0/byteOffset", "66 bytes", "gltf-validator"] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn vertices_that_are_not_numbers() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut model = Model::empty();
        let position = model.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., bad, 0., 7., 7., bad]);
        model.mesh(json!({"POSITION": position}));
        model.push("nodes", json!({"mesh": 0}));
        let error = model.load().unwrap_err();
        let SceneError::Invalid { pointer, reason, .. } = &error else { panic!("{error}") };
        assert_eq!(pointer, "/accessors/0");
        assert!(reason.contains("vertex 2"), "{reason}");
    }
    // A vertex that no triangle uses does not matter; a morph displacement does.
    let mut model = Model::empty();
    let position = model.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0., 7., 7., f32::NAN]);
    model.mesh(json!({"POSITION": position}));
    model.push("nodes", json!({"mesh": 0}));
    let indices = model.accessor(UBYTE, "SCALAR", 3, &[0, 1, 2]);
    model.primitive()["indices"] = json!(indices);
    model.scene();
    let deltas = model.floats("VEC3", &[f32::NAN; 12]);
    model.primitive()["targets"] = json!([{"POSITION": deltas}]);
    model.json["meshes"][0]["weights"] = json!([1]);
    assert!(model.load().unwrap_err().to_string().contains("/accessors/2: vertex 0"));
}

#[test]
fn indices_past_the_vertices() {
    for (component, bytes) in [
        (UBYTE, vec![0, 1, 3]),
        (USHORT, vec![0, 0, 1, 0, 255, 255]),
        (UINT, vec![0, 0, 0, 0, 1, 0, 0, 0, 255, 255, 255, 255]),
    ] {
        let mut model = Model::triangle();
        let indices = model.accessor(component, "SCALAR", 3, &bytes);
        model.primitive()["indices"] = json!(indices);
        let error = model.load().unwrap_err();
        let SceneError::Invalid { pointer, reason, .. } = &error else { panic!("{error}") };
        assert_eq!(pointer, "/accessors/1");
        assert!(reason.contains("at 2, but there are 3 vertices"), "{reason}");
    }
    let mut model = rich();
    let joints = model.accessor(UBYTE, "VEC4", 3, &[1; 12]);
    model.primitive()["attributes"]["JOINTS_0"] = json!(joints);
    assert!(model.load().unwrap_err().to_string().contains("joint 1 at vertex 0"));
}

#[test]
fn sparse_indices_must_ascend_and_fit() {
    for (bytes, part) in [([3_u8, 4], "index 3 at 0"), ([1, 1], "does not ascend"), ([2, 1], "does not ascend")] {
        let mut model = Model::triangle();
        let (indices, values) = (model.view(&bytes), model.view(&[0; 24]));
        model.json["accessors"][0]["sparse"] = json!({"count": 2,
            "indices": {"bufferView": indices, "componentType": UBYTE}, "values": {"bufferView": values}});
        let text = model.load().unwrap_err().to_string();
        assert!(text.contains(part) && text.contains("/accessors/0/sparse/indices"), "{text}");
    }
}

#[test]
fn counts_that_would_eat_memory() {
    // Four billion zeros without a byte of data.
    let mut model = Model::triangle();
    let zeros = json!({"componentType": FLOAT, "type": "VEC3", "count": 4_294_967_295_u64});
    let zeros = model.push("accessors", zeros);
    for mode in [4, 5, 6] {
        model.primitive()["mode"] = json!(mode);
        model.primitive()["attributes"]["POSITION"] = json!(zeros);
        assert!(model.load().unwrap_err().to_string().contains("MAX_TRIANGLES = 10000000"));
    }
    // The same as indices, as copies, and as copies of nothing.
    let mut model = Model::triangle();
    let zeros = model.push("accessors", json!({"componentType": UINT, "type": "SCALAR", "count": u64::MAX}));
    model.primitive()["indices"] = json!(zeros);
    assert!(model.load().unwrap_err().to_string().contains("MAX_TRIANGLES"));
    let mut model = Model::triangle();
    let zeros = model.push("accessors", json!({"componentType": FLOAT, "type": "VEC3", "count": 4_000_000_000_u64}));
    let attributes = json!({"attributes": {"TRANSLATION": zeros}});
    model.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": attributes});
    assert!(model.load().unwrap_err().to_string().contains("MAX_TRIANGLES"));
    model.primitive()["mode"] = json!(0);
    assert!(model.load().unwrap_err().to_string().contains("MAX_DRAWS = 1000000"));
}

#[test]
fn many_nodes_times_many_primitives() {
    let mut model = Model::triangle();
    let primitive = model.primitive().clone();
    model.json["meshes"][0]["primitives"] = json!(vec![primitive; 2000]);
    model.json["nodes"] = json!(vec![json!({"mesh": 0}); 2000]);
    let text = model.load().unwrap_err().to_string();
    assert!(text.contains("MAX_DRAWS") && text.contains("/nodes/500/mesh"), "{text}");
}

#[test]
fn files_without_triangles() {
    for (json, pointer) in [(json!([]), ""), (json!([{"primitives": []}]), "/meshes")] {
        let mut model = Model::triangle();
        model.json["nodes"] = json!([]);
        model.json["meshes"] = json;
        let error = model.load().unwrap_err();
        let SceneError::Invalid { pointer: found, reason, .. } = &error else { panic!("{error}") };
        assert_eq!(found, pointer);
        assert!(reason.contains("no triangles"));
    }
}

#[test]
fn missing_and_damaged_buffers() {
    for (uri, part) in [
        ("nothing.bin", "\"nothing.bin\""),
        ("data:;base64,AA@A", "base64"),
        ("data:;base64", "comma"),
        ("data:application/octet-stream;base64,AAAA", "3"),
    ] {
        let mut model = Model::triangle();
        model.json["buffers"][0] = json!({"byteLength": 36, "uri": uri});
        let error = load_bytes("model.gltf", model.text().as_bytes()).unwrap_err();
        assert_eq!(error.exit_code(), 3);
        assert!(error.to_string().contains(part), "{error}");
    }
    let mut model = Model::triangle();
    model.json["buffers"] = json!([{"byteLength": 36}]);
    let text = load_bytes("model.gltf", model.text().as_bytes()).unwrap_err().to_string();
    assert!(text.contains("/buffers/0") && text.contains("no uri"), "{text}");
}

#[test]
fn required_extensions_that_are_not_known() {
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "VENDOR_thing"] {
        let mut model = Model::triangle();
        model.json["extensionsRequired"] = json!(["KHR_mesh_quantization", name]);
        let error = model.load().unwrap_err();
        assert_eq!(error.exit_code(), 5);
        let text = error.to_string();
        assert!(text.contains(name) && text.contains("npx @gltf-transform/cli copy IN OUT"), "{text}");
        assert!(!text.contains("quantization"), "{text}");
    }
    // Not required, but the only copy of the data.
    let mut model = Model::triangle();
    model.push("accessors", json!({"componentType": FLOAT, "type": "VEC3", "count": 3}));
    model.primitive()["attributes"]["POSITION"] = json!(1);
    model.primitive()["extensions"] = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}});
    assert_eq!(model.load().unwrap_err().exit_code(), 5);
    model.primitive()["attributes"]["POSITION"] = json!(0);
    assert_eq!(model.scene().soup.corners_model.len(), 1);
    let mut model = Model::triangle();
    model.push("buffers", json!({"byteLength": 36, "extensions": {"EXT_meshopt_compression": {"fallback": true}}}));
    model.json["bufferViews"][0]["buffer"] = json!(1);
    model.json["buffers"][0]["byteLength"] = json!(36);
    assert_eq!(model.load().unwrap_err().exit_code(), 5);
}

#[test]
fn broken_containers() {
    let good = Model::triangle().glb();
    let patched = |at: usize, bytes: &[u8]| {
        let mut broken = good.clone();
        broken[at..at + bytes.len()].copy_from_slice(bytes);
        broken
    };
    let mut bad_utf8 = good.clone();
    bad_utf8[30] = 0xff;
    let deep = format!("{{\"asset\": {}", "[".repeat(100_000));
    let cases: [(&str, Vec<u8>, &str); 13] = [
        ("empty.glb", Vec::new(), "does not start with `glTF`"),
        ("empty.gltf", Vec::new(), "not JSON"),
        ("magic.glb", patched(0, b"glTX"), "does not start with `glTF`"),
        ("version.glb", patched(4, &1_u32.to_le_bytes()), "version 1"),
        ("length.glb", patched(8, &u32::MAX.to_le_bytes()), "the header says 4294967295"),
        ("short.glb", patched(8, &20_u32.to_le_bytes()), "chunk 0 says"),
        ("tiny.glb", patched(8, &3_u32.to_le_bytes()), "first chunk is not JSON"),
        ("chunk.glb", patched(12, &u32::MAX.to_le_bytes()), "chunk 0 says 4294967295"),
        ("kind.glb", patched(16, b"NOSJ"), "first chunk is not JSON"),
        ("utf8.glb", bad_utf8, "UTF-8"),
        ("text.gltf", b"hello".to_vec(), "not JSON"),
        ("list.gltf", b"[]".to_vec(), "not an object"),
        ("deep.gltf", deep.into_bytes(), "recursion"),
    ];
    for (name, bytes, part) in cases {
        let error = load_bytes(name, &bytes).unwrap_err();
        assert_eq!(error.exit_code(), 3, "{name}");
        assert!(error.to_string().contains(part) && error.to_string().contains(name), "{error}");
    }
}

#[test]
fn truncated_at_every_byte() {
    let folder = TempDir::new().unwrap();
    let model = rich();
    let good = model.glb();
    for length in 0..good.len() {
        assert_eq!(load_in(folder.path(), "m.glb", &good[..length]).unwrap_err().exit_code(), 3, "{length} bytes");
    }
    // The binary chunk cut short (by whole words: chunks are padded) in a file that is honest about it.
    let text = {
        let mut model = model.clone();
        model.json["buffers"][0]["byteLength"] = json!(model.bin.len());
        model.text()
    };
    for length in (0..model.bin.len()).step_by(4) {
        let cut = glb(text.as_bytes(), &model.bin[..length]);
        assert!(load_in(folder.path(), "m.glb", &cut).is_err(), "{length} bytes of the chunk");
    }
}

/// SplitMix64 (Steele, Lea, Flood, 2014).
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[test]
fn random_damage_never_panics() {
    let folder = TempDir::new().unwrap();
    let good = rich().glb();
    let mut state = 7;
    let mut read = 0;
    for round in 0..2000 {
        let mut bytes = good.clone();
        // One to four bytes; half of the digits become other digits, which keeps the JSON readable.
        for _ in 0..=random(&mut state) % 4 {
            let at = random(&mut state) as usize % bytes.len();
            let is_digit = bytes[at].is_ascii_digit() && round % 2 == 0;
            bytes[at] = if is_digit { b'0' + (random(&mut state) % 10) as u8 } else { random(&mut state) as u8 };
        }
        read += usize::from(load_in(folder.path(), "m.glb", &bytes).is_ok());
    }
    // The test is void if everything fails at the first byte, or nothing fails.
    assert!((50..1900).contains(&read), "{read} of 2000 damaged files were read");
}
