//! Procedural scenes with camera walks. A recipe with equal sizes makes an identical scene on every machine.
//!
//! The recipes stand in for models of the papers that are not available: a city of furnished houses, a 2.5-D
//! London, a walled town, forests, and office floors with exact cells and portals. All recipes have z up,
//! metres as the unit, and sizes that the user may choose. Sizes are bounded, so that a typing error cannot
//! exhaust the machine's memory.
//!
//! The walks are made for the sample sizes. Larger scenes keep the walks, since scenes grow outwards from a
//! fixed corner or centre; in smaller scenes the walks may leave the scene.

mod forest;
mod furniture;
mod limits;
mod london;
mod mesh;
mod office;
mod plpcity;
pub(crate) mod random;
mod rooms;
mod scene;
mod town;
mod walls;

pub use office::{Cell, Office, Portal, office};

use crate::error::SourceError;
use crate::source::{SceneSource, SourceObject, collected};
use forest::forest;
use london::london;
use mesh::Parts;
use plpcity::plpcity;
use town::town;

/// Entry of the table of recipes: the recipe's name, the names of its sizes and the sizes of the stored
/// sample, as a user types them, and the function that passes the
/// objects on and returns the scene without them.
struct Recipe {
    name: &'static str,
    sizes: &'static str,
    sample: &'static [f64],
    make: fn(&Sizes<'_>, Parts<'_>) -> Result<SceneSource, SourceError>,
}

/// Table of all recipes. The default sizes are those of the stored sample scenes.
const RECIPES: [Recipe; 5] = [
    Recipe {
        name: "plpcity",
        sizes: "blocks_x,blocks_y",
        sample: &[2.0, 2.0],
        make: |sizes, parts| plpcity(sizes.whole(0)?, sizes.whole(1)?, parts),
    },
    Recipe {
        name: "london",
        sizes: "blocks_x,blocks_y",
        sample: &[12.0, 12.0],
        make: |sizes, parts| london(sizes.whole(0)?, sizes.whole(1)?, parts),
    },
    Recipe {
        name: "town",
        sizes: "rings",
        sample: &[3.0],
        make: |sizes, parts| town(sizes.whole(0)?, parts),
    },
    Recipe {
        name: "forest",
        sizes: "trees,side_in_metres",
        sample: &[200.0, 84.0],
        make: |sizes, parts| forest(sizes.whole(0)?, sizes.number(1), parts),
    },
    Recipe {
        name: "office",
        sizes: "floors,rooms",
        sample: &[2.0, 16.0],
        make: |sizes, parts| Ok(office::building(sizes.whole(0)?, sizes.whole(1)?, parts)?.scene),
    },
];

/// Returns each recipe with the names of its sizes, for help texts: `plpcity:blocks_x,blocks_y` and so on.
pub fn known_recipes() -> impl Iterator<Item = String> {
    RECIPES.iter().map(|recipe| format!("{}:{}", recipe.name, recipe.sizes))
}

/// Makes the scene that a specification such as `plpcity`, `plpcity:3,3`, `office:2x16` or `town:8` names.
/// Sizes are separated by `,` or `x`; without a colon the scene has the recipe's sample sizes.
///
/// # Errors
///
/// Returns [`SourceError::Recipe`] when the name is unknown, when a size is missing, superfluous or not a
/// number, or when the recipe refuses the sizes.
///
/// # Example
///
/// ```
/// let scene = visibility_examples::built_in("plpcity:1x1")?;
/// assert_eq!(scene.triangle_count(), 58_056);
/// assert!(visibility_examples::built_in("atlantis").is_err());
/// # Ok::<(), visibility_examples::SourceError>(())
/// ```
pub fn built_in(spec: &str) -> Result<SceneSource, SourceError> {
    collected(|each| built_in_by_object(spec, each))
}

