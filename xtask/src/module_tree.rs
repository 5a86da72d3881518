//! Module tree of a crate, as its source files declare it: what each module defines, what it imports, and the
//! module to which a path leads.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, UseTree, Visibility};

/// Module in a source file of its own. Modules are referred to by their index in the tree.
pub(crate) struct Module {
    /// Path of the source file.
    pub(crate) file: PathBuf,
    /// Items of the file, without test items and without declarations of modules in other files.
    pub(crate) items: Vec<Item>,
    /// Names and indices of the child modules that are declared `pub`.
    pub(crate) public_children: Vec<(String, usize)>,
    parent: Option<usize>,
    children: HashMap<String, usize>,
    definitions: Vec<String>,
    /// Names that `use` declarations introduce, each with the path of its item.
    imports: HashMap<String, Vec<String>>,
    /// Paths of the `use ...::*` declarations, without the `*`.
    globs: Vec<Vec<String>>,
    /// Paths that the module's own code mentions, as lists of names, without the code of tests and without
    /// re-exports.
    mentions: Vec<Vec<String>>,
}

/// Tree of the modules of a crate that are files of their own.
pub(crate) struct ModuleTree {
    /// All modules; the root is at index 0.
    pub(crate) modules: Vec<Module>,
}

impl ModuleTree {
    /// Reads a crate from its root file.
    ///
    /// # Errors
    ///
    /// Returns the first file that cannot be read or parsed, and why.
    pub(crate) fn read(root: &Path) -> Result<Self, String> {
        let mut tree = Self { modules: Vec::new() };
        let folder = root.parent().unwrap_or(Path::new("."));
        tree.add(root.to_owned(), folder, None)?;
        Ok(tree)
    }

    /// Reads a source file whose child modules are in `folder`, and recursively its children. Returns the
    /// module's index, or an error for the first file that cannot be read or parsed.
    fn add(&mut self, file: PathBuf, folder: &Path, parent: Option<usize>) -> Result<usize, String> {
        let text = std::fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))?;
        let parsed = syn::parse_file(&text).map_err(|error| format!("{}: {error}", file.display()))?;
        let index = self.modules.len();
        self.modules.push(Module {
            file,
            items: Vec::new(),
            public_children: Vec::new(),
            parent,
            children: HashMap::new(),
            definitions: Vec::new(),
            imports: HashMap::new(),
            globs: Vec::new(),
            mentions: Vec::new(),
        });
        for item in parsed.items {
            if is_test(&item) {
                continue;
            }
            if let Item::Mod(declared) = &item
                && declared.content.is_none()
            {
                let name = declared.ident.to_string();
                let candidates = [folder.join(format!("{name}.rs")), folder.join(&name).join("mod.rs")];
                let Some(path) = candidates.into_iter().find(|path| path.is_file()) else { continue };
                let child = self.add(path, &folder.join(&name), Some(index))?;
                if matches!(declared.vis, Visibility::Public(_)) {
                    self.modules[index].public_children.push((name.clone(), child));
                }
                self.modules[index].children.insert(name, child);
                continue;
            }
            self.modules[index].take_in(&item);
            self.modules[index].items.push(item);
        }
        Ok(index)
    }

    /// Returns the index of the module that defines the item to which a path in a module leads, and the rest
    /// of the path from that module: empty if the path leads to a module. `None` if the item is not in this
    /// crate, or if more than 32 imports must be followed.
    pub(crate) fn find(&self, module: usize, path: &[String]) -> Option<(usize, Vec<String>)> {
        self.resolve(module, path, 0)
    }

    /// Like [`find`](Self::find); `depth` counts the imports followed so far.
    fn resolve(&self, module: usize, path: &[String], depth: u32) -> Option<(usize, Vec<String>)> {
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

    /// Like [`resolve`](Self::resolve), for a path whose first name is looked up within `module`. An empty
    /// path leads to the module itself. `None` if the first name is not found there.
    fn descend(&self, module: usize, path: &[String], depth: u32) -> Option<(usize, Vec<String>)> {
        let Some((first, rest)) = path.split_first() else { return Some((module, Vec::new())) };
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
            return Some((module, path.to_vec()));
        }
        here.globs.iter().find_map(|glob| {
            let (target, _) = self.resolve(module, glob, depth + 1).filter(|(_, rest)| rest.is_empty())?;
            self.modules[target].names(first).then(|| self.descend(target, path, depth + 1))?
        })
    }

    /// Returns the indices, ascending, of the modules that a module's own code needs, without the module
    /// itself.
    pub(crate) fn needs(&self, module: usize) -> Vec<usize> {
        let mentions = &self.modules[module].mentions;
        let mut found: Vec<usize> = mentions
            .iter()
            .filter_map(|path| Some(self.find(module, path)?.0))
            .filter(|&m| m != module)
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }
}

impl Module {
    /// Tests whether the module has a child module, import or definition of this name.
    fn names(&self, name: &str) -> bool {
        self.children.contains_key(name)
            || self.imports.contains_key(name)
            || self.definitions.iter().any(|defined| defined == name)
    }

    /// Records the name that an item defines, and the paths that it imports or mentions.
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
        let Item::Use(item) = item else { return Mentions(&mut self.mentions).visit_item(item) };
        for import in imports(&item.tree) {
            match import.alias {
                None => self.globs.push(import.path),
                Some(alias) => {
                    // The path of a private `use` counts as a mention; a re-export needs no module by itself.
                    if matches!(item.vis, Visibility::Inherited) {
                        self.mentions.push(import.path.clone());
                    }
                    if alias != "_" {
                        self.imports.insert(alias, import.path);
                    }
                }
            }
        }
    }
}

/// Name that a `use` declaration introduces.
pub(crate) struct Import {
    /// The name; `None` for `use ...::*`.
    pub(crate) alias: Option<String>,
    /// Path of the item, or of the module before the `*`.
    pub(crate) path: Vec<String>,
}

/// Returns the names that a `use` declaration introduces, in the order of the source.
pub(crate) fn imports(tree: &UseTree) -> Vec<Import> {
    let import = |alias: &syn::Ident, name: &syn::Ident| Import {
        alias: Some(alias.to_string()),
        path: vec![name.to_string()],
    };
    match tree {
        UseTree::Path(part) => {
            let mut found = imports(&part.tree);
            for import in &mut found {
                // `use a::b::{self}` introduces `b`; `use a::b::{self as c}` introduces `c`.
                if import.path == ["self"] {
                    import.path.clear();
                    import.alias.take_if(|alias| alias == "self");
                    import.alias.get_or_insert(part.ident.to_string());
                }
                import.path.insert(0, part.ident.to_string());
            }
            found
        }
        UseTree::Name(name) => vec![import(&name.ident, &name.ident)],
        UseTree::Rename(rename) => vec![import(&rename.rename, &rename.ident)],
        UseTree::Glob(_) => vec![Import { alias: None, path: Vec::new() }],
        UseTree::Group(group) => group.items.iter().flat_map(imports).collect(),
    }
}

/// Visitor that collects the paths that code mentions.
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

/// Tests whether an item is compiled only for tests.
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
