//! Edits of a JSON document as text: new elements and members are inserted at byte offsets, all else stays.
//!
//! In: a JSON text, and what to add. Out: the text with the additions. White space, the order of members, the
//! spelling of numbers (`1.00`, `1.0e-7`) and escapes survive, since nothing is parsed into values and printed
//! again. Taking the inserted pieces out again gives the input back, byte for byte.
//!
//! Positions come from `serde_json`'s raw values: borrowed slices of the text, so that their distance from its
//! start is their offset. Not guaranteed: that the added members make sense where they are put.

use crate::gltf_file::Invalid;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::value::RawValue;
use std::{fmt, ops::Range};

/// A value inside a JSON text: its place, not its meaning.
#[derive(Clone, Debug)]
pub struct Spot<'a> {
    text: &'a str,
    span: Range<usize>,
    pointer: String,
}

/// The members of an object in the order of the text, keys unescaped.
struct RawMembers<'a>(Vec<(String, &'a RawValue)>);

impl<'de: 'a, 'a> Deserialize<'de> for RawMembers<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members;
        impl<'de> Visitor<'de> for Members {
            type Value = Vec<(String, &'de RawValue)>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(members)
            }
        }
        deserializer.deserialize_map(Members).map(RawMembers)
    }
}

impl<'a> Spot<'a> {
    /// The whole document.
    ///
    /// # Errors
    /// Not JSON.
    pub fn root(text: &'a str) -> Result<Self, Invalid> {
        let whole = Self { text, span: 0..text.len(), pointer: String::new() };
        let raw: &RawValue = serde_json::from_str(text).map_err(|e| whole.error(e))?;
        whole.child(raw, "")
    }

    /// The text of the value, without white space around it.
    #[must_use]
    pub fn slice(&self) -> &'a str {
        &self.text[self.span.clone()]
    }

    /// Byte range in the document.
    #[must_use]
    pub fn span(&self) -> Range<usize> {
        self.span.clone()
    }

    /// The elements of an array.
    ///
    /// # Errors
    /// The value is no array.
    pub fn elements(&self) -> Result<Vec<Self>, Invalid> {
        let raw: Vec<&RawValue> = serde_json::from_str(self.slice()).map_err(|e| self.error(e))?;
        raw.into_iter().enumerate().map(|(i, value)| self.child(value, &format!("/{i}"))).collect()
    }

    /// The members of an object, keys unescaped.
    ///
    /// # Errors
    /// The value is no object, or a key appears twice (readers disagree about which one counts).
    pub fn members(&self) -> Result<Vec<(String, Self)>, Invalid> {
        let RawMembers(raw) = serde_json::from_str(self.slice()).map_err(|e| self.error(e))?;
        let mut members: Vec<(String, Self)> = Vec::with_capacity(raw.len());
        for (key, value) in raw {
            if members.iter().any(|(earlier, _)| *earlier == key) {
                return Err(self.error(format!("the key {key:?} appears twice")));
            }
            let spot = self.child(value, &format!("/{key}"))?;
            members.push((key, spot));
        }
        Ok(members)
    }

    /// One member of an object.
    ///
    /// # Errors
    /// As [`Spot::members`].
    pub fn member(&self, key: &str) -> Result<Option<Self>, Invalid> {
        Ok(self.members()?.into_iter().find_map(|(k, spot)| (k == key).then_some(spot)))
    }

    /// A raw value inside this one: the distance of the two slices is its offset.
    fn child(&self, raw: &RawValue, step: &str) -> Result<Self, Invalid> {
        let start = (raw.get().as_ptr() as usize).wrapping_sub(self.text.as_ptr() as usize);
        let span = start..start.wrapping_add(raw.get().len());
        if self.text.get(span.clone()) != Some(raw.get()) {
            return Err(self.error("the parser returned a copy, not a slice"));
        }
        Ok(Self { text: self.text, span, pointer: format!("{}{step}", self.pointer) })
    }

    fn error(&self, reason: impl ToString) -> Invalid {
        Invalid { pointer: self.pointer.clone(), reason: reason.to_string() }
    }
}

