//! Shadow volumes: their borders on the CPU, and what is drawn with them.

#[path = "volumes/borders.rs"]
mod borders;
#[allow(dead_code, reason = "each test binary uses its part")]
mod stages;
#[path = "volumes/stencil.rs"]
mod stencil;
#[path = "volumes/transparent.rs"]
mod transparent;
