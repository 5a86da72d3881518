//! Names of objects. Many objects share the text of a name and differ in its number, so a hundred thousand
//! copies of a tree do not need a hundred thousand texts.

use std::fmt;
use std::sync::Arc;

/// Name of an object: a text, or a number between two texts. Names are equal if they read the same.
#[derive(Clone)]
pub struct ObjectName {
    /// Text before the number, and text after it.
    texts: Arc<[Box<str>; 2]>,
    number: Option<u32>,
}

impl ObjectName {
    /// Returns the name with a number between its two texts, which the new name shares. Replaces a number
    /// that the name already has.
    #[must_use]
    pub fn with_number(&self, number: u32) -> Self {
        Self { texts: self.texts.clone(), number: Some(number) }
    }
}

impl From<[String; 2]> for ObjectName {
    /// Makes a name without number from the texts before and after a [number](ObjectName::with_number).
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
