//! A glTF file as bytes and JSON: the container, and the buffers and images beside it.
//!
//! In: the bytes of a `.glb` or `.gltf` (what it is decides its content, not its name), or of another JSON
//! document whose URIs mean the same (the sidecar of an asset). Out: a [`GltfFile`] with the JSON as text and as
//! a value, the binary chunk, and the bytes behind any URI. What the JSON says is the business of its readers.
//!
//! Guaranteed: nothing outside the file's own folder is opened or listed. A URI with a scheme, an absolute path, a
//! `..`, a backslash or a link that leads out of the folder is an error. No file above [`MAX_FILE_BYTES`] is read.
//! Source: glTF 2.0 specification (Khronos, ISO/IEC 12113:2022), sections 2.8 (URIs) and 4.4 (GLB).

pub mod container;
pub mod uri;

use container::Chunks;
use serde_json::Value;
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// Name of the glTF extension of shadow planes. Listed in `extensionsUsed`, never in `extensionsRequired`.
pub const EXTENSION: &str = "SHADOWFIT_node_shadow_planes";

/// Name of the vertex attribute that tells the sections of a primitive's triangles apart: a scalar, the same at the
/// three corners of a triangle.
pub const SECTION_ATTRIBUTE: &str = "_SHADOW_SECTION";

/// Largest file that is read, bytes: a GLB cannot be longer (its length is a 32-bit number), and a sparse file
/// or a wrong mount must not fill the memory.
pub const MAX_FILE_BYTES: u64 = u32::MAX as u64;

/// A place in a document that is wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{pointer}: {reason}")]
pub struct Invalid {
    /// JSON pointer (RFC 6901) of the culprit; empty where it is the whole file.
    pub pointer: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Why a URI has no bytes.
#[derive(Debug, thiserror::Error)]
pub enum UriError {
    /// It leads where a model must not reach.
    #[error("{0}")]
    Forbidden(String),
    /// A `data:` URI that does not decode.
    #[error("{0}")]
    Damaged(String),
    /// The file that it names cannot be read.
    #[error("cannot read the external file {:?} in the model's folder: {source}", file.relative)]
    Unreadable {
        /// The file.
        file: External,
        /// What the system says.
        source: io::Error,
    },
}

/// An open file.
#[derive(Clone, Debug)]
pub struct GltfFile<'a> {
    path: &'a Path,
    chunks: Chunks<'a>,
    root: Value,
}

impl<'a> GltfFile<'a> {
    /// Takes the bytes of the file at `path` apart. A byte order mark before the JSON is ignored.
    ///
    /// # Errors
    /// A damaged GLB, or text that is not a JSON object in UTF-8.
    pub fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Self, Invalid> {
        let invalid = |reason: String| Invalid { pointer: String::new(), reason };
        let is_glb = bytes.starts_with(container::MAGIC);
        let mut chunks = if is_glb {
            container::split(bytes).map_err(|reason| invalid(format!("GLB: {reason}")))?
        } else {
            let json = std::str::from_utf8(bytes).map_err(|error| {
                invalid(format!("neither GLB nor UTF-8 text: the file does not start with `glTF`, and has an {error}"))
            })?;
            Chunks { json, bin: None, others: Vec::new() }
        };
        chunks.json = chunks.json.strip_prefix('\u{feff}').unwrap_or(chunks.json);
        let root: Value = serde_json::from_str(chunks.json).map_err(|error| {
            let no_glb = if is_glb { "" } else { " (and the file does not start with `glTF`, as a GLB does)" };
            invalid(format!("not JSON: {error}{no_glb}"))
        })?;
        if !root.is_object() {
            return Err(invalid("the JSON is not an object".to_owned()));
        }
        Ok(Self { path, chunks, root })
    }

