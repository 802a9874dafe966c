//! How seconds and memory grow with triangles, pairs and planes.
//!
//!     cargo build --release
//!     cargo run --release --example scaling
//!
//! Writes `reports/baseline/scaling.{csv,md,svg}`. Triangles and planes: one run of the release binary beside this
//! example per row, preset fast, no frames, on a knot over a ground made for it in a temporary folder. Pairs: the
//! solver called directly, one section. CPU seconds are of all threads and, unlike the seconds of the stages, the same
//! on a busy machine.

mod glb;
mod model;
mod plot;

use glam::Vec3;
use glb::glb;
use model::Model;
use plot::{Panel, slope, svg};
use serde_json::Value;
use shadowfit::effort::{Effort, Plan};
use shadowfit_solver::{
    fit::bake,
    lights::LightDomain,
    lists::assign,
    mesh::Mesh,
    pair_table::PairTable,
    search::{Verdict, search},
    sections,
};
use std::{
    error::Error,
    fmt::Write as _,
    fs,
    hint::black_box,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

/// The last one is here to show that it completes.
const TRIANGLES: [usize; 7] = [1_000, 4_000, 16_000, 64_000, 256_000, 1_000_000, 7_000_000];

/// Planes of one section, and the model's triangles while planes or pairs grow.
const PLANES: [usize; 5] = [2, 4, 8, 16, 32];
const PAIRS: [usize; 4] = [250_000, 1_000_000, 4_000_000, 16_000_000];
const FIXED_TRIANGLES: usize = 64_000;

/// Growth is told by the power law through this many of the largest rows: the first ones show constants.
const FITTED_ROWS: usize = 3;

/// Columns of the table: title, and where the report has the number.
const COLUMNS: [(&str, &str); 11] = [
    ("load", "/time_s/load"),
    ("bvh", "/time_s/bvh"),
    ("receivers", "/time_s/receivers"),
    ("reference", "/time_s/reference"),
    ("search", "/time_s/search"),
    ("bake", "/time_s/bake"),
    ("write", "/time_s/write"),
    ("validate", "/time_s/validate"),
    ("CPU", "/cpu"),
    ("peak_bytes", "/peak_memory_bytes"),
    ("shadow_error", "/held_out/shadow_error"),
];

/// Columns that are seconds.
const SECONDS: usize = 9;

/// One row: what grows, how much of it, and the columns.
struct Row {
    axis: &'static str,
    count: usize,
    cells: [Option<f64>; COLUMNS.len()],
}

fn main() -> Result<(), Box<dyn Error>> {
    let binary = std::env::current_exe()?.ancestors().nth(2).map(|dir| dir.join("shadowfit")).ok_or("no binary")?;
    if !binary.exists() {
        return Err(format!("{} is missing: cargo build --release", binary.display()).into());
    }
    let mut rows = Vec::new();
    for pairs in PAIRS {
        add(&mut rows, Row { axis: "pairs", count: pairs, cells: solve(pairs)? })?;
    }
    for triangles in TRIANGLES {
        let cells = fit(&binary, triangles, &[])?;
        add(&mut rows, Row { axis: "triangles", count: triangles, cells })?;
    }
    for planes in PLANES {
        let cells = fit(&binary, FIXED_TRIANGLES, &["--max-planes", &planes.to_string()])?;
        add(&mut rows, Row { axis: "planes", count: planes, cells })?;
    }
    Ok(())
}

/// Appends a row and writes the tables anew, so that a run that is cut short leaves what it has.
fn add(rows: &mut Vec<Row>, row: Row) -> Result<(), Box<dyn Error>> {
    println!("{} {}: {:.3?}", row.axis, row.count, row.cells.map(Option::unwrap_or_default));
    rows.push(row);
    let folder = Path::new("reports/baseline");
    fs::create_dir_all(folder)?;
    fs::write(folder.join("scaling.csv"), csv(rows))?;
    fs::write(folder.join("scaling.md"), markdown(rows))?;
    fs::write(folder.join("scaling.svg"), picture(rows))?;
    Ok(())
}

/// One run of the program.
fn fit(binary: &Path, triangles: usize, arguments: &[&str]) -> Result<[Option<f64>; COLUMNS.len()], Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path: PathBuf = folder.path().join("knot.glb");
    fs::write(&path, glb(&Model::with_triangles(triangles)))?;
    let cpu = cpu_seconds()?;
    let output = Command::new(binary)
        .args(["fit", "--json", "--validate", "none", "--preset", "fast", "-o"])
        .arg(folder.path().join("out"))
        .arg(&path)
        .args(arguments)
        .output()?;
    let cpu = cpu_seconds()? - cpu;
    if !output.status.success() {
        return Err(format!("{triangles} triangles: {}", String::from_utf8_lossy(&output.stderr)).into());
    }
    let mut report: Value = serde_json::from_slice(&output.stdout)?;
    report["cpu"] = cpu.into();
    Ok(COLUMNS.map(|(_, pointer)| report.pointer(pointer).and_then(Value::as_f64)))
}

