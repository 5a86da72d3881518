//! Check of the packages of published crates: complete, and created without a warning.

use crate::crates::{package_name, published_crates};
use std::path::Path;
use std::process::{Command, Output};

/// Files that every package must contain.
const REQUIRED: [&str; 4] = ["LICENSE-APACHE", "LICENSE-MIT", "README.md", "src/lib.rs"];

/// Creates the packages of all published crates without building them. Prints the crates in the order in which
/// they can be published, each warning and each missing file, and returns the number of warnings and missing
/// files.
///
/// # Errors
///
/// Returns cargo's messages when it cannot create a package.
pub(crate) fn check(root: &Path) -> Result<usize, String> {
    let names: Vec<String> = published_crates(root)?.iter().map(|folder| package_name(folder)).collect();
    let all = names.iter().flat_map(|name| ["-p", name]);
    let output = cargo(Command::new("cargo").args(["package", "--no-verify"]).args(all), root)?;
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    // Cargo packages a crate after those that it needs.
    let packaged = messages.lines().filter_map(|line| line.trim_start().strip_prefix("Packaging "));
    let order: Vec<&str> = packaged.filter_map(|line| line.split(' ').next()).collect();
    println!("order of publishing: {}", order.join(" "));
    let mut found: Vec<String> =
        messages.lines().filter(|line| line.starts_with("warning")).map(str::to_owned).collect();
    for name in &names {
        let output = cargo(Command::new("cargo").args(["package", "--list", "-p", name]), root)?;
        let files = String::from_utf8_lossy(&output.stdout).into_owned();
        let missing = REQUIRED.iter().filter(|file| !files.lines().any(|line| line == **file));
        found.extend(missing.map(|file| format!("{name}: the package lacks {file}")));
    }
    found.iter().for_each(|line| println!("{line}"));
    Ok(found.len())
}

/// Runs cargo in the workspace. Uncommitted changes are allowed. Returns cargo's messages as an error if it
/// fails.
fn cargo(command: &mut Command, root: &Path) -> Result<Output, String> {
    let output = command.args(["--allow-dirty", "--locked"]).current_dir(root).output();
    let output = output.map_err(|error| format!("cargo: {error}"))?;
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    output.status.success().then_some(output).ok_or(messages)
}
