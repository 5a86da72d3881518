//! Mutant schemata: all mutations of a batch compiled into one program, which an environment variable
//! switches on one by one.
//!
//! Based on: R. H. Untch, A. J. Offutt, M. J. Harrold, "Mutation analysis using mutant schemata", 1993.

use super::sites::{Site, source_files};
use crate::crates::papers;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Mutation of an expression.
#[derive(Clone, Debug)]
pub(crate) struct Mutant {
    /// File relative to the root of the workspace, with `/` between folders.
    pub(crate) file: String,
    pub(crate) function: String,
    /// Line of the expression in the file, from 1.
    pub(crate) line: usize,
    /// Bytes of the expression in the text of the file.
    range: Range<usize>,
    /// Text before the expression, see [`Site::prefix`].
    prefix: String,
    pub(crate) old: String,
    pub(crate) new: String,
}

impl Mutant {
    /// Makes a mutant of the first expression `old` behind the head of a function in the text of a file.
    /// `None` if there is none.
    pub(crate) fn at(file: &str, text: &str, function: &str, old: &str, new: &str) -> Option<Self> {
        let head = text.find(&format!("fn {function}"))?;
        let start = head + text[head..].find(old)?;
        let line = text[..start].matches('\n').count() + 1;
        let [file, function, old, new] = [file, function, old, new].map(str::to_owned);
        Some(Self { file, function, line, range: start..start + old.len(), prefix: String::new(), old, new })
    }
}

/// Returns the mutants of a file with the given text, in the order of its sites.
pub(crate) fn mutants(file: &str, text: &str, sites: &[Site]) -> Vec<Mutant> {
    let of_site = |site: &Site| {
        let (range, old) = (site.range.clone(), flat(&text[site.range.clone()]));
        let line = text[..range.start].matches('\n').count() + 1;
        let (file, function) = (file.to_owned(), site.function.clone());
        let new = |new: &String| Mutant {
            file: file.clone(),
            function: function.clone(),
            line,
            range: range.clone(),
            prefix: site.prefix.clone(),
            old: old.clone(),
            new: new.clone(),
        };
        site.mutants.iter().map(new).collect::<Vec<_>>()
    };
    sites.iter().flat_map(of_site).collect()
}

/// Returns text with runs of white space as one space.
pub(crate) fn flat(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Largest number of mutants that are compiled into one program.
const BATCH: usize = 512;

/// Divides mutants, given by their indices, into batches of at most [`BATCH`].
pub(crate) fn batches(chosen: &[usize]) -> Vec<Vec<usize>> {
    chosen.chunks(BATCH).map(<[usize]>::to_vec).collect()
}

/// Module that each mutated crate is given: `on(k)` tells whether the mutant `k` is switched on. If the word
/// `record` stands for the number, all are off, and those that are asked for are written to a file.
const SWITCH: &str = r#"
#[allow(missing_docs, dead_code)]
mod mutant_switch {
    extern crate std;
    use self::std::io::Write;
    use self::std::sync::atomic::{AtomicBool, Ordering};
    static CHOSEN: self::std::sync::OnceLock<u32> = self::std::sync::OnceLock::new();
    static REACHED: [AtomicBool; 65536] = [const { AtomicBool::new(false) }; 65536];
    pub(crate) fn on(mutant: u32) -> bool {
        let chosen = *CHOSEN.get_or_init(|| match self::std::env::var("MUTANT").as_deref() {
            Ok("record") => u32::MAX,
            Ok(number) => number.parse().unwrap_or(u32::MAX - 1),
            Err(_) => u32::MAX - 1,
        });
        if chosen == u32::MAX && !REACHED[mutant as usize].swap(true, Ordering::Relaxed) {
            let path = self::std::env::var("MUTANT_RECORD").unwrap_or_default();
            let file = self::std::fs::OpenOptions::new().create(true).append(true).open(path);
            let _ = file.and_then(|mut file| self::std::writeln!(file, "{mutant}"));
        }
        chosen == mutant
    }
}
"#;

/// Mutated text of a file, and the bytes in it of each mutated expression with the mutants there.
struct Mutated {
    text: String,
    expressions: Vec<(Range<usize>, Vec<usize>)>,
}

/// Returns the text of a file in which the mutants of a batch can be switched on. Of an expression that holds
/// others, the mutants stand beside the expression in which those of the others are switched.
fn mutated(text: &str, mutants: &[Mutant], batch: &[usize]) -> Mutated {
    let mut by_range: BTreeMap<(usize, Reverse<usize>), Vec<usize>> = BTreeMap::new();
    for &index in batch {
        let Range { start, end } = mutants[index].range;
        by_range.entry((start, Reverse(end))).or_default().push(index);
    }
    let mut sites: VecDeque<Vec<usize>> = by_range.into_values().collect();
    let mut result = Mutated { text: String::new(), expressions: Vec::new() };
    append(0..text.len(), text, mutants, &mut sites, &mut result);
    result
}

/// Appends the part `range` of a text to the result, with the sites that begin in it: mutants of one
/// expression each, in order of their beginnings, the longer of two that begin together first.
fn append(
    range: Range<usize>,
    text: &str,
    mutants: &[Mutant],
    sites: &mut VecDeque<Vec<usize>>,
    result: &mut Mutated,
) {
    let mut done = range.start;
    while sites.front().is_some_and(|list| mutants[list[0]].range.start < range.end) {
        let Some(list) = sites.pop_front() else { break };
        let Mutant { range, prefix, .. } = &mutants[list[0]];
        result.text += &text[done..range.start];
        let begin = result.text.len();
        result.text += prefix;
        result.text.push('(');
        for &index in &list {
            result.text +=
                &format!("if crate::mutant_switch::on({index}) {{ {} }} else ", mutants[index].new);
        }
        // A margin may be a reference, which the factor makes a value in this branch as in the others.
        let is_margin = list.iter().any(|&index| mutants[index].new.starts_with("0."));
        result.text += if is_margin { "{ 1.0 * " } else { "{ " };
        append(range.clone(), text, mutants, sites, result);
        result.text += " })";
        result.expressions.push((begin..result.text.len(), list));
        done = range.end;
    }
    result.text += &text[done..range.end];
}

/// Choice of the unit tests of a crate.
pub(crate) const UNIT_TESTS: &[&str] = &["--lib"];
/// Choice of the program with the tests of the folder `tests` of a crate.
pub(crate) const INTEGRATION_TESTS: &[&str] = &["--test=main"];
/// Choice of all programs of tests of a crate.
pub(crate) const ALL_TESTS: &[&str] = &["--lib", "--tests"];

/// Copy of the workspace in which crates are mutated, and the tests of one are run.
pub(crate) struct Tree {
    /// The workspace itself.
    root: PathBuf,
    /// Its copy.
    copy: PathBuf,
    /// Folder of the crate whose tests are run, relative to the root.
    package: String,
    /// Arguments by which cargo chooses programs of tests.
    programs: &'static [&'static str],
}