    /// Where the file lies.
    #[must_use]
    pub fn path(&self) -> &'a Path {
        self.path
    }

    /// The JSON as text, the binary chunk, and the other chunks.
    #[must_use]
    pub fn chunks(&self) -> &Chunks<'a> {
        &self.chunks
    }

    /// The JSON as a value; an object.
    #[must_use]
    pub fn root(&self) -> &Value {
        &self.root
    }

    /// `asset.version` must be 2.x, and `asset.minVersion`, where it is given, 2.0.
    ///
    /// # Errors
    /// It is not.
    pub fn check_version(&self) -> Result<(), Invalid> {
        let of = |key: &str| self.root.get("asset").and_then(|asset| asset.get(key)).and_then(Value::as_str);
        let wrong = |key: &str, reason: String| Err(Invalid { pointer: format!("/asset/{key}"), reason });
        match (of("version"), of("minVersion")) {
            (None, _) => wrong("version", "missing: this is not a glTF 2.0 file".to_owned()),
            (Some(version), _) if !version.starts_with("2.") => {
                let remedy = "convert it with `npx gltf-pipeline -i IN -o OUT`";
                wrong("version", format!("not glTF 2.0 but {version:?}: {remedy}"))
            }
            (_, None | Some("2.0")) => Ok(()),
            (_, Some(version)) => wrong("minVersion", format!("needs a reader of glTF {version:?}, not 2.0")),
        }
    }

    /// The bytes behind a URI of the JSON: decoded from a `data:` URI, or read from the file's folder.
    ///
    /// # Errors
    /// A URI that is malformed or leads out of the folder, or a file that cannot be read.
    pub fn fetch(&self, uri: &str) -> Result<Vec<u8>, UriError> {
        if uri::is_data(uri) {
            return uri::data(uri).map_err(UriError::Damaged);
        }
        let file = self.locate(uri).map_err(UriError::Forbidden)?;
        read_file(&file.path).map_err(|source| UriError::Unreadable { file, source })
    }

    /// Where the buffers and images lie that are files of their own, in the order of the document, buffers
    /// first, each once. Whether they exist is not checked.
    ///
    /// # Errors
    /// A URI that leads out of the folder. Images elsewhere (`https:`) are no error: they are listed.
    pub fn externals(&self) -> Result<Externals, Invalid> {
        let mut externals = Externals::default();
        for (list, kind) in [("buffers", Kind::Buffer), ("images", Kind::Image)] {
            let entries = self.root.get(list).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
            for (i, entry) in entries.iter().enumerate() {
                let Some(uri) = entry.get("uri").and_then(Value::as_str).filter(|uri| !uri::is_data(uri)) else {
                    continue;
                };
                if kind == Kind::Image && uri::has_scheme(uri) {
                    externals.elsewhere.push(uri.to_owned());
                    continue;
                }
                let file = self.locate(uri);
                let file = file.map_err(|reason| Invalid { pointer: format!("/{list}/{i}/uri"), reason })?;
                if externals.files.iter().all(|(known, _)| known.relative != file.relative) {
                    externals.files.push((file, kind));
                }
            }
        }
        Ok(externals)
    }

    /// The file that a relative URI names, whether it exists or not.
    fn locate(&self, uri: &str) -> Result<External, String> {
        let folder = folder_of(self.path);
        let mut relative = uri::relative_path(uri)?;
        // Writers that do not encode may have a "%41" in the name itself.
        if !folder.join(&relative).exists()
            && let Ok(verbatim) = uri::checked_path(uri, uri)
            && folder.join(&verbatim).exists()
        {
            relative = verbatim;
        }
        let path = folder.join(&relative);
        if let (Ok(inside), Ok(real)) = (folder.canonicalize(), path.canonicalize())
            && !real.starts_with(inside)
        {
            return Err(format!("{relative:?} is a link out of the model's folder: put the file itself there"));
        }
        Ok(External { relative, path })
    }
}

/// A file that a document names by a relative URI.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct External {
    /// Path below the document's folder, percent-decoded, `/` between its parts.
    pub relative: String,
    /// Where it lies.
    pub path: PathBuf,
}

/// What a document names a file as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Without it the model is incomplete.
    Buffer,
    /// Decoration.
    Image,
}

/// What a document needs beside its own file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Externals {
    /// Files in the document's folder or below it.
    pub files: Vec<(External, Kind)>,
    /// URIs of images that are no relative paths.
    pub elsewhere: Vec<String>,
}

/// Reads a regular file of at most [`MAX_FILE_BYTES`].
///
/// # Errors
/// What the system says, or that the file is too large or not a regular one.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let metadata = fs::metadata(path)?;
    if !metadata.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
    }
    if metadata.len() > MAX_FILE_BYTES {
        let text = format!("{} bytes are more than MAX_FILE_BYTES = {MAX_FILE_BYTES}", metadata.len());
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, text));
    }
    fs::read(path)
}

/// The folder that holds a file, `.` for a bare name.
#[must_use]
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
