//! Finder of assertions without a message, whose failure tells neither the case nor the expectation.

use proc_macro2::{TokenStream, TokenTree};
use syn::parse::Parser;
use syn::punctuated::Punctuated;
use syn::{Expr, Token};

/// Returns the line numbers, from 1, of the assertions without a message in Rust source text, or an error if
/// the text is not Rust. Code in comments, such as doctests, does not count.
pub(crate) fn silent(text: &str) -> Result<Vec<usize>, String> {
    let tokens = text.parse().map_err(|error| format!("{error}"))?;
    let mut lines = Vec::new();
    collect(tokens, &mut lines)?;
    Ok(lines)
}

/// Appends to `lines` the lines of the assertions without a message in `tokens`, nested groups included.
fn collect(tokens: TokenStream, lines: &mut Vec<usize>) -> Result<(), String> {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    for window in tokens.windows(3) {
        let [TokenTree::Ident(name), TokenTree::Punct(mark), TokenTree::Group(group)] = window else {
            continue;
        };
        let needed = match name.to_string().trim_start_matches("debug_") {
            "assert" => 1,
            "assert_eq" | "assert_ne" => 2,
            _ => continue,
        };
        if mark.as_char() == '!' {
            let line = name.span().start().line;
            let arguments = Punctuated::<Expr, Token![,]>::parse_terminated.parse2(group.stream());
            if arguments.map_err(|error| format!("line {line}: {error}"))?.len() <= needed {
                lines.push(line);
            }
        }
    }
    for token in tokens {
        if let TokenTree::Group(group) = token {
            collect(group.stream(), lines)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::silent;

    #[test]
    fn assertions_without_a_message_are_found() {
        for (text, lines) in [
            ("fn f() { assert!(g::<A, B>(a, b)); }", vec![1]),
            ("fn f() {\n assert_eq!(\n 1,\n 2,\n);\n debug_assert_ne!(1, 2) }", vec![2, 6]),
            ("m! { || { assert![a] } }", vec![1]),
            ("/// assert!(a);\nfn f() { assert!(a, \"{b}\"); assert_eq!(a, b, \"{}\", c,) }", vec![]),
            ("fn f(assert: i8) -> i8 { assert_ne(assert - (1)) }", vec![]),
        ] {
            assert_eq!(silent(text), Ok(lines), "lines of the assertions without a message in: {text}");
        }
        assert!(silent("fn f() { \"").is_err(), "text that is not Rust is refused");
    }
}
