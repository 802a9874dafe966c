//! Files of an asset: writing several of them all or nothing.
//!
//! A [`Batch`] first writes every file under a temporary name (starting with `.`) beside its place and syncs it,
//! then renames them one after another. An error on the way removes what was made. Guaranteed: no file is ever
//! seen half written, also after a kill. Not guaranteed: that a kill between two renames leaves a matching set.

use super::AssetError;
use crate::gltf_file::{folder_of, read_file};
use std::{
    fs, io,
    path::{Path, PathBuf},
};
use tempfile::NamedTempFile;

/// Reads a whole file.
///
/// # Errors
/// It cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>, AssetError> {
    read_file(path).map_err(|source| AssetError::Io { action: "read", path: path.into(), source })
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
