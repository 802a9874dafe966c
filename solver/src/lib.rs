//! The method of shadowfit: from a triangle soup to shadow planes with occluder textures.
//!
//! Deterministic: the same input and seed give the same bytes at any thread count. No files, no GPU, no clock,
//! no environment, no printing.

pub mod mesh;
pub mod plane;
pub mod shade;
