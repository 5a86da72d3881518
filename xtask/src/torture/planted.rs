//! Faults that are planted on purpose, and the number of trials until a test notices each.

use super::oracles::oracles;
use super::trial::{Trial, run};
use crate::mutants::schemata::{INTEGRATION_TESTS, Mutant, Tree};
use crate::test_programs::TestProgram;
use std::collections::BTreeMap;
use std::path::Path;

/// Faults, one on a line: test with the crate's name before it, file, function, expression, and what stands
/// in its place, divided by ` | `.
const FAULTS: &str = "xtask/faults.txt";
/// Seeds with which a test runs before a fault counts as not noticed.
const SEEDS: u64 = 20;

/// Faults by package, each with its test.
type ByPackage = BTreeMap<String, Vec<(String, Mutant)>>;

/// Reads the lines of `text` that contain `only`. `Err` with the first line that is about no place of the
/// code.
fn faults(root: &Path, text: &str, only: &str) -> Result<ByPackage, String> {
    let mut by_package = ByPackage::new();
    for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with('#') && line.contains(only))
    {
        let parts: Vec<&str> = line.split(" | ").collect();
        let [name, file, function, old, new] = parts[..] else {
            return Err(format!("{FAULTS}: {line}: not five parts"));
        };
        let (package, test) = name.split_once(' ').ok_or_else(|| format!("{FAULTS}: {name}: no test"))?;
        let text = std::fs::read_to_string(root.join(file)).map_err(|error| format!("{file}: {error}"))?;
        let mutant = Mutant::at(file, &text, function, old, new)
            .ok_or_else(|| format!("{FAULTS}: {file}: {function} has no `{old}`"))?;
        by_package.entry(package.to_owned()).or_default().push((test.to_owned(), mutant));
    }
    Ok(by_package)
}

/// Plants each fault of [`FAULTS`] that has `only` in its line, prints how many trials its test needs to
/// fail, and returns the number of faults that no trial noticed.
pub(super) fn check(root: &Path, only: &str) -> Result<usize, String> {
    let path = root.join(FAULTS);
    let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let by_package = faults(root, &text, only)?;
    let mut missed = 0;
    for name in oracles(root)?.iter().filter(|name| name.contains(only)) {
        let has_fault =
            |line: &str| line.strip_prefix(name.as_str()).is_some_and(|rest| rest.starts_with(" | "));
        if !text.lines().any(has_fault) {
            println!("no fault: {name}");
        }
    }
    println!("| fault | test | noticed within |\n|---|---|---:|");
    for (package, faults) in by_package {
        let folder = root.join("target/mutants/tree");
        let tree = Tree::new(root, folder.clone(), &package, INTEGRATION_TESTS)?;
        let mutants: Vec<Mutant> = faults.iter().map(|(_, mutant)| mutant.clone()).collect();
        let mut batch: Vec<usize> = (0..mutants.len()).collect();
        let programs = tree.build(&mutants, &mut batch)?;
        if batch.len() < mutants.len() {
            let wrong = (0..mutants.len()).filter(|index| !batch.contains(index));
            let wrong: Vec<&str> = wrong.map(|index| mutants[index].new.as_str()).collect();
            return Err(format!("{package}: do not compile: {wrong:?}"));
        }
        let path = programs.iter().find(|path| path.to_string_lossy().contains("/main-"));
        let path = path.ok_or_else(|| format!("{package} has no integration tests"))?.clone();
        let program = TestProgram { path, folder: folder.join(&package), package: package.clone() };
        for (number, (test, mutant)) in faults.into_iter().enumerate() {
            let trial = Trial { program: program.clone(), test };
            let of_seed =
                run(&trial, 0, &[]).ok_or_else(|| format!("{} fails without a fault", trial.name()))?;
            if of_seed == 0 {
                return Err(format!("{FAULTS}: {} judges nothing", trial.name()));
            }
            let fault = [("MUTANT", number.to_string())];
            let seeds = (0..SEEDS).position(|seed| run(&trial, seed, &fault).is_none());
            let within = seeds.map_or("not noticed".to_owned(), |n| ((n as u64 + 1) * of_seed).to_string());
            let Mutant { file, function, old, new, .. } = mutant;
            println!("| `{file}`, `{function}`: `{old}` to `{new}` | `{}` | {within} |", trial.test);
            missed += usize::from(seeds.is_none());
        }
    }
    Ok(missed)
}

#[cfg(test)]
mod tests {
    use super::{FAULTS, faults};
    use std::path::Path;

    #[test]
    fn faults_are_about_places_of_the_code() -> Result<(), String> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("no folder around this crate")?;
        let text = std::fs::read_to_string(root.join(FAULTS)).map_err(|error| error.to_string())?;
        let count: usize = faults(root, &text, "")?.values().map(Vec::len).sum();
        assert!(count > 100, "{count} faults");
        let stale = "visibility-2d a::b | visibility-2d/src/lib.rs | none( | of no | place";
        assert!(faults(root, stale, "").is_err(), "a line about no place");
        Ok(())
    }
}
