//! Reading glTF: files built in memory, broken files, and a corpus of real ones where there is one.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails; clippy only knows that of `#[test]` functions")]

#[path = "scene/broken.rs"]
mod broken;
#[path = "scene/build.rs"]
mod build;
#[path = "scene/corpus.rs"]
mod corpus;
#[path = "scene/files.rs"]
mod files;
#[path = "scene/geometry.rs"]
mod geometry;
#[path = "scene/materials.rs"]
mod materials;