/// Program of tests.
pub(crate) type Program = PathBuf;

impl Tree {
    /// Copies the files that git knows to `copy`, without those that are equal there already. `package` is
    /// the crate whose tests are run, `programs` chooses some of them.
    pub(crate) fn new(
        root: &Path,
        copy: PathBuf,
        package: &str,
        programs: &'static [&'static str],
    ) -> Result<Self, String> {
        let list = Command::new("git").arg("-C").arg(root).arg("ls-files").output();
        let list = list.map_err(|error| format!("git ls-files: {error}"))?.stdout;
        for name in String::from_utf8_lossy(&list).lines() {
            let Ok(bytes) = std::fs::read(root.join(name)) else { continue };
            store(&copy.join(name), &bytes)?;
        }
        // A module that has moved since the last copy would be there twice.
        for name in source_files(&copy, package)?.iter().filter(|name| !root.join(name).exists()) {
            std::fs::remove_file(copy.join(name)).map_err(|error| format!("{name}: {error}"))?;
        }
        Ok(Self { root: root.to_owned(), copy, package: package.to_owned(), programs })
    }

    /// Compiles the tests of the crate with a batch of mutants. Mutants that do not compile leave the batch.
    /// Returns the programs of tests.
    pub(crate) fn build(&self, mutants: &[Mutant], batch: &mut Vec<usize>) -> Result<Vec<Program>, String> {
        loop {
            let files = self.write(mutants, batch)?;
            let (programs, errors) = self.compile()?;
            if errors.is_empty() {
                return Ok(programs);
            }
            let mut wrong = Vec::new();
            for (name, bytes) in &errors {
                // The smallest expression that the error is in: those around it have no part in it.
                let expressions = files.get(name).into_iter().flat_map(|mutated| &mutated.expressions);
                let is_met = |range: &Range<usize>| {
                    bytes.start < range.end && range.start < bytes.end.max(bytes.start + 1)
                };
                let met = expressions.filter(|(range, _)| is_met(range));
                wrong.extend(met.min_by_key(|(range, _)| range.len()).into_iter().flat_map(|(_, list)| list));
            }
            if wrong.is_empty() {
                return Err(format!("{} does not compile: {:?}", self.package, errors.first()));
            }
            batch.retain(|index| !wrong.contains(&index));
        }
    }

    /// Stores the files of the crate, and of all others that have a mutant, with the mutants of a batch.
    /// Returns the files by name.
    fn write(&self, mutants: &[Mutant], batch: &[usize]) -> Result<BTreeMap<String, Mutated>, String> {
        let mut result = BTreeMap::new();
        for package in packages(&self.package, mutants) {
            for file in source_files(&self.root, package)? {
                let path = self.root.join(&file);
                let text = std::fs::read_to_string(path).map_err(|error| format!("{file}: {error}"))?;
                let own: Vec<usize> =
                    batch.iter().copied().filter(|&index| mutants[index].file == file).collect();
                let mut mutated = mutated(&text, mutants, &own);
                if file == format!("{package}/src/lib.rs") {
                    mutated.text += SWITCH;
                }
                store(&self.copy.join(&file), mutated.text.as_bytes())?;
                result.insert(file, mutated);
            }
        }
        Ok(result)
    }

    /// Compiles the tests of the crate. Returns their programs, or the files and bytes of the errors.
    #[allow(clippy::type_complexity)]
    fn compile(&self) -> Result<(Vec<Program>, Vec<(String, Range<usize>)>), String> {
        // Code and tests of systems that lose are compiled as well, as `cargo test --workspace` does.
        let output = Command::new("cargo")
            .args(["test", "--no-run", "--locked", "--message-format=json", "-p", &self.package])
            .args(self.programs)
            .args(papers(&self.root, std::slice::from_ref(&self.package)))
            .current_dir(&self.copy)
            .env("CARGO_TARGET_DIR", self.copy.with_file_name("target"))
            .env("RUSTFLAGS", "--cap-lints=warn")
            .output()
            .map_err(|error| format!("cargo: {error}"))?;
        let (mut programs, mut errors) = (Vec::new(), Vec::new());
        for line in String::from_utf8_lossy(&output.stdout).lines() {
            let Ok(message) = serde_json::from_str::<serde_json::Value>(line) else { continue };
            if let Some(program) = message["executable"].as_str() {
                programs.push(PathBuf::from(program));
            }
            if message["message"]["level"] == "error" {
                for span in message["message"]["spans"].as_array().into_iter().flatten() {
                    let byte = |name: &str| span[name].as_u64().unwrap_or(0) as usize;
                    let file = span["file_name"].as_str().unwrap_or_default().to_owned();
                    errors.push((file, byte("byte_start")..byte("byte_end")));
                }
            }
        }
        if errors.is_empty() && !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into_owned());
        }
        Ok((programs, errors))
    }
}

