//! Shadow volumes: their borders on the CPU, and what is drawn with them.

#[path = "volumes/borders.rs"]
mod borders;
