//! An input is never overwritten, whatever the output is called.

use crate::program::{bake_plate, contents, fit, model, plane_file, planes, run, small_asset};
use std::{fs, path::Path};

/// A copy of a small model in a fresh folder.
fn copied(folder: &Path) -> std::path::PathBuf {
    let input = folder.join("plate.glb");
    fs::copy(model("plate_over_ground"), &input).unwrap();
    input
}

#[test]
fn the_output_folder_may_be_the_inputs_own() {
    let folder = tempfile::tempdir().unwrap();
    let input = copied(folder.path());
    let before = fs::read(&input).unwrap();
    // Twice: the second run finds the first one's files.
    for _ in 0..2 {
        bake_plate(&input, folder.path()).ok();
        assert_eq!(fs::read(&input).unwrap(), before);
        assert_eq!(planes(folder.path(), "plate").planes.len(), 1);
        assert_eq!(contents(folder.path()).len(), 5, "model, sidecar, atlas, report beside the input");
    }
    fit(&folder.path().join("plate.shadow.glb"), folder.path(), &[])
        .refused(3, &["fit the model that it was made from"]);
}

#[cfg(unix)]
#[test]
fn links_do_not_lead_to_the_input() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let input = copied(folder.path());
    let before = fs::read(&input).unwrap();
    let [linked, out] = ["linked", "out"].map(|name| folder.path().join(name));
    symlink(folder.path(), &linked).unwrap();
    bake_plate(&input, &linked).ok();
    assert_eq!(fs::read(&input).unwrap(), before);
    assert_eq!(planes(folder.path(), "plate").planes.len(), 1);
    // Every name that a fit writes, as another name of the input.
    for name in ["plate.shadow.glb", "plate.shadow.json", "plate.atlas-0.png", "plate.report.json"] {
        fs::create_dir(&out).unwrap();
        fs::hard_link(&input, out.join(name)).unwrap();
        bake_plate(&input, &out).refused(2, &[name, "never overwritten"]);
        assert_eq!(contents(&out).into_iter().collect::<Vec<_>>(), [(name.to_owned(), before.clone())]);
        fs::remove_dir_all(&out).unwrap();
    }
}

#[test]
fn a_plane_file_is_an_input_too() {
    let folder = tempfile::tempdir().unwrap();
    let by_hand = plane_file("plate_over_ground");
    for name in ["plate_over_ground.shadow.json", "plate_over_ground.report.json"] {
        let planes = folder.path().join(name);
        fs::copy(&by_hand, &planes).unwrap();
        let outcome = fit(&model("plate_over_ground"), folder.path(), &["--planes", planes.to_str().unwrap()]);
        outcome.refused(2, &[name, "never overwritten"]);
        assert_eq!(fs::read(&planes).unwrap(), fs::read(&by_hand).unwrap());
        fs::remove_file(&planes).unwrap();
        assert_eq!(contents(folder.path()).len(), 0);
    }
}

#[test]
fn a_picture_does_not_replace_the_asset_that_it_shows() {
    let folder = tempfile::tempdir().unwrap();
    let asset = small_asset(folder.path());
    let before = contents(folder.path());
    let path = asset.to_str().unwrap();
    run(&["render", path, "-o", path, "--size", "16"]).refused(2, &[path, "never overwritten"]);
    assert_eq!(contents(folder.path()), before);
}
