//! The command line: raw arguments, checked into requests, run, and answered with an exit code.

mod compare;
mod render;

use crate::{
    ablation,
    effort::Effort,
    pipeline::{self, FitError, FitRequest},
    validation::ValidationOptions,
};
use clap::{Args, Parser, Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use shadowfit_solver::{columns::ColumnOptions, lights::LightDomain};
use std::{io::IsTerminal, path::PathBuf, time::Duration};

/// Finds shadow planes through a 3D model and bakes occluder textures on them: self-shadows for any light in one
/// pass, without a shadow map.
#[derive(Debug, Parser)]
#[command(version, about, max_term_width = 110)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Fit shadow planes to a model (.glb or .gltf) and write the asset, its report and a comparison picture.
    Fit(FitArgs),
    /// Draw a fitted asset to a PNG.
    Render(render::RenderArgs),
    /// Measure error against planes: of the method, of it with each part switched off, of published baselines, and of
    /// shadow maps.
    Ablate(AblateArgs),
    /// Compare shadow planes with the other techniques of the field in one renderer: error, frame time, memory, scaling.
    Compare(compare::CompareArgs),
}

#[derive(Debug, Args)]
struct FitArgs {
    /// The model: .glb or .gltf.
    model: PathBuf,
    /// Folder of the output; made where it is missing.
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Most planes [default: 12 of a whole model, with --max-error 64; of a divided one as many as pay].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=20_000))]
    max_planes: Option<u16>,
    /// Most planes that a fragment reads under any light [default: 4; with --max-planes alone: all].
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u16).range(1..=64))]
    max_lookups: Option<u16>,
    /// Sections that the surface is divided into [default: 1 where a few planes explain all shadow or --max-planes is
    /// given alone; else by preset, 48 (fast), 96 or 160 (best), half as many again where the model is mirrored].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    sections: Option<u16>,
    /// Most bytes of all occluder textures; K, M for KiB, MiB [default: 2M].
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    texture_budget: Option<usize>,
    /// Serve the ground below the model, too: a level square at its lowest point, four of its radii wide, receives its
    /// shadow.
    #[arg(long, conflicts_with = "certificate")]
    ground: bool,
    /// Find the fewest planes whose held-out shadow_error is at most this, on the ground, too; exit code 6 where that
    /// fails.
    #[arg(long, value_name = "E", value_parser = error_share, conflicts_with_all = ["sections", "max_lookups"])]
    max_error: Option<f64>,
    #[command(flatten)]
    method: MethodArgs,
    /// Bake the rectangles of this JSON file instead of searching.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["max_planes", "max_error", "sections"])]
    planes: Option<PathBuf>,
    /// Frames to render and compare: none, short (4 views x 2 lights, 512 px) or full (8 x 8, 1024 px).
    #[arg(long, value_enum, default_value_t = Validate::Short)]
    validate: Validate,
    /// Prove how far the planes found are from the best of a pool, all of them read everywhere (half a minute more).
    /// The model is left whole.
    #[arg(long, conflicts_with = "max_lookups")]
    certificate: bool,
    /// Print the report as one JSON object instead of the table.
    #[arg(long)]
    json: bool,
}

/// What every search is told.
#[derive(Debug, Args)]
struct MethodArgs {
    /// Texels along the longer side of each plane at most [default: 128].
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u16).range(8..=256))]
    texture_size: Option<u16>,
    /// Light directions to serve: sphere, hemisphere, or cone:AZIMUTH,ELEVATION,HALF_ANGLE in degrees.
    #[arg(long, value_name = "DOMAIN", default_value = "sphere")]
    lights: String,
    /// How much work to do.
    #[arg(long, value_enum, default_value_t = Preset::Balanced)]
    preset: Preset,
    /// Seed of all sampling: the same seed gives the same bytes.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Threads [default: one a core]. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

#[derive(Debug, Args)]
struct AblateArgs {
    /// The model: .glb or .gltf.
    model: PathBuf,
    /// Folder of the tables; made where it is missing.
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Most planes of each method.
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u16).range(1..=200))]
    max_planes: u16,
    /// Measure the rectangles of this JSON file too.
    #[arg(long, value_name = "FILE")]
    planes: Option<PathBuf>,
    /// Sections of the divided model [default: by preset, 48 (fast), 96 or 160 (best), where a few planes do not
    /// explain all shadow]; 1 measures whole models only.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    sections: Option<u16>,
    #[command(flatten)]
    method: MethodArgs,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Preset {
    Fast,
    Balanced,
    Best,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Validate {
    None,
    Short,
    Full,
}

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Arguments that do not fit together.
    #[error("{0}")]
    Usage(String),
    /// The fit failed.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The result is written, but not as good as asked for.
    #[error(
        "shadow_error {found:.4} is above --max-error {wanted}: allow more planes or texels (--max-planes, --texture-size, --preset best)"
    )]
    Target {
        /// Held-out error reached.
        found: f64,
        /// Error asked for.
        wanted: f64,
    },
}

