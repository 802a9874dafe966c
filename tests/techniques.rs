//! Each technique against the traced reference on closed-form scenes, with the class of error that is expected of it.

#[path = "techniques/perspective_shadow_map.rs"]
mod perspective_shadow_map;
#[path = "techniques/shadow_map.rs"]
mod shadow_map;
#[path = "techniques/silhouette_map.rs"]
mod silhouette_map;
mod stages;
#[path = "techniques/unshadowed.rs"]
mod unshadowed;
