//! Files with one thing wrong: each is refused with the place.

use crate::fixtures::{Folders, active_set, document, glb, open, parse, planes, request, triangle};
use glam::Vec3;
use serde_json::{Value, json};
use shadowfit::asset::{AssetError, check_input, read, read_plane_file, write};
use shadowfit_solver::plane::{BakedSet, Encoding, Side};

const SET: &str = "/extensions/SHADOWFIT_node_shadow_planes/sets/0";

/// (where, new value or null for "take it out", pointer or words of the complaint)
fn faults() -> Vec<(&'static str, Value, &'static str)> {
    vec![
        ("planes/0/origin", json!([0, 1]), "planes/0/origin"),
        ("planes/0/origin", json!([0, 1, "2"]), "planes/0/origin"),
        ("planes/1/uAxis", json!([0, 0, 0]), "planes/1/vAxis: parallel"),
        ("planes/1/vAxis", Value::Null, "planes/1: the member \"vAxis\" is missing"),
        ("planes/1/occluderTexture", json!({"index": 7}), "planes/1/occluderTexture/index: index 7 is out of range"),
        ("planes/1/occluderTexture", json!({}), "planes/1/occluderTexture: the member \"index\" is missing"),
        ("planes/1/region", json!([0, 0, 5000, 3]), "planes/1/region: not inside the texture"),
        ("planes/1/region", json!([4294967295_u32, 0, 3, 3]), "planes/1/region: not inside the texture"),
        ("planes/1/region", json!([-1, 0, 3, 3]), "planes/1/region"),
        ("planes/1/region", json!([0, 0, 2, 3]), "planes/1/region: the texture is 2 x 3"),
        ("planes/1/channel", json!("a"), "planes/1/channel: unknown variant `a`"),
        ("planes/1/encoding", json!("msdf"), "planes/1/encoding: unknown variant `msdf`"),
        ("planes/1/side", json!("left"), "planes/1/side: unknown variant `left`"),
        ("planes/1/bias", json!(-1), "planes/1/bias"),
        ("planes/1/tint", json!([0.2, 0.5]), "planes/1/tint"),
        ("planes/1/tint", json!([0, 1.01, 1]), "planes/1/tint: not three shares from 0 to 1"),
        ("planes/0/tint", json!([-0.1, 0, 1]), "planes/0/tint: not three shares from 0 to 1"),
        ("planes", json!({}), "planes: not an array"),
        ("sections/0/1", json!(3), "sections/0/1: index 3 is out of range, there are 3"),
        ("sections/0/1", json!(-1), "sections/0/1"),
        ("sections", json!([]), "sections: one section is needed"),
        ("sections", json!(7), "sections: not an array"),
        ("sections/0", json!({}), "sections/0: not an array"),
        ("planes/0/region", json!([0, 0, 3, 3]), "planes/0/region: the outermost ring"),
        ("active", json!([]), "active: not an object"),
        ("active/lists", Value::Null, "active: the member \"lists\" is missing"),
        ("active/directions", json!([]), "active/directions: one direction is needed"),
        ("active/directions/1", json!([0, 0]), "active/directions/1"),
        ("active/directions/1", json!([0, 0, 0]), "active/directions/1: of length 0, not 1"),
        ("active/directions/1", json!([0, 1.01, 0]), "active/directions/1: of length 1.01, not 1"),
        ("active/directions", json!([[0, 1, 0]]), "active/lists: 2 lists for 1 directions"),
        ("active/lists/1", json!([[1], [1]]), "active/lists/1: 2 lists for 1 sections"),
        ("active/lists/0/0/1", json!(3), "active/lists/0/0/1: plane 3 is not in the list of section 0"),
        ("active/lists/0/0/1", json!(-3), "active/lists/0/0/1"),
        ("active/lists/0/0", json!(3), "active/lists/0/0: not an array"),
        ("bounds/min", json!([9, 9, 9]), "bounds: min is above max"),
        ("bounds", Value::Null, "the member \"bounds\" is missing"),
    ]
}

/// Sets or removes one member of a document.
fn change(document: &mut Value, pointer: &str, value: &Value) {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = document.pointer_mut(parent).unwrap();
    match (parent, value) {
        (Value::Object(object), Value::Null) => drop(object.remove(key)),
        (Value::Array(array), value) => array[key.parse::<usize>().unwrap()] = value.clone(),
        (parent, value) => parent[key] = value.clone(),
    }
}

