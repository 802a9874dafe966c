//! Running the program, and reading what it leaves.

use serde_json::Value;
use shadowfit::asset::{ShadowSet, read};
use std::{
    collections::BTreeMap,
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// The least that a fit can do.
pub const QUICK: [&str; 4] = ["--preset", "fast", "--validate", "none"];

/// How the program ended and what it printed.
#[derive(Debug)]
pub struct Outcome {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Outcome {
    /// Ended well, without a word on stderr.
    #[track_caller]
    pub fn ok(self) -> Self {
        assert_eq!((self.code, self.stderr.as_str()), (Some(0), ""), "{self:?}");
        self
    }

    /// Ended with this code, nothing on stdout, and one message on stderr that has all of `words`.
    #[track_caller]
    pub fn refused(&self, code: i32, words: &[&str]) {
        assert_eq!((self.code, self.stdout.as_str()), (Some(code), ""), "{self:?}");
        assert_eq!(self.stderr.matches("error:").count(), 1, "{self:?}");
        for word in words {
            assert!(self.stderr.contains(word), "no {word:?} in {self:?}");
        }
    }

    /// The one JSON object on stdout.
    #[track_caller]
    pub fn json(&self) -> Value {
        let value: Value = serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self:?}"));
        assert!(value.is_object(), "{self:?}");
        value
    }
}

/// The program, not yet started.
pub fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shadowfit"));
    // Mesa's device selection prints a line otherwise.
    command.env("NODEVICE_SELECT", "1");
    command
}

/// Runs a command to its end.
pub fn outcome(command: &mut Command) -> Outcome {
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Outcome { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Runs the program with these words.
pub fn run(words: &[impl AsRef<OsStr>]) -> Outcome {
    outcome(program().args(words))
}

/// A quick fit that has not started.
pub fn fit_command(model: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = program();
    command.arg("fit").arg(model).arg("-o").arg(out).args(QUICK).args(more);
    command
}

/// A quick fit.
pub fn fit(model: &Path, out: &Path, more: &[&str]) -> Outcome {
    outcome(&mut fit_command(model, out, more))
}

/// A model of the repository.
pub fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("models").join(format!("{name}.glb"))
}

/// A plane file of the repository.
pub fn plane_file(name: &str) -> String {
    model("planes").with_file_name(format!("planes/{name}.planes.json")).to_str().unwrap().to_owned()
}

/// A fit of a copy of the plate over its ground whose planes are given: the quickest that leaves all files.
pub fn bake_plate(model: &Path, out: &Path) -> Outcome {
    fit(model, out, &["--texture-size", "32", "--planes", &plane_file("plate_over_ground")])
}

/// Such an asset in a folder.
pub fn small_asset(folder: &Path) -> PathBuf {
    bake_plate(&model("plate_over_ground"), folder).ok();
    folder.join("plate_over_ground.shadow.glb")
}

/// `STEM.report.json` of a folder.
pub fn report(folder: &Path, stem: &str) -> Value {
    serde_json::from_slice(&fs::read(folder.join(format!("{stem}.report.json"))).unwrap()).unwrap()
}

/// The planes as written for `stem`: the same in the model and in the sidecar.
pub fn planes(folder: &Path, stem: &str) -> ShadowSet {
    let set = read(&folder.join(format!("{stem}.shadow.glb"))).unwrap();
    assert_eq!(read(&folder.join(format!("{stem}.shadow.json"))).unwrap(), set);
    set
}

/// Names and contents of all files of a folder; it must not hold folders.
pub fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let Ok(entries) = fs::read_dir(folder) else { return BTreeMap::new() };
    entries
        .map(|entry| entry.unwrap())
        .map(|entry| (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap()))
        .collect()
}

/// The number behind a JSON pointer.
#[track_caller]
pub fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no number at {pointer} in {value}"))
}
