//! What is printed: help, table, report.

use crate::program::{bake_plate, fit, model, number, report, run};
use serde_json::Value;
use std::{collections::BTreeSet, path::Path};

/// Kinds of JSON values, as the report's contract names them.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Text,
    Whole,
    /// A share: 0 and up.
    Share,
    Seconds,
    Texts,
    UnitVector,
    Null,
}

use Kind::{Null, Seconds, Share, Text, Texts, UnitVector, Whole};

/// Members of the report of a `fit --validate none`, but for those of `image` and of list entries.
const MEMBERS: [(&str, Kind); 46] = [
    ("/schema", Text),
    ("/version", Text),
    ("/model", Text),
    ("/triangles", Whole),
    ("/seed", Whole),
    ("/light_domain", Text),
    ("/planes", Whole),
    ("/sections", Whole),
    ("/lookups/mean", Share),
    ("/lookups/max", Whole),
    ("/texture_bytes", Whole),
    ("/held_out/shadow_error", Share),
    ("/held_out/light_error", Share),
    ("/held_out/missed", Share),
    ("/held_out/false", Share),
    ("/held_out/worst_light/max", Share),
    ("/held_out/worst_light/p95", Share),
    ("/held_out/worst_light/direction", UnitVector),
    ("/held_out/receivers", Whole),
    ("/held_out/lights", Whole),
    ("/training/shadow_error", Share),
    ("/training/light_error", Share),
    ("/training/missed", Share),
    ("/training/false", Share),
    ("/training/worst_light/max", Share),
    ("/training/worst_light/p95", Share),
    ("/training/worst_light/direction", UnitVector),
    ("/training/receivers", Whole),
    ("/training/lights", Whole),
    ("/image", Null),
    ("/certificate", Null),
    ("/time_s/load", Seconds),
    ("/time_s/bvh", Seconds),
    ("/time_s/receivers", Seconds),
    ("/time_s/reference", Seconds),
    ("/time_s/search", Seconds),
    ("/time_s/bake", Seconds),
    ("/time_s/write", Seconds),
    ("/time_s/validate", Seconds),
    ("/time_s/total", Seconds),
    ("/peak_memory_bytes", Whole),
    ("/skipped", Texts),
    ("/command", Text),
    ("/files", Texts),
    ("/curve/1/seconds", Seconds),
    ("/curve/1/texture_bytes", Whole),
];

fn is(value: &Value, kind: Kind) -> bool {
    let number = value.as_f64().unwrap_or(f64::NAN);
    match kind {
        Text => value.as_str().is_some_and(|text| !text.is_empty()),
        Whole => value.is_u64(),
        // A share of the shadow's energy can exceed 1; ten times it is noise.
        Share => (0.0..10.0).contains(&number),
        // An hour: some unit other than seconds.
        Seconds => (0.0..3600.0).contains(&number),
        Texts => value.as_array().is_some_and(|list| list.iter().all(Value::is_string)),
        UnitVector => {
            let numbers: Vec<f64> = value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
            numbers.len() == 3 && (numbers.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-5
        }
        Null => value.is_null(),
    }
}

/// Missed and false shadow are all the error there is.
fn assert_adds_up(errors: &Value) {
    let [error, missed, false_] = ["/shadow_error", "/missed", "/false"].map(|pointer| number(errors, pointer));
    // A rounding of f64.
    assert!((error - missed - false_).abs() < 1e-12, "{errors}");
}

#[test]
fn help_and_version_are_answers() {
    for (words, expected) in [
        (&["--help"][..], &["Usage:", "fit", "render"][..]),
        (&["-h"], &["Usage:"]),
        (
            &["fit", "--help"],
            &[
                "--max-planes",
                "--max-lookups",
                "--sections",
                "--texture-budget",
                "--max-error",
                "--planes",
                "--validate",
                "--json",
            ],
        ),
        (&["render", "--help"], &["--light", "--view", "--size", "--mode"]),
        (&["--version"], &[env!("CARGO_PKG_VERSION")]),
    ] {
        let outcome = run(words).ok();
        for word in expected {
            assert!(outcome.stdout.contains(word), "no {word:?} in {outcome:?}");
        }
    }
}

#[test]
fn json_is_one_object_that_keeps_the_contract() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = fit(&model("plate_over_ground"), folder.path(), &["--json", "--seed", "7"]).ok();
    let printed = outcome.json();
    let wrong: Vec<_> = MEMBERS
        .iter()
        .filter(|(pointer, kind)| !printed.pointer(pointer).is_some_and(|value| is(value, *kind)))
        .map(|(pointer, kind)| format!("{pointer}: {:?} is no {kind:?}", printed.pointer(pointer)))
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(printed["schema"], "shadowfit.report/1");
    assert_eq!((&printed["triangles"], &printed["seed"]), (&Value::from(4), &Value::from(7)));
    assert!(printed["command"].as_str().unwrap().contains("--seed 7"));
    for errors in [&printed["held_out"], &printed["training"]] {
        assert_adds_up(errors);
    }
    for count in ["receivers", "lights"] {
        assert_ne!(printed["held_out"][count], printed["training"][count], "held out in name only");
    }
    // The stages are disjoint parts of the whole.
    let times = printed["time_s"].as_object().unwrap();
    let stages: f64 = times.iter().filter(|(name, _)| *name != "total").map(|(_, time)| time.as_f64().unwrap()).sum();
    assert!(stages <= number(&printed, "/time_s/total") * 1.001, "{times:?}");
    assert_eq!(printed, report(folder.path(), "plate_over_ground"), "the file says the same");
}

