//! Public items of a crate, one line each: the path, the kind and the signature.
//!
//! An item in a public module has the path of its definition. An item in private modules has the shortest
//! path by which it is re-exported. Further paths are lines of kind `use`. Types are written as in the
//! source. Items of all features are listed. Items hidden from the documentation, items made by macros and
//! automatic traits (`Send`, `Sync`) are not.

use crate::item_lines::{add_item, is_hidden, is_public, parts};
use crate::module_tree::{ModuleTree, imports};
use crate::signature::{of_function, text};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syn::{ImplItem, Item, Type};

/// Definition of an item: the index of its module and its name there.
type Definition = (usize, String);

/// Lines of a crate and the public paths of its items.
struct Listing {
    tree: ModuleTree,
    lines: BTreeSet<String>,
    /// Public paths of each definition. The first is the item's own; all are sorted by rank.
    paths: BTreeMap<Definition, BTreeSet<Rank>>,
}

/// Public path and its rank among the paths of an item: whether it is a re-export, its number of `::`, and
/// the path itself. So definitions come before re-exports, then short paths first.
type Rank = (bool, usize, String);

/// Returns the lines of a crate, sorted, without duplicates. `root` is the crate's root file, `name` its name
/// in paths.
///
/// # Errors
///
/// Returns the first file that cannot be read or parsed, and why.
pub(crate) fn public_items(root: &Path, name: &str) -> Result<BTreeSet<String>, String> {
    let mut listing =
        Listing { tree: ModuleTree::read(root)?, lines: BTreeSet::new(), paths: BTreeMap::new() };
    listing.find_paths(0, name, &mut Vec::new());
    for ((module, name), paths) in &listing.paths {
        let Some((_, _, own)) = paths.first() else { continue };
        let items = listing.tree.modules[*module].items.iter();
        items
            .filter(|item| parts(item).is_some_and(|(_, _, own)| own == name))
            .for_each(|item| add_item(&mut listing.lines, own, item));
        listing.lines.extend(paths.iter().skip(1).map(|(_, _, path)| format!("{path} use {own}")));
    }
    for module in 0..listing.tree.modules.len() {
        listing.add_impls(module);
    }
    Ok(listing.lines)
}

/// Target of a path in a module.
enum Place {
    /// Public item of this crate, with its own public path.
    Public(String),
    /// Item of this crate that is not public.
    Private,
    /// Item of another crate, generic parameter, or primitive type.
    Elsewhere,
}

impl Listing {
    /// Collects the public paths of the items of a public module. `path` is the module's own. `open` holds
    /// the modules between the root and this one, which are not entered again.
    fn find_paths(&mut self, module: usize, path: &str, open: &mut Vec<usize>) {
        if open.contains(&module) {
            return;
        }
        open.push(module);
        for (name, child) in self.tree.modules[module].public_children.clone() {
            self.lines.insert(format!("{path}::{name} mod"));
            self.find_paths(child, &format!("{path}::{name}"), open);
        }
        for item in self.tree.modules[module].items.clone() {
            let Item::Use(item) = item else {
                if let Some((visibility, attributes, name)) = parts(&item)
                    && is_public(visibility)
                    && !is_hidden(attributes)
                {
                    self.add_path((module, name.to_string()), true, format!("{path}::{name}"));
                }
                continue;
            };
            if !is_public(&item.vis) || is_hidden(&item.attrs) {
                continue;
            }
            for import in imports(&item.tree) {
                let alias = import.alias.as_deref().unwrap_or("*");
                let public = format!("{path}::{alias}");
                match self.tree.find(module, &import.path) {
                    Some((target, rest)) if rest.is_empty() => {
                        if alias != "*" {
                            self.lines.insert(format!("{public} mod"));
                        }
                        self.find_paths(target, if alias == "*" { path } else { &public }, open);
                    }
                    Some((target, mut rest)) => {
                        self.add_path((target, rest.swap_remove(0)), false, public);
                    }
                    None => {
                        self.lines.insert(format!("{public} use {}", import.path.join("::")));
                    }
                }
            }
        }
        open.pop();
    }