fn refusal(path: &std::path::Path, expected: &str) {
    let error = read(path).unwrap_err();
    assert!(error.to_string().contains(expected), "{error}\nshould contain {expected}");
    assert_eq!(error.exit_code(), 3, "{error}");
}

#[test]
fn broken_extensions_name_the_place() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let (set, out) = (active_set(planes(3)), folders.out());
    let written = write(&request(&input, &out, &set)).unwrap();
    let (json, bin) = open(&written.model);
    for (place, value, expected) in faults() {
        let mut broken = parse(&json);
        change(&mut broken, &format!("{SET}/{place}"), &value);
        let path = folders.input("broken.glb", &glb(&broken.to_string(), bin.as_deref()));
        refusal(&path, expected);
        // The whole pointer, not only its end.
        refusal(&path, SET);
    }
    let more = [
        ("/nodes/1/extensions/SHADOWFIT_node_shadow_planes/set", json!(1), "set: index 1 is out of range"),
        ("/nodes/1/extensions", Value::Null, "0 nodes carry"),
        ("/nodes/1/scale", json!([1, 0, 1]), "/nodes/1: the node's transform has no inverse"),
        ("/nodes/1/children", json!([1]), "/nodes/1: is its own ancestor"),
        ("/nodes/1/children", json!([9]), "/nodes/1/children/0: 9, but /nodes has 2 elements"),
        ("/textures/0/source", json!(5), "/textures/0/source: index 5"),
        ("/images/0/bufferView", json!(0), "cannot decode the texture"),
        ("/bufferViews/1/byteLength", json!(1e9 as u64), "/bufferViews/1: not inside its buffer"),
        ("/bufferViews/1/byteOffset", json!(u64::MAX), "/bufferViews/1: not inside its buffer"),
        ("/extensions", Value::Null, "\"extensions\" is missing"),
    ];
    for (pointer, value, expected) in more {
        let mut broken = parse(&json);
        change(&mut broken, pointer, &value);
        refusal(&folders.input("broken.glb", &glb(&broken.to_string(), bin.as_deref())), expected);
    }
    let infinite = json.replacen("\"origin\":[", "\"origin\":[1e999,", 1);
    refusal(&folders.input("broken.glb", &glb(&infinite, bin.as_deref())), "number out of range");
}

#[test]
fn broken_sidecars_name_the_place() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let written = folders.write(&input, &planes(3)).unwrap();
    let json = std::fs::read_to_string(&written.sidecar).unwrap();
    let cases = [
        ("/sets/0/planes/2/occluderTexture/uri", json!("../m.atlas-0.png"), "/sets/0/planes/2/occluderTexture/uri"),
        ("/sets/0/planes/2/occluderTexture/uri", json!("data:,x"), "cannot decode the texture"),
        ("/sets/0/planes/2/occluderTexture/uri", json!("data:;base64,@"), "base64"),
        ("/sets/0/planes/0/side", json!("up"), "/sets/0/planes/0/side"),
        ("/sets", json!([]), "/sets: one set expected, found 0"),
    ];
    for (pointer, value, expected) in cases {
        let mut broken = parse(&json);
        change(&mut broken, pointer, &value);
        let path = folders.out().join("broken.json");
        std::fs::write(&path, broken.to_string()).unwrap();
        refusal(&path, expected);
    }
    std::fs::remove_file(folders.out().join("m.atlas-0.png")).unwrap();
    let error = read(&written.sidecar).unwrap_err();
    assert!(matches!(error, AssetError::Io { .. }) && error.to_string().contains("m.atlas-0.png"), "{error}");
    assert_eq!(read(&folders.out().join("gone.json")).unwrap_err().exit_code(), 2);
}

#[test]
fn inputs_that_are_no_models_are_refused() {
    let folders = Folders::new();
    let good = glb(&document("", ""), Some(&triangle()));
    let twice = document("", "").replace("\"scene\":0", "\"nodes\":[]");
    let cases: [(&[u8], &str); 7] = [
        (b"", "not JSON"),
        (b"\xff\xfe", "neither GLB nor UTF-8"),
        (&good[..good.len() - 4], "header says"),
        (b"{\"asset\":{\"version\":\"1.0\"}}", "/asset/version: not glTF 2.0"),
        (b"{\"asset\":{\"version\":\"2.0\"},\"nodes\":{}}", "/nodes"),
        (b"{\"asset\":{\"version\":\"2.0\"},\"scenes\":[{}],\"scene\":1}", "/scene: not one of the 1 scenes"),
        (twice.as_bytes(), "appears twice"),
    ];
    for (bytes, expected) in cases {
        let input = folders.input("m.glb", bytes);
        let error = folders.write(&input, &planes(1)).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}\nshould contain {expected}");
        assert_eq!((error.exit_code(), folders.listing().len()), (3, 0));
        assert!(check_input(&input).is_err());
    }
}

