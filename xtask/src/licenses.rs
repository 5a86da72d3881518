//! Check of the licences of all dependencies in all workspaces. A crate is refused if its licence offers none
//! of [`ALLOWED`], so that no dependency brings in a copyleft licence, or code without a licence.

use crate::crates::{package_name, published_crates};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// SPDX identifiers of licences that only require a notice.
const ALLOWED: [&str; 13] = [
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "MIT-0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// Crates with another licence that only tests run and no program links to, each with its licence.
const TOOLS: [(&str, &str); 1] = [("cbindgen", "MPL-2.0")];

/// Manifests of the workspaces, relative to the root.
const WORKSPACES: [&str; 6] = [
    "Cargo.toml",
    "no-std-proof/Cargo.toml",
    "platforms/capi/Cargo.toml",
    "platforms/web/Cargo.toml",
    "platforms/bevy/Cargo.toml",
    "platforms/gpu/Cargo.toml",
];

/// Manifest keys that a published crate must have for its page at the registry.
const REQUIRED: [&str; 4] = ["license", "description", "readme", "documentation"];

/// Prints each dependency whose licence is not allowed, and each of the [`REQUIRED`] keys that the manifest
/// of a published crate lacks. Returns the number of lines printed.
///
/// # Errors
///
/// Returns cargo's messages when it cannot list the packages of a workspace.
pub(crate) fn check(root: &Path) -> Result<usize, String> {
    let published: Vec<String> = published_crates(root)?.iter().map(|folder| package_name(folder)).collect();
    let mut found = Vec::new();
    for manifest in WORKSPACES {
        let metadata = metadata(&root.join(manifest))?;
        for package in metadata["packages"].as_array().map_or(&[][..], Vec::as_slice) {
            let name = package["name"].as_str().unwrap_or_default();
            // A crate that is never published needs no licence of its own.
            let is_private = package["publish"].as_array().is_some_and(Vec::is_empty);
            let license = package["license"].as_str().unwrap_or_default();
            if !is_private && !is_allowed(license) && !TOOLS.contains(&(name, license)) {
                found.push(format!("{manifest}: {name} has the licence {license:?}"));
            }
            if manifest == WORKSPACES[0] && published.iter().any(|published| published == name) {
                let lacks = REQUIRED.iter().filter(|key| package[**key].as_str().is_none_or(str::is_empty));
                found.extend(lacks.map(|key| format!("{name}: the manifest lacks {key}")));
                if package["metadata"]["docs"]["rs"].is_null() {
                    found.push(format!("{name}: the manifest lacks package.metadata.docs.rs"));
                }
            }
        }
    }
    found.iter().for_each(|line| println!("{line}"));
    Ok(found.len())
}

/// Returns cargo's metadata of a workspace and its dependencies on this machine's platform.
fn metadata(manifest: &Path) -> Result<Value, String> {
    let version = run(Command::new("rustc").arg("-vV"))?;
    let version = String::from_utf8_lossy(&version);
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).unwrap_or_default();
    let mut cargo = Command::new("cargo");
    cargo.args(["metadata", "--format-version", "1", "--locked", "--filter-platform", host]);
    let output = run(cargo.arg("--manifest-path").arg(manifest))?;
    serde_json::from_slice(&output).map_err(|error| format!("{}: {error}", manifest.display()))
}

/// Runs a command and returns its standard output. Returns its messages as an error if it fails.
fn run(command: &mut Command) -> Result<Vec<u8>, String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    if output.status.success() {
        Ok(output.stdout)
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

/// Returns whether allowed licences alone can satisfy a licence expression. `AND` binds closer than `OR`; a
/// slash is an older form of `OR`. False for an expression that cannot be parsed.
fn is_allowed(expression: &str) -> bool {
    let spaced = expression.replace('(', " ( ").replace(')', " ) ").replace('/', " OR ");
    let mut words = spaced.split_whitespace().peekable();
    let allowed = any_of(&mut words);
    allowed && words.next().is_none()
}

type Words<'a> = std::iter::Peekable<std::str::SplitWhitespace<'a>>;

fn any_of(words: &mut Words<'_>) -> bool {
    let mut allowed = all_of(words);
    while words.next_if_eq(&"OR").is_some() {
        allowed |= all_of(words);
    }
    allowed
}

fn all_of(words: &mut Words<'_>) -> bool {
    let mut allowed = one(words);
    while words.next_if_eq(&"AND").is_some() {
        allowed &= one(words);
    }
    allowed
}

fn one(words: &mut Words<'_>) -> bool {
    if words.next_if_eq(&"(").is_some() {
        let allowed = any_of(words);
        return words.next_if_eq(&")").is_some() && allowed;
    }
    let mut license = words.next().unwrap_or_default().to_owned();
    while words.next_if_eq(&"WITH").is_some() {
        license = format!("{license} WITH {}", words.next().unwrap_or_default());
    }
    ALLOWED.contains(&license.as_str())
}

#[cfg(test)]
mod tests {
    use super::is_allowed;

    #[test]
    fn expressions_are_met_by_allowed_licenses_alone() {
        for allowed in [
            "MIT",
            "MIT/Apache-2.0",
            "GPL-3.0 OR MIT",
            "(MIT OR GPL-3.0) AND Unicode-3.0",
            "Apache-2.0 WITH LLVM-exception OR GPL-2.0",
            "GPL-2.0 AND ISC OR Zlib",
        ] {
            assert!(is_allowed(allowed), "{allowed}");
        }
        for refused in [
            "",
            "GPL-3.0",
            "MIT AND GPL-3.0",
            "(MIT",
            "MIT MIT",
            "MIT WITH Unknown-exception",
            "(MIT OR Apache-2.0) AND MPL-2.0",
        ] {
            assert!(!is_allowed(refused), "{refused}");
        }
    }
}
