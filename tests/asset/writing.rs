//! Files on the disk: external buffers, refusals, nothing left behind.

use crate::fixtures::{Folders, document, glb, open, parse, planes, request, triangle, write_to};
use serde_json::json;
use shadowfit::asset::{AssetError, AssetRequest, check_input, read};
use shadowfit_solver::plane::BakedSet;
use std::fs;

const EXTERNAL: &str = r#""uri":"sub%20folder/m.bin","#;
const IMAGES: &str = r#","images":[{"uri":"./pic.png"},{"uri":"gone.png"},{"uri":"https://example.org/a.png"},
{"uri":"data:image/png;base64,AAAA"}]"#;

#[test]
fn external_files_are_copied_beside_the_output() {
    let folders = Folders::new();
    folders.input("sub folder/m.bin", &triangle());
    folders.input("pic.png", b"a picture");
    let json = document(EXTERNAL, IMAGES);
    for (name, bytes) in [("m.gltf", json.clone().into_bytes()), ("m.glb", glb(&json, None))] {
        let input = folders.input(name, &bytes);
        let planes = planes(4);
        let written = folders.write(&input, &planes).unwrap();
        let out = folders.out();
        assert_eq!(written.copied, [out.join("sub folder/m.bin"), out.join("pic.png")]);
        assert_eq!(written.not_copied, ["gone.png", "https://example.org/a.png"]);
        assert_eq!(fs::read(out.join("sub folder/m.bin")).unwrap(), triangle());
        let (output, bin) = open(&written.model);
        assert_eq!(bin, None);
        let value = parse(&output);
        assert_eq!(value["images"][4], json!({"name":"shadow atlas 0","uri":"m.atlas-0.png"}));
        assert_eq!(value["buffers"], parse(&json)["buffers"]);
        assert_eq!(read(&written.model).unwrap().planes.len(), 4);
    }
    // A second run finds the copies in place; a foreign file is not overwritten.
    fs::write(folders.out().join("pic.png"), b"another picture").unwrap();
    let error = folders.write(&folders.root.path().join("in/m.glb"), &planes(4)).unwrap_err();
    assert!(matches!(error, AssetError::Occupied { .. }), "{error}");
    assert_eq!(error.exit_code(), 2);
    assert_eq!(fs::read(folders.out().join("pic.png")).unwrap(), b"another picture");
}

#[test]
fn only_planes_that_let_light_pass_have_a_tint() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let written = folders.write(&input, &planes(4)).unwrap();
    for path in [&written.model, &written.sidecar] {
        let bytes = fs::read(path).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        assert_eq!(text.matches("\"tint\"").count(), 2, "{}", path.display());
        let tints: Vec<_> = read(path).unwrap().planes.iter().map(|plane| plane.tint).collect();
        assert_eq!(tints, [[255; 3], [255, 0, 51], [128, 200, 254], [255; 3]]);
    }
}

#[test]
fn a_gltf_beside_its_output_keeps_its_files() {
    let folders = Folders::new();
    folders.input("sub folder/m.bin", &triangle());
    let bom = format!("\u{feff}{}", document(EXTERNAL, ""));
    let input = folders.input("m.gltf", bom.as_bytes());
    let written = write_to(&input, input.parent().unwrap(), &planes(2)).unwrap();
    assert_eq!(read(&written.model).unwrap().planes.len(), 2);
    assert_eq!(fs::read(&input).unwrap(), bom.as_bytes());
}

#[test]
fn data_uris_stay_and_names_are_encoded() {
    let folders = Folders::new();
    let uri = r#""uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA","#;
    let input = folders.input("m.gltf", document(uri, "").as_bytes());
    let (set, out) = (BakedSet::one_section(planes(2)), folders.out());
    let request = AssetRequest { stem: "é 100%", ..request(&input, &out, &set) };
    let written = shadowfit::asset::write(&request).unwrap();
    assert_eq!(folders.listing(), ["é 100%.atlas-0.png", "é 100%.shadow.glb", "é 100%.shadow.json"]);
    assert_eq!(read(&written.sidecar).unwrap(), read(&written.model).unwrap());
    for stem in ["", ".", "..", "a/b", "a\\b"] {
        let error = shadowfit::asset::write(&AssetRequest { stem, ..request }).unwrap_err();
        assert!(matches!(error, AssetError::Stem { .. }), "{error}");
    }
}

#[test]
fn files_outside_the_models_folder_are_refused() {
    let folders = Folders::new();
    fs::write(folders.root.path().join("secret.bin"), triangle()).unwrap();
    let absolute = folders.root.path().join("secret.bin").display().to_string();
    for uri in ["../secret.bin", "%2e%2e/secret.bin", "a/../../secret.bin", &absolute, "file:///secret.bin"] {
        let input = folders.input("m.gltf", document(&format!("\"uri\":\"{uri}\","), "").as_bytes());
        let error = folders.write(&input, &planes(1)).unwrap_err();
        assert!(error.to_string().contains("/buffers/0/uri"), "{error}");
        assert_eq!((error.exit_code(), folders.listing().len()), (3, 0));
        assert_eq!(check_input(&input).unwrap_err().to_string(), error.to_string());
    }
    let input = folders.input("m.gltf", document("\"uri\":\"gone.bin\",", "").as_bytes());
    let error = folders.write(&input, &planes(1)).unwrap_err();
    assert!(error.to_string().contains("gone.bin") && error.exit_code() == 2, "{error}");
}