#[test]
fn planes_that_no_file_can_hold_are_refused() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let mut bad = planes(2);
    bad[1].plane.v = bad[1].plane.u * 2.0;
    let error = folders.write(&input, &bad).unwrap_err();
    assert!(error.to_string().contains("shadow plane 1: vAxis: parallel"), "{error}");
    let mut bad = planes(2);
    bad[0].plane.origin.x = f32::NAN;
    let error = folders.write(&input, &bad).unwrap_err();
    assert_eq!((error.to_string().as_str(), error.exit_code()), ("shadow plane 0: origin: not a finite number", 4));
    assert!(folders.listing().is_empty());
}

#[test]
fn lists_that_no_file_can_hold_are_refused() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let refused = |change: &dyn Fn(&mut BakedSet), expected: &str| {
        let (mut set, out) = (active_set(planes(3)), folders.out());
        change(&mut set);
        let error = write(&request(&input, &out, &set)).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}\nshould contain {expected}");
        assert_eq!((error.exit_code(), folders.listing().len()), (4, 0));
    };
    refused(&|set| set.sections.clear(), "sections: there is none");
    refused(&|set| set.sections[0].push(3), "plane 3 in a list, but there are 3");
    refused(&|set| set.active.as_mut().unwrap().directions.truncate(1), "1 directions with 2 lists");
    refused(&|set| set.active.as_mut().unwrap().directions[0] = Vec3::ONE, "not of length 1");
    refused(&|set| set.active.as_mut().unwrap().lists[1].clear(), "0 active lists for 1 sections");
    refused(&|set| set.sections[0].truncate(2), "a plane that the section has not");
    // The border of a distance field must not block.
    refused(&|set| set.planes[1].texture.texels[0] = 1, "shadow plane 1: the outermost ring");
    let field = |texel: u8| {
        let mut set = active_set(planes(3));
        set.planes[1].texture.encoding = Encoding::Sdf;
        set.planes[1].texture.texels[0] = texel;
        write(&request(&input, &folders.out(), &set))
    };
    assert!(field(128).unwrap_err().to_string().contains("shadow plane 1: the outermost ring"));
    let back = read(&field(127).unwrap().sidecar).unwrap();
    assert_eq!((back.planes[1].texture.encoding, back.planes[1].texture.texels[0]), (Encoding::Sdf, 127));
}

#[test]
fn plane_files_are_checked_word_by_word() {
    let folders = Folders::new();
    let good = r#"{"comment":"by hand","planes":[
        {"name":"wing","origin":[0,1,2],"uAxis":[1e5,0,0],"vAxis":[0,1,0],"side":"front"},
        {"origin":[0.1,0,0],"uAxis":[1,0,0],"vAxis":[0,0,1]}]}"#;
    let planes = read_plane_file(&folders.input("planes.json", good.as_bytes())).unwrap();
    assert_eq!((planes[0].name.as_deref(), planes[0].side), (Some("wing"), Side::Front));
    assert_eq!((planes[1].name.as_deref(), planes[1].side), (None, Side::Both));
    assert_eq!(planes[1].rectangle.origin.x, 0.1);
    let cases = [
        ("\"name\"", "\"label\"", "/planes/0: unknown field `label`"),
        ("\"comment\"", "\"note\"", "unknown field `note`"),
        ("\"front\"", "\"up\"", "/planes/0: unknown variant `up`"),
        ("[1,0,0]", "[0,0,3]", "/planes/1/vAxis: parallel"),
        ("[1,0,0]", "[1,0]", "/planes/1"),
        ("\"planes\"", "\"sets\"", "unknown field `sets`"),
        ("[1e5,0,0]", "[1e999,0,0]", "number out of range"),
    ];
    let many = vec![r#"{"origin":[0,0,0],"uAxis":[1,0,0],"vAxis":[0,0,1]}"#; 256].join(",");
    let error =
        read_plane_file(&folders.input("many.json", format!(r#"{{"planes":[{many}]}}"#).as_bytes())).unwrap_err();
    assert!(error.to_string().contains("256 planes; 255 at most"), "{error}");
    for (from, to, expected) in cases {
        let path = folders.input("planes.json", good.replacen(from, to, 1).as_bytes());
        let error = read_plane_file(&path).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}\nshould contain {expected}");
        assert_eq!(error.exit_code(), 3);
    }
}