#[test]
fn the_curve_ends_with_the_result() {
    let folder = tempfile::tempdir().unwrap();
    for more in [&["--max-planes", "4"][..], &["--sections", "4", "--max-lookups", "2"]] {
        let whole = more[0] == "--max-planes";
        let words = [&["--json", "--texture-size", "32"], more].concat();
        let printed = fit(&model("t_shape"), folder.path(), &words).ok().json();
        let curve = printed["curve"].as_array().unwrap();
        let planes = number(&printed, "/planes");
        assert!(planes >= 1.0);
        let counts: Vec<f64> = curve.iter().map(|point| number(point, "/planes")).collect();
        if whole {
            assert_eq!(counts, (0..=planes as usize).map(|k| k as f64).collect::<Vec<_>>());
        }
        assert_eq!(number(&curve[0], "/shadow_error"), 1.0, "no planes are as good as no shadow");
        let last = curve.last().unwrap();
        for member in ["shadow_error", "missed", "false"] {
            assert_eq!(last[member], printed["held_out"][member]);
        }
        assert_eq!(counts.last(), Some(&planes));
        for pair in curve.windows(2) {
            // A whole model has more planes from point to point, a divided one more bytes.
            let rises = if whole { "/seconds" } else { "/texture_bytes" };
            assert!(number(&pair[0], rises) <= number(&pair[1], rises), "{curve:?}");
            assert_adds_up(&pair[1]);
        }
    }
}

#[test]
fn the_table_names_what_matters_and_the_files_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = fit(&model("plate_over_ground"), folder.path(), &["--validate", "short"]);
    // The option stands twice: clap must say so rather than take one of them.
    outcome.refused(1, &["--validate"]);
    let outcome = bake_plate(&model("plate_over_ground"), folder.path()).ok();
    for word in ["planes", "lookups", "shadow_error", "missed", "false", "worst light", "texture", "seconds", "files"] {
        assert!(outcome.stdout.contains(word), "no {word:?} in {outcome:?}");
    }
    let report = report(folder.path(), "plate_over_ground");
    let listed: BTreeSet<&Path> =
        report["files"].as_array().unwrap().iter().map(|f| Path::new(f.as_str().unwrap())).collect();
    let entries = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    assert_eq!(entries.iter().map(|path| path.as_path()).collect::<BTreeSet<_>>(), listed);
    assert_eq!(listed.len(), 4, "model, sidecar, atlas, report");
    for file in listed {
        assert!(outcome.stdout.contains(file.to_str().unwrap()), "{file:?} is not in {outcome:?}");
    }
}

#[test]
fn a_convex_model_is_told_to_have_no_self_shadow() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["box", "sphere"] {
        let outcome = fit(&model(name), folder.path(), &[]).ok();
        assert!(outcome.stdout.contains("no self-shadow"), "{outcome:?}");
        let report = report(folder.path(), name);
        for (pointer, expected) in [("/planes", 0.0), ("/held_out/shadow_error", 0.0), ("/texture_bytes", 0.0)] {
            assert_eq!(number(&report, pointer), expected, "{name}: {pointer}");
        }
    }
}

#[test]
fn a_validated_fit_compares_frames() {
    let folder = tempfile::tempdir().unwrap();
    let [out, model] =
        [folder.path().to_str().unwrap(), model("plate_over_ground").to_str().unwrap()].map(str::to_owned);
    let outcome = run(&["fit", &model, "-o", &out, "--preset", "fast", "--texture-size", "64", "--json"]).ok();
    let report = outcome.json();
    let image = &report["image"];
    assert!(image["renderer"].as_str().unwrap().starts_with("wgpu:"), "{image}");
    let [error, missed, false_] = ["/mask_error", "/missed", "/false"].map(|pointer| number(image, pointer));
    assert!((error - missed - false_).abs() < 1e-12, "{image}");
    // One plane answers this model (under its worst light, a grazing one, `fast` misses 0.021 of the picture); frames
    // of a wrong scale, side or light would be wrong in every pixel of the shadow, 5 to 20 % of the picture.
    assert!(error < 0.03, "{image}");
    assert_eq!((number(image, "/frames"), number(image, "/size_px")), (8.0, 512.0));
    let flip = &image["flip_mean"];
    // FLIP of unequal pictures is above 0, of such similar ones below 0.1 (one pixel in ten wrong altogether).
    let plausible = flip.as_f64().is_some_and(|flip| flip > 0.0 && flip < 0.1);
    assert!(if cfg!(feature = "flip") { plausible } else { flip.is_null() }, "{image}");
    let picture = image::open(folder.path().join("plate_over_ground.compare.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (3 * 512, 512));
}
