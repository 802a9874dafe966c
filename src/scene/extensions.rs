//! Which extensions the reader understands, may ignore, or must refuse.

use super::{
    Fault, Notices,
    document::{Document, Extensions},
};
use crate::gltf_file::EXTENSION;

/// Extensions that this reader honours, or that change nothing about the triangles and the base colour.
const KNOWN: [&str; 9] = [
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "EXT_mesh_gpu_instancing",
    "KHR_xmp_json_ld",
    "KHR_animation_pointer",
    EXTENSION,
];

/// Extensions that only concern shading; all start like this.
const SHADING_PREFIX: &str = "KHR_materials_";

/// Extensions that hide geometry from a reader without their decoder.
const COMPRESSION: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The compression among the extensions of an object.
pub(super) fn compression(extensions: &Extensions) -> Option<&'static str> {
    COMPRESSION.into_iter().find(|name| extensions.contains_key(*name))
}

/// Refuses unknown required extensions, and counts unknown ones that may be ignored.
///
/// # Errors
/// [`Fault::Unsupported`] with all required extensions that are not understood.
pub(super) fn check(document: &Document, notices: &mut Notices) -> Result<(), Fault> {
    let known = |name: &str| KNOWN.contains(&name) || name.starts_with(SHADING_PREFIX);
    let refused: Vec<&str> = document.extensions_required.iter().map(String::as_str).filter(|n| !known(n)).collect();
    if !refused.is_empty() {
        return Err(Fault::unsupported(&refused));
    }
    for name in document.extensions_used.iter().filter(|name| !known(name)) {
        let why = if COMPRESSION.contains(&name.as_str()) {
            "compressed data is not decoded; the uncompressed copy in the file was read"
        } else {
            "not known to this reader, and not required by the file"
        };
        notices.add(name, 1, why);
    }
    Ok(())
}
