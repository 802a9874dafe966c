//! Fits hard cases, each with and without what makes it hard, and writes `reports/baseline/hard_cases.{csv,md}`.
//!
//!     cargo run --release --example hard_cases
//!
//! Small fits on purpose: the table is about what a case changes, not about how low an error can be.

mod cases;
mod double;
mod fit;
#[path = "../../solver/tests/scenes/mod.rs"]
mod scenes;
mod sweep;

use fit::{Fitted, Settings, fit, receivers};
use glam::Vec3;
use shadowfit_solver::{
    lights::{LightDomain, direction},
    plane::BakedPlane,
    shade::EDGE_ON,
    visibility::{Pairs, trace},
};
use std::{error::Error, fmt::Write as _, fs, path::Path, time::Instant};
use sweep::{Jump, Kind, across_borders, largest, through_planes};

/// One line of the table.
struct Row {
    case: String,
    attacks: String,
    planes: usize,
    without: Option<f64>,
    with: f64,
    remark: String,
}

/// Seeds of the spread.
const SEEDS: u64 = 20;

/// Receivers of a whole model, from next to none.
const RECEIVERS: [usize; 7] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000];

/// Receivers under a swept light; one of them is 0.03 % of the light and more.
const SWEPT: usize = 3_000;

fn row(case: &str, attacks: &str, fitted: &Fitted, without: Option<f64>) -> Row {
    let metrics = fitted.metrics();
    let remark = format!("{:.4} missed + {:.4} false", metrics.missed, metrics.false_);
    let (case, attacks) = (case.to_string(), attacks.to_string());
    Row { case, attacks, planes: fitted.set.planes.len(), without, with: metrics.shadow_error, remark }
}

fn shapes_and_surfaces(plain: &Fitted, plain_error: f64) -> Vec<Row> {
    let settings = Settings::default();
    let mut rows = vec![row("plain", "nothing: a knot over a ground", plain, None)];
    for case in cases::like_plain() {
        rows.push(row(case.name, case.attacks, &fit(&case.soup, &settings), Some(plain_error)));
    }
    rows.push(row(
        "soup",
        "500 triangles in any position, edges of 3",
        &fit(&cases::random_soup(400), &settings),
        None,
    ));
    rows.push(row("one triangle", "no shadow, no thickness", &fit(&cases::one_triangle(), &settings), None));
    let overhead = LightDomain::Cone { axis: Vec3::Y, half_angle_rad: 0.2 };
    let dark = Settings { domain: overhead, ..settings };
    rows.push(row("all in shadow", "no lit pair", &fit(&cases::all_in_shadow(), &dark), None));
    for (name, elevation) in [("lights in the ground's plane", 0.0), ("lights 2 degrees above it", 2.0f32)] {
        let axis = direction(0.4, elevation.to_radians());
        let domain = LightDomain::Cone { axis, half_angle_rad: 0.02 };
        rows.push(row(
            name,
            "grazing light on the ground",
            &fit(&cases::plain(), &Settings { domain, ..settings }),
            None,
        ));
    }
    rows
}

/// Errors of all seeds: each one's, the mean, the spread.
fn seeds() -> Row {
    let fits: Vec<Fitted> =
        (0..SEEDS).map(|seed| fit(&cases::plain(), &Settings { seed, ..Settings::default() })).collect();
    let errors: Vec<f64> = fits.iter().map(Fitted::error).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let deviation = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (errors.len() - 1) as f64).sqrt();
    let (low, high) = errors.iter().fold((f64::MAX, f64::MIN), |(low, high), e| (low.min(*e), high.max(*e)));
    let verdict = if deviation <= 0.05 * mean { "stable" } else { "NOT stable" };
    Row {
        case: format!("seeds 0..{}", SEEDS - 1),
        attacks: "luck of sampling and search".to_string(),
        planes: fits.iter().map(|fitted| fitted.set.planes.len()).sum::<usize>() / fits.len(),
        without: None,
        with: mean,
        remark: format!(
            "{low:.4} to {high:.4}, standard deviation {deviation:.4} = {:.1} % of the mean: {verdict}",
            100.0 * deviation / mean
        ),
    }
}

fn receiver_counts() -> Vec<Row> {
    let of_count = |&count: &usize| {
        let start = Instant::now();
        let settings = Settings { receivers: Some(count), max_lookups: 8, ..Settings::default() };
        let fitted = fit(&cases::plain(), &settings);
        let seconds = start.elapsed().as_secs_f64();
        let mut row = row(&format!("{count} receivers"), "too few or too many samples, one section", &fitted, None);
        let _ = write!(row.remark, ", {seconds:.1} s");
        row
    };
    RECEIVERS.iter().map(of_count).collect()
}

