//! shadowfit finds shadow planes through a 3D model and bakes an occluder texture on each, so that any renderer
//! draws the model's self-shadows for any light direction in one pass, without a shadow map.

pub mod ablation;
pub mod asset;
pub mod cli;
pub mod comparison;
pub mod effort;
mod fitting;
pub mod gltf_file;
pub mod masks;
pub mod pipeline;
pub mod render;
pub mod report;
pub mod scene;
pub mod validation;
