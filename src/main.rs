//! The program: arguments in, exit code out.

use clap::{Parser, error::ErrorKind};
use shadowfit::cli::{self, Cli};
use std::{
    io::{IsTerminal, stderr},
    process::ExitCode,
};
use tracing_subscriber::{
    Layer,
    filter::{LevelFilter, Targets},
    fmt,
    layer::SubscriberExt,
    util::SubscriberInitExt,
};

/// Warnings go to stderr. wgpu tries every driver and calls each one that it cannot use an error: whether one of
/// them draws, the program itself says.
fn set_up_log() {
    let filter = Targets::new().with_default(LevelFilter::WARN).with_target("wgpu_hal", LevelFilter::OFF);
    let to_stderr = fmt::layer().with_writer(stderr).with_ansi(stderr().is_terminal()).without_time();
    tracing_subscriber::registry().with(to_stderr.with_filter(filter)).init();
}

fn main() -> ExitCode {
    set_up_log();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Nothing can be done where even the message cannot be printed.
            let _ = error.print();
            let is_answer = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
            return ExitCode::from(u8::from(!is_answer));
        }
    };
    match cli::run(cli, std::env::args().collect::<Vec<_>>().join(" ")) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
