//! Checks of the workspace beyond those of the compiler: `cargo run -p xtask -- (api | assertions | cycles |
//! figures | licenses | modules | mutants | package | torture | width)`.

mod api;
mod assertions;
mod crates;
mod cycles;
mod figures;
mod item_lines;
mod licenses;
mod module_tree;
mod mutants;
mod package;
mod public_items;
mod signature;
mod test_programs;
mod torture;

use crate::crates::{crates, rust_files};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Maximum length of a comment line in characters, equal to rustfmt's `max_width` for code.
const WIDTH: usize = 110;

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let task = std::env::args().nth(1).unwrap_or_default();
    let write = std::env::args().nth(2).is_some_and(|option| option == "--write");
    let found = match task.as_str() {
        "api" => api::check(root, write),
        "assertions" => check_assertions(root),
        "cycles" => check_cycles(root),
        "figures" => figures::check(root, write),
        "licenses" => licenses::check(root),
        "modules" => check_modules(root),
        "mutants" => mutants::check(root, &std::env::args().skip(2).collect::<Vec<_>>()),
        "package" => package::check(root),
        "torture" => torture::check(root, &std::env::args().skip(2).collect::<Vec<_>>()),
        "width" => check_width(root),
        _ => Err("usage: cargo run -p xtask -- (api [--write] | assertions | cycles | figures [--write] | \
                  licenses | modules | mutants (CRATE | FILE...) | package | torture | width)"
            .to_owned()),
    };
    match found {
        Ok(0) => ExitCode::SUCCESS,
        Ok(count) => {
            println!("{task}: {count} found");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Prints each assertion below `root` without a message, and returns their number. Returns an error for the
/// first folder or file that cannot be read or parsed.
fn check_assertions(root: &Path) -> Result<usize, String> {
    let mut count = 0;
    for path in sources(root)? {
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        for line in assertions::silent(&text).map_err(|error| format!("{}: {error}", path.display()))? {
            count += 1;
            println!("{}:{line}: an assertion without a message", path.display());
        }
    }
    Ok(count)
}

/// Prints each group of modules that depend on each other, for all crates below `root`, and returns the
/// number of groups. Returns an error for the first file that cannot be read or parsed.
fn check_cycles(root: &Path) -> Result<usize, String> {
    let mut count = 0;
    for folder in crates(root)? {
        let source = folder.join("src");
        let Some(file) =
            ["lib.rs", "main.rs"].map(|name| source.join(name)).into_iter().find(|p| p.is_file())
        else {
            continue;
        };
        for group in cycles::cycles(&file)? {
            count += 1;
            let name = folder.strip_prefix(root).unwrap_or(&folder).display();
            println!("{name}: {} modules need each other\n  {}", group.len(), group.join("\n  "));
        }
    }
    Ok(count)
}

/// Returns the Rust files of all crates below `root`, and the fuzz targets. Returns an error for the first
/// folder that cannot be read.
fn sources(root: &Path) -> Result<Vec<PathBuf>, String> {
    let mut folders = crates(root)?;
    folders.push(root.join("fuzz"));
    rust_files(folders)
}

/// Prints each module file that lies beside the folder of its submodules, and should be `mod.rs` inside it.
/// Returns the number of such files, or an error for the first folder that cannot be read.
fn check_modules(root: &Path) -> Result<usize, String> {
    let mut files = sources(root)?;
    files.retain(|file| file.with_extension("").is_dir());
    for file in &files {
        println!("{} stands beside its folder: move it to mod.rs in there", file.display());
    }
    Ok(files.len())
}

/// Prints each comment line below `root` that is longer than [`WIDTH`], and returns the number of such lines.
/// Returns an error for the first folder or file that cannot be read.
fn check_width(root: &Path) -> Result<usize, String> {
    let mut count = 0;
    for path in sources(root)? {
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        for (number, line) in (1..).zip(text.lines()) {
            let comment = line.trim_start();
            let text = comment.trim_start_matches(['/', '!', ' ']);
            // Links and table rows are exempt, since they cannot be wrapped.
            if comment.starts_with("//")
                && line.chars().count() > WIDTH
                && !text.contains("://")
                && !text.starts_with('|')
            {
                count += 1;
                println!("{}:{number}: {} wide", path.display(), line.chars().count());
            }
        }
    }
    Ok(count)
}
