//! URIs as glTF uses them: percent-encoded relative paths, and `data:` with base64.
//!
//! Sources: RFC 3986 (unreserved characters), RFC 2397 (data), RFC 4648 (base64).

/// Percent-encodes a file name so that it is a relative reference.
#[must_use]
pub fn encode(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    for &byte in name.as_bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => out.push(char::from(byte)),
            _ => out.push_str(&format!("%{byte:02X}")),
        }
    }
    out
}

/// The name that a percent-encoded URI stands for; a `%` that starts no escape stays. `None` where the result is
/// not UTF-8.
#[must_use]
pub fn decode(uri: &str) -> Option<String> {
    let bytes = uri.as_bytes();
    let hex = |i: usize| bytes.get(i).and_then(|b| char::from(*b).to_digit(16));
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        match (bytes[i], hex(i + 1), hex(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((16 * high + low) as u8);
                i += 3;
            }
            (byte, ..) => {
                out.push(byte);
                i += 1;
            }
        }
    }
    String::from_utf8(out).ok()
}

/// Does the URI carry its contents?
#[must_use]
pub fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// Does the URI name a scheme (`https:`, `file:`), so that it is no relative path? One letter is a Windows drive,
/// which is no relative path either.
#[must_use]
pub fn has_scheme(uri: &str) -> bool {
    let Some((scheme, _)) = uri.split_once(':') else { return false };
    let mut characters = scheme.chars();
    characters.next().is_some_and(|c| c.is_ascii_alphabetic())
        && characters.all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
}

/// The contents of a base64 `data:` URI, or `None` where it is none.
#[must_use]
pub fn data(uri: &str) -> Option<Vec<u8>> {
    let (header, body) = uri.split_once(',')?;
    (is_data(uri) && header.ends_with(";base64")).then(|| base64(body))?
}

/// Decodes base64, padded or not. `None` for other characters or a length that cannot be.
fn base64(text: &str) -> Option<Vec<u8>> {
    let digits = text.trim_end_matches('=').as_bytes();
    let value = |digit: u8| match digit {
        b'A'..=b'Z' => Some(digit - b'A'),
        b'a'..=b'z' => Some(digit - b'a' + 26),
        b'0'..=b'9' => Some(digit - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let mut out = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    for group in digits.chunks(4) {
        let mut bits = 0_u32;
        for &digit in group {
            bits = bits << 6 | u32::from(value(digit)?);
        }
        bits <<= 6 * (4 - group.len());
        let count = [0, 0, 1, 2, 3][group.len()];
        if count == 0 {
            return None;
        }
        out.extend_from_slice(&bits.to_be_bytes()[1..=count]);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_the_round_trip() {
        for name in ["teapot.atlas-0.png", "my model 100%.png", "é#?.png", "a%2"] {
            assert_eq!(decode(&encode(name)).as_deref(), Some(name));
        }
        assert_eq!(encode("a b"), "a%20b");
        assert_eq!(decode("%ff"), None);
    }

    #[test]
    fn base64_matches_the_vectors_of_rfc_4648() {
        let vectors =
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob"), ("Zm9vYmFy", "foobar")];
        for (text, expected) in vectors {
            assert_eq!(base64(text).unwrap(), expected.as_bytes());
        }
        assert_eq!(base64("Zm9vY"), None);
        assert_eq!(base64("Zm 9"), None);
        assert_eq!(data("data:image/png;base64,Zg==").unwrap(), b"f");
    }

    #[test]
    fn schemes_are_told_from_names() {
        assert!(has_scheme("https://a/b") && has_scheme("C:\\a") && is_data("DATA:,"));
        assert!(!has_scheme("a/b.png") && !has_scheme("1:2") && !has_scheme("a b:c"));
    }
}
