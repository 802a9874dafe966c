//! Real models, where `SHADOWFIT_CORPUS` names a folder of them with a `MANIFEST.tsv`: columns `file`,
//! `triangles`, `bbox` ([[min],[max]] in model space, to four digits) and `extensions` (`!` marks required ones).
//! Files in `malformed/` must be refused.

use glam::DVec3;
use shadowfit::scene::{Scene, load};
use std::{collections::BTreeSet, fs, path::Path};

/// The manifest's boxes have four digits.
const BOX_TOLERANCE: f64 = 1e-3;

/// The manifest's boxes hold all vertices. In this file no triangle uses the highest ones: of its 98 vertices at
/// node 0, the 18 indices name only some at y = -1. The box of the triangles must still lie inside.
const UNUSED_VERTICES: [&str; 1] = ["negative_scale_12.glb"];

#[test]
fn the_corpus_reads_as_its_manifest_says() {
    let Ok(folder) = std::env::var("SHADOWFIT_CORPUS") else {
        println!("corpus: not run, SHADOWFIT_CORPUS is not set");
        return;
    };
    let folder = Path::new(&folder);
    let manifest = fs::read_to_string(folder.join("MANIFEST.tsv")).unwrap();
    let mut lines = manifest.lines();
    let header: Vec<&str> = lines.next().unwrap().split('\t').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let columns = [column("file"), column("triangles"), column("bbox"), column("extensions")];
    let mut failures = Vec::new();
    let mut listed = BTreeSet::new();
    for line in lines {
        let cells: Vec<&str> = line.split('\t').collect();
        let [file, triangles, bbox, extensions] = columns.map(|i| cells.get(i).copied().unwrap_or_default());
        listed.insert(folder.join(file));
        if let Err(why) = check(&folder.join(file), triangles, bbox, extensions) {
            failures.push(format!("{file}: {why}"));
        }
    }
    let present = models(folder);
    failures.extend(present.difference(&listed).map(|path| format!("{}: not in the manifest", path.display())));
    println!("corpus: {} models, {} failures", listed.len(), failures.len());
    assert!(!listed.is_empty() && failures.is_empty(), "{failures:#?}");
}

/// Compares one model with its line.
fn check(path: &Path, triangles: &str, bbox: &str, extensions: &str) -> Result<(), String> {
    let compressed = extensions.split(',').any(|e| e.ends_with("compression!"));
    let malformed = path.parent().is_some_and(|parent| parent.ends_with("malformed"));
    let result = load(path);
    let scene = match (result, compressed, malformed) {
        (Ok(scene), false, false) => scene,
        (Err(error), true, false) if error.exit_code() == 5 => return Ok(()),
        (Err(error), false, true) if error.exit_code() == 3 => {
            println!("refused as it should be: {error}");
            return Ok(());
        }
        (Ok(_), ..) => return Err("was read, but should be refused".to_owned()),
        (Err(error), ..) => return Err(format!("exit code {}: {error}", error.exit_code())),
    };
    let wanted: usize = triangles.parse().map_err(|error| format!("{triangles:?}: {error}"))?;
    let found = scene.soup.corners_model.len();
    if found != wanted {
        return Err(format!("{found} triangles, not {wanted}; {:?}", scene.skipped));
    }
    let wanted: [[f64; 3]; 2] = serde_json::from_str(bbox).map_err(|error| format!("{bbox:?}: {error}"))?;
    let found = bounds(&scene);
    let size = DVec3::from(wanted[1]).distance(DVec3::from(wanted[0]));
    let wanted = wanted.map(DVec3::from);
    let outside = (wanted[0] - found[0]).max(found[1] - wanted[1]).max_element();
    let inside = (found[0] - wanted[0]).max(wanted[1] - found[1]).max_element();
    let has_unused = path.file_name().is_some_and(|name| UNUSED_VERTICES.iter().any(|unused| name == *unused));
    if outside > BOX_TOLERANCE * size || (inside > BOX_TOLERANCE * size && !has_unused) {
        return Err(format!("the box is {found:?}, not {wanted:?}"));
    }
    consistent(&scene)
}

/// Every list has its length and every index its target.
fn consistent(scene: &Scene) -> Result<(), String> {
    let soup = &scene.soup;
    let lengths = [soup.sides.len(), soup.cutout.len(), soup.cutout_uv.len(), scene.normals.len(), scene.uvs.len()];
    let count = soup.corners_model.len();
    let more = [scene.material_of.len(), scene.origins.len(), scene.section_of.len()];
    if lengths.iter().chain(&more).any(|length| *length != count) {
        return Err(format!("lists of {lengths:?} for {count} triangles"));
    }
    if scene.normals.iter().flatten().any(|normal| (normal.length() - 1.0).abs() > 1e-4) {
        return Err("a normal is not of unit length".to_owned());
    }
    if scene.material_of.iter().any(|i| *i as usize >= scene.materials.len())
        || soup.cutout.iter().flatten().any(|i| *i as usize >= soup.cutouts.len())
        || scene.materials.iter().filter_map(|material| material.image).any(|i| i >= scene.images.len())
    {
        return Err("an index out of range".to_owned());
    }
    Ok(())
}

fn bounds(scene: &Scene) -> [DVec3; 2] {
    let points = scene.soup.corners_model.as_flattened();
    let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    [low, points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max)]
}

/// All `.glb` and `.gltf` files in and below a folder.
fn models(folder: &Path) -> BTreeSet<std::path::PathBuf> {
    let mut found = BTreeSet::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "glb" || e == "gltf") {
                found.insert(path);
            }
        }
    }
    found
}
