//! Real models, where `SHADOWFIT_CORPUS` names a folder of them: every `.glb` and `.gltf` in and below it goes
//! through a whole fit. `MANIFEST.tsv` there says what must come out: a file in `malformed/` is refused as invalid
//! (or as incomplete), one whose column `extensions` marks a compression as required (`!`) is refused as
//! unsupported, all others are fitted.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

#[allow(dead_code, reason = "each test binary uses its part")]
mod fits;

use shadowfit::effort::Effort;
use std::{
    collections::BTreeMap,
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    time::Instant,
};

/// Exit codes that are right for a model.
fn expected(file: &Path, extensions: &str) -> &'static [u8] {
    if file.starts_with("malformed") {
        &[2, 3]
    } else if extensions.split(',').any(|extension| extension.ends_with("compression!")) {
        &[5]
    } else {
        &[0]
    }
}

/// File and required outcome of every line of the manifest.
fn manifest(folder: &Path) -> BTreeMap<PathBuf, &'static [u8]> {
    let text = fs::read_to_string(folder.join("MANIFEST.tsv")).unwrap();
    let mut lines = text.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let [file, extensions] = ["file", "extensions"].map(|name| header.iter().position(|h| *h == name).unwrap());
    lines
        .map(|cells| {
            let path = PathBuf::from(cells[file]);
            let codes = expected(&path, cells.get(extensions).copied().unwrap_or_default());
            (path, codes)
        })
        .collect()
}

/// All models in and below a folder, relative to it.
fn models(folder: &Path) -> Vec<PathBuf> {
    let (mut found, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(inside) = open.pop() {
        for path in fs::read_dir(inside).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"))
            {
                found.push(path.strip_prefix(folder).unwrap().to_owned());
            }
        }
    }
    found.sort();
    found
}

/// Enough to pass every stage, for models of up to 100,000 triangles.
fn effort() -> Effort {
    let mut least = fits::least();
    (least.whole.trace.pairs, least.whole.search.max_planes) = (200_000, 3);
    (least.divided.trace.pairs, least.divided.search.max_planes, least.divided.sections) = (400_000, 2, 8);
    least
}

/// Fits one model: the exit code and what to say of it.
fn outcome(model: &Path) -> (u8, String) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    match fits::fit(&fits::request(model, &out, effort())) {
        Ok((report, _)) => (0, format!("{} planes, shadow_error {:.3}", report.planes, report.held_out.shadow_error)),
        Err(error) if out.exists() => (error.exit_code(), format!("left {} behind: {error}", out.display())),
        Err(error) => (error.exit_code(), error.to_string()),
    }
}

mod slow {
    use super::*;

    #[test]
    fn every_model_of_the_corpus_is_fitted_or_refused_as_it_should_be() {
        let Some(folder) = std::env::var_os("SHADOWFIT_CORPUS").filter(|folder| !folder.is_empty()) else {
            println!("corpus: not run, SHADOWFIT_CORPUS is not set");
            return;
        };
        let folder = PathBuf::from(folder);
        let (manifest, models) = (manifest(&folder), models(&folder));
        assert!(!models.is_empty(), "no model below {}", folder.display());
        let mut failures = Vec::new();
        for model in &models {
            let start = Instant::now();
            let fitted = catch_unwind(AssertUnwindSafe(|| outcome(&folder.join(model))));
            let seconds = start.elapsed().as_secs_f64();
            let line = match (fitted, manifest.get(model)) {
                (Err(_), _) => Err("panicked".to_owned()),
                (Ok(_), None) => Err("is not in the manifest".to_owned()),
                (Ok((code, text)), Some(codes)) if !codes.contains(&code) || text.starts_with("left") => {
                    Err(format!("exit code {code} instead of {codes:?}: {text}"))
                }
                (Ok((code, text)), _) => Ok(format!("exit code {code}, {text}")),
            };
            match line {
                Ok(line) => println!("{} ({seconds:.1} s): {line}", model.display()),
                Err(line) => failures.push(format!("{} ({seconds:.1} s): {line}", model.display())),
            }
        }
        failures.extend(
            manifest
                .keys()
                .filter(|file| !models.contains(file))
                .map(|file| format!("{}: is in the manifest, but not in the folder", file.display())),
        );
        println!("corpus: {} models, {} failures", models.len(), failures.len());
        assert!(failures.is_empty(), "{failures:#?}");
    }
}
