//! The same input and seed give the same bytes at any thread count; another seed gives others.

use crate::program::{contents, fit, model};
use serde_json::Value;
use std::{collections::BTreeMap, path::Path};

/// Members of the report that name the clock, the machine, or this very command.
const OF_THE_RUN: [&str; 4] = ["time_s", "peak_memory_bytes", "command", "files"];

fn fitted(out: &Path, more: &[&str]) -> BTreeMap<String, Vec<u8>> {
    fit(&model("t_shape"), out, &[&["--texture-size", "64", "--max-planes", "2"], more].concat()).ok();
    contents(out)
}

/// The report without what depends on the run.
fn timeless(files: &BTreeMap<String, Vec<u8>>) -> Value {
    let mut report: Value = serde_json::from_slice(&files["t_shape.report.json"]).unwrap();
    for member in OF_THE_RUN {
        report.as_object_mut().unwrap().remove(member).unwrap();
    }
    for point in report["curve"].as_array_mut().unwrap() {
        point.as_object_mut().unwrap().remove("seconds").unwrap();
    }
    report
}

#[test]
fn one_seed_gives_the_same_bytes_with_one_thread_and_with_two() {
    let folder = tempfile::tempdir().unwrap();
    let [one, two, other] =
        [&["--threads", "1", "--seed", "3"][..], &["--threads", "2", "--seed", "3"], &["--seed", "4"]]
            .map(|more| fitted(&folder.path().join(more.join("")), more));
    assert_eq!(one.keys().collect::<Vec<_>>(), two.keys().collect::<Vec<_>>());
    assert_eq!(one.len(), 4);
    for name in one.keys().filter(|name| !name.ends_with(".report.json")) {
        assert!(one[name] == two[name], "{name} depends on the number of threads");
        assert!(one[name] != other[name], "{name} does not depend on the seed");
    }
    assert_eq!(timeless(&one), timeless(&two));
    assert_ne!(timeless(&one)["held_out"], timeless(&other)["held_out"]);
}
