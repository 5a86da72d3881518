//! The tests that judge answers, as the sources tell them.

use crate::crates::{crates, package_name, rust_files};
use std::collections::BTreeSet;
use std::path::Path;

/// Returns the tests of all crates that call `judged`, by themselves or by a function of their file: the name
/// of each after that of its crate. A file of each crate is a module of one program.
///
/// # Errors
///
/// Returns a file or folder that cannot be read.
pub(super) fn oracles(root: &Path) -> Result<Vec<String>, String> {
    let mut names = Vec::new();
    for folder in crates(root)? {
        let tests = folder.join("tests");
        for file in rust_files(vec![tests.clone()]).unwrap_or_default() {
            let text =
                std::fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))?;
            let path = file.strip_prefix(&tests).unwrap_or(&file).with_extension("");
            let parts = path.iter().map(|part| part.to_string_lossy()).filter(|part| part != "mod");
            let module = parts.collect::<Vec<_>>().join("::");
            let of_file = judging_tests(&text).into_iter();
            names.extend(of_file.map(|test| format!("{} {module}::{test}", package_name(&folder))));
        }
    }
    names.sort();
    Ok(names)
}

/// Returns the names of the tests of a file that call `judged`.
fn judging_tests(text: &str) -> Vec<String> {
    // Functions: name, whether it is a test, and the text up to the next function.
    let mut functions: Vec<(String, bool, String)> = Vec::new();
    let mut is_test = false;
    for line in text.lines() {
        let code = line.trim_start().trim_start_matches("pub(crate) ").trim_start_matches("pub ");
        is_test |= code.starts_with("#[test]");
        if let Some(head) = code.strip_prefix("fn ") {
            let name: String = head.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            functions.push((name, std::mem::take(&mut is_test), String::new()));
        } else if let Some((.., body)) = functions.last_mut() {
            body.push_str(line);
            body.push('\n');
        }
    }
    let mut judging: BTreeSet<&str> = BTreeSet::from(["judged"]);
    let calls = |body: &str, judging: &BTreeSet<&str>| {
        let mut words = body.match_indices('(').map(|(at, _)| {
            body[..at].rsplit(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default()
        });
        words.any(|word| judging.contains(word))
    };
    loop {
        let found =
            functions.iter().find(|(name, _, body)| !judging.contains(&**name) && calls(body, &judging));
        let Some((name, ..)) = found else { break };
        judging.insert(name);
    }
    let tests = functions.iter().filter(|(name, is_test, _)| *is_test && judging.contains(&**name));
    tests.map(|(name, ..)| name.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::judging_tests;

    #[test]
    fn tests_that_judge_by_a_helper_are_found() {
        let text = "fn run() {\n    judged(3);\n}\n#[test]\nfn a() {\n    run();\n}\n#[test]\nfn b() {\n    other();\n}\n";
        assert_eq!(judging_tests(text), ["a"], "tests that judge");
    }
}
