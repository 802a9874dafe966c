//! The GLB container: a JSON chunk, an optional binary chunk, and chunks that only others understand.
//!
//! Source: glTF 2.0 specification, section 4 ("GLB File Format Specification"). Every length is checked before it
//! is used. Splitting and joining keeps the bytes of every chunk; only padding may grow.
//!
//! Read although the specification forbids it: bytes after the length in the header, a tail too short for a
//! chunk, chunk lengths that are no multiple of four (the next chunk follows without a gap, as in three.js), and
//! JSON padded with zeros.
//!
//! Not `gltf::binary::Glb`: it loses or refuses the other chunks, lets chunks reach past the length in the
//! header, subtracts without a check where that length is below 12, and cuts the length of a file above 4 GiB.

/// First four bytes of a GLB file.
pub const MAGIC: &[u8; 4] = b"glTF";
const CHUNK_JSON: u32 = u32::from_le_bytes(*b"JSON");
const CHUNK_BIN: u32 = u32::from_le_bytes(*b"BIN\0");
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// The chunks of a GLB file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunks<'a> {
    /// JSON text, without the padding at its end.
    pub json: &'a str,
    /// Binary chunk with its padding, where there is one.
    pub bin: Option<&'a [u8]>,
    /// Whatever follows: (type, contents).
    pub others: Vec<(u32, &'a [u8])>,
}

/// Splits a GLB file.
///
/// # Errors
/// What is wrong with the container, as a sentence.
pub fn split(bytes: &[u8]) -> Result<Chunks<'_>, String> {
    if !bytes.starts_with(MAGIC) {
        return Err("the file does not start with `glTF`".into());
    }
    let (Some(version), Some(length)) = (u32_at(bytes, 4), u32_at(bytes, 8)) else {
        return Err(format!("{} bytes are less than the header's {HEADER_BYTES}", bytes.len()));
    };
    if version != 2 {
        return Err(format!("version {version}, but 2 is read: convert it with `npx gltf-pipeline -i IN -o OUT`"));
    }
    let Some(inside) = bytes.get(..length as usize) else {
        return Err(format!("the header says {length} bytes, but the file has {}", bytes.len()));
    };
    let mut chunks = chunk_list(inside)?.into_iter();
    let Some((CHUNK_JSON, json)) = chunks.next() else { return Err("the first chunk is not JSON".into()) };
    let json = std::str::from_utf8(json).map_err(|error| format!("the JSON is not UTF-8: {error}"))?;
    let mut others: Vec<(u32, &[u8])> = chunks.collect();
    let bin = (others.first().map(|chunk| chunk.0) == Some(CHUNK_BIN)).then(|| others.remove(0).1);
    Ok(Chunks { json: json.trim_end_matches([' ', '\0']), bin, others })
}

/// All chunks in order: (type, contents).
fn chunk_list(bytes: &[u8]) -> Result<Vec<(u32, &[u8])>, String> {
    let mut chunks = Vec::new();
    let mut at = HEADER_BYTES;
    while let (Some(size), Some(kind)) = (u32_at(bytes, at), u32_at(bytes, at + 4)) {
        let left = bytes.get(at + CHUNK_HEADER_BYTES..).unwrap_or_default();
        let Some(contents) = left.get(..size as usize) else {
            return Err(format!("chunk {} says {size} bytes, but {} are left", chunks.len(), left.len()));
        };
        chunks.push((kind, contents));
        at += CHUNK_HEADER_BYTES + contents.len();
    }
    Ok(chunks)
}

/// Joins chunks to a GLB file; JSON is padded with spaces, the others with zeros.
///
/// # Errors
/// More than the 4 GiB that a GLB file can hold.
pub fn join(chunks: &Chunks<'_>) -> Result<Vec<u8>, String> {
    let json = std::iter::once((CHUNK_JSON, chunks.json.as_bytes()));
    let bin = chunks.bin.iter().map(|bin| (CHUNK_BIN, *bin));
    let list: Vec<(u32, &[u8])> = json.chain(bin).chain(chunks.others.iter().copied()).collect();
    let total =
        HEADER_BYTES + list.iter().map(|(_, c)| CHUNK_HEADER_BYTES + c.len().next_multiple_of(4)).sum::<usize>();
    let length = u32::try_from(total).map_err(|_| format!("{total} bytes do not fit into one GLB file (4 GiB)"))?;
    let mut out = Vec::with_capacity(total);
    out.extend_from_slice(MAGIC);
    out.extend_from_slice(&2_u32.to_le_bytes());
    out.extend_from_slice(&length.to_le_bytes());
    for (kind, contents) in list {
        let padded = contents.len().next_multiple_of(4);
        // Fits: it is less than `length`.
        out.extend_from_slice(&(padded as u32).to_le_bytes());
        out.extend_from_slice(&kind.to_le_bytes());
        out.extend_from_slice(contents);
        let padding = if kind == CHUNK_JSON { b' ' } else { 0 };
        out.resize(out.len() + padded - contents.len(), padding);
    }
    Ok(out)
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(four.try_into().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn join_then_split_keeps_every_chunk() {
        for bin in [None, Some(&[1_u8, 2, 3, 4][..])] {
            let chunks = Chunks { json: "{\"é\":1}", bin, others: vec![(7, &[9; 8])] };
            assert_eq!(split(&join(&chunks).unwrap()).unwrap(), chunks);
        }
    }

    #[test]
    fn every_cut_and_every_broken_length_is_refused() {
        let chunks = Chunks { json: "{}", bin: Some(&[1, 2, 3, 4]), others: vec![] };
        let good = join(&chunks).unwrap();
        for cut in 0..good.len() {
            assert!(split(&good[..cut]).is_err(), "cut at {cut}");
        }
        for at in [8, 12, 24] {
            let mut broken = good.clone();
            broken[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
            assert!(split(&broken).is_err(), "length at {at}");
        }
    }
}
