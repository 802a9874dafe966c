//! What the machine gives and what the method takes of it: pairs and rays a second of one thread.
//!
//!     cargo run --release --example counters -- [PYTHON]
//!
//! Writes `reports/baseline/counters.{csv,md}`. PYTHON is an interpreter with `embreex` (see
//! `solver/benches/embree.py`), which then traces the same rays in the same run; without it that column is empty.
//! All seconds are CPU seconds of the one thread, the best of several passes: other processes take no part but through
//! shared caches and memory.

#[path = "../scaling/model.rs"]
mod model;

mod limits;
mod pairs;
mod rays;

use std::{error::Error, fmt::Write as _, fs, path::PathBuf};

/// One line of the table.
pub struct Counter {
    /// What is counted.
    pub name: String,
    /// How many a second.
    pub rate: f64,
    /// The limit, how many a second, and what it is.
    pub limit: Option<(f64, String)>,
    /// Share of answers that agree with the limit's.
    pub agreeing: Option<f64>,
}

fn main() -> Result<(), Box<dyn Error>> {
    // The solver's parallel loops run on this thread.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    let python = std::env::args().nth(1).map(PathBuf::from);
    let mut counters = pairs::counters()?;
    write(&counters)?;
    counters.extend(rays::counters(python.as_deref())?);
    write(&counters)
}

fn write(counters: &[Counter]) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all("reports/baseline")?;
    fs::write("reports/baseline/counters.csv", csv(counters))?;
    fs::write("reports/baseline/counters.md", markdown(counters))?;
    Ok(())
}

/// CPU seconds of the best of `passes` runs.
pub fn best_seconds(passes: usize, mut run: impl FnMut()) -> Result<f64, Box<dyn Error>> {
    let mut best = f64::INFINITY;
    for _ in 0..passes {
        let start = thread_seconds()?;
        run();
        best = best.min(thread_seconds()? - start);
    }
    Ok(best)
}

/// CPU seconds of this thread: the first number of its schedstat (Linux, Documentation/scheduler/sched-stats.rst).
fn thread_seconds() -> Result<f64, Box<dyn Error>> {
    let text = fs::read_to_string("/proc/thread-self/schedstat")?;
    let nanoseconds: u64 = text.split_whitespace().next().ok_or("an empty schedstat")?.parse()?;
    Ok(nanoseconds as f64 * 1e-9)
}

fn csv(counters: &[Counter]) -> String {
    let mut out = String::from("counter,per_second,limit_per_second,limit,share,agreeing\n");
    for counter in counters {
        let limit = counter.limit.as_ref().map_or_else(
            || ",,".to_string(),
            |(limit, name)| format!("{limit:.4e},{name},{:.4}", counter.rate / limit),
        );
        let agreeing = counter.agreeing.map_or_else(String::new, |share| format!("{share:.6}"));
        let _ = writeln!(out, "{},{:.4e},{limit},{agreeing}", counter.name, counter.rate);
    }
    out
}

fn markdown(counters: &[Counter]) -> String {
    let mut out = String::from(
        "# Counters\n\nMillions a second of one thread, beside what the machine or Embree gives for the same bytes, operations or rays in \
         the same run. CPU seconds, the best of several passes. Written by \
         `cargo run --release --example counters -- PYTHON` (an interpreter with `embreex`, Embree 4).\n\n\
         | counter | M/s | limit M/s | limit | share | same answers |\n|---|---|---|---|---|---|\n",
    );
    for counter in counters {
        let limit = counter.limit.as_ref().map_or_else(
            || " | | ".to_string(),
            |(limit, name)| format!("{:.3} | {name} | {:.2}", limit * 1e-6, counter.rate / limit),
        );
        let agreeing = counter.agreeing.map_or_else(String::new, |share| format!("{:.4} %", 100.0 * share));
        let _ = writeln!(out, "| {} | {:.3} | {limit} | {agreeing} |", counter.name, counter.rate * 1e-6);
    }
    out
}