/// Makes the same scene as [`built_in`], object by object. Passes each object to `each` as soon as it is
/// made, and returns the scene without objects.
///
/// # Errors
///
/// Returns the errors of [`built_in`], all of them before the first object, except for those of `office`.
pub fn built_in_by_object(
    spec: &str,
    each: &mut dyn FnMut(SourceObject),
) -> Result<SceneSource, SourceError> {
    let (name, sizes) = match spec.split_once(':') {
        Some((name, sizes)) => (name, Some(sizes)),
        None => (spec, None),
    };
    let Some(recipe) = RECIPES.iter().find(|recipe| recipe.name == name) else {
        let known: Vec<_> = known_recipes().collect();
        return Err(SourceError::recipe(
            spec,
            format!("there is no recipe `{name}`; known are {}", known.join(", ")),
        ));
    };
    let sizes = Sizes::parse(spec, recipe, sizes)?;
    (recipe.make)(&sizes, Parts::new(&mut |name, mesh| each(mesh.named(name))))
}

/// Sizes read from a specification, as many as the recipe takes. `spec` is the whole specification, for error
/// messages.
struct Sizes<'a> {
    spec: &'a str,
    values: Vec<f64>,
}

impl<'a> Sizes<'a> {
    /// Reads the sizes after the colon of `spec`. With `text` as `None` the sizes are the recipe's sample
    /// sizes. Returns an error when a size is not a number or their count is not the recipe's.
    fn parse(spec: &'a str, recipe: &Recipe, text: Option<&str>) -> Result<Self, SourceError> {
        let values = match text {
            None => recipe.sample.to_vec(),
            Some(text) => text
                .split([',', 'x'])
                .map(|size| {
                    size.trim()
                        .parse()
                        .map_err(|_| SourceError::recipe(spec, format!("the size `{size}` is no number")))
                })
                .collect::<Result<Vec<f64>, _>>()?,
        };
        if values.len() != recipe.sample.len() {
            return Err(SourceError::recipe(
                spec,
                format!(
                    "{} sizes are given where {} are needed: {}:{}",
                    values.len(),
                    recipe.sample.len(),
                    recipe.name,
                    recipe.sizes
                ),
            ));
        }
        Ok(Self { spec, values })
    }

    /// Returns the size at `index`, which may be negative, fractional, infinite or NaN. Panics when `index`
    /// is not below the recipe's number of sizes.
    fn number(&self, index: usize) -> f64 {
        self.values[index]
    }

    /// Returns the size at `index` as a whole number. Returns an error unless the size is whole and from 0 to
    /// `u32::MAX`.
    fn whole(&self, index: usize) -> Result<u32, SourceError> {
        let value = self.values[index];
        if value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value) {
            Ok(value as u32)
        } else {
            Err(SourceError::recipe(
                self.spec,
                format!("the size {value} is no whole number from 0 to {}", u32::MAX),
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_specifications_are_explained() {
        let wrong = [
            ("", "known are plpcity"),
            ("atlantis:3", "no recipe `atlantis`"),
            ("plpcity:", "is no number"),
            ("plpcity:2", "1 sizes are given where 2 are needed"),
            ("plpcity:2,2,2", "3 sizes"),
            ("plpcity:0,2", "at least one of the blocks along x"),
            ("plpcity:-1,2", "no whole number"),
            ("plpcity:1.5,2", "no whole number"),
            ("plpcity:4000000000,4000000000", "triangles are more than"),
            ("london:1000,1000", "triangles are more than"),
            ("town:4294967295", "triangles are more than"),
            ("office:4294967295,4294967295", "triangles are more than"),
            ("forest:4294967295,84", "at most 20000 trees"),
            ("forest:200,inf", "the side must be"),
            ("forest:200,NaN", "the side must be"),
            ("forest:1,100000", "triangles are more than"),
        ];
        for (spec, part) in wrong {
            let message = built_in(spec).expect_err(spec).to_string();
            assert!(message.contains(part), "{spec}: {message}");
        }
    }

    #[test]
    fn both_separators_and_spaces_are_read() {
        for spec in ["plpcity:1,1", "plpcity:1x1", "plpcity: 1, 1"] {
            assert_eq!(built_in(spec).expect(spec).triangle_count(), 58_056, "triangles of {spec}");
        }
    }
}
