//! The bytes of a model: the file itself, the chunks of a GLB, and the buffers and images beside it.
//!
//! In: a path, or a URI of the JSON. Out: bytes. Nothing outside the model's own folder is ever opened: a URI
//! with a scheme, an absolute path, a `..` or a link that leads out of the folder is an error.
//!
//! Containers: glTF 2.0 specification, section 4.4 (GLB) and 2.8 (URIs). A GLB may be longer than its header
//! says (the rest is ignored), never shorter; unknown chunks are skipped.

use super::{Fault, SceneError, document::Document};
use base64::Engine as _;
use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
    fs, io,
    ops::Range,
    path::{Path, PathBuf},
};

/// Largest file that is read, bytes: a GLB cannot be longer (its length is a 32-bit number), and a sparse file
/// or a wrong mount must not fill the memory.
pub(super) const MAX_FILE_BYTES: u64 = u32::MAX as u64;

const GLB_MAGIC: &[u8] = b"glTF";
const CHUNK_JSON: u32 = u32::from_le_bytes(*b"JSON");
const CHUNK_BIN: u32 = u32::from_le_bytes(*b"BIN\0");

/// A model file in memory.
pub(super) struct ModelFile {
    /// Where it lies.
    pub path: PathBuf,
    bytes: Vec<u8>,
    json: Range<usize>,
    bin: Option<Range<usize>>,
}

impl ModelFile {
    /// Reads the file and splits it into its chunks.
    ///
    /// # Errors
    /// A file that cannot be read, or a container that is not glTF 2.0.
    pub(super) fn open(path: &Path) -> Result<Self, SceneError> {
        let bytes = read_file(path).map_err(|source| SceneError::Io { path: path.to_owned(), source })?;
        let is_glb = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
        let chunks =
            if bytes.starts_with(GLB_MAGIC) || is_glb { glb_chunks(&bytes) } else { Ok((0..bytes.len(), None)) };
        let (json, bin) = chunks.map_err(|fault| fault.at(path))?;
        Ok(Self { path: path.to_owned(), bytes, json, bin })
    }

    /// The JSON text.
    pub(super) fn json(&self) -> &[u8] {
        &self.bytes[self.json.clone()]
    }

    /// The bytes behind a URI of the JSON: decoded from a `data:` URI, or read from the model's folder.
    ///
    /// # Errors
    /// A URI that is malformed or leads out of the folder, or a file that cannot be read.
    pub(super) fn fetch(&self, uri: &str, pointer: &str) -> Result<Vec<u8>, Fetch> {
        if let Some(data) = data_uri(uri, pointer) {
            return data.map_err(Fetch::Broken);
        }
        let relative = relative_path(uri, pointer).map_err(Fetch::Forbidden)?;
        let folder = match self.path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let file = folder.join(&relative);
        // A link must not lead out of the folder either.
        if let (Ok(inside), Ok(real)) = (folder.canonicalize(), file.canonicalize())
            && !real.starts_with(inside)
        {
            let reason = format!("{relative:?} is a link out of the model's folder; put the file itself there");
            return Err(Fetch::Forbidden(Fault::new(pointer, reason)));
        }
        read_file(&file).map_err(|error| {
            let reason = format!("cannot read the external file {relative:?} in the model's folder: {error}");
            Fetch::Broken(Fault::new(pointer, reason))
        })
    }
}

/// Why [`ModelFile::fetch`] has no bytes.
pub(super) enum Fetch {
    /// The URI leads where a model must not reach.
    Forbidden(Fault),
    /// The file is missing, or the `data:` URI is damaged.
    Broken(Fault),
}

impl From<Fetch> for Fault {
    fn from(fetch: Fetch) -> Self {
        match fetch {
            Fetch::Forbidden(fault) | Fetch::Broken(fault) => fault,
        }
    }
}

/// The buffers of a document. A buffer without data (the fallback of a compressed one) fails where it is used.
pub(super) struct Buffers<'a> {
    bytes: Vec<Option<Source<'a>>>,
    files: Vec<Vec<u8>>,
}

