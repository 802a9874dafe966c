//! The method of shadowfit: from a triangle soup to shadow planes with occluder textures.
//!
//! Deterministic: the same input and seed give the same bytes at any thread count. No files, no GPU, no clock,
//! no environment, no printing.

pub mod baselines;
pub mod budget;
pub mod certificate;
pub mod columns;
pub mod crossing;
pub mod field;
pub mod fit;
pub mod ground;
pub mod halves;
pub mod harmonics;
pub mod importance;
pub mod lights;
pub mod lists;
pub mod mesh;
pub mod metrics;
pub mod pair_table;
pub mod plane;
pub mod pool;
pub mod proposals;
pub mod receivers;
pub mod rectangle;
pub mod relaxation;
pub mod sampling;
pub mod search;
pub mod sections;
pub mod shade;
pub mod shadow_map;
pub mod smoothing;
pub mod symmetry;
pub mod vertex_visibility;
pub mod visibility;
pub(crate) mod window;
