//! Test that the checked-in header equals the one that cbindgen makes from the sources.

use std::path::Path;

/// Returns the header that cbindgen makes from the sources.
fn made() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).expect("cbindgen.toml");
    let bindings =
        cbindgen::Builder::new().with_crate(folder).with_config(config).generate().expect("header");
    let mut text = Vec::new();
    bindings.write(&mut text);
    String::from_utf8(text).expect("UTF-8")
}

#[test]
fn the_header_is_current() {
    let made = made();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/visibility.h");
    if std::env::var_os("VIS_WRITE_HEADER").is_some() {
        std::fs::write(&path, &made).expect("header is written");
    }
    let stored = std::fs::read_to_string(&path).unwrap_or_default();
    let differing = made.lines().zip(stored.lines()).position(|(made, stored)| made != stored);
    let line = differing.unwrap_or(made.lines().count().min(stored.lines().count())) + 1;
    assert!(
        made == stored,
        "line {line} differs: VIS_WRITE_HEADER=1 cargo test --test header writes the header"
    );
}

/// Returns the texts of the files of folders.
fn texts(folders: &[&str]) -> String {
    let read = |folder: &&str| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let paths = std::fs::read_dir(folder).expect("folder").map(|entry| entry.expect("entry").path());
        let files = paths.filter(|path| path.is_file());
        files.map(|path| std::fs::read_to_string(path).expect("text")).collect::<String>()
    };
    folders.iter().map(read).collect()
}

#[test]
fn every_exported_function_is_declared_and_called_by_a_test_or_sample() {
    let header = made();
    let uses = texts(&["tests", "samples"]);
    let sources = texts(&["src", "src/whole"]);
    let mut count = 0;
    // cbindgen silently omits functions that it cannot express in C.
    for rest in sources.split("#[unsafe(no_mangle)]").skip(1) {
        let name = rest.split_once("fn ").and_then(|(_, rest)| rest.split_once('(')).expect("a function").0;
        assert!(header.contains(&format!("{name}(")), "{name} is not declared");
        let uses = uses.matches(name).count();
        assert!(uses > 0, "{name} is called nowhere");
        count += 1;
    }
    assert!(count > 100, "{count} functions");
}

#[test]
fn every_name_in_the_header_is_declared() {
    let header = made();
    let is_comment = |line: &&str| line.trim_start().starts_with("//");
    let code: String =
        header.lines().filter(|line| !is_comment(line)).flat_map(|line| [line, "\n"]).collect();
    let words = header.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
    let is_name = |word: &&str| word.starts_with("vis_") || word.starts_with("VIS_") && !word.ends_with('_');
    let mut names: std::collections::BTreeSet<_> = words.filter(is_name).collect();
    // What writes the header is no name of the library.
    names.remove("VIS_WRITE_HEADER");
    for name in &names {
        // Functions, structures, enumerations, enumerators and constants.
        let forms = ["NAME(", "typedef struct NAME ", "typedef enum NAME ", "  NAME = ", "#define NAME "];
        let is_declared = forms.iter().any(|form| code.contains(&form.replace("NAME", name)));
        assert!(is_declared, "{name} is mentioned, and declared nowhere");
    }
    assert!(names.len() > 150, "{} names", names.len());
}
