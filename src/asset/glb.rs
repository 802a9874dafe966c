//! The GLB container: a JSON chunk, an optional binary chunk, and chunks that only others understand.
//!
//! Source: glTF 2.0 specification, section 4 ("GLB File Format Specification"). Every length is checked before it
//! is used. Splitting and joining keeps the bytes of every chunk; only padding may grow.

/// First four bytes of a GLB file.
pub const MAGIC: &[u8; 4] = b"glTF";
const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;
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
        return Err("not a GLB file: the first four bytes are not \"glTF\"".into());
    }
    let version = u32_at(bytes, 4).ok_or("the GLB header is cut off")?;
    if version != 2 {
        return Err(format!("GLB version {version}, only version 2 is read: convert it with gltf-pipeline"));
    }
    let length = u32_at(bytes, 8).ok_or("the GLB header is cut off")? as usize;
    if length != bytes.len() {
        return Err(format!("the GLB header says {length} bytes, the file has {}", bytes.len()));
    }
    let mut chunks = chunk_list(bytes)?.into_iter();
    let json = match chunks.next() {
        Some((CHUNK_JSON, json)) => std::str::from_utf8(json).map_err(|e| format!("the JSON chunk: {e}"))?,
        _ => return Err("the first GLB chunk is not JSON".into()),
    };
    let mut others: Vec<(u32, &[u8])> = chunks.collect();
    let bin = (others.first().map(|c| c.0) == Some(CHUNK_BIN)).then(|| others.remove(0).1);
    // Some writers pad with zero bytes where the format asks for spaces.
    Ok(Chunks { json: json.trim_end_matches([' ', '\0']), bin, others })
}

/// All chunks in order: (type, contents).
fn chunk_list(bytes: &[u8]) -> Result<Vec<(u32, &[u8])>, String> {
    let mut chunks = Vec::new();
    let mut at = HEADER_BYTES;
    while at < bytes.len() {
        let cut = || format!("GLB chunk {} is cut off", chunks.len());
        let length = u32_at(bytes, at).ok_or_else(cut)? as usize;
        let kind = u32_at(bytes, at + 4).ok_or_else(cut)?;
        let start = at + CHUNK_HEADER_BYTES;
        let end = start.checked_add(length).ok_or_else(cut)?;
        chunks.push((kind, bytes.get(start..end).ok_or_else(cut)?));
        at = end;
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
