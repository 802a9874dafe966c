//! Files of an asset: which ones a model needs, and writing several of them all or nothing.
//!
//! A [`Batch`] first writes every file under a temporary name (starting with `.`) beside its place and syncs it,
//! then renames them one after another. An error on the way removes what was made. Guaranteed: no file is ever
//! seen half written, also after a kill. Not guaranteed: that a kill between two renames leaves a matching set.

use super::{AssetError, uri};
use serde_json::Value;
use std::{
    fs, io,
    path::{Component, Path, PathBuf},
};
use tempfile::NamedTempFile;

/// A file that a model names by a relative URI.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct External {
    /// Path below the model's folder.
    pub relative: PathBuf,
    /// Where it lies.
    pub source: PathBuf,
}

/// What a model needs beside its own file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Externals {
    /// Buffers and images that exist, sorted, each once.
    pub found: Vec<External>,
    /// URIs of images that do not exist or are no relative paths (`https:`): the output names them as the input
    /// does.
    pub not_copied: Vec<String>,
}

/// Reads a whole file.
///
/// # Errors
/// It cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>, AssetError> {
    fs::read(path).map_err(|source| AssetError::Io { action: "read", path: path.into(), source })
}

/// The external files of the glTF document `root` in the file `input`; `data:` URIs are none.
///
/// # Errors
/// A path that leads out of the model's folder; a buffer that does not exist.
pub fn external_files(input: &Path, root: &Value) -> Result<Externals, AssetError> {
    let mut externals = Externals::default();
    for kind in ["buffers", "images"] {
        let list = root.get(kind).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        for (i, entry) in list.iter().enumerate() {
            let Some(uri) = entry.get("uri").and_then(Value::as_str).filter(|uri| !uri::is_data(uri)) else { continue };
            let pointer = || format!("/{kind}/{i}/uri");
            match locate(input, uri) {
                Ok(file) if file.source.is_file() => externals.found.push(file),
                Ok(file) if kind == "buffers" => {
                    return Err(AssetError::Io {
                        action: "read",
                        path: file.source,
                        source: io::ErrorKind::NotFound.into(),
                    });
                }
                Err(why) if kind == "buffers" || !uri::has_scheme(uri) => {
                    return Err(AssetError::Invalid { path: input.into(), pointer: pointer(), why });
                }
                _ => externals.not_copied.push(uri.to_owned()),
            }
        }
    }
    externals.found.sort();
    externals.found.dedup();
    Ok(externals)
}

/// The file that a relative URI in the file `document` names, whether it exists or not.
///
/// # Errors
/// Why the URI is no path below the document's folder, also through symbolic links.
pub fn locate(document: &Path, uri: &str) -> Result<External, String> {
    if uri::has_scheme(uri) {
        return Err(format!("{uri:?} is no relative path: put the file beside the model"));
    }
    let folder = folder_of(document);
    let decoded = uri::decode(uri).ok_or_else(|| format!("{uri:?} is not UTF-8 when decoded"))?;
    // Writers that do not encode may have a "%41" in the name itself.
    let name = if folder.join(&decoded).exists() { decoded.as_str() } else { uri };
    let name = if folder.join(name).exists() { name } else { decoded.as_str() };
    let mut relative = PathBuf::new();
    for component in Path::new(name).components() {
        match component {
            Component::Normal(part) => relative.push(part),
            Component::CurDir => {}
            _ => return Err(format!("{uri:?} leads out of the model's folder: put the file below it")),
        }
    }
    let source = folder.join(&relative);
    if let (Ok(real), Ok(real_folder)) = (source.canonicalize(), folder.canonicalize())
        && !real.starts_with(&real_folder)
    {
        return Err(format!("{uri:?} is a link that leads out of the model's folder: put the file below it"));
    }
    Ok(External { relative, source })
}

/// The folder that holds a file, `.` for a bare name.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Do two paths lead to one file, also by symbolic or hard links? False where one does not exist.
#[must_use]
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    if let (Ok(a), Ok(b)) = (fs::metadata(a), fs::metadata(b)) {
        use std::os::unix::fs::MetadataExt;
        return (a.dev(), a.ino()) == (b.dev(), b.ino());
    }
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Files on their way to the disk.
#[derive(Debug, Default)]
pub struct Batch {
    staged: Vec<(NamedTempFile, PathBuf)>,
    new_folders: Vec<PathBuf>,
    new_files: Vec<PathBuf>,
}

impl Batch {
    /// Writes the contents beside `path` under a temporary name, making folders where needed.
    ///
    /// # Errors
    /// The file system says no.
    pub fn stage(&mut self, path: &Path, contents: &[u8]) -> Result<(), AssetError> {
        let failed = |source| AssetError::Io { action: "write", path: path.into(), source };
        let folder = folder_of(path);
        self.make_folder(folder).map_err(failed)?;
        if path.is_dir() {
            return Err(failed(io::ErrorKind::IsADirectory.into()));
        }
        let mut file = temporary_file(folder).map_err(failed)?;
        io::Write::write_all(&mut file, contents).map_err(failed)?;
        file.as_file().sync_all().map_err(failed)?;
        self.staged.push((file, path.into()));
        Ok(())
    }

    /// Stages a copy of a file that the model needs, unless it is there already.
    ///
    /// # Errors
    /// Another file is in its place; the file system says no.
    pub fn stage_copy(&mut self, source: &Path, path: &Path) -> Result<(), AssetError> {
        if is_same_file(source, path) {
            return Ok(());
        }
        let contents = read(source)?;
        if path.symlink_metadata().is_err() {
            self.stage(path, &contents)
        } else if fs::read(path).is_ok_and(|there| there == contents) {
            Ok(())
        } else {
            Err(AssetError::Occupied { path: path.into() })
        }
    }

    /// Renames all files to their places, in the order in which they were staged.
    ///
    /// # Errors
    /// A rename fails; files that did not exist before are removed again.
    pub fn commit(mut self) -> Result<(), AssetError> {
        for (file, path) in std::mem::take(&mut self.staged) {
            let is_new = path.symlink_metadata().is_err();
            match file.persist(&path) {
                Ok(_) if is_new => self.new_files.push(path),
                Ok(_) => {}
                Err(error) => return Err(AssetError::Io { action: "write", path, source: error.error }),
            }
        }
        self.new_files.clear();
        self.new_folders.clear();
        Ok(())
    }

    /// Makes a folder and those above it, and remembers the new ones, outermost first.
    fn make_folder(&mut self, folder: &Path) -> io::Result<()> {
        let missing = folder.ancestors().take_while(|f| !f.as_os_str().is_empty() && f.symlink_metadata().is_err());
        let mut missing: Vec<PathBuf> = missing.map(Path::to_path_buf).collect();
        missing.reverse();
        self.new_folders.extend(missing);
        fs::create_dir_all(folder)
    }
}

impl Drop for Batch {
    /// Undoes what was not committed. Failures here have no remedy and hide the error that led here.
    fn drop(&mut self) {
        self.staged.clear();
        for file in &self.new_files {
            let _ = fs::remove_file(file);
        }
        for folder in self.new_folders.iter().rev() {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// A temporary file with the permissions of any new file (the crate's default is readable by the owner only).
fn temporary_file(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".shadowfit-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}
