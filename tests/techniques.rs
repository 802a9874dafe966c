//! Each technique against the traced reference on closed-form scenes, with the class of error that is expected of it.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

#[allow(dead_code, reason = "each test binary uses its part")]
mod fits;
#[path = "techniques/golden.rs"]
mod golden;
mod pictures;
#[path = "techniques/shadow_map.rs"]
mod shadow_map;
#[path = "techniques/soft_edges.rs"]
mod soft_edges;
mod stages;
#[path = "techniques/unshadowed.rs"]
mod unshadowed;
#[path = "techniques/vertex_visibility.rs"]
mod vertex_visibility;