enum Source<'a> {
    Chunk(&'a [u8]),
    File(usize),
}

impl<'a> Buffers<'a> {
    /// Loads every buffer; one that several records name is loaded once.
    ///
    /// # Errors
    /// A missing file, a damaged `data:` URI, or fewer bytes than `byteLength`.
    pub(super) fn load(model: &'a ModelFile, document: &Document) -> Result<Self, Fault> {
        let mut buffers = Self { bytes: Vec::new(), files: Vec::new() };
        let mut file_of: HashMap<&str, usize> = HashMap::new();
        let mut total = 0;
        for (i, buffer) in document.buffers.iter().enumerate() {
            let source = match &buffer.uri {
                Some(uri) => Some(match file_of.get(uri.as_str()) {
                    Some(&file) => Source::File(file),
                    None => {
                        let pointer = format!("/buffers/{i}/uri");
                        let bytes = model.fetch(uri, &pointer)?;
                        total += bytes.len() as u64;
                        if total > MAX_FILE_BYTES {
                            let reason = format!("the buffers exceed MAX_FILE_BYTES = {MAX_FILE_BYTES}");
                            return Err(Fault::new(pointer, reason));
                        }
                        buffers.files.push(bytes);
                        file_of.insert(uri, buffers.files.len() - 1);
                        Source::File(buffers.files.len() - 1)
                    }
                }),
                None if i == 0 => model.bin.clone().map(|bin| Source::Chunk(&model.bytes[bin])),
                None => None,
            };
            buffers.bytes.push(source);
            if let Some(bytes) = buffers.get(i)
                && (bytes.len() as u64) < buffer.byte_length
            {
                let reason = format!("{} bytes announced, but the data has {}", buffer.byte_length, bytes.len());
                return Err(Fault::new(format!("/buffers/{i}/byteLength"), reason));
            }
        }
        Ok(buffers)
    }

    /// The bytes of buffer `i`, or `None` where it has no data.
    pub(super) fn get(&self, i: usize) -> Option<&[u8]> {
        match self.bytes.get(i)?.as_ref()? {
            Source::Chunk(bytes) => Some(bytes),
            Source::File(file) => self.files.get(*file).map(Vec::as_slice),
        }
    }
}

/// The checked relative paths of external buffers and images, in the order of the file, each once.
pub(super) fn external_paths(document: &Document) -> Result<Vec<String>, Fault> {
    let buffers = document.buffers.iter().map(|b| &b.uri).enumerate().map(|(i, uri)| ("buffers", i, uri));
    let images = document.images.iter().map(|b| &b.uri).enumerate().map(|(i, uri)| ("images", i, uri));
    let (mut paths, mut seen) = (Vec::new(), HashSet::new());
    for (list, i, uri) in buffers.chain(images) {
        let Some(uri) = uri else { continue };
        if !is_data_uri(uri) {
            let path = relative_path(uri, &format!("/{list}/{i}/uri"))?;
            if seen.insert(path.clone()) {
                paths.push(path);
            }
        }
    }
    Ok(paths)
}

