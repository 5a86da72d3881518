//! Finder of the expressions that a mutation changes: comparisons, roundings and margins.

use crate::crates::rust_files;
use std::ops::Range;
use std::path::Path;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Attribute, BinOp, Expr, ExprBinary, ExprCall, ExprMethodCall, ExprPath, ImplItemFn, Item, ItemFn};

/// Expression of a source file, and what stands in its place in each of its mutations.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Site {
    /// Name of the function that the expression is in.
    pub(crate) function: String,
    /// Bytes of the expression in the text of the file.
    pub(crate) range: Range<usize>,
    /// Text before the expression where it is switched: name and colon of a field that is written as its name
    /// alone, else empty.
    pub(crate) prefix: String,
    /// Mutated expressions, as Rust text.
    pub(crate) mutants: Vec<String>,
}

/// Words in names of margins: bounds on errors of rounding, and what is added to be safe.
const MARGINS: [&str; 10] =
    ["margin", "error", "slack", "epsilon", "delta", "tolerance", "rounding", "clearance", "safety", "wrong"];

/// Name of the unit round-off in bounds on errors of rounding.
const UNIT: &str = "U";

/// Methods that round, compare or bound, each beside the method that stands in its place in a mutation.
const METHODS: [[&str; 2]; 6] = [
    ["next_up", "next_down"],
    ["floor", "ceil"],
    ["cmplt", "cmple"],
    ["cmpgt", "cmpge"],
    ["is_lt", "is_le"],
    ["min", "max"],
];

/// Returns the names of the source files of a crate, relative to the root and sorted.
pub(crate) fn source_files(root: &Path, package: &str) -> Result<Vec<String>, String> {
    let files = rust_files(vec![root.join(package).join("src")])?;
    let names = files.iter().filter_map(|file| file.strip_prefix(root).ok());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().replace('\\', "/")).collect();
    names.sort();
    Ok(names)
}

/// Returns where the modules without a body of a source file are that are compiled for tests alone: paths
/// relative to the root, without `.rs`.
pub(crate) fn test_modules(file: &str, text: &str) -> Vec<String> {
    let items = syn::parse_file(text).map(|file| file.items).unwrap_or_default();
    let folder = match file.rsplit_once('/') {
        Some((folder, "mod.rs" | "lib.rs" | "main.rs")) => folder,
        _ => file.trim_end_matches(".rs"),
    };
    let names = items.iter().filter_map(|item| match item {
        Item::Mod(module) if module.content.is_none() && is_test(&module.attrs) => Some(&module.ident),
        _ => None,
    });
    names.map(|name| format!("{folder}/{name}")).collect()
}

/// Returns the sites of Rust source text in order, or an error if the text is not Rust. Tests, constants and
/// code in macros have none: only what runs can be switched from one mutation to the next.
pub(crate) fn sites(text: &str) -> Result<Vec<Site>, String> {
    let file = syn::parse_file(text).map_err(|error| format!("{error}"))?;
    let mut finder = Finder { text, function: String::new(), sites: Vec::new() };
    finder.visit_file(&file);
    finder.sites.sort_by_key(|site| (site.range.start, site.range.end));
    Ok(finder.sites)
}

struct Finder<'a> {
    text: &'a str,
    function: String,
    sites: Vec<Site>,
}

impl Finder<'_> {
    /// Adds a site with at least one mutation.
    fn add(&mut self, range: Range<usize>, mutants: Vec<String>) {
        let (function, prefix) = (self.function.clone(), String::new());
        self.sites.push(Site { function, range, prefix, mutants });
    }

    /// Adds a margin as a site: it becomes nothing, and half of itself. A term of a bound, which the unit
    /// round-off tells, becomes nothing.
    fn add_margin(&mut self, expression: &Expr, name: &str) {
        let factors: &[&str] = match name.to_lowercase() {
            lower if MARGINS.iter().any(|word| lower.contains(word)) => &["0.0", "0.5"],
            _ if name == UNIT => &["0.0"],
            _ => return,
        };
        let range = expression.span().byte_range();
        let mutants = factors.iter().map(|by| format!("{by} * {}", &self.text[range.clone()]));
        let mutants = mutants.collect();
        self.add(range, mutants);
    }

    /// Adds a chain of `&&` or of `||` as sites, each without one of its operands: here without the right
    /// one, and without the left one if that is no chain of the same kind. A chain with `let` has none.
    fn add_chain(&mut self, binary: &ExprBinary) {
        let is_same = |side: &Expr| {
            matches!((side, binary.op), (Expr::Binary(ExprBinary { op: BinOp::And(_), .. }), BinOp::And(_)))
                || matches!(
                    (side, binary.op),
                    (Expr::Binary(ExprBinary { op: BinOp::Or(_), .. }), BinOp::Or(_))
                )
        };
        let [left, right] = [&*binary.left, &*binary.right];
        if has_let(left) || has_let(right) {
            return;
        }
        let sides = if is_same(left) { &[left][..] } else { &[left, right] };
        let mutants = sides.iter().map(|side| self.text[side.span().byte_range()].to_owned()).collect();
        self.add(binary.span().byte_range(), mutants);
    }
}

