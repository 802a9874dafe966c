//! Models that break what is taken for granted: far away, tiny, huge, flat, doubled, mirrored, hidden, empty, wrong.
//! Each must end with a sound asset that is as good as that of the plain model, or with the right refusal.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

#[allow(dead_code, reason = "shared with tests/scene.rs, which uses more of it")]
#[path = "scene/build.rs"]
mod build;
mod fits;
#[path = "hard_cases/lights.rs"]
mod lights;
#[path = "hard_cases/placement.rs"]
mod placement;
#[path = "hard_cases/shapes.rs"]
mod shapes;
#[path = "hard_cases/stability.rs"]
mod stability;
#[path = "hard_cases/surfaces.rs"]
mod surfaces;

// The cases of the table, see `examples/hard_cases/main.rs`.
#[allow(dead_code, reason = "shared with the example that writes the table")]
#[path = "../examples/hard_cases/cases.rs"]
mod cases;
#[path = "../examples/hard_cases/double.rs"]
mod double;
#[allow(dead_code, reason = "shared with the example that writes the table")]
#[path = "../examples/hard_cases/fit.rs"]
mod fit;
#[path = "../solver/tests/scenes/mod.rs"]
mod scenes;
#[allow(dead_code, reason = "shared with the example that writes the table")]
#[path = "../examples/hard_cases/sweep.rs"]
mod sweep;
