//! The program: arguments in, exit code out.

use clap::{Parser, error::ErrorKind};
use shadowfit::cli::{self, Cli};
use std::process::ExitCode;

fn main() -> ExitCode {
    let filter = tracing_subscriber::filter::LevelFilter::WARN;
    tracing_subscriber::fmt().with_max_level(filter).with_writer(std::io::stderr).without_time().init();
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