/// Returns whether a condition is a `let` or a chain of `&&` with one.
fn has_let(condition: &Expr) -> bool {
    match condition {
        Expr::Let(_) => true,
        Expr::Binary(binary) => has_let(&binary.left) || has_let(&binary.right),
        _ => false,
    }
}

/// Returns whether code with these attributes is compiled for tests alone.
fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        syn::Meta::List(list) if list.path.is_ident("cfg") => list.tokens.to_string().starts_with("test"),
        meta => meta.path().is_ident("test"),
    })
}

impl<'ast> Visit<'ast> for Finder<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        match item {
            Item::Fn(_) | Item::Impl(_) | Item::Trait(_) => visit::visit_item(self, item),
            Item::Mod(module) if !is_test(&module.attrs) => visit::visit_item(self, item),
            _ => {}
        }
    }

    fn visit_item_fn(&mut self, item: &'ast ItemFn) {
        if item.sig.constness.is_none() && !is_test(&item.attrs) {
            let outer = std::mem::replace(&mut self.function, item.sig.ident.to_string());
            self.visit_block(&item.block);
            self.function = outer;
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast ImplItemFn) {
        if item.sig.constness.is_none() {
            let outer = std::mem::replace(&mut self.function, item.sig.ident.to_string());
            self.visit_block(&item.block);
            self.function = outer;
        }
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        if let Some(block) = &item.default {
            let outer = std::mem::replace(&mut self.function, item.sig.ident.to_string());
            self.visit_block(block);
            self.function = outer;
        }
    }

    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}

    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}

    fn visit_expr_repeat(&mut self, repeat: &'ast syn::ExprRepeat) {
        self.visit_expr(&repeat.expr);
    }

    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}

    fn visit_type(&mut self, _: &'ast syn::Type) {}

    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}

    /// Ranges and constants in patterns are no expressions that could be switched.
    fn visit_pat(&mut self, _: &'ast syn::Pat) {}

    /// What is assigned to stays as it is: only the value has sites.
    fn visit_expr_assign(&mut self, assign: &'ast syn::ExprAssign) {
        self.visit_expr(&assign.right);
    }

    /// What is borrowed for writing stays as it is.
    fn visit_expr_reference(&mut self, reference: &'ast syn::ExprReference) {
        if reference.mutability.is_none() {
            visit::visit_expr_reference(self, reference);
        }
    }

    fn visit_expr_binary(&mut self, binary: &'ast ExprBinary) {
        let other = match binary.op {
            BinOp::Lt(_) => Some("<="),
            BinOp::Le(_) => Some("<"),
            BinOp::Gt(_) => Some(">="),
            BinOp::Ge(_) => Some(">"),
            _ => None,
        };
        if let Some(other) = other {
            let text = |range: Range<usize>| &self.text[range];
            let [left, right] = [&binary.left, &binary.right].map(|side| text(side.span().byte_range()));
            let mutants = vec![format!("{left} {other} {right}")];
            self.add(binary.span().byte_range(), mutants);
        }
        if matches!(binary.op, BinOp::And(_) | BinOp::Or(_)) {
            self.add_chain(binary);
        }
        let is_assignment = binary.op.span().byte_range().len() > 1
            && self.text[binary.op.span().byte_range()].ends_with('=')
            && other.is_none()
            && !matches!(binary.op, BinOp::Eq(_) | BinOp::Ne(_));
        if is_assignment {
            self.visit_expr(&binary.right);
        } else {
            visit::visit_expr_binary(self, binary);
        }
    }

    fn visit_expr_method_call(&mut self, call: &'ast ExprMethodCall) {
        let name = call.method.to_string();
        let other = METHODS.iter().find_map(|[a, b]| match &name {
            name if name == a => Some(*b),
            name if name == b => Some(*a),
            _ => None,
        });
        let (range, method) = (call.span().byte_range(), call.method.span().byte_range());
        if let Some(other) = other {
            let [before, after] = [range.start..method.start, method.end..range.end];
            let mutants = vec![format!("{}{other}{}", &self.text[before], &self.text[after])];
            self.add(range, mutants);
        }
        self.add_margin(&Expr::MethodCall(call.clone()), &name);
        visit::visit_expr_method_call(self, call);
    }

    fn visit_expr_call(&mut self, call: &'ast ExprCall) {
        if let Expr::Path(path) = &*call.func
            && let Some(last) = path.path.segments.last()
        {
            self.add_margin(&Expr::Call(call.clone()), &last.ident.to_string());
        }
        call.args.iter().for_each(|argument| self.visit_expr(argument));
    }

    fn visit_field_value(&mut self, field: &'ast syn::FieldValue) {
        let begin = self.sites.len();
        self.visit_expr(&field.expr);
        if field.colon_token.is_none() {
            self.sites[begin..].iter_mut().for_each(|site| {
                site.prefix = format!("{}: ", &self.text[site.range.clone()]);
            });
        }
    }

    fn visit_expr_path(&mut self, path: &'ast ExprPath) {
        if let Some(last) = path.path.segments.last() {
            self.add_margin(&Expr::Path(path.clone()), &last.ident.to_string());
        }
    }

    fn visit_expr_field(&mut self, field: &'ast syn::ExprField) {
        match &field.member {
            syn::Member::Named(name) => self.add_margin(&Expr::Field(field.clone()), &name.to_string()),
            syn::Member::Unnamed(_) => {}
        }
        // The object that has the field must stay a place.
        if !matches!(*field.base, Expr::Path(_)) {
            self.visit_expr(&field.base);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{sites, test_modules};

    #[test]
    fn modules_of_tests_are_found() {
        let text = "mod a; #[cfg(test)] mod b; #[cfg(test)] mod c { fn f() {} }";
        assert_eq!(test_modules("x/src/y/mod.rs", text), ["x/src/y/b"], "modules of a folder");
        assert_eq!(test_modules("x/src/y.rs", text), ["x/src/y/b"], "modules of a file");
    }

    #[test]
    fn sites_are_what_decides() {
        let text = "const A: bool = 1 < 2; #[cfg(test)] mod tests { fn t() -> bool { 1 < 2 } }
            fn f(a: f32, slack: f32) -> bool { let b = [0; A < B]; g(|x| x.floor() * SLACK) >= a + slack }";
        let found: Vec<_> = sites(text)
            .into_iter()
            .flatten()
            .flat_map(|site| {
                let old = text[site.range.clone()].to_owned();
                site.mutants.into_iter().map(move |new| (old.clone(), new))
            })
            .collect();
        let whole = "g(|x| x.floor() * SLACK) >= a + slack";
        let expected = [
            (whole, "g(|x| x.floor() * SLACK) > a + slack"),
            ("x.floor()", "x.ceil()"),
            ("SLACK", "0.0 * SLACK"),
            ("SLACK", "0.5 * SLACK"),
            ("slack", "0.0 * slack"),
            ("slack", "0.5 * slack"),
        ];
        assert_eq!(found, expected.map(|(a, b)| (a.to_owned(), b.to_owned())), "sites of one function");
        for (text, count) in [("slack == a", 1), ("slack != a", 1), ("slack += a", 0), ("a += slack", 1)] {
            let found = sites(&format!("fn f() {{ {text}; }}")).map(|found| found.len());
            assert_eq!(found, Ok(count), "sites of {text}");
        }
        let text = "fn f() -> bool { a && b && c || let d = e && f || 2.0 * U > g.min(h) }";
        let found: Vec<_> = sites(text).into_iter().flatten().flat_map(|site| site.mutants).collect();
        let expected = ["a", "b", "a && b", "2.0 * U >= g.min(h)", "0.0 * U", "g.max(h)"];
        assert_eq!(found, expected, "operands of chains, a unit round-off and a bound");
        let text = "fn f(slack: f32) -> S { S { a: slack, slack } }";
        let prefixes = sites(text).unwrap_or_default().into_iter().map(|site| site.prefix);
        assert_eq!(prefixes.collect::<Vec<_>>(), ["", "slack: "], "a field and one written as its name");
        assert!(sites("fn f( {").is_err(), "text that is not Rust is refused");
    }
}
