//! The bytes of the buffers: the binary chunk of the file, `data:` URIs, and files beside it.

use super::{Fault, document::Document};
use crate::gltf_file::{GltfFile, MAX_FILE_BYTES};
use std::collections::HashMap;

/// The buffers of a document. A buffer without data (the fallback of a compressed one) fails where it is used.
pub(super) struct Buffers<'a> {
    sources: Vec<Option<Source<'a>>>,
    fetched: Vec<Vec<u8>>,
}

enum Source<'a> {
    Chunk(&'a [u8]),
    Fetched(usize),
}

impl<'a> Buffers<'a> {
    /// Loads every buffer; one that several records name is loaded once.
    ///
    /// # Errors
    /// A missing file, a damaged `data:` URI, or fewer bytes than `byteLength`.
    pub(super) fn load(file: &GltfFile<'a>, document: &Document) -> Result<Self, Fault> {
        let mut buffers = Self { sources: Vec::new(), fetched: Vec::new() };
        let mut known: HashMap<&str, usize> = HashMap::new();
        let mut total = 0;
        for (i, buffer) in document.buffers.iter().enumerate() {
            let source = match &buffer.uri {
                Some(uri) => Some(match known.get(uri.as_str()) {
                    Some(&at) => Source::Fetched(at),
                    None => {
                        let pointer = format!("/buffers/{i}/uri");
                        let bytes = file.fetch(uri).map_err(|error| Fault::new(pointer.as_str(), error.to_string()))?;
                        total += bytes.len() as u64;
                        if total > MAX_FILE_BYTES {
                            let reason = format!("the buffers exceed MAX_FILE_BYTES = {MAX_FILE_BYTES}");
                            return Err(Fault::new(pointer, reason));
                        }
                        buffers.fetched.push(bytes);
                        known.insert(uri, buffers.fetched.len() - 1);
                        Source::Fetched(buffers.fetched.len() - 1)
                    }
                }),
                None if i == 0 => file.chunks().bin.map(Source::Chunk),
                None => None,
            };
            buffers.sources.push(source);
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
        match self.sources.get(i)?.as_ref()? {
            Source::Chunk(bytes) => Some(bytes),
            Source::Fetched(at) => self.fetched.get(*at).map(Vec::as_slice),
        }
    }
}
