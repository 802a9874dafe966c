//! The method of shadowfit: from a triangle soup to shadow planes with occluder textures.
//!
//! Deterministic: the same input and seed give the same bytes at any thread count. No files, no GPU, no clock,
//! no environment, no printing.

pub mod bake;
pub mod baselines;
pub mod candidates;
pub mod lights;
pub mod mesh;
pub mod metrics;
pub mod plane;
pub mod receivers;
pub mod rectangle;
pub mod sampling;
pub mod selection;
pub mod shade;
pub mod shadow_map;
pub mod visibility;
pub mod votes;