    /// Records a public path of a definition. `is_own` tells that the path leads through the defining module.
    fn add_path(&mut self, definition: Definition, is_own: bool, path: String) {
        let rank = (!is_own, path.matches("::").count(), path);
        self.paths.entry(definition).or_default().insert(rank);
    }

    /// Looks up the item to which a path in a module leads.
    fn place(&self, module: usize, path: &syn::Path) -> Place {
        let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        let Some((target, rest)) = self.tree.find(module, &names) else { return Place::Elsewhere };
        let paths = rest.into_iter().next().and_then(|name| self.paths.get(&(target, name)));
        paths.and_then(BTreeSet::first).map_or(Place::Private, |(_, _, path)| Place::Public(path.clone()))
    }

    /// Adds the public items of a module's `impl` blocks for public types, and its implementations of public
    /// traits for the types of other crates.
    fn add_impls(&mut self, module: usize) {
        for item in self.tree.modules[module].items.clone() {
            let Item::Impl(block) = item else { continue };
            let of_type = match &*block.self_ty {
                Type::Path(path) if path.qself.is_none() => self.place(module, &path.path),
                _ => Place::Elsewhere,
            };
            if let Some((_, path, _)) = &block.trait_ {
                match (of_type, self.place(module, path)) {
                    (Place::Public(own), Place::Public(_) | Place::Elsewhere) => {
                        let name = path.segments.last().map(text).unwrap_or_default();
                        self.lines.insert(format!("{own} impl {name}"));
                    }
                    (Place::Elsewhere, Place::Public(own)) => {
                        self.lines.insert(format!("{own} impl for {}", text(&block.self_ty)));
                    }
                    _ => {}
                }
            } else if let Place::Public(own) = of_type {
                for item in &block.items {
                    match item {
                        ImplItem::Fn(item) if is_public(&item.vis) && !is_hidden(&item.attrs) => {
                            self.lines.insert(format!(
                                "{own}::{} {}",
                                item.sig.ident,
                                of_function(&item.sig)
                            ));
                        }
                        ImplItem::Const(item) if is_public(&item.vis) && !is_hidden(&item.attrs) => {
                            self.lines.insert(format!("{own}::{} const {}", item.ident, text(&item.ty)));
                        }
                        _ => {}
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_have_the_path_by_which_users_reach_them() {
        let folder = std::env::temp_dir().join(format!("public-items-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        write("lib.rs", "mod a; pub mod b; pub use a::{T, E as F}; pub use b::{deep::self as d, C};");
        write(
            "a.rs",
            "#[derive(Clone)] pub struct T { pub x: u8, y: u8 } pub enum E { V(u8) } pub struct Unseen;\n\
             impl T { pub fn f(&self) {} fn g(&self) {} } impl super::b::C for T {}\n\
             impl super::b::C for [T; 2] {} impl From<Unseen> for Unseen {} trait P {} impl P for T {}",
        );
        write("b.rs", "mod deep; pub trait C { const K: u8 = 1; fn h(&self); } #[doc(hidden)] pub fn i() {}");
        std::fs::create_dir_all(folder.join("b")).unwrap();
        write("b/deep.rs", "pub const N: usize = 3;");
        let lines = public_items(&folder.join("lib.rs"), "c").unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        let expected = [
            "c::C use c::b::C",
            "c::F enum",
            "c::F::V variant",
            "c::F::V::0 field u8",
            "c::T impl C",
            "c::T impl Clone",
            "c::T struct with private fields",
            "c::T::f fn(&self)",
            "c::T::x field u8",
            "c::b mod",
            "c::b::C impl for [T; 2]",
            "c::b::C trait",
            "c::b::C::K provided const u8",
            "c::b::C::h fn(&self)",
            "c::d mod",
            "c::d::N const usize",
        ];
        assert_eq!(lines.iter().map(String::as_str).collect::<Vec<_>>(), expected, "public items by path");
    }
}
