//! Containers, external files and `data:` URIs.

use super::build::{Model, glb, load_bytes, load_in};
use base64::Engine as _;
use serde_json::json;
use shadowfit::{
    gltf_file::{GltfFile, Invalid},
    scene::{SceneError, load},
};
use std::{fs, path::Path};
use tempfile::TempDir;

/// The triangle as `.gltf` text with that buffer URI.
fn gltf(uri: &str) -> String {
    let mut model = Model::triangle();
    model.json["buffers"][0] = json!({"byteLength": model.bin.len(), "uri": uri});
    model.text()
}

#[test]
fn external_buffers() {
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("bin")).unwrap();
    fs::write(folder.path().join("bin/a b.bin"), Model::triangle().bin).unwrap();
    for uri in ["bin/a b.bin", "bin/a%20b.bin", "./bin/./a%20b.bin", "bin%2Fa b.bin"] {
        let scene = load_in(folder.path(), "model.gltf", gltf(uri).as_bytes()).unwrap();
        assert_eq!(scene.soup.corners_model.len(), 1);
        assert_eq!(external_files(folder.path(), &gltf(uri)).unwrap(), ["bin/a b.bin"]);
    }
    // A bare `%` is what some exporters write.
    fs::write(folder.path().join("100%.bin"), Model::triangle().bin).unwrap();
    load_in(folder.path(), "model.gltf", gltf("100%.bin").as_bytes()).unwrap();
    // An exporter that does not encode: the name itself has an escape in it.
    fs::write(folder.path().join("a%41.bin"), Model::triangle().bin).unwrap();
    load_in(folder.path(), "model.gltf", gltf("a%41.bin").as_bytes()).unwrap();
}

#[test]
fn a_relative_model_path_works() {
    let folder = TempDir::new_in(".").unwrap();
    fs::write(folder.path().join("a.bin"), Model::triangle().bin).unwrap();
    let name = folder.path().file_name().unwrap();
    fs::write(folder.path().join("model.gltf"), gltf("a.bin")).unwrap();
    load(&Path::new(name).join("model.gltf")).unwrap();
}

#[test]
fn data_uris() {
    let bin = Model::triangle().bin;
    let padded = base64::engine::general_purpose::STANDARD.encode(&bin);
    let bare = base64::engine::general_purpose::STANDARD_NO_PAD.encode(&bin);
    let percent: String = bin.iter().map(|byte| format!("%{byte:02x}")).collect();
    for uri in [
        format!("data:application/octet-stream;base64,{padded}"),
        format!("data:;base64,{bare}"),
        format!("DATA:application/gltf-buffer;BASE64,{padded}"),
        format!("data:application/octet-stream,{percent}"),
    ] {
        load_bytes("model.gltf", gltf(&uri).as_bytes()).unwrap();
    }
    assert!(external_files(Path::new("."), &gltf("data:;base64,AAAA")).unwrap().is_empty());
}

/// The files that a document in that folder names.
fn external_files(folder: &Path, text: &str) -> Result<Vec<String>, Invalid> {
    let externals = GltfFile::new(&folder.join("model.gltf"), text.as_bytes())?.externals()?;
    Ok(externals.files.into_iter().map(|(file, _)| file.relative).collect())
}

#[test]
fn external_files_come_once_in_order() {
    let text = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 1, "uri": "b.bin"}, {"byteLength": 1, "uri": "./b.bin"}, {"byteLength": 1}],
        "images": [{"uri": "t/%C3%A4.png"}, {"uri": "data:image/png;base64,"}, {"uri": "a.jpg"}, {"bufferView": 0},
            {"uri": "https://example.org/a.png"}]
    });
    assert_eq!(external_files(Path::new("."), &text.to_string()).unwrap(), ["b.bin", "t/ä.png", "a.jpg"]);
}

