//! Names of objects: a text that objects may share, with a number of their own in it, so that a hundred
//! thousand copies of a tree do not keep a hundred thousand texts.

use std::fmt;
use std::sync::Arc;

/// Name of an object: a text, or a number between two texts. Equal names read alike.
#[derive(Clone)]
pub struct ObjectName {
    /// Texts before and after the number.
    texts: Arc<[Box<str>; 2]>,
    number: Option<u32>,
}

impl ObjectName {
    /// Returns the name with a number between the texts before and after it, which the new name shares with
    /// this one. A number that the name already has is replaced.
    #[must_use]
    pub fn with_number(&self, number: u32) -> Self {
        Self { texts: self.texts.clone(), number: Some(number) }
    }
}

impl From<[String; 2]> for ObjectName {
    /// Takes the texts before and after a [number](ObjectName::with_number).
    fn from(texts: [String; 2]) -> Self {
        Self { texts: Arc::new(texts.map(String::into_boxed_str)), number: None }
    }
}

impl From<String> for ObjectName {
    fn from(text: String) -> Self {
        [text, String::new()].into()
    }
}

impl From<&str> for ObjectName {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

impl fmt::Display for ObjectName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.texts[0])?;
        self.number.map_or(Ok(()), |number| number.fmt(f))?;
        f.write_str(&self.texts[1])
    }
}

impl fmt::Debug for ObjectName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_string().fmt(f)
    }
}

impl PartialEq for ObjectName {
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}

impl PartialEq<str> for ObjectName {
    fn eq(&self, other: &str) -> bool {
        self.to_string().as_str() == other
    }
}
