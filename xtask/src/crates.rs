//! Crates of the workspace, found by their folders.

use std::path::{Path, PathBuf};

/// Returns the crates, sorted: the folders directly below `root` and `root/platforms` that have a manifest
/// and a `src`. Returns an error when one of the two cannot be listed.
pub(crate) fn crates(root: &Path) -> Result<Vec<PathBuf>, String> {
    let list =
        |folder: &Path| std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()));
    let mut folders: Vec<PathBuf> = list(root)?
        .chain(list(&root.join("platforms"))?)
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("Cargo.toml").is_file() && path.join("src").is_dir())
        .collect();
    folders.sort();
    Ok(folders)
}

/// Returns the folders of the published crates: those whose manifest does not say `publish = false`. Returns
/// an error when a folder or manifest cannot be read.
pub(crate) fn published_crates(root: &Path) -> Result<Vec<PathBuf>, String> {
    let mut folders = Vec::new();
    for folder in crates(root)? {
        let manifest = folder.join("Cargo.toml");
        let text =
            std::fs::read_to_string(&manifest).map_err(|error| format!("{}: {error}", manifest.display()))?;
        if !text.lines().any(|line| line == "publish = false") {
            folders.push(folder);
        }
    }
    Ok(folders)
}

/// Returns the options of cargo that turn the feature `papers` on in those of some packages that have it.
/// With the whole workspace it is on, with single packages it is not.
pub(crate) fn papers(root: &Path, packages: &[String]) -> Vec<String> {
    let has_papers = |package: &&String| {
        let manifest = std::fs::read_to_string(root.join(package).join("Cargo.toml")).unwrap_or_default();
        manifest.lines().any(|line| line.starts_with("papers = "))
    };
    packages.iter().filter(has_papers).map(|package| format!("--features={package}/papers")).collect()
}

/// Returns the last part of a crate's folder, which is also the name of its package.
pub(crate) fn package_name(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the Rust files in and below some folders, without those of folders named `target`. Returns an
/// error for the first folder that cannot be read.
pub(crate) fn rust_files(mut folders: Vec<PathBuf>) -> Result<Vec<PathBuf>, String> {
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        let entries = std::fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            if path.is_dir() && path.file_name().is_some_and(|name| name != "target") {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    Ok(files)
}
