//! Test that the declarations of the C# samples are those of the header: functions by their parameters and
//! results, structures by the types of their fields.

const HEADER: &str = include_str!("../include/visibility.h");
const SHARP: &str = include_str!("../samples/csharp/Vis.cs");

/// Returns a text without comments, which are lines of their own or end a line.
fn code(text: &str) -> String {
    text.lines().flat_map(|line| [line.split("//").next().unwrap_or_default(), "\n"]).collect()
}

/// Returns the C# type of a C type without its pointers.
fn sharp_type(c: &str) -> String {
    match c {
        "uint32_t" => "uint".into(),
        "int32_t" => "int".into(),
        "uint64_t" => "ulong".into(),
        "size_t" => "UIntPtr".into(),
        _ => match c.strip_prefix("vis_") {
            // vis_draw_group is DrawGroup.
            Some(name) => name.split('_').map(|word| word[..1].to_uppercase() + &word[1..]).collect(),
            None => c.into(),
        },
    }
}

/// Splits a C declaration without its end into the C# type, the number of its pointers, and the name.
fn declared(c: &str) -> (String, usize, String) {
    let words: Vec<_> =
        c.split_whitespace().filter(|word| !["const", "struct", "enum"].contains(word)).collect();
    let [base, .., last] = words[..] else { panic!("{c} is no declaration") };
    let base = if c.contains("enum ") { "int".into() } else { sharp_type(base) };
    (base, c.matches('*').count(), last.trim_start_matches('*').into())
}

/// Splits a list of parameters.
fn parameters(list: &str) -> Vec<String> {
    let whole = list.split_whitespace().collect::<Vec<_>>().join(" ");
    whole.split(',').map(|one| one.trim().to_owned()).filter(|one| !one.is_empty() && one != "void").collect()
}

/// Whether a parameter of C# is passed as a parameter of C takes it.
fn is_passed(sharp: &str, c: &str) -> bool {
    let (base, pointers, _) = declared(c);
    let is_marked = sharp.contains("UnmanagedType.U1");
    let words: Vec<_> = sharp.split_whitespace().filter(|word| !word.starts_with('[')).collect();
    let (by_reference, kind) = match words[..] {
        ["ref" | "out", kind, _] => (1, kind),
        [kind, _] => (0, kind),
        _ => return false,
    };
    let found = by_reference + usize::from(kind.ends_with("[]"));
    let kind = kind.trim_end_matches("[]");
    // Bytes, where C# has 4 of its own accord.
    (kind != "bool" || is_marked)
        && match kind {
            "IntPtr" => found + 1 == pointers,
            _ => kind == base && found == pointers,
        }
}

#[test]
fn functions_are_those_of_the_header() {
    let (header, sharp) = (code(HEADER), code(SHARP));
    let mut count = 0;
    for declaration in sharp.split("extern ").skip(1) {
        let (head, rest) = declaration.split_once('(').expect("parameters");
        let (result, name) = head.trim().split_once(' ').expect("a result and a name");
        let list = rest.split_once(");").expect("an end").0;
        let (before, after) =
            header.split_once(&format!("{name}(")).unwrap_or_else(|| panic!("the header has no {name}"));
        let c = parameters(after.split_once(");").expect("an end").0);
        let c_result = before.lines().last().expect("a result");
        let expected = match declared(&format!("{c_result} {name}")) {
            (_, 1, _) => "IntPtr".into(),
            (kind, _, _) => kind,
        };
        assert_eq!(result, expected, "the result of {name}");
        let sharp = parameters(list);
        assert_eq!(sharp.len(), c.len(), "the number of parameters of {name}");
        for (sharp, c) in sharp.iter().zip(&c) {
            assert!(is_passed(sharp, c), "{name}: {sharp} for {c}");
        }
        count += 1;
    }
    assert!(count > 80, "{count} functions");
}

#[test]
fn structures_have_the_fields_of_the_header() {
    let (header, sharp) = (code(HEADER), code(SHARP));
    let mut count = 0;
    for declaration in sharp.split("public struct ").skip(1) {
        let (name, rest) = declaration.split_once('{').expect("fields");
        let name = name.trim();
        let constructor = format!("public {name}(");
        let fields = rest.lines().take_while(|line| !line.contains('}') && !line.contains(&constructor));
        let found: Vec<String> = rest[..fields.map(|line| line.len() + 1).sum()]
            .split(';')
            .filter_map(|field| field.split_once("public "))
            .flat_map(|(before, field)| {
                let (kind, names) = field.trim().split_once(' ').expect("a type and names");
                assert!(kind != "bool" || before.contains("UnmanagedType.U1"), "{name}: bytes for {names}");
                vec![kind.to_owned(); names.split(',').count()]
            })
            .collect();
        let c = header
            .split("typedef struct ")
            .find(|c| c.split_once(" {").is_some_and(|(c, _)| sharp_type(c) == name))
            .unwrap_or_else(|| panic!("the header has no {name}"));
        let body = c.split_once('{').and_then(|(_, rest)| rest.split_once('}')).expect("fields").0;
        let expected: Vec<String> = body
            .split(';')
            .filter(|field| !field.trim().is_empty())
            .flat_map(|field| {
                let (kind, pointers, field) = declared(field);
                assert_eq!(pointers, 0, "{name}: {field}");
                let length = field.split_once('[').map_or("1", |(_, rest)| rest.trim_end_matches(']'));
                vec![kind; length.parse().expect("a length")]
            })
            .collect();
        assert_eq!(found, expected, "the fields of {name}");
        count += 1;
    }
    assert!(count > 10, "{count} structures");
}
