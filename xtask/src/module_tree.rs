//! The modules of a crate as its source files declare them: what each defines, what it imports, and where a
//! path leads.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, UseTree, Visibility};

/// One source file.
pub(crate) struct Module {
    /// The path of the file.
    pub(crate) file: PathBuf,
    parent: Option<usize>,
    children: HashMap<String, usize>,
    definitions: Vec<String>,
    /// Names that `use` brings in, each with its path.
    imports: HashMap<String, Vec<String>>,
    /// Paths of `use ...::*`.
    globs: Vec<Vec<String>>,
    /// Paths that the module's own code mentions, tests and re-exports left out.
    mentions: Vec<Vec<String>>,
}

/// The modules of a crate, the root first.
pub(crate) struct ModuleTree {
    /// The modules.
    pub(crate) modules: Vec<Module>,
}

impl ModuleTree {
    /// Reads a crate from its root file.
    ///
    /// # Errors
    /// The first file that cannot be read or parsed, and why.
    pub(crate) fn read(root: &Path) -> Result<Self, String> {
        let mut tree = Self { modules: Vec::new() };
        let folder = root.parent().unwrap_or(Path::new("."));
        tree.add(root.to_owned(), folder, None)?;
        Ok(tree)
    }

    /// Reads a file whose child modules are in `folder`. Returns its index.
    fn add(&mut self, file: PathBuf, folder: &Path, parent: Option<usize>) -> Result<usize, String> {
        let text = std::fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))?;
        let parsed = syn::parse_file(&text).map_err(|error| format!("{}: {error}", file.display()))?;
        let index = self.modules.len();
        self.modules.push(Module {
            file,
            parent,
            children: HashMap::new(),
            definitions: Vec::new(),
            imports: HashMap::new(),
            globs: Vec::new(),
            mentions: Vec::new(),
        });
        for item in &parsed.items {
            if is_test(item) {
                continue;
            }
            if let Item::Mod(declared) = item
                && declared.content.is_none()
            {
                let name = declared.ident.to_string();
                let candidates = [folder.join(format!("{name}.rs")), folder.join(&name).join("mod.rs")];
                let Some(path) = candidates.into_iter().find(|path| path.is_file()) else { continue };
                let child = self.add(path, &folder.join(&name), Some(index))?;
                self.modules[index].children.insert(name, child);
                continue;
            }
            self.modules[index].take_in(item);
        }
        Ok(index)
    }

    /// The module that defines what a path in a module leads to; `None` if that is not in this crate.
    fn resolve(&self, module: usize, path: &[String], depth: u32) -> Option<usize> {
        let (first, rest) = path.split_first()?;
        let here = &self.modules[module];
        if depth > 32 {
            return None;
        }
        match first.as_str() {
            "crate" => self.descend(0, rest, depth),
            "self" => self.descend(module, rest, depth),
            "super" => self.descend(here.parent?, rest, depth),
            name if here.names(name) => self.descend(module, path, depth),
            _ => None,
        }
    }

    /// The same for what is named within a module.
    fn descend(&self, module: usize, path: &[String], depth: u32) -> Option<usize> {
        let Some((first, rest)) = path.split_first() else { return Some(module) };
        let here = &self.modules[module];
        if first == "super" || first == "self" {
            return self.resolve(module, path, depth + 1);
        }
        if let Some(&child) = here.children.get(first) {
            return self.descend(child, rest, depth);
        }
        if let Some(import) = here.imports.get(first) {
            let whole: Vec<String> = import.iter().chain(rest).cloned().collect();
            return self.resolve(module, &whole, depth + 1);
        }
        if here.definitions.contains(first) {
            return Some(module);
        }
        here.globs.iter().find_map(|glob| {
            let target = self.resolve(module, glob, depth + 1)?;
            self.modules[target].names(first).then(|| self.descend(target, path, depth + 1))?
        })
    }

    /// The modules that a module's own code needs, itself left out.
    pub(crate) fn needs(&self, module: usize) -> Vec<usize> {
        let mentions = &self.modules[module].mentions;
        let mut found: Vec<usize> = mentions
            .iter()
            .filter_map(|path| self.resolve(module, path, 0))
            .filter(|&m| m != module)
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }
}

impl Module {
    fn names(&self, name: &str) -> bool {
        self.children.contains_key(name)
            || self.imports.contains_key(name)
            || self.definitions.iter().any(|defined| defined == name)
    }

    fn take_in(&mut self, item: &Item) {
        let name = match item {
            Item::Const(item) => Some(&item.ident),
            Item::Enum(item) => Some(&item.ident),
            Item::Fn(item) => Some(&item.sig.ident),
            Item::Macro(item) => item.ident.as_ref(),
            Item::Static(item) => Some(&item.ident),
            Item::Struct(item) => Some(&item.ident),
            Item::Trait(item) => Some(&item.ident),
            Item::Type(item) => Some(&item.ident),
            Item::Union(item) => Some(&item.ident),
            _ => None,
        };
        self.definitions.extend(name.map(ToString::to_string));
        if let Item::Use(item) = item {
            let is_private = matches!(item.vis, Visibility::Inherited);
            self.import(&item.tree, &mut Vec::new(), is_private);
        } else {
            Mentions(&mut self.mentions).visit_item(item);
        }
    }

    /// Takes in what a `use` names. A private one counts as a mention; a re-export needs nothing by itself.
    fn import(&mut self, tree: &UseTree, path: &mut Vec<String>, is_private: bool) {
        let mut bring_in = |alias: String, mut path: Vec<String>, name: String| {
            if name != "self" {
                path.push(name);
            }
            if is_private {
                self.mentions.push(path.clone());
            }
            if alias != "_" {
                self.imports.insert(alias, path);
            }
        };
        match tree {
            UseTree::Path(part) => {
                path.push(part.ident.to_string());
                self.import(&part.tree, path, is_private);
                path.pop();
            }
            UseTree::Name(name) => {
                let name = name.ident.to_string();
                let alias = if name == "self" { path.last().cloned() } else { Some(name.clone()) };
                bring_in(alias.unwrap_or_default(), path.clone(), name);
            }
            UseTree::Rename(rename) => {
                bring_in(rename.rename.to_string(), path.clone(), rename.ident.to_string());
            }
            UseTree::Glob(_) => self.globs.push(path.clone()),
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.import(tree, path, is_private);
                }
            }
        }
    }
}

/// Collects the paths that code mentions.
struct Mentions<'a>(&'a mut Vec<Vec<String>>);

impl<'ast> Visit<'ast> for Mentions<'_> {
    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.0.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }

    fn visit_item(&mut self, item: &'ast Item) {
        if !is_test(item) {
            visit::visit_item(self, item);
        }
    }

    fn visit_visibility(&mut self, _: &'ast Visibility) {}

    fn visit_attribute(&mut self, _: &'ast Attribute) {}
}

/// Whether an item is compiled for tests alone.
fn is_test(item: &Item) -> bool {
    let attributes = match item {
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => return false,
    };
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute.parse_args::<syn::Ident>().is_ok_and(|condition| condition == "test")
    })
}
