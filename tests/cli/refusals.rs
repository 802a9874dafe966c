//! What the program refuses, with which exit code, and that it leaves nothing then.

use crate::{
    build::Model,
    program::{contents, fit, model, number, report, run},
};
use serde_json::json;
use std::{fs, path::Path};

#[test]
fn usage_errors_end_with_1() {
    let asset = model("box").to_str().unwrap().to_owned();
    let fit =
        |more: &[&str]| ["fit", &asset, "-o", "/nonexistent/out"].iter().chain(more).map(|w| (*w).to_owned()).collect();
    let cases: Vec<Vec<String>> = vec![
        vec!["fit".into()],
        vec!["fit".into(), asset.clone()],
        vec!["bake".into()],
        fit(&["--no-such-flag"]),
        fit(&["--max-planes", "-1"]),
        fit(&["--max-planes", "many"]),
        fit(&["--max-error", "0"]),
        fit(&["--max-error", "1.5"]),
        fit(&["--max-error", "nan"]),
        fit(&["--texture-size", "4"]),
        fit(&["--texture-size", "257"]),
        fit(&["--max-lookups", "0"]),
        fit(&["--max-lookups", "65"]),
        fit(&["--max-lookups", "few"]),
        fit(&["--sections", "0"]),
        fit(&["--sections", "1025"]),
        fit(&["--sections", "2.5"]),
        fit(&["--texture-budget", "0"]),
        fit(&["--texture-budget", "-1"]),
        fit(&["--texture-budget", "K"]),
        fit(&["--texture-budget", "1.5M"]),
        fit(&["--texture-budget", "2G"]),
        fit(&["--texture-budget", "99999999999999999999"]),
        fit(&["--texture-budget", "99999999999999999M"]),
        fit(&["--lights", "disc"]),
        fit(&["--lights", "cone:0,0"]),
        fit(&["--lights", "cone:0,0,0"]),
        fit(&["--lights", "cone:0,nan,10"]),
        fit(&["--preset", "lazy"]),
        fit(&["--validate", "maybe"]),
        fit(&["--seed", "-1"]),
        fit(&["--threads", "0"]),
        fit(&["--planes", "a.json", "--max-planes", "3"]),
        fit(&["--planes", "a.json", "--max-error", "0.1"]),
        fit(&["--planes", "a.json", "--sections", "2"]),
        fit(&["--max-error", "0.1", "--sections", "2"]),
        fit(&["--max-error", "0.1", "--max-lookups", "2"]),
        ["render", &asset, "-o", "a.png", "--light", "35"].map(str::to_owned).to_vec(),
        ["render", &asset, "-o", "a.png", "--view", "0,91"].map(str::to_owned).to_vec(),
        ["render", &asset, "-o", "a.png", "--size", "0"].map(str::to_owned).to_vec(),
        ["render", &asset, "-o", "a.png", "--mode", "pretty"].map(str::to_owned).to_vec(),
        ["render", &asset, "-o", "a.png", "--light-radius", "46"].map(str::to_owned).to_vec(),
        ["render", &asset, "-o", "a.png", "--light-radius", "nan"].map(str::to_owned).to_vec(),
    ];
    for words in &cases {
        let outcome = run(words);
        assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(1), ""), "{words:?}: {outcome:?}");
        assert!(outcome.stderr.contains("error:"), "{words:?}: {outcome:?}");
    }
    let outcome = run(&[""; 0]);
    assert!(outcome.code == Some(1) && outcome.stdout.is_empty() && outcome.stderr.contains("Usage:"), "{outcome:?}");
}

#[test]
fn files_that_cannot_be_read_or_written_end_with_2() {
    let folder = tempfile::tempdir().unwrap();
    let [out, file] = ["out", "file"].map(|name| folder.path().join(name));
    fs::write(&file, b"in the way").unwrap();
    fit(Path::new("/nonexistent/a.glb"), &out, &[]).refused(2, &["/nonexistent/a.glb"]);
    fit(folder.path(), &out, &[]).refused(2, &[folder.path().to_str().unwrap()]);
    fit(&model("box"), &out, &["--planes", "/nonexistent/p.json"]).refused(2, &["/nonexistent/p.json"]);
    fit(&model("box"), &file.join("deeper"), &[]).refused(2, &[file.to_str().unwrap()]);
    assert!(!out.exists() && fs::read(&file).unwrap() == b"in the way");
    run(&["render", "/nonexistent/a.glb", "-o", out.to_str().unwrap()]).refused(2, &["/nonexistent/a.glb"]);
}

#[test]
fn invalid_inputs_end_with_3_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let [out, input] = ["out", "input.glb"].map(|name| folder.path().join(name));
    let whole = fs::read(model("t_shape")).unwrap();
    let mut cases: Vec<Vec<u8>> = vec![vec![], b"garbage".to_vec(), vec![0xff; 4096], b"{}".to_vec(), b"glTF".to_vec()];
    // Cut in the header, in the JSON, between the chunks, and in the binary.
    cases.extend([4, 11, 12, 19, 20, 200, whole.len() / 2, whole.len() - 1].map(|length| whole[..length].to_vec()));
    for bytes in cases {
        fs::write(&input, &bytes).unwrap();
        fit(&input, &out, &[]).refused(3, &[input.to_str().unwrap()]);
        assert!(!out.exists(), "{} bytes left something", bytes.len());
    }
    let asset = model("box").to_str().unwrap().to_owned();
    run(&["render", &asset, "-o", out.to_str().unwrap()]).refused(3, &[&asset, "SHADOWFIT_node_shadow_planes"]);
    assert!(!out.exists());
}

#[test]
fn required_extensions_that_are_not_understood_end_with_5() {
    let folder = tempfile::tempdir().unwrap();
    let [out, input] = ["out", "input.glb"].map(|name| folder.path().join(name));
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "ACME_folded_space"] {
        let mut triangle = Model::triangle();
        triangle.json["extensionsUsed"] = json!([name]);
        triangle.json["extensionsRequired"] = json!([name]);
        fs::write(&input, triangle.glb()).unwrap();
        fit(&input, &out, &[]).refused(5, &[name, input.to_str().unwrap(), "npx @gltf-transform/cli copy"]);
        assert!(!out.exists());
    }
}

#[test]
fn a_target_out_of_reach_ends_with_6_and_keeps_what_was_found() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--max-planes", "1", "--max-error", "0.05", "--texture-size", "32"];
    let outcome = fit(&model("t_shape"), folder.path(), &more);
    // Neither the bar alone nor the stem alone shadows half of what there is.
    assert_eq!(outcome.code, Some(6), "{outcome:?}");
    assert!(outcome.stderr.contains("--max-error 0.05") && outcome.stderr.contains("--max-planes"), "{outcome:?}");
    assert!(outcome.stdout.contains("shadow_error") && !outcome.stdout.contains("error:"), "{outcome:?}");
    let report = report(folder.path(), "t_shape");
    assert_eq!((number(&report, "/planes"), number(&report, "/max_error")), (1.0, 0.05));
    assert!(number(&report, "/held_out/shadow_error") > 0.05);
    assert_eq!(contents(folder.path()).len(), 4);
}