/// Insertions and replacements, collected against one text and applied together.
#[derive(Clone, Debug, Default)]
pub struct Edits {
    list: Vec<(Range<usize>, String)>,
}

impl Edits {
    /// Puts `text` in the place of a value.
    pub fn replace(&mut self, spot: &Spot<'_>, text: String) {
        self.list.push((spot.span(), text));
    }

    /// Adds elements (JSON texts) at the end of an array. Call once an array.
    ///
    /// # Errors
    /// The value is no array.
    pub fn append(&mut self, array: &Spot<'_>, elements: &[String]) -> Result<(), Invalid> {
        let last = array.elements()?.pop();
        self.insert(array, last, elements.join(","));
        Ok(())
    }

    /// Adds members (key, JSON text) at the end of an object. Call once an object.
    ///
    /// # Errors
    /// The value is no object.
    pub fn add_members(&mut self, object: &Spot<'_>, members: &[(&str, String)]) -> Result<(), Invalid> {
        let last = object.members()?.pop().map(|(_, spot)| spot);
        // Debug of a str is its JSON spelling for the ASCII keys that glTF and this program use.
        let texts: Vec<String> = members.iter().map(|(key, value)| format!("{key:?}:{value}")).collect();
        self.insert(object, last, texts.join(","));
        Ok(())
    }

    /// After the last child, or after the opening bracket where there is none.
    fn insert(&mut self, parent: &Spot<'_>, last: Option<Spot<'_>>, addition: String) {
        if addition.is_empty() {
            return;
        }
        let (at, text) = match last {
            Some(last) => (last.span.end, format!(",{addition}")),
            None => (parent.span.start + 1, addition),
        };
        self.list.push((at..at, text));
    }

    /// The edited text. `text` is the one that the edits were collected against.
    #[must_use]
    pub fn apply(&self, text: &str) -> String {
        let mut sorted: Vec<&(Range<usize>, String)> = self.list.iter().collect();
        sorted.sort_by_key(|(span, _)| (span.start, span.end));
        let mut out = String::with_capacity(text.len() + sorted.iter().map(|(_, t)| t.len()).sum::<usize>());
        let mut done = 0;
        for (span, addition) in sorted {
            out.push_str(&text[done..span.start]);
            out.push_str(addition);
            done = span.end;
        }
        out.push_str(&text[done..]);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn additions_land_at_the_end_and_leave_the_rest_alone() {
        let text = " { \"a\\u0062\" : [ 1.00 , 1.0e-7 ]\n, \"é\":{ } ,\t\"empty\":[\n] , \"n\": 12 } ";
        let root = Spot::root(text).unwrap();
        let at = |key: &str| root.member(key).unwrap().unwrap();
        assert_eq!(at("ab").slice(), "[ 1.00 , 1.0e-7 ]");
        let mut edits = Edits::default();
        edits.append(&at("ab"), &["3".into(), "4".into()]).unwrap();
        edits.append(&at("empty"), &["5".into()]).unwrap();
        edits.add_members(&at("é"), &[("x", "6".into())]).unwrap();
        edits.replace(&at("n"), "13".into());
        edits.add_members(&root, &[("new", "[]".into())]).unwrap();
        let expected =
            " { \"a\\u0062\" : [ 1.00 , 1.0e-7,3,4 ]\n, \"é\":{\"x\":6 } ,\t\"empty\":[5\n] , \"n\": 13,\"new\":[] } ";
        assert_eq!(edits.apply(text), expected);
    }

    #[test]
    fn refuses_what_it_cannot_place() {
        assert!(Spot::root("{").is_err());
        let twice = Spot::root("{\"a\":{\"b\":1,\"\\u0062\":2}}").unwrap().member("a").unwrap().unwrap();
        let error = twice.members().unwrap_err();
        assert_eq!((error.pointer.as_str(), error.reason.as_str()), ("/a", "the key \"b\" appears twice"));
        assert!(twice.elements().is_err());
    }
}