#[cfg(unix)]
#[test]
fn links_out_of_the_models_folder_are_refused() {
    let folders = Folders::new();
    fs::write(folders.root.path().join("secret.bin"), triangle()).unwrap();
    let input = folders.input("m.gltf", document("\"uri\":\"link.bin\",", "").as_bytes());
    std::os::unix::fs::symlink("../secret.bin", input.with_file_name("link.bin")).unwrap();
    assert_eq!(folders.write(&input, &planes(1)).unwrap_err().exit_code(), 3);
}

#[test]
fn the_input_is_never_overwritten() {
    let folders = Folders::new();
    let bytes = glb(&document("", ""), Some(&triangle()));
    let input = folders.input("m.shadow.glb", &bytes);
    let here = input.parent().unwrap();
    let refused = |input: &std::path::Path, out: &std::path::Path| {
        let error = write_to(input, out, &planes(2)).unwrap_err();
        assert!(matches!(error, AssetError::OverwritesInput { .. }), "{error}");
        assert_eq!(error.exit_code(), 2);
        assert_eq!(fs::read(folders.root.path().join("in/m.shadow.glb")).unwrap(), bytes);
        assert!(!out.join("m.atlas-0.png").exists());
    };
    refused(&input, here);
    refused(&input, &here.join("."));
    refused(&input, &here.join("../in"));
    #[cfg(unix)]
    {
        fs::create_dir(folders.out()).unwrap();
        let output = folders.out().join("m.shadow.glb");
        std::os::unix::fs::symlink(&input, &output).unwrap();
        refused(&input, &folders.out());
        fs::remove_file(&output).unwrap();
        fs::hard_link(&input, &output).unwrap();
        refused(&input, &folders.out());
        let alias = here.join("alias.glb");
        std::os::unix::fs::symlink(&input, &alias).unwrap();
        refused(&alias, here);
    }
    // An image of the model under the name of our atlas.
    folders.input("m.atlas-0.png", b"a picture");
    let gltf = folders.input("m.gltf", document("", ",\"images\":[{\"uri\":\"m.atlas-0.png\"}]").as_bytes());
    for out in [here.to_path_buf(), folders.root.path().join("elsewhere")] {
        let error = write_to(&gltf, &out, &planes(2)).unwrap_err();
        assert!(matches!(error, AssetError::OverwritesInput { .. }), "{error}");
    }
    assert_eq!(fs::read(here.join("m.atlas-0.png")).unwrap(), b"a picture");
}

#[test]
fn a_failed_write_leaves_nothing() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    // A file where the folder should be.
    let blocked = folders.input("file", b"").join("deeper/out");
    let error = write_to(&input, &blocked, &planes(2)).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    // A folder in the place of the last file: the earlier ones and their temporary names are gone.
    fs::create_dir_all(folders.out().join("m.shadow.glb")).unwrap();
    let error = folders.write(&input, &planes(2)).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    assert_eq!(folders.listing(), ["m.shadow.glb"]);
    // A folder that was made for the output goes too.
    let json = document("", ",\"images\":[{\"uri\":\"m.shadow.json/a.png\"}]");
    folders.input("m.shadow.json/a.png", b"a picture");
    let fresh = folders.root.path().join("fresh/deep");
    let error = write_to(&folders.input("n.glb", &glb(&json, Some(&triangle()))), &fresh, &planes(2)).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    assert!(!folders.root.path().join("fresh").exists());
}

#[cfg(unix)]
#[test]
fn files_have_the_permissions_of_new_files() {
    use std::os::unix::fs::PermissionsExt;
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let written = folders.write(&input, &planes(1)).unwrap();
    let mode = |path: &std::path::Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&written.model), mode(&input));
}

#[test]
fn a_fitted_model_is_refused_with_a_remedy() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let written = folders.write(&input, &planes(1)).unwrap();
    let error = check_input(&written.model).unwrap_err();
    assert!(error.to_string().contains("/extensions/SHADOWFIT_node_shadow_planes"), "{error}");
    assert!(error.to_string().contains("fit the model that it was made from"), "{error}");
    assert_eq!(error.exit_code(), 3);
    check_input(&input).unwrap();
}

#[test]
fn outputs_for_the_khronos_validator() {
    // `tests/khronos/validate.mjs` is run on these files by the test script.
    let folders = Folders::new();
    folders.input("sub folder/m.bin", &triangle());
    let embedded = folders.input("embedded.glb", &glb(&document("", ""), Some(&triangle())));
    let external = folders.input("external.gltf", document(EXTERNAL, "").as_bytes());
    let out = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("khronos");
    for (input, name, count) in [(&embedded, "embedded", 11), (&embedded, "empty", 0), (&external, "external", 4)] {
        write_to(input, &out.join(name), &planes(count)).unwrap();
    }
}
