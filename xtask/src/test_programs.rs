//! Programs of tests, and the tests in them.

use crate::crates::papers;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Program with the integration tests of a crate.
#[derive(Clone, Debug)]
pub(crate) struct TestProgram {
    pub(crate) path: PathBuf,
    /// Name of the crate's folder.
    pub(crate) package: String,
    /// Folder of the crate, in which its tests run.
    pub(crate) folder: PathBuf,
}

/// Compiles the integration tests of packages with optimization, checks for overflow and debug assertions,
/// and with the systems of papers. The folder `target` holds what cargo has compiled.
///
/// # Errors
///
/// Returns what cargo says if it fails.
pub(crate) fn test_programs(
    root: &Path,
    packages: &[String],
    target: &Path,
) -> Result<Vec<TestProgram>, String> {
    let output = Command::new("cargo")
        .args(["test", "--release", "--no-run", "--tests", "--locked", "--message-format=json"])
        .args(packages.iter().map(|package| format!("-p={package}")))
        .args(papers(root, packages))
        .current_dir(root)
        .env("CARGO_TARGET_DIR", target)
        .env("CARGO_PROFILE_RELEASE_OVERFLOW_CHECKS", "true")
        .env("CARGO_PROFILE_RELEASE_DEBUG_ASSERTIONS", "true")
        .output()
        .map_err(|error| format!("cargo: {error}"))?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    let program = |line: &str| {
        let message = serde_json::from_str::<serde_json::Value>(line).ok()?;
        let path = PathBuf::from(message["executable"].as_str()?);
        let folder = Path::new(message["manifest_path"].as_str()?).parent()?.to_owned();
        let package = folder.file_name()?.to_string_lossy().into_owned();
        (message["target"]["kind"][0] == "test").then_some(TestProgram { path, package, folder })
    };
    Ok(String::from_utf8_lossy(&output.stdout).lines().filter_map(program).collect())
}

/// Returns the names of the tests of a program, or an error if it cannot be run.
pub(crate) fn test_names(program: &Path) -> Result<Vec<String>, String> {
    let list = Command::new(program).args(["--list", "--format=terse"]).output();
    let list = list.map_err(|error| format!("{}: {error}", program.display()))?.stdout;
    let text = String::from_utf8_lossy(&list).into_owned();
    Ok(text.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
}
