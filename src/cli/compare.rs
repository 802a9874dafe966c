//! `shadowfit compare`.

use super::{CliError, Preset, progress_bar};
use crate::{
    comparison::{self, CompareOptions, Family},
    pipeline::{FitRequest, stem_of},
};
use clap::{Args, ValueEnum};
use shadowfit_solver::lights::LightDomain;
use std::{collections::BTreeSet, path::PathBuf};

#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// The models: .glb or .gltf. One without planes is fitted first, with 8 planes and divided.
    #[arg(required = true, value_name = "MODEL")]
    models: Vec<PathBuf>,
    /// Folder of the tables, the charts and the pictures; made where it is missing.
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Techniques [default: all].
    #[arg(long, value_name = "LIST", value_enum, value_delimiter = ',')]
    techniques: Vec<Family>,
    /// Light directions.
    #[arg(long = "lights", value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=64))]
    lights: u16,
    /// Views around the model.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=64))]
    views: u16,
    /// Width and height of the frames in pixels.
    #[arg(long, value_name = "PX", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(64..=4096))]
    size: u32,
    /// Frames of each technique that are timed.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u16).range(1..=1000))]
    frames: u16,
    /// Instances of the model in the scaling tests; 0: no such tests.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1,10,100,200",
          value_parser = clap::value_parser!(u16).range(0..=2000))]
    instances: Vec<u16>,
    /// How much work the fits do.
    #[arg(long, value_enum, default_value_t = Preset::Balanced)]
    preset: Preset,
    /// Seed of all sampling.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
}

/// Compares the techniques on each model and prints the tables.
pub(super) fn compare(args: &CompareArgs, command: &str) -> Result<(), CliError> {
    let mut families =
        if args.techniques.is_empty() { Family::value_variants().to_vec() } else { args.techniques.clone() };
    families.push(Family::None);
    families.sort();
    families.dedup();
    let options = CompareOptions {
        families,
        lights: usize::from(args.lights),
        views: usize::from(args.views),
        size_px: args.size,
        frames: usize::from(args.frames),
        instances: args.instances.iter().map(|&n| usize::from(n)).filter(|&n| n > 0).collect(),
    };
    let mut names = BTreeSet::new();
    if let Some(model) = args.models.iter().find(|model| !names.insert(stem_of(model))) {
        let name = stem_of(model);
        return Err(CliError::Usage(format!("two models are called {name}: their tables would lie in the same files")));
    }
    for model in &args.models {
        let request = FitRequest {
            model: model.clone(),
            out_dir: args.out.clone(),
            effort: args.preset.effort(),
            max_planes: None,
            max_lookups: None,
            sections: None,
            texture_budget: None,
            certificate: None,
            max_error: None,
            texture_size: None,
            domain: LightDomain::Sphere,
            domain_text: "sphere".to_string(),
            planes: None,
            ground: false,
            validation: None,
            seed: args.seed,
            command: command.to_string(),
        };
        let bar = progress_bar();
        let outcome = comparison::run(&request, &options, &mut |message| bar.set_message(message));
        bar.finish_and_clear();
        print!("{}", outcome?.markdown());
    }
    Ok(())
}
