//! Figures of pages that come from runs of the programs: counts of objects, errors, triangles.
//!
//! A page says in a comment before a table or a paragraph which program prints its figures, and where:
//!
//! ```text
//! <!-- figures: walkthrough {scene} --cullers frustum,hzb
//! | {scene} | frustum 1 | - |
//! by the frustum, and {hzb 1} by the z-buffer
//! -->
//! ```
//!
//! - The first line has the program and its arguments.
//! - A reference `START K` means the K-th number behind START in the first line of the program's output that
//!   begins with START. Runs of spaces count as one.
//! - A line that begins with `|` describes the columns of the next table: `-` is not compared, `{name}` is a
//!   key, and any other cell lists references for the first numbers of the page's cell, separated by `;`,
//!   with `-` for a number that is not compared. Keys stand in references and in the command for what their
//!   cell has in backticks, or else for its text. A row is compared if one of its keys is in backticks.
//! - Any other line is a phrase that the page must have after the comment, with references in braces.
//!
//! Numbers agree if that of the program, rounded to the page's decimals, is that of the page. Times are not
//! to be referred to.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

/// Figure of a page, and where the programs say it.
#[derive(Debug, PartialEq, Eq)]
struct Figure {
    /// Bytes of the number in the text of the page.
    range: Range<usize>,
    /// Program with its arguments.
    command: String,
    /// Reference into the program's output: `START K`.
    reference: String,
}

/// Least number of figures in all pages. Fewer mean that a marker or a key is misspelt.
const LEAST: usize = 330;

/// Compares all figures in the pages below `root` with the programs, prints each that differs and returns
/// their number. With `write` stores the programs' figures in the pages instead, and returns 0.
///
/// # Errors
///
/// Returns the first page that cannot be read or written, marker that does not fit its page, program that
/// fails, and reference that the output of its program does not have.
pub(crate) fn check(root: &Path, write: bool) -> Result<usize, String> {
    let mut pages = Vec::new();
    for path in markdown_files(root)? {
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let figures = figures(&text).map_err(|error| format!("{}: {error}", path.display()))?;
        pages.push((path, text, figures));
    }
    let commands = pages.iter().flat_map(|(_, _, figures)| figures).map(|figure| figure.command.clone());
    let outputs = run_all(commands.collect())?;
    let (mut compared, mut found) = (0, 0);
    for (path, mut text, figures) in pages {
        let stored = text.clone();
        // From the end on, so that ranges stay right while numbers are replaced.
        for figure in figures.iter().rev() {
            let Figure { range, command, reference } = figure;
            let output = outputs.get(command).map_or("", String::as_str);
            let said = referred(output, reference)
                .ok_or_else(|| format!("{}: `{command}` has no `{reference}`", path.display()))?;
            let page = &stored[range.clone()];
            compared += 1;
            if agree(page, said) {
                continue;
            }
            if write {
                text.replace_range(range.clone(), &formatted_like(page, said));
            } else {
                found += 1;
                let line = stored[..range.start].lines().count();
                let name = path.strip_prefix(root).unwrap_or(&path).display();
                println!("{name}:{line}: {page}, but `{command}` says {said} ({reference})");
            }
        }
        if text != stored {
            std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
        }
    }
    println!("{compared} figures from {} runs", outputs.len());
    if compared < LEAST {
        return Err(format!("the pages had {LEAST} figures or more: a marker may be misspelt"));
    }
    if found > 0 {
        println!(
            "pages differ from what programs say; if that is meant: cargo run -p xtask -- figures --write"
        );
    }
    Ok(found)
}