/// Reads a regular file of at most [`MAX_FILE_BYTES`].
fn read_file(path: &Path) -> io::Result<Vec<u8>> {
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

/// The ranges of the JSON chunk and of the BIN chunk of a GLB.
fn glb_chunks(bytes: &[u8]) -> Result<(Range<usize>, Option<Range<usize>>), Fault> {
    let broken = |reason: String| Fault::new("", format!("GLB: {reason}"));
    if !bytes.starts_with(GLB_MAGIC) {
        return Err(broken("the file does not start with `glTF`".to_owned()));
    }
    let word = |at: usize| -> Option<u32> {
        bytes.get(at..at.checked_add(4)?).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes)
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(broken(format!("{} bytes are less than the header's 12", bytes.len())));
    };
    if version != 2 {
        return Err(broken(format!(
            "version {version}, but 2 is read: convert it with `npx gltf-pipeline -i IN -o OUT`"
        )));
    }
    let length = length as usize;
    if length > bytes.len() {
        return Err(broken(format!("the header says {length} bytes, but the file has {}", bytes.len())));
    }
    let (mut json, mut bin) = (None, None);
    let (mut at, mut chunk) = (12, 0);
    // A tail of less than a chunk header is padding.
    while at + 8 <= length {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else { break };
        let range = at + 8..at + 8 + size as usize;
        if range.end > length {
            return Err(broken(format!("chunk {chunk} says {size} bytes, but {} are left", length - range.start)));
        }
        match (chunk, kind) {
            (0, CHUNK_JSON) => json = Some(range.clone()),
            (1, CHUNK_BIN) => bin = Some(range.clone()),
            _ => {}
        }
        at = range.end.next_multiple_of(4);
        chunk += 1;
    }
    json.map(|json| (json, bin)).ok_or_else(|| broken("the first chunk is not JSON".to_owned()))
}

fn is_data_uri(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// The bytes of a `data:` URI, or `None` for another URI.
fn data_uri(uri: &str, pointer: &str) -> Option<Result<Vec<u8>, Fault>> {
    if !is_data_uri(uri) {
        return None;
    }
    let Some((kind, payload)) = uri.split_once(',') else {
        return Some(Err(Fault::new(pointer, "data: URI without a comma")));
    };
    if !kind.to_ascii_lowercase().ends_with(";base64") {
        return Some(Ok(percent_decoded(payload).into_owned()));
    }
    let config = base64::engine::GeneralPurposeConfig::new()
        .with_decode_padding_mode(base64::engine::DecodePaddingMode::Indifferent);
    let decoder = base64::engine::GeneralPurpose::new(&base64::alphabet::STANDARD, config);
    let bytes = decoder.decode(percent_decoded(payload));
    Some(bytes.map_err(|error| Fault::new(pointer, format!("base64 of the data: URI is damaged: {error}"))))
}

/// The path, relative to the model's folder and with `/` between its parts, that a URI names.
fn relative_path(uri: &str, pointer: &str) -> Result<String, Fault> {
    let refused = |why: &str| {
        let shown: String = uri.chars().take(80).collect();
        let remedy = "put the file beside the model and name it by a relative path";
        Err(Fault::new(pointer, format!("{shown:?} {why}: {remedy}")))
    };
    let Ok(decoded) = String::from_utf8(percent_decoded(uri).into_owned()) else {
        return refused("is not UTF-8");
    };
    // A scheme (`http:`, `file:`, and a drive `c:`) is letters, digits, `+`, `-`, `.` before a colon.
    let scheme = decoded.split_once(':').map(|(scheme, _)| scheme);
    if scheme.is_some_and(|s| s.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))) {
        return refused("is not a relative path");
    }
    if decoded.starts_with('/') || decoded.contains('\\') {
        return refused("is absolute or has a backslash");
    }
    if decoded.chars().any(char::is_control) {
        return refused("has a control character");
    }
    let parts: Vec<&str> = decoded.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
    if parts.contains(&"..") {
        return refused("leads out of the model's folder");
    }
    if parts.is_empty() {
        return refused("names no file");
    }
    Ok(parts.join("/"))
}

/// `%xx` replaced by the byte; a `%` without two hexadecimal digits stays, since exporters write bare ones.
fn percent_decoded(text: &str) -> Cow<'_, [u8]> {
    if !text.contains('%') {
        return Cow::Borrowed(text.as_bytes());
    }
    let bytes = text.as_bytes();
    let digit = |i: usize| bytes.get(i).and_then(|b| char::from(*b).to_digit(16)).map(|d| d as u8);
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        match (bytes[i], digit(i + 1), digit(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push(high << 4 | low);
                i += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                i += 1;
            }
        }
    }
    Cow::Owned(decoded)
}
