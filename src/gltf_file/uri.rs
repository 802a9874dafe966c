//! URIs as glTF uses them: percent-encoded relative paths, and `data:`.
//!
//! Sources: RFC 3986 (unreserved characters, schemes), RFC 2397 (data), RFC 4648 (base64).

use base64::{
    Engine as _, alphabet,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};

/// What a file name may not hold as it is: all but the unreserved characters.
const RESERVED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// Base64 with or without padding: exporters write both.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Percent-encodes a file name so that it is a relative reference.
#[must_use]
pub fn encode(name: &str) -> String {
    utf8_percent_encode(name, RESERVED).to_string()
}

/// Does the URI carry its contents?
#[must_use]
pub fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// Does the text before the first colon look like a scheme (`https:`, `file:`, and a Windows drive `c:`)? A
/// relative path cannot have such a colon, so this may be generous: `1:2` counts, though no scheme starts so.
#[must_use]
pub fn has_scheme(uri: &str) -> bool {
    let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
    scheme.is_some_and(|scheme| scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c)))
}

/// The contents of a `data:` URI, base64 or percent-encoded.
///
/// # Errors
/// What is wrong with it, as a sentence.
pub fn data(uri: &str) -> Result<Vec<u8>, String> {
    let Some((header, body)) = uri.split_once(',') else { return Err("data: URI without a comma".to_owned()) };
    let body: Vec<u8> = percent_decode_str(body).collect();
    if !header.to_ascii_lowercase().ends_with(";base64") {
        return Ok(body);
    }
    BASE64.decode(body).map_err(|error| format!("base64 of the data: URI is damaged: {error}"))
}

/// The path that a URI names, relative to the document's folder, `/` between its parts. A `%` that starts no
/// escape stays: exporters write bare ones.
///
/// # Errors
/// Why it is no path below the folder.
pub fn relative_path(uri: &str) -> Result<String, String> {
    match percent_decode_str(uri).decode_utf8() {
        Ok(decoded) => checked_path(&decoded, uri),
        Err(_) => Err(refusal(uri, "is not UTF-8 when decoded")),
    }
}

/// A path below a folder, without its empty and `.` parts; an error quotes `uri`.
pub(super) fn checked_path(path: &str, uri: &str) -> Result<String, String> {
    let parts: Vec<&str> = path.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
    let fault = if has_scheme(path) {
        "is not a relative path"
    } else if path.starts_with('/') || path.contains('\\') {
        "is absolute or has a backslash"
    } else if path.chars().any(char::is_control) {
        "has a control character"
    } else if parts.contains(&"..") {
        "leads out of the model's folder"
    } else if parts.is_empty() {
        "names no file"
    } else {
        return Ok(parts.join("/"));
    };
    Err(refusal(uri, fault))
}

fn refusal(uri: &str, fault: &str) -> String {
    let shown: String = uri.chars().take(80).collect();
    format!("{shown:?} {fault}: put the file beside the model and name it by a relative path")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_the_round_trip() {
        for name in ["teapot.atlas-0.png", "my model 100%.png", "é#?.png", "a%2", "a%41"] {
            assert_eq!(relative_path(&encode(name)).as_deref(), Ok(name));
        }
        assert_eq!(encode("a b"), "a%20b");
        assert_eq!(relative_path("100%.png").as_deref(), Ok("100%.png"));
        assert!(relative_path("%ff").is_err());
    }

    #[test]
    fn data_is_base64_or_percent_encoded() {
        let cases = [
            ("data:;base64,", ""),
            ("data:image/png;base64,Zg==", "f"),
            ("DATA:;BASE64,Zm9vYg", "foob"),
            ("data:;base64,Zm9v%59g==", "foob"),
            ("data:,f%6f", "fo"),
        ];
        for (uri, contents) in cases {
            assert_eq!(data(uri).as_deref(), Ok(contents.as_bytes()), "{uri}");
        }
        for uri in ["data:;base64", "data:;base64,Zm9vY", "data:;base64,Zm 9", "data:;base64,AA@A"] {
            assert!(data(uri).is_err(), "{uri}");
        }
    }

    #[test]
    fn schemes_are_told_from_names() {
        assert!(has_scheme("https://a/b") && has_scheme("C:\\a") && has_scheme(":a") && is_data("DATA:,"));
        assert!(!has_scheme("a/b.png") && !has_scheme("a b:c"));
    }
}
