//! Each technique against the traced reference on closed-form scenes, with the class of error that is expected of it.

#[path = "techniques/golden.rs"]
mod golden;
mod pictures;
#[path = "techniques/shadow_map.rs"]
mod shadow_map;
mod stages;
#[path = "techniques/stencil_volumes.rs"]
mod stencil_volumes;
#[path = "techniques/transparent.rs"]
mod transparent;
#[path = "techniques/unshadowed.rs"]
mod unshadowed;
