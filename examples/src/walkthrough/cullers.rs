//! Cullers by the names that programs take on the command line.

use visibility_core::{FrustumCuller, Pipeline};
use visibility_hzb::{Hzb, HzbCuller};

/// The names of the cullers that can be asked for, and what they are.
pub const KNOWN: &[(&str, &str)] = &[
    ("frustum", "boxes outside the view volume are hidden"),
    ("hzb", "boxes behind the scene's own opaque triangles are hidden, by a z-buffer of 512x288 pixels"),
];

/// Pipelines from a list such as `frustum,a,a+b`: separated by commas, and `a+b` runs `b` after `a`. Every one but `frustum`
/// itself runs after the frustum. Yields each entry with its pipeline.
pub fn parse(list: &str) -> Result<Vec<(String, Pipeline)>, UnknownCuller> {
    list.split(',')
        .map(|entry| {
            let entry: String = entry.split_whitespace().collect();
            let pipeline = pipeline(&entry)?;
            Ok((entry, pipeline))
        })
        .collect()
}

fn pipeline(entry: &str) -> Result<Pipeline, UnknownCuller> {
    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    for name in entry.split('+') {
        match name {
            "frustum" => {}
            "hzb" => {
                pipeline.push(Box::new(HzbCuller::new(Hzb::new(512, 288).expect("a size within the limits"))))
            }
            other => return Err(UnknownCuller { name: other.to_owned() }),
        }
    }
    Ok(pipeline)
}

/// A name that is not among the [`KNOWN`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownCuller {
    /// The name.
    pub name: String,
}

impl std::fmt::Display for UnknownCuller {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "there is no culler `{}`; known are:", self.name)?;
        KNOWN.iter().try_for_each(|(name, what)| write!(f, "\n  {name}: {what}"))
    }
}

impl std::error::Error for UnknownCuller {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_split_and_unknown_names_refused() {
        let names: Vec<_> =
            parse("frustum, hzb + frustum").unwrap().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["frustum", "hzb+frustum"]);
        assert_eq!(parse("frustum,fog").unwrap_err().name, "fog");
        assert!(parse("").is_err());
    }
}
