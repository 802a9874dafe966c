//! Measures the program on its own models and on a folder of further ones, and writes the tracked tables.
//!
//!     cargo build --release --features flip
//!     cargo run --release --features flip --example baseline
//!     cargo run --release --features flip --example baseline -- CORPUS_DIR
//!     cargo run --release --features flip --example baseline -- CORPUS_DIR settings
//!
//! Each case is one run of the release binary beside this example, so that time and memory are its own. The first
//! writes `reports/baseline/models.{csv,md}`: preset balanced; the second `reports/baseline/corpus.{csv,md}`: preset fast;
//! the third `reports/baseline/settings.{csv,md}`: lookups and bytes against error, without frames, with the size of the
//! shadow map that leaves the same error (`shadow_map::equivalent_size`, on held-out pairs of its own).
//! Frames are those of the short validation: the full one takes a minute and more a case without a GPU.

use serde_json::Value;
use shadowfit::scene;
use shadowfit_solver::{
    lights::LightDomain,
    receivers::{ReceiverOptions, sample},
    shadow_map::{EquivalentSize, SIZES, equivalent_size},
    visibility::trace,
};
use std::{
    error::Error,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// One run: what the table calls it, the model, further arguments.
struct Case {
    model: PathBuf,
    name: String,
    arguments: Vec<String>,
}

/// Columns of the tables: title, and where the report has the number.
const COLUMNS: [(&str, &str); 16] = [
    ("triangles", "/triangles"),
    ("sections", "/sections"),
    ("planes", "/planes"),
    ("lookups", "/lookups/mean"),
    ("max_lookups", "/lookups/max"),
    ("shadow_error", "/held_out/shadow_error"),
    ("missed", "/held_out/missed"),
    ("false", "/held_out/false"),
    ("worst_light", "/held_out/worst_light/max"),
    ("training", "/training/shadow_error"),
    ("mask_error", "/image/mask_error"),
    ("flip", "/image/flip_mean"),
    ("texture_bytes", "/texture_bytes"),
    ("search_s", "/time_s/search"),
    ("total_s", "/time_s/total"),
    ("peak_bytes", "/peak_memory_bytes"),
];

/// A table: its name, the arguments of all its runs, what its last column has.
struct Table {
    name: &'static str,
    arguments: [&'static str; 2],
    maps: Maps,
}

/// Are shadow maps measured beside?
#[derive(PartialEq)]
enum Maps {
    Left,
    Measured,
}

const MODELS: Table = Table { name: "models", arguments: ["--preset", "balanced"], maps: Maps::Left };
const CORPUS: Table = Table { name: "corpus", arguments: ["--preset", "fast"], maps: Maps::Left };
const SETTINGS: Table = Table { name: "settings", arguments: ["--validate", "none"], maps: Maps::Measured };

/// Receivers, exposure rays and lights on which shadow maps are measured, and their seed.
const MAP_SAMPLING: (usize, usize, usize, u64) = (8_000, 32, 61, 4242);

fn main() -> Result<(), Box<dyn Error>> {
    let binary = std::env::current_exe()?.ancestors().nth(2).map(|dir| dir.join("shadowfit")).ok_or("no binary")?;
    if !binary.exists() {
        return Err(format!("{} is missing: cargo build --release --features flip", binary.display()).into());
    }
    match (std::env::args().nth(1), std::env::args().nth(2).as_deref()) {
        (None, _) => run(&MODELS, &own_cases(), &binary),
        (Some(folder), Some("settings")) => run(&SETTINGS, &settings_cases(Path::new(&folder))?, &binary),
        (Some(_), Some(other)) => Err(format!("{other}: only 'settings' is known").into()),
        (Some(folder), None) => run(&CORPUS, &corpus_cases(Path::new(&folder))?, &binary),
    }
}

/// The project's models: as they come, and where the published and hand-placed planes are to be compared.
fn own_cases() -> Vec<Case> {
    let by_hand = |file: &str| vec!["--planes".to_string(), format!("models/planes/{file}.planes.json")];
    let planes = |n: usize| vec!["--max-planes".to_string(), n.to_string()];
    [
        ("teapot", planes(11)),
        ("teapot", by_hand("teapot-by-hand")),
        ("teapot", vec![]),
        ("aircraft", planes(3)),
        ("aircraft", by_hand("aircraft-thesis")),
        ("aircraft", planes(8)),
        ("aircraft", vec![]),
        ("plate_over_ground", vec![]),
        ("planted_planes", vec![]),
        ("t_shape", vec![]),
        ("sphere", vec![]),
        ("box", vec![]),
    ]
    .into_iter()
    .map(|(model, arguments)| {
        let model = PathBuf::from(format!("models/{model}.glb"));
        Case { name: format!("{} {}", model.display(), arguments.join(" ")).trim().to_string(), model, arguments }
    })
    .collect()
}

/// Every glTF file below a folder, by name; the three.js teapot also with the eleven planes of the thesis's count.
fn corpus_cases(folder: &Path) -> Result<Vec<Case>, Box<dyn Error>> {
    let (mut folders, mut models) = (vec![folder.to_path_buf()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "glb" || e == "gltf") {
                models.push(path);
            }
        }
    }
    models.sort();
    let mut cases = Vec::new();
    for model in models {
        let name = model.strip_prefix(folder)?.display().to_string();
        if name.ends_with("teapot_three.glb") {
            let arguments = vec!["--max-planes".to_string(), "11".to_string()];
            cases.push(Case { model: model.clone(), name: format!("{name} {}", arguments.join(" ")), arguments });
        }
        cases.push(Case { model, name, arguments: Vec::new() });
    }
    Ok(cases)
}

/// The settings that users weigh: lookups and bytes against error.
fn settings_cases(folder: &Path) -> Result<Vec<Case>, Box<dyn Error>> {
    let all = corpus_cases(folder)?;
    let find = |name: &str| all.iter().find(|case| case.name.ends_with(name)).map(|case| (&case.model, &case.name));
    let mut cases = Vec::new();
    let mut add = |(model, name): (&PathBuf, &String), arguments: &str| {
        let arguments: Vec<String> = arguments.split_whitespace().map(str::to_string).collect();
        cases.push(Case { name: format!("{name} {}", arguments.join(" ")), model: model.clone(), arguments });
    };
    let teapot = find("teapot_three.glb").ok_or("teapot_three.glb is missing")?;
    for arguments in TEAPOT_SETTINGS {
        add(teapot, arguments);
    }
    for (name, settings) in OTHER_SETTINGS {
        let model = find(name).ok_or_else(|| format!("{name} is missing"))?;
        for arguments in settings {
            add(model, arguments);
        }
    }
    Ok(cases)
}

/// Of the three.js teapot.
const TEAPOT_SETTINGS: [&str; 8] = [
    "--preset fast --max-planes 11",
    "--preset balanced --max-planes 11",
    "--preset best --max-planes 11",
    "--preset balanced --max-lookups 2 --texture-budget 2M",
    "--preset balanced --max-lookups 4 --texture-budget 512K",
    "--preset balanced --max-lookups 4 --texture-budget 2M",
    "--preset best --max-lookups 4 --texture-budget 2M",
    "--preset best --max-lookups 8 --texture-budget 8M",
];

/// Of further models.
const OTHER_SETTINGS: [(&str, &[&str]); 7] = [
    (
        "j31_twintail.glb",
        &["--preset balanced --max-lookups 4 --texture-budget 2M", "--preset best --max-lookups 4 --texture-budget 2M"],
    ),
    ("cesium_air.glb", &BOTH),
    ("b787_lowpoly.glb", &BOTH),
    ("office_chair.glb", &BOTH),
    ("lantern_geom.glb", &BOTH),
    ("stanford_bunny.glb", &BOTH),
    ("car.glb", &BOTH),
];

const BOTH: [&str; 2] = ["--preset balanced --max-planes 8", "--preset balanced --max-lookups 4"];

/// Runs the cases and writes the tables after each, so that a run that is cut short leaves what it has.
fn run(table: &Table, cases: &[Case], binary: &Path) -> Result<(), Box<dyn Error>> {
    let mut titles: Vec<&str> = COLUMNS.iter().map(|(title, _)| *title).collect();
    titles.extend((table.maps == Maps::Measured).then_some("shadow_map_texels"));
    let mut csv = format!("case,exit,{}\n", titles.join(","));
    let mut markdown = format!("| case | exit | {} |\n|---|{}\n", titles.join(" | "), "---|".repeat(titles.len() + 1));
    fs::create_dir_all("reports/baseline")?;
    for case in cases {
        let out = tempfile::tempdir()?;
        let output = Command::new(binary)
            .args(["fit", "--json"])
            .args(table.arguments)
            .arg("-o")
            .arg(out.path())
            .arg(&case.model)
            .args(&case.arguments)
            .output()?;
        let report: Value = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
        let exit = output.status.code().map_or_else(|| "signal".to_string(), |code| code.to_string());
        let mut cells: Vec<String> = COLUMNS.iter().map(|(_, pointer)| cell(report.pointer(pointer))).collect();
        if let (Maps::Measured, Some(error)) = (&table.maps, report["held_out"]["shadow_error"].as_f64()) {
            cells.push(shadow_map_texels(&case.model, error)?);
        }
        writeln!(csv, "{},{exit},{}", case.name, cells.join(","))?;
        writeln!(markdown, "| {} | {exit} | {} |", case.name, cells.join(" | "))?;
        println!("{} exit {exit}: {}", case.name, cells.join(" "));
        fs::write(format!("reports/baseline/{}.csv", table.name), &csv)?;
        fs::write(format!("reports/baseline/{}.md", table.name), &markdown)?;
    }
    Ok(())
}

/// Texels a side of the shadow map that leaves `error` on this model.
fn shadow_map_texels(model: &Path, error: f64) -> Result<String, Box<dyn Error>> {
    let mesh = scene::load(model)?.mesh()?;
    let (count, exposure_rays, lights, seed) = MAP_SAMPLING;
    let receivers = sample(&mesh, &ReceiverOptions { count, exposure_rays, seed });
    let domain = LightDomain::Sphere;
    let pairs = trace(&mesh, &receivers, &domain.directions(lights, seed), domain.solid_angle());
    Ok(match equivalent_size(&mesh, &receivers, &pairs, error) {
        EquivalentSize::BelowAll => format!("<{}", SIZES[0]),
        EquivalentSize::Texels(texels) => format!("{texels:.0}"),
        EquivalentSize::AboveAll => format!(">{}", SIZES[SIZES.len() - 1]),
    })
}

/// Whole numbers as they are, others with four digits after the point, nothing where there is none.
fn cell(value: Option<&Value>) -> String {
    match value {
        Some(Value::Number(n)) if n.is_u64() => n.to_string(),
        Some(Value::Number(n)) => n.as_f64().map_or_else(String::new, |x| format!("{x:.4}")),
        _ => String::new(),
    }
}