/// The solver alone on one section of so many pairs.
fn solve(pairs: usize) -> Result<[Option<f64>; COLUMNS.len()], Box<dyn Error>> {
    let mesh = Mesh::new(&Model::with_triangles(FIXED_TRIANGLES).to_soup())?;
    let (domain, Plan { mut trace, search: options, lists, budget, min_gain, .. }) =
        (LightDomain::Sphere, Effort::fast().whole);
    let directions: Vec<Vec3> = domain.directions(64, 1);
    trace.pairs = pairs;
    let (cpu, start) = (cpu_seconds()?, Instant::now());
    let section_of = vec![0; mesh.triangle_count()];
    let tables: Vec<PairTable> = sections::trace(&mesh, &section_of, &directions, domain, &trace);
    let traced = start.elapsed().as_secs_f64();
    let shadow = tables[0].weights().0;
    let found = search(&mesh, &tables[0], &options, min_gain * shadow, &mut |_| Verdict::Continue);
    let searched = start.elapsed().as_secs_f64();
    black_box(bake(&[assign(&tables[0], &found.planes, &lists)], &directions, shadow, &budget));
    let baked = start.elapsed().as_secs_f64();
    let cpu = cpu_seconds()? - cpu;
    let peak = peak_bytes();
    Ok(COLUMNS.map(|(title, _)| match title {
        "reference" => Some(traced),
        "search" => Some(searched - traced),
        "bake" => Some(baked - searched),
        "CPU" => Some(cpu),
        "peak_bytes" => peak,
        _ => None,
    }))
}

/// CPU seconds of this process and of those that it has waited for: utime, stime, cutime and cstime of proc(5), in
/// hundredths of seconds.
fn cpu_seconds() -> Result<f64, Box<dyn Error>> {
    let stat = fs::read_to_string("/proc/self/stat")?;
    let after_name = stat.rsplit_once(')').ok_or("no name in /proc/self/stat")?.1;
    let ticks: Result<Vec<u64>, _> = after_name.split_whitespace().skip(11).take(4).map(str::parse).collect();
    Ok(ticks?.iter().sum::<u64>() as f64 * 0.01)
}

/// Largest resident set of this process so far.
fn peak_bytes() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().trim_end_matches("kB").trim().parse::<f64>().ok().map(|kib| kib * 1024.0)
}

fn text(cell: Option<f64>, column: usize) -> String {
    match cell {
        None => String::new(),
        Some(value) if COLUMNS[column].0 == "peak_bytes" => format!("{value:.0}"),
        Some(value) => format!("{value:.3}"),
    }
}

fn csv(rows: &[Row]) -> String {
    let titles: Vec<&str> = COLUMNS.iter().map(|(title, _)| *title).collect();
    let mut out = format!("axis,count,{}\n", titles.join(","));
    for row in rows {
        let cells: Vec<String> = row.cells.iter().enumerate().map(|(i, cell)| text(*cell, i)).collect();
        let _ = writeln!(out, "{},{},{}", row.axis, row.count, cells.join(","));
    }
    out
}

/// The points of one column of an axis.
fn points(rows: &[Row], axis: &str, column: usize) -> Vec<(f64, f64)> {
    let of_axis = rows.iter().filter(|row| row.axis == axis);
    of_axis.filter_map(|row| Some((row.count as f64, row.cells[column]?))).collect()
}

/// The axes in the order of the report, with what stays the same.
const AXES: [(&str, &str); 3] = [
    ("triangles", "`shadowfit fit KNOT --preset fast --validate none`, divided into sections"),
    ("planes", "the same with `--max-planes N`, one section, 64 000 triangles"),
    ("pairs", "the solver's trace, search of preset fast, lists and bake; one section, 64 000 triangles"),
];

fn markdown(rows: &[Row]) -> String {
    let mut out = String::from(
        "# Scaling\n\nA knot over a ground with more and more triangles, planes and training pairs. Seconds of wall time a stage, CPU \
         seconds of all threads (on two cores about twice the seconds of an idle machine), largest resident set; other programs shared the cores while this was measured. The last \
         line of each table is the exponent of the power law through the three largest rows: 1 is linear. Written by \
         `cargo run --release --example scaling`.\n\n![log-log plots](scaling.svg)\n",
    );
    let titles: Vec<&str> = COLUMNS.iter().map(|(title, _)| *title).collect();
    for (axis, what) in AXES {
        let of_axis: Vec<&Row> = rows.iter().filter(|row| row.axis == axis).collect();
        let _ = writeln!(out, "\n## {axis}\n\n{what}.\n\n| {axis} | {} |", titles.join(" | "));
        let _ = writeln!(out, "|{}", "---|".repeat(titles.len() + 1));
        for row in &of_axis {
            let cells: Vec<String> = row.cells.iter().enumerate().map(|(i, cell)| text(*cell, i)).collect();
            let _ = writeln!(out, "| {} | {} |", row.count, cells.join(" | "));
        }
        let exponents = (0..=SECONDS).map(|column| {
            let points = points(rows, axis, column);
            let last = &points[points.len().saturating_sub(FITTED_ROWS)..];
            slope(last).map_or_else(String::new, |slope| format!("{slope:.2}"))
        });
        let _ = writeln!(out, "| exponent | {} | |", exponents.collect::<Vec<_>>().join(" | "));
    }
    out
}

fn picture(rows: &[Row]) -> String {
    let panel = |&(axis, _): &(&'static str, &str)| {
        let line = |column: usize| (COLUMNS[column].0, points(rows, axis, column));
        // The seconds of all threads first.
        Panel { title: axis, lines: [SECONDS - 1].into_iter().chain(0..SECONDS - 1).map(line).collect() }
    };
    svg(&AXES.iter().map(panel).collect::<Vec<_>>())
}
