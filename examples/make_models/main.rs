//! Writes the models and the hand-made plane files of `models/`: `cargo run --example make_models [-- DIR]`.
//!
//! Deterministic: the committed files are what it writes, byte for byte (`tests/models.rs` compares them).

#[path = "catalogue.rs"]
mod catalogue;

use std::{env, fs, io, path::PathBuf};

/// Where the files go if no folder is given, relative to the working directory.
const DEFAULT_FOLDER: &str = "models";

fn main() -> io::Result<()> {
    let folder = PathBuf::from(env::args().nth(1).unwrap_or_else(|| DEFAULT_FOLDER.to_owned()));
    for file in catalogue::all_files() {
        let path = folder.join(file.path);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent)?;
        }
        fs::write(&path, &file.bytes)?;
        println!("{} ({} bytes)", path.display(), file.bytes.len());
    }
    Ok(())
}
