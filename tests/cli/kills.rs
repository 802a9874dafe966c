//! A fit that is killed leaves whole files or none.
#![cfg(unix)]

use crate::program::{contents, fit, fit_command, model};
use std::{
    fs,
    path::Path,
    process::{Child, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

const STEM: &str = "plate_over_ground";
const OPTIONS: [&str; 4] = ["--max-planes", "1", "--seed", "5"];

/// When to kill.
#[derive(Clone, Copy, Debug)]
enum Moment {
    /// After this share of an undisturbed run.
    Share(f64),
    /// So long after the first change in the output folder: while files are written and renamed.
    AfterFirstChange(Duration),
}

/// Names in a folder.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Starts a fit, kills it, and says whether it was still running.
fn killed(out: &Path, moment: Moment, run_time: Duration) -> bool {
    let start = Instant::now();
    let before = names(out);
    let mut child: Child =
        fit_command(&model(STEM), out, &OPTIONS).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    match moment {
        Moment::Share(share) => sleep(run_time.mul_f64(share)),
        Moment::AfterFirstChange(delay) => {
            // A minute: forty times what this fit needs.
            while names(out) == before && start.elapsed() < Duration::from_secs(60) {
                sleep(Duration::from_micros(50));
            }
            sleep(delay);
        }
    }
    let running = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    running
}

/// The parts of a report that do not depend on the clock, the machine or the folder.
fn timeless(report: &[u8]) -> serde_json::Value {
    let mut value: serde_json::Value = serde_json::from_slice(report).unwrap();
    let object = value.as_object_mut().unwrap();
    for member in ["time_s", "peak_memory_bytes", "command", "files", "curve"] {
        object.remove(member).unwrap();
    }
    value
}

mod slow {
    use super::*;

    #[test]
    fn every_file_under_its_final_name_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("whole");
        let start = Instant::now();
        fit(&model(STEM), &whole, &OPTIONS).ok();
        let run_time = start.elapsed();
        let whole = contents(&whole);
        let shares = (1..=6).map(|i| Moment::Share(f64::from(i) / 6.5));
        let delays = [0, 100, 300, 1_000, 3_000, 10_000, 30_000, 100_000].map(Duration::from_micros);
        let (mut interrupted, mut files_seen) = (0, 0);
        for (i, moment) in shares.chain(delays.map(Moment::AfterFirstChange)).enumerate() {
            let out = folder.path().join(format!("killed-{i}"));
            fs::create_dir(&out).unwrap();
            // Every other run replaces files that an earlier one left: they are the old or the new ones then.
            let old = format!("{STEM}.shadow.json");
            if i % 2 == 1 {
                fs::write(out.join(&old), b"old").unwrap();
            }
            interrupted += usize::from(killed(&out, moment, run_time));
            for (name, bytes) in contents(&out) {
                if name.starts_with(".shadowfit-") {
                    continue;
                }
                let expected = whole.get(&name).unwrap_or_else(|| panic!("{moment:?} left {name}"));
                let same = if name.ends_with(".report.json") {
                    timeless(&bytes) == timeless(expected)
                } else {
                    bytes == *expected || (name == old && i % 2 == 1 && bytes == b"old")
                };
                assert!(same, "{moment:?} left {} of {} bytes of {name}", bytes.len(), expected.len());
                files_seen += usize::from(bytes != b"old");
            }
        }
        // A kill that always comes too late or too early would test nothing. The first three shares and delays hit a
        // running program even where the machine is twice as fast or slow as it was in the undisturbed run.
        assert!(interrupted >= 6, "{interrupted} runs were killed before their end");
        assert!(files_seen > 0, "no run was killed after its first file");
    }
}