fn sweeps(plain: &Fitted) -> Vec<Row> {
    let receivers = receivers(&plain.mesh, SWEPT, 31);
    let jumps = [across_borders(plain, &receivers, usize::MAX), through_planes(plain, &receivers, usize::MAX)].concat();
    let of_kind = |(kind, name): (Kind, &str)| {
        let (jump, count) = largest(&jumps, kind);
        let of_kind = || jumps.iter().filter(|jump| jump.kind == kind);
        let mean = of_kind().map(Jump::excess).sum::<f64>() / count.max(1) as f64;
        let excess = jump.map_or(0.0, |jump| jump.excess());
        let [before, after] = jump.map_or([0.0; 2], |jump| jump.errors);
        Row {
            case: format!("sweep: {name}"),
            attacks: format!("popping between frames {} degrees apart", sweep::STEP_DEG),
            planes: plain.set.planes.len(),
            without: Some(jump.map_or(0.0, |jump| jump.traced)),
            with: jump.map_or(0.0, |jump| jump.predicted),
            remark: format!(
                "share of the light that changes, reference and planes, at the largest jump of {count}: excess \
                 {excess:.4} (mean {mean:.5}); wrong before and after: {before:.4}, {after:.4}"
            ),
        }
    };
    let kinds = [
        (Kind::Plain, "between"),
        (Kind::EdgeOn, "through edge-on planes"),
        (Kind::Border, "to another direction's lists"),
    ];
    kinds.into_iter().map(of_kind).collect()
}

/// Under the lights of the held-out pairs, and under such as make every plane nearly edge-on, where rows are largest.
fn rounding(plain: &Fitted) -> Vec<Row> {
    let (pairs, section_of) = plain.held_out();
    let receivers = receivers(&plain.mesh, SWEPT, 32);
    let grazing = |baked: &BakedPlane| {
        let n = baked.plane.normal();
        (n.any_orthonormal_vector() + n * (2.0 * EDGE_ON)).normalize()
    };
    let lights: Vec<Vec3> = plain.set.planes.iter().map(grazing).collect();
    let grazed = trace(&plain.mesh, &receivers, &lights, 1.0);
    let of_receivers = plain.sections(&receivers);
    let cases = [("f32 against f64", pairs, section_of), ("f32 against f64, edge-on", grazed, of_receivers)];
    let row = |(case, pairs, section_of): (&str, Pairs, Vec<u32>)| Row {
        case: case.to_string(),
        attacks: "rounding of the run-time formula".to_string(),
        planes: plain.set.planes.len(),
        without: None,
        with: double::difference(&plain.set, &pairs, &section_of),
        remark: format!("share of the light of {} pairs for which they differ", pairs.len()),
    };
    cases.into_iter().map(row).collect()
}

const TITLES: [&str; 6] = ["case", "attacks", "planes", "without", "with", "remark"];

fn cells(row: &Row) -> [String; 6] {
    let number = |x: f64| if x > 0.0 && x < 1e-3 { format!("{x:.1e}") } else { format!("{x:.4}") };
    let without = row.without.map_or(String::new(), number);
    [row.case.clone(), row.attacks.clone(), row.planes.to_string(), without, number(row.with), row.remark.clone()]
}

fn write(rows: &[Row]) -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/baseline");
    let mut csv = format!("{}\n", TITLES.join(","));
    let mut md = String::from(
        "# Hard cases\n\nSmall fits in memory (6 sections, at most 4 lookups, 600 k training pairs) of a knot over a \
         ground; held-out `shadow_error` without and with what makes the case hard. Written by `cargo run --release \
         --example hard_cases`.\n\n",
    );
    let _ = writeln!(md, "| {} |\n|{}", TITLES.join(" | "), "---|".repeat(TITLES.len()));
    for cells in rows.iter().map(cells) {
        let quoted = cells.each_ref().map(|cell| if cell.contains(',') { format!("\"{cell}\"") } else { cell.clone() });
        csv += &format!("{}\n", quoted.join(","));
        md += &format!("| {} |\n", cells.join(" | "));
    }
    fs::create_dir_all(&folder)?;
    fs::write(folder.join("hard_cases.csv"), csv)?;
    fs::write(folder.join("hard_cases.md"), &md)?;
    println!("{md}");
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let plain = fit(&cases::plain(), &Settings::default());
    let plain_error = plain.error();
    let mut rows = shapes_and_surfaces(&plain, plain_error);
    rows.extend(sweeps(&plain));
    rows.extend(rounding(&plain));
    write(&rows)?;
    rows.push(seeds());
    write(&rows)?;
    rows.extend(receiver_counts());
    write(&rows)
}
