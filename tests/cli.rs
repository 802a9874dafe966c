//! The program from outside: exit codes, what is printed where, and which files there are afterwards, also after a
//! kill. Models are small and efforts low: how good a fit is, other tests say.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

#[path = "cli/ablate.rs"]
mod ablate;
#[path = "cli/answers.rs"]
mod answers;
#[allow(dead_code, reason = "shared with tests/scene.rs, which uses more of it")]
#[path = "scene/build.rs"]
mod build;
#[path = "cli/compare.rs"]
mod compare;
#[path = "cli/determinism.rs"]
mod determinism;
#[path = "cli/ground.rs"]
mod ground;
#[path = "cli/inputs.rs"]
mod inputs;
#[path = "cli/kills.rs"]
mod kills;
#[path = "cli/options.rs"]
mod options;
#[path = "cli/program.rs"]
mod program;
#[path = "cli/refusals.rs"]
mod refusals;
#[path = "cli/render.rs"]
mod render;