#[test]
fn paths_that_leave_the_folder_are_refused() {
    let outside = TempDir::new().unwrap();
    fs::write(outside.path().join("secret.bin"), Model::triangle().bin).unwrap();
    let folder = outside.path().join("inside");
    fs::create_dir(&folder).unwrap();
    let absolute = outside.path().join("secret.bin");
    let absolute = absolute.to_str().unwrap();
    for uri in [
        "../secret.bin",
        "%2e%2e/secret.bin",
        "..%2Fsecret.bin",
        "a/../../secret.bin",
        "..\\secret.bin",
        "c:\\secret.bin",
        "C:/secret.bin",
        "http://example.com/a.bin",
        "file:secret.bin",
        &format!("file://{absolute}"),
        absolute,
        "//server/a.bin",
        "a\u{0}b",
        "a%00b",
        "%ff",
        "",
        ".",
        "./",
    ] {
        let error = load_in(&folder, "model.gltf", gltf(uri).as_bytes()).unwrap_err();
        let SceneError::Invalid { pointer, .. } = &error else { panic!("{uri}: {error}") };
        assert_eq!(pointer, "/buffers/0/uri", "{uri}");
        assert_eq!(external_files(&folder, &gltf(uri)).unwrap_err().pointer, "/buffers/0/uri", "{uri}");
        // An image is decoration, but its path is not.
        let mut model = Model::triangle();
        model.push("images", json!({"uri": uri}));
        let texture = model.push("textures", json!({"source": 0}));
        model.textured(texture, json!({}));
        let error = load_in(&folder, "model.glb", &model.glb()).unwrap_err();
        assert_eq!(error.exit_code(), 3, "{uri}: {error}");
    }
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_are_refused() {
    let outside = TempDir::new().unwrap();
    fs::write(outside.path().join("secret.bin"), Model::triangle().bin).unwrap();
    let folder = outside.path().join("inside");
    fs::create_dir(&folder).unwrap();
    std::os::unix::fs::symlink("../secret.bin", folder.join("a.bin")).unwrap();
    let error = load_in(&folder, "model.gltf", gltf("a.bin").as_bytes()).unwrap_err();
    assert!(error.to_string().contains("link out of the model's folder"), "{error}");
    fs::write(folder.join("b.bin"), Model::triangle().bin).unwrap();
    std::os::unix::fs::symlink("b.bin", folder.join("c.bin")).unwrap();
    load_in(&folder, "model.gltf", gltf("c.bin").as_bytes()).unwrap();
}

#[test]
fn a_model_that_cannot_be_read_is_an_io_error() {
    let folder = TempDir::new().unwrap();
    for path in [folder.path().join("nothing.glb"), folder.path().to_owned()] {
        let error = load(&path).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(path.to_str().unwrap()), "{error}");
    }
}

#[test]
fn the_content_decides_not_the_name() {
    load_bytes("model.gltf", &Model::triangle().glb()).unwrap();
    load_bytes("model", gltf_with_data().as_bytes()).unwrap();
    // A byte order mark, which the specification lets readers ignore.
    load_bytes("model.gltf", format!("\u{feff}{}", gltf_with_data()).as_bytes()).unwrap();
}

fn gltf_with_data() -> String {
    let bin = base64::engine::general_purpose::STANDARD.encode(Model::triangle().bin);
    gltf(&format!("data:;base64,{bin}"))
}

#[test]
fn harmless_oddities_of_a_glb() {
    let model = Model::triangle();
    // Bytes after the length in the header, and an unknown third chunk.
    let mut bytes = model.glb();
    bytes.extend(b"trailing");
    load_bytes("model.glb", &bytes).unwrap();
    let mut bytes = model.glb();
    bytes.extend([4, 0, 0, 0, b'X', b'Y', b'Z', b' ', 1, 2, 3, 4]);
    let length = (bytes.len() as u32).to_le_bytes();
    bytes[8..12].copy_from_slice(&length);
    load_bytes("model.glb", &bytes).unwrap();
    // JSON padded with zeros, and up to three bytes of padding behind the buffer.
    let mut model = model;
    model.json["buffers"][0]["byteLength"] = json!(36);
    model.bin.extend([0; 3]);
    let text = format!("{}\0\0", model.text());
    load_bytes("model.glb", &glb(text.as_bytes(), &model.bin)).unwrap();
    // The same without padding, the chunk's length not a multiple of four.
    let mut bytes = glb(model.text().as_bytes(), &model.bin);
    bytes.pop();
    let length = bytes.len() as u32;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    let at = bytes.len() - 39 - 8;
    bytes[at..at + 4].copy_from_slice(&39_u32.to_le_bytes());
    load_bytes("model.glb", &bytes).unwrap();
}
