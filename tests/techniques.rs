//! Each technique against the traced reference on closed-form scenes, with the class of error that is expected of it.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

#[allow(dead_code, reason = "each test binary uses its part")]
mod fits;
#[path = "techniques/golden.rs"]
mod golden;
#[path = "techniques/occluder_planes.rs"]
mod occluder_planes;
#[path = "techniques/perspective_shadow_map.rs"]
mod perspective_shadow_map;
mod pictures;
#[path = "techniques/planar.rs"]
mod planar;
#[allow(dead_code, reason = "each test binary uses its part")]
mod procedural;
#[path = "techniques/projective_texture.rs"]
mod projective_texture;
#[path = "techniques/shadow_map.rs"]
mod shadow_map;
#[path = "techniques/silhouette_map.rs"]
mod silhouette_map;
#[path = "techniques/soft_edges.rs"]
mod soft_edges;
#[path = "techniques/soft_planar.rs"]
mod soft_planar;
mod stages;
#[path = "techniques/stencil_volumes.rs"]
mod stencil_volumes;
#[path = "techniques/tints.rs"]
mod tints;
#[path = "techniques/transparent.rs"]
mod transparent;
#[path = "techniques/unshadowed.rs"]
mod unshadowed;
#[path = "techniques/vertex_visibility.rs"]
mod vertex_visibility;
