//! Each technique against the traced reference on closed-form scenes, with the class of error that is expected of it.

#[path = "techniques/shadow_map.rs"]
mod shadow_map;
mod stages;
#[path = "techniques/unshadowed.rs"]
mod unshadowed;
#[path = "techniques/vertex_visibility.rs"]
mod vertex_visibility;
