//! A JSON value together with its JSON pointer, so that every complaint says where.

use super::AssetError;
use crate::gltf_file::Invalid;
use serde::{Deserialize, de::DeserializeOwned};
use serde_json::Value;
use std::path::Path;

/// A value and where it stands.
#[derive(Clone, Debug)]
pub struct At<'a> {
    file: &'a Path,
    pointer: String,
    value: &'a Value,
}

impl<'a> At<'a> {
    /// The root of a document.
    pub fn root(file: &'a Path, value: &'a Value) -> Self {
        Self { file, pointer: String::new(), value }
    }

    /// A member that must be there.
    pub fn member(&self, key: &str) -> Result<Self, AssetError> {
        match self.value {
            Value::Object(_) => self.optional(key).ok_or_else(|| self.error(format!("the member {key:?} is missing"))),
            _ => Err(self.error("not an object".into())),
        }
    }

    /// A member that may be left out.
    pub fn optional(&self, key: &str) -> Option<Self> {
        self.value.get(key).map(|value| self.step(key, value))
    }

    /// The elements of an array.
    pub fn elements(&self) -> Result<Vec<Self>, AssetError> {
        let array = self.value.as_array().ok_or_else(|| self.error("not an array".into()))?;
        Ok(array.iter().enumerate().map(|(i, value)| self.step(i, value)).collect())
    }

    /// The elements of the array `key`, none where it is left out.
    pub fn optional_elements(&self, key: &str) -> Result<Vec<Self>, AssetError> {
        self.optional(key).map_or(Ok(Vec::new()), |array| array.elements())
    }

    /// The element of the array `array` that this index names.
    pub fn follow(&self, array: &[Self]) -> Result<Self, AssetError> {
        let index: usize = self.parse()?;
        let outside = || self.error(format!("index {index} is out of range, there are {}", array.len()));
        array.get(index).cloned().ok_or_else(outside)
    }

    /// A list of indices below `limit`.
    pub fn indices(&self, limit: usize) -> Result<Vec<u32>, AssetError> {
        // The pointers of thousands of numbers are made where one is wrong.
        if let Ok(indices) = <Vec<u32> as Deserialize>::deserialize(self.value)
            && indices.iter().all(|index| (*index as usize) < limit)
        {
            return Ok(indices);
        }
        let index = |at: &Self| {
            let index: u32 = at.parse()?;
            let outside = || at.error(format!("index {index} is out of range, there are {limit}"));
            if (index as usize) < limit { Ok(index) } else { Err(outside()) }
        };
        self.elements()?.iter().map(index).collect()
    }

    /// The value as a `T`.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, AssetError> {
        T::deserialize(self.value).map_err(|e| self.error(e.to_string()))
    }

    /// A complaint about this value.
    pub fn error(&self, why: String) -> AssetError {
        AssetError::invalid(self.file, Invalid { pointer: self.pointer.clone(), reason: why })
    }

    fn step(&self, step: impl std::fmt::Display, value: &'a Value) -> Self {
        Self { file: self.file, pointer: format!("{}/{step}", self.pointer), value }
    }
}
