//! Signatures of items as texts of one line, independent of how the source is wrapped.

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};
use quote::quote;
use syn::{FnArg, Pat, Signature};

/// Returns a function's signature without its name, body and the `mut` of its arguments.
pub(crate) fn of_function(signature: &Signature) -> String {
    let Signature { constness, asyncness, unsafety, abi, generics, output, .. } = signature;
    let mut inputs = signature.inputs.clone();
    for input in &mut inputs {
        match input {
            FnArg::Receiver(receiver) if receiver.reference.is_none() => receiver.mutability = None,
            FnArg::Receiver(_) => {}
            FnArg::Typed(argument) => {
                if let Pat::Ident(name) = &mut *argument.pat {
                    name.mutability = None;
                }
            }
        }
    }
    let bounds = &generics.where_clause;
    text(quote!(#constness #asyncness #unsafety #abi fn #generics (#inputs) #output #bounds))
}

/// Returns tokens of types, bounds and signatures as rustfmt would write them on one line of any length,
/// without trailing commas.
pub(crate) fn text(tokens: impl quote::ToTokens) -> String {
    let mut words = Vec::new();
    flatten(tokens.to_token_stream(), &mut words);
    let mut line = String::new();
    for word in &words {
        let word = word.as_str();
        // Removes a comma before the end of arguments, but keeps that of a tuple with one field.
        if word == ">" && line.ends_with(',') {
            line.pop();
        }
        let after_name = ends_name(&line);
        let is_tight = line.is_empty()
            || line.ends_with(['(', '[', '<', '&', '*', '?', '#', '!'])
            || line.ends_with("::")
            || matches!(word, "," | ";" | ":" | "::" | ")" | "]" | ">")
            || (matches!(word, "(" | "<") && after_name);
        if !is_tight {
            line.push(' ');
        }
        line.push_str(word);
    }
    line.trim_end_matches(',').to_owned()
}

/// Tests whether a text ends with a name or its generic arguments, so that a parenthesis opens its arguments.
fn ends_name(text: &str) -> bool {
    text.ends_with(|last: char| last.is_alphanumeric() || matches!(last, '_' | '>')) && !text.ends_with("->")
}

/// Appends the words of a token stream: names, literals, delimiters and operators of one or more characters.
fn flatten(tokens: TokenStream, words: &mut Vec<String>) {
    let mut is_joined = false;
    for token in tokens {
        match token {
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::None => ("", ""),
                };
                let is_tuple = !words.last().is_some_and(|last| ends_name(last));
                words.push(open.to_owned());
                flatten(group.stream(), words);
                if !is_tuple && words.last().is_some_and(|last| last == ",") {
                    words.pop();
                }
                words.push(close.to_owned());
                is_joined = false;
            }
            TokenTree::Punct(punct) => {
                match words.last_mut().filter(|_| is_joined) {
                    Some(last) => last.push(punct.as_char()),
                    None => words.push(punct.as_char().to_string()),
                }
                is_joined = punct.spacing() == Spacing::Joint;
            }
            // A lifetime is a quote followed by its name.
            TokenTree::Ident(name) => match words.last_mut().filter(|_| is_joined) {
                Some(last) => {
                    last.push_str(&name.to_string());
                    is_joined = false;
                }
                None => words.push(name.to_string()),
            },
            TokenTree::Literal(literal) => words.push(literal.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn signatures_do_not_depend_on_the_wrapping_of_the_source() {
        let source = "pub const fn f<'a, const N: usize>(&'a mut self, mut x: &[f32; N], each: impl FnMut(\n\
            (u8,),\n &mut dyn X<T = u8>,\n),\n) -> (Option<&'a T>, [u8; 2]) where\n Self: Sized + ?Copy,\n {}";
        let item: syn::ImplItemFn = syn::parse_str(source).unwrap();
        assert_eq!(
            super::of_function(&item.sig),
            "const fn<'a, const N: usize>(&'a mut self, x: &[f32; N], each: impl FnMut((u8,), \
             &mut dyn X<T = u8>)) -> (Option<&'a T>, [u8; 2]) where Self: Sized + ?Copy",
            "the signature on one line"
        );
    }
}