impl CliError {
    /// The program's exit code.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 1,
            Self::Fit(error) => error.exit_code(),
            Self::Target { .. } => 6,
        }
    }
}

/// A share of the shadow energy: above 0, at most 1.
fn error_share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if share > 0.0 && share <= 1.0 => Ok(share),
        _ => Err("a number above 0 and at most 1 is needed".to_string()),
    }
}

/// A number of bytes, with K or M for KiB or MiB.
fn bytes(text: &str) -> Result<usize, String> {
    let (digits, unit) = match text.char_indices().last() {
        Some((at, 'K' | 'k')) => (&text[..at], 1 << 10),
        Some((at, 'M' | 'm')) => (&text[..at], 1 << 20),
        _ => (text, 1),
    };
    let number = digits.parse::<usize>().ok().and_then(|n| n.checked_mul(unit)).filter(|n| *n > 0);
    number.ok_or_else(|| "a number of bytes is needed, or one with K or M".to_string())
}

/// Runs a parsed command line; `command` is its text, for the report.
///
/// # Errors
/// See [`CliError`].
pub fn run(cli: Cli, command: String) -> Result<(), CliError> {
    match cli.command {
        Command::Fit(args) => fit(args, command),
        Command::Render(args) => render::render(&args),
        Command::Ablate(args) => ablate(args, command),
        Command::Compare(args) => compare::compare(&args, &command),
    }
}

impl Preset {
    fn effort(self) -> Effort {
        match self {
            Self::Fast => Effort::fast(),
            Self::Balanced => Effort::balanced(),
            Self::Best => Effort::best(),
        }
    }
}

fn light_domain(text: &str) -> Result<LightDomain, CliError> {
    text.parse().map_err(|error| CliError::Usage(format!("--lights: {error}")))
}

fn set_threads(threads: Option<u16>) -> Result<(), CliError> {
    let Some(threads) = threads else { return Ok(()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build_global();
    pool.map_err(|error| CliError::Usage(format!("--threads: {error}")))
}

fn fit(args: FitArgs, command: String) -> Result<(), CliError> {
    let domain = light_domain(&args.method.lights)?;
    if args.ground && !domain.is_seen_from_ground() {
        let lights = &args.method.lights;
        return Err(CliError::Usage(format!("--ground: no light of --lights {lights} is above the horizon")));
    }
    set_threads(args.method.threads)?;
    let request = FitRequest {
        model: args.model,
        out_dir: args.out,
        effort: args.method.preset.effort(),
        ground: args.ground,
        max_planes: args.max_planes.map(usize::from),
        max_lookups: args.max_lookups.map(usize::from),
        sections: args.sections.map(usize::from),
        texture_budget: args.texture_budget,
        max_error: args.max_error,
        texture_size: args.method.texture_size.map(usize::from),
        domain,
        domain_text: args.method.lights,
        planes: args.planes,
        validation: match args.validate {
            Validate::None => None,
            Validate::Short => Some(ValidationOptions::short()),
            Validate::Full => Some(ValidationOptions::full()),
        },
        certificate: args.certificate.then(ColumnOptions::default),
        seed: args.method.seed,
        command,
    };
    let bar = progress_bar();
    let outcome = pipeline::run(&request, &mut |message| bar.set_message(message));
    bar.finish_and_clear();
    let report = outcome?;
    if args.json {
        let json = serde_json::to_string(&report).map_err(FitError::Report)?;
        println!("{json}");
    } else {
        print!("{report}");
    }
    match request.max_error {
        Some(wanted) if report.worst_error() > wanted => Err(CliError::Target { found: report.worst_error(), wanted }),
        _ => Ok(()),
    }
}

/// Measures all methods and prints the table.
fn ablate(args: AblateArgs, command: String) -> Result<(), CliError> {
    let domain = light_domain(&args.method.lights)?;
    set_threads(args.method.threads)?;
    let request = FitRequest {
        model: args.model,
        out_dir: args.out,
        effort: args.method.preset.effort(),
        ground: false,
        max_planes: Some(usize::from(args.max_planes)),
        max_lookups: None,
        sections: args.sections.map(usize::from),
        texture_budget: None,
        certificate: None,
        max_error: None,
        texture_size: args.method.texture_size.map(usize::from),
        domain,
        domain_text: args.method.lights,
        planes: args.planes,
        validation: None,
        seed: args.method.seed,
        command,
    };
    let bar = progress_bar();
    let outcome = ablation::run(&request, &mut |message| bar.set_message(message));
    bar.finish_and_clear();
    print!("{}", outcome?);
    Ok(())
}

/// A spinner on a terminal, nothing elsewhere.
fn progress_bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed_precise} {msg}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(120));
    bar
}
