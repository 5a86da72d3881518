//! JSON reader in which an object with two equal keys is an error. Other parsers would silently drop the
//! first of the two values. A whole number may be written with a fraction or an exponent, as `3.0` or `1e2`.

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;

/// Reads a JSON value from the bytes of a file.
///
/// # Errors
///
/// Returns an error with line and column when the text is not JSON, is nested too deeply, or an object has
/// two equal keys.
pub(crate) fn parse(bytes: &[u8]) -> serde_json::Result<Value> {
    Strict::Whole.parse(bytes)
}

/// Reads a JSON value like [`parse`], but passes the items of the list under `key` of the outermost object to
/// `take` one by one, and leaves this list empty. That saves memory: a value takes about ten times the memory
/// of its text.
///
/// # Errors
///
/// Returns the errors of [`parse`]. Some items may have been passed to `take` before.
pub(crate) fn parse_items(bytes: &[u8], key: &str, take: &mut dyn FnMut(Value)) -> serde_json::Result<Value> {
    Strict::Outermost(key, take).parse(bytes)
}

/// Returns the list under a key of an object. Empty if there is no list.
pub(crate) fn list<'a>(object: &'a Value, key: &str) -> &'a [Value] {
    object.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// Visitor that makes a JSON value, and returns an error for an object with two equal keys.
enum Strict<'a> {
    /// Makes the whole value.
    Whole,
    /// Makes the outermost object. Passes the items of the list under the given key to the function.
    Outermost(&'a str, &'a mut dyn FnMut(Value)),
    /// Passes the items of the list to the function.
    Items(&'a mut dyn FnMut(Value)),
}

impl Strict<'_> {
    fn parse(self, bytes: &[u8]) -> serde_json::Result<Value> {
        // Some tools begin UTF-8 text with a byte order mark.
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let mut deserializer = serde_json::Deserializer::from_slice(text);
        let value = self.deserialize(&mut deserializer)?;
        deserializer.end()?;
        Ok(value)
    }
}

impl<'de> DeserializeSeed<'de> for Strict<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Strict<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        // Above 2^53 an f64 may stand for several whole numbers. -0.0 stays, because integers have no sign of
        // zero.
        const EXACT: f64 = (1_u64 << 53) as f64;
        let is_whole =
            value.fract() == 0.0 && value.abs() < EXACT && !(value == 0.0 && value.is_sign_negative());
        if is_whole {
            return Ok((value as i64).into());
        }
        Ok(Number::from_f64(value).map_or(Value::Null, Value::Number))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(Value::String(value.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        let mut push = |item| list.push(item);
        let take: &mut dyn FnMut(Value) = match self {
            Self::Items(take) => take,
            Self::Whole | Self::Outermost(..) => &mut push,
        };
        while let Some(item) = items.next_element_seed(Strict::Whole)? {
            take(item);
        }
        Ok(Value::Array(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        let mut given = match self {
            Self::Outermost(key, take) => Some((key, take)),
            Self::Whole | Self::Items(_) => None,
        };
        while let Some(key) = members.next_key::<String>()? {
            if object.contains_key(&key) {
                return Err(A::Error::custom(format!("the key `{key}` is given twice")));
            }
            let given = given.take_if(|(given, _)| *given == key);
            let value = given.map_or(Strict::Whole, |(_, take)| Strict::Items(take));
            object.insert(key, members.next_value_seed(value)?);
        }
        Ok(Value::Object(object))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_are_those_of_serde_json_and_equal_keys_are_refused() {
        let good = r#"{"a": [1, -2, 2.5, 1e30, null, true, "x"], "b": {"a": {}}, "c": 18446744073709551615}"#;
        assert_eq!(
            parse(good.as_bytes()).unwrap(),
            serde_json::from_str::<Value>(good).unwrap(),
            "values of this reader and of serde_json"
        );
        let mut items = Vec::new();
        let rest = parse_items(br#"{"a": {"x": [1]}, "x": [2, [3]], "b": [{"x": [4]}]}"#, "x", &mut |item| {
            items.push(item);
        });
        assert_eq!(
            (rest.unwrap(), Value::Array(items)),
            (json!({"a": {"x": [1]}, "x": [], "b": [{"x": [4]}]}), json!([2, [3]])),
            "what is left, and the items of the outermost object's list"
        );
        assert_eq!(
            parse(b"\xef\xbb\xbf[3.0, 1e2, -2.0, 9007199254740992.0, 0.0, 1.5]").unwrap(),
            json!([3, 100, -2, 9_007_199_254_740_992.0, 0, 1.5]),
            "whole numbers below 2^53 become integers, after a byte order mark"
        );
        assert!(
            parse(b"-0.0").unwrap().as_f64().is_some_and(f64::is_sign_negative),
            "the sign of zero stays"
        );
        for (wrong, why) in [
            (r#"{"a": 1, "b": 2, "a": 1}"#, "`a` is given twice"),
            (r#"[{"x": {"near": 1, "near": 2}}]"#, "`near` is given twice"),
            (r#"{"a": 1} 2"#, "trailing"),
            ("", "EOF"),
        ] {
            let error = parse(wrong.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(why), "{wrong}: {error}");
        }
    }
}