/// Returns all pages below `root`, sorted, but for those in folders of builds and in hidden folders.
fn markdown_files(root: &Path) -> Result<Vec<PathBuf>, String> {
    let (mut files, mut folders) = (Vec::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        let entries = std::fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if path.is_dir() && name != "target" && name != "node_modules" && !name.starts_with('.') {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// Returns the figures that the markers of a page refer to, in the order of the page.
fn figures(text: &str) -> Result<Vec<Figure>, String> {
    const START: &str = "<!-- figures: ";
    let mut all = Vec::new();
    for (at, _) in text.match_indices(START) {
        let begin = at + START.len();
        let end = text[begin..].find("-->").ok_or("a marker without an end")? + begin;
        let mut lines = text[begin..end].lines().map(str::trim).filter(|line| !line.is_empty());
        let command = lines.next().ok_or("a marker without a command")?;
        for line in lines {
            match line.strip_prefix('|') {
                Some(columns) => table_figures(text, end, command, columns, &mut all)?,
                None => phrase_figures(text, end, command, line, &mut all)?,
            }
        }
    }
    all.sort_by_key(|figure| figure.range.start);
    Ok(all)
}

/// Appends the figures of the first table behind byte `from` of a page. `columns` describes its columns.
fn table_figures(
    text: &str,
    from: usize,
    command: &str,
    columns: &str,
    all: &mut Vec<Figure>,
) -> Result<(), String> {
    let columns: Vec<&str> = columns.trim_end_matches('|').split('|').map(str::trim).collect();
    let mut at = from;
    let lines = text[from..].split_inclusive('\n').map(|line| {
        at += line.len();
        (at - line.len(), line)
    });
    let rows =
        lines.skip_while(|(_, line)| !line.starts_with('|')).take_while(|(_, line)| line.starts_with('|'));
    let is_key = |column: &str| column.starts_with('{') && column.ends_with('}');
    let before = all.len();
    for (start, line) in rows.skip(2) {
        let mut place = start + 1;
        let mut cells = Vec::new();
        for cell in line[1..].trim_end().trim_end_matches('|').split('|') {
            cells.push((place, cell));
            place += cell.len() + 1;
        }
        if cells.len() != columns.len() {
            return Err(format!("a row without {} columns: {line}", columns.len()));
        }
        let keys = || columns.iter().zip(&cells).filter(|(column, _)| is_key(column));
        if !keys().any(|(_, (_, cell))| cell.contains('`')) {
            continue;
        }
        let filled = |text: &str| {
            let quoted = |cell: &str| cell.split('`').nth(1).unwrap_or(cell.trim()).to_owned();
            keys().fold(text.to_owned(), |text, (name, (_, cell))| text.replace(name, &quoted(cell)))
        };
        for (column, (place, cell)) in columns.iter().zip(&cells) {
            if *column == "-" || is_key(column) || cell.trim().is_empty() {
                continue;
            }
            let mut numbers = numbers(cell);
            for reference in column.split(';') {
                let number =
                    numbers.next().ok_or_else(|| format!("too few numbers in `{cell}` of {line}"))?;
                if reference == "-" {
                    continue;
                }
                let range = place + number.start..place + number.end;
                all.push(Figure { range, command: filled(command), reference: filled(reference.trim()) });
            }
        }
    }
    (all.len() > before).then_some(()).ok_or_else(|| format!("no row of a table to compare with `{command}`"))
}

/// Appends the figures of the first place behind byte `from` of a page that reads as `phrase`.
fn phrase_figures(
    text: &str,
    from: usize,
    command: &str,
    phrase: &str,
    all: &mut Vec<Figure>,
) -> Result<(), String> {
    for begin in text[from..].char_indices().map(|(index, _)| from + index) {
        let (mut at, mut rest, mut found) = (Some(begin), phrase, Vec::new());
        while let Some(place) = at.filter(|_| !rest.is_empty()) {
            if let Some((reference, after)) = rest.strip_prefix('{').and_then(|rest| rest.split_once('}')) {
                let number = numbers(&text[place..]).next().filter(|number| number.start == 0);
                at = number.map(|number| place + number.end);
                let range = place..at.unwrap_or(place);
                found.push(Figure { range, command: command.to_owned(), reference: reference.to_owned() });
                rest = after;
            } else {
                let (literal, after) = rest.split_at(rest.find('{').unwrap_or(rest.len()));
                at = literal_end(text, place, literal);
                rest = after;
            }
        }
        if at.is_some() {
            all.append(&mut found);
            return Ok(());
        }
    }
    Err(format!("the page does not read: {phrase}"))
}

/// Returns where `literal` ends in `text` if it stands at `place`. A space matches any run of spaces and line
/// ends.
fn literal_end(text: &str, mut place: usize, literal: &str) -> Option<usize> {
    for expected in literal.chars() {
        let rest = &text[place..];
        place += if expected == ' ' {
            Some(rest.len() - rest.trim_start().len()).filter(|&length| length > 0)?
        } else {
            rest.starts_with(expected).then_some(expected.len_utf8())?
        };
    }
    Some(place)
}

/// Returns the places of the numbers in a text: digits, with commas before three of them, and with decimals.
fn numbers(text: &str) -> impl Iterator<Item = Range<usize>> + '_ {
    let bytes = text.as_bytes();
    let digits = move |from: usize| bytes[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let mut at = 0;
    core::iter::from_fn(move || {
        while at < bytes.len() {
            let start = at;
            at += digits(at);
            if at > start {
                while bytes.get(at) == Some(&b',') && digits(at + 1) == 3 {
                    at += 4;
                }
            }
            if bytes.get(at) == Some(&b'.') && digits(at + 1) > 0 {
                at += 1 + digits(at + 1);
            }
            if at > start {
                return Some(start..at);
            }
            at += 1;
        }
        None
    })
}

/// Returns the number in a program's output that `START K` refers to.
fn referred<'a>(output: &'a str, reference: &str) -> Option<&'a str> {
    let (start, number) = reference.rsplit_once(' ')?;
    let number: usize = number.parse().ok()?;
    let line = output.lines().find_map(|line| {
        let line = line.trim_start();
        let end = literal_end(line, 0, start)?;
        // `hom:0.9` is not the start of `hom:0.95`.
        let ends =
            line[end..].chars().next().is_none_or(|next| !next.is_alphanumeric() && !"-:.+".contains(next));
        ends.then_some(&line[end..])
    })?;
    let place = numbers(line).nth(number.checked_sub(1)?)?;
    Some(&line[place])
}

/// Returns the value of a number, and how many decimals it has.
fn value(number: &str) -> (f64, usize) {
    let decimals = number.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    (number.replace(',', "").parse().unwrap_or(f64::NAN), decimals)
}

/// Returns whether the program's number, rounded to the decimals of the page, is that of the page. A half may
/// be rounded up or down.
fn agree(page: &str, said: &str) -> bool {
    let ((page, decimals), (said, _)) = (value(page), value(said));
    (page - said).abs() <= 0.500_001 * 0.1f64.powi(decimals as i32)
}

/// Returns the program's number with the decimals that the page has, and with commas if the page has some or
/// the number has five digits or more.
fn formatted_like(page: &str, said: &str) -> String {
    let text = format!("{:.*}", value(page).1, value(said).0);
    let (whole, decimals) = text.split_at(text.find('.').unwrap_or(text.len()));
    let has_commas = page.contains(',') || whole.len() > 4;
    let digits = whole.char_indices().flat_map(|(index, digit)| {
        let is_group = has_commas && index > 0 && (whole.len() - index).is_multiple_of(3);
        is_group.then_some(',').into_iter().chain([digit])
    });
    digits.chain(decimals.chars()).collect()
}

/// Runs programs of the workspace in release, as many at a time as there are processors, and returns what
/// each prints.
fn run_all(mut commands: Vec<String>) -> Result<BTreeMap<String, String>, String> {
    commands.sort();
    commands.dedup();
    let programs: BTreeSet<&str> = commands.iter().filter_map(|command| command.split(' ').next()).collect();
    let build = ["build", "--release", "--quiet", "--locked", "-p", "visibility-examples"];
    let bins = programs.iter().flat_map(|program| ["--bin", program]);
    if !Command::new("cargo").args(build).args(bins).status().is_ok_and(|status| status.success()) {
        return Err("the programs do not compile".to_owned());
    }
    // This program is `target/debug/xtask`.
    let this = std::env::current_exe().map_err(|error| error.to_string())?;
    let built = this.ancestors().nth(2).unwrap_or(Path::new("target")).join("release");
    let pictures = std::env::temp_dir().join(format!("visibility-figures-{}", std::process::id()));
    std::fs::create_dir_all(&pictures).map_err(|error| format!("{}: {error}", pictures.display()))?;
    let (left, outputs) = (Mutex::new(commands), Mutex::new(BTreeMap::new()));
    let work = || -> Result<(), String> {
        loop {
            let Some(command) = left.lock().map_err(|error| error.to_string())?.pop() else { return Ok(()) };
            let output = run(&built, &pictures, &command)?;
            outputs.lock().map_err(|error| error.to_string())?.insert(command, output);
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let result = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .try_for_each(|worker| worker.join().unwrap_or(Err("a worker panicked".to_owned())))
    });
    // A folder of pictures in the system's own folder for them does no harm if it stays.
    let _ = std::fs::remove_dir_all(&pictures);
    result.and_then(|()| outputs.into_inner().map_err(|error| error.to_string()))
}

/// Runs a program and returns what it prints. `folder` is for the pictures that it writes.
fn run(built: &Path, folder: &Path, command: &str) -> Result<String, String> {
    let mut words = command.split_whitespace();
    let program = built.join(words.next().unwrap_or_default());
    let output = Command::new(program).args(words).current_dir(folder).output();
    let output = output.map_err(|error| format!("{command}: {error}"))?;
    let text =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    if output.status.success() { Ok(text) } else { Err(format!("{command}: {text}")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTPUT: &str = "a frame: 65.4 objects visible\n culler   us\n hom:0.95   conservative   7.0\n\
                          hom:0.9    approximate   1,936.5   8/2\n";

    fn read(text: &str) -> Vec<(&str, String, String)> {
        let figures = figures(text).unwrap();
        figures.into_iter().map(|figure| (&text[figure.range], figure.command, figure.reference)).collect()
    }

    #[test]
    fn references_count_numbers_behind_the_start_of_a_line() {
        assert_eq!(referred(OUTPUT, "a frame: 1"), Some("65.4"), "a start that ends with a colon");
        assert_eq!(referred(OUTPUT, "hom:0.9 approximate 1"), Some("1,936.5"), "spaces and commas");
        assert_eq!(referred(OUTPUT, "hom:0.9 3"), Some("2"), "not the line of hom:0.95");
        assert_eq!(referred(OUTPUT, "hom:0.9 4"), None, "too few numbers");
        assert_eq!(referred(OUTPUT, "hzb 1"), None, "no such line");
    }

    #[test]
    fn numbers_agree_in_the_decimals_of_the_page() {
        assert!(agree("1,937", "1936.5") && agree("1936", "1936.5"), "a half, both ways");
        assert!(!agree("1,935", "1936.5") && !agree("65.5", "65.4"), "other numbers");
        assert_eq!(formatted_like("1,2", "1936.5"), "1,936", "commas as on the page");
        assert_eq!(formatted_like("12.00", "1936.5"), "1936.50", "decimals as on the page");
        assert_eq!(formatted_like("1", "12345"), "12,345", "five digits");
    }

    #[test]
    fn rows_and_phrases_name_their_figures() {
        let text = "<!-- figures: walk {scene}\n| {scene} | {culler} | {scene} {culler} 1; {culler} 2 | - |\n\
                    {all 1} in all, {all 2}\n-->\n\n7 in\nall, .5 |\n\n| s | c | n | us |\n|---|---|---|---|\n\
                    | `town` | `hzb` | **3.5, 1,204 us** | 5 |\n| town | `hom` | 6; 8 | |\n\
                    | a town | hzb | 9 | 9 |\n";
        let row = |page, key: &str| (page, "walk town".to_owned(), key.to_owned());
        let all = |page, key: &str| (page, "walk {scene}".to_owned(), key.to_owned());
        let expected = [
            all("7", "all 1"),
            all(".5", "all 2"),
            row("3.5", "town hzb 1"),
            row("1,204", "hzb 2"),
            row("6", "town hom 1"),
            row("8", "hom 2"),
        ];
        assert_eq!(read(text), expected, "figures in the order of the page");
        assert!(figures("<!-- figures: walk\nseven\n-->\neight\n").is_err(), "a phrase that is not there");
        assert!(
            figures("<!-- figures: walk\n| {a} | a 1 |\n-->\nno table\n").is_err(),
            "a table that is not there"
        );
    }
}