/// Returns the folders of a crate and of all crates that have a mutant, each once.
fn packages<'a>(tested: &'a str, mutants: &'a [Mutant]) -> BTreeSet<&'a str> {
    mutants.iter().filter_map(|mutant| mutant.file.split('/').next()).chain([tested]).collect()
}

/// Stores a file, unless it has these bytes: what is not new is not compiled again.
fn store(path: &Path, bytes: &[u8]) -> Result<(), String> {
    if std::fs::read(path).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    let folder = path.parent().unwrap_or(path);
    let stored = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(path, bytes));
    stored.map_err(|error| format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::super::sites::sites;
    use super::{Mutant, batches, mutants, mutated, packages};

    #[test]
    fn mutants_of_a_batch_are_switched() -> Result<(), String> {
        let text = "fn f(a: f32, slack: f32) -> bool { a < slack }";
        let mutants = mutants("f.rs", text, &sites(text)?);
        let texts = [&[0][..], &[1, 2], &[0, 1, 2]].map(|batch| mutated(text, &mutants, batch).text);
        let on = "if crate::mutant_switch::on";
        let expected = [
            format!("fn f(a: f32, slack: f32) -> bool {{ ({on}(0) {{ a <= slack }} else {{ a < slack }}) }}"),
            format!(
                "fn f(a: f32, slack: f32) -> bool {{ a < \
                 ({on}(1) {{ 0.0 * slack }} else {on}(2) {{ 0.5 * slack }} else {{ 1.0 * slack }}) }}"
            ),
            format!(
                "fn f(a: f32, slack: f32) -> bool {{ ({on}(0) {{ a <= slack }} else {{ a < \
                 ({on}(1) {{ 0.0 * slack }} else {on}(2) {{ 0.5 * slack }} else {{ 1.0 * slack }}) }}) }}"
            ),
        ];
        assert_eq!(texts, expected, "texts with switches");
        let of_other = [Mutant { file: "other/src/f.rs".to_owned(), ..mutants[0].clone() }];
        let found: Vec<_> = packages("tested", &of_other).into_iter().collect();
        assert_eq!(found, ["other", "tested"], "crates to be mutated");
        assert_eq!(batches(&[3; 1000]).len(), 2, "batches of a thousand mutants");
        Ok(())
    }
}
