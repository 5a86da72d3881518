//! Lines of the listing of public items that describe one item: its own, and those of its fields, variants,
//! derived traits and trait items.

use crate::signature::{of_function, text};
use std::collections::BTreeSet;
use syn::{Attribute, Fields, Item, TraitItem, Visibility};

/// Adds the line of an item whose public path is `path`, and those of its fields, variants, derived traits
/// and trait items.
pub(crate) fn add_item(lines: &mut BTreeSet<String>, path: &str, item: &Item) {
    let (attributes, line) = match item {
        Item::Const(item) => (&item.attrs, format!("const {}", text(&item.ty))),
        Item::Static(item) => (&item.attrs, format!("static {}", text(&item.ty))),
        Item::Fn(item) => (&item.attrs, of_function(&item.sig)),
        Item::Type(item) => (&item.attrs, format!("type{} = {}", text(&item.generics), text(&item.ty))),
        Item::Enum(item) => {
            for variant in &item.variants {
                let own = format!("{path}::{}", variant.ident);
                let value = variant.discriminant.as_ref().map(|(_, value)| format!(" = {}", text(value)));
                lines.insert(format!("{own} variant{}", value.unwrap_or_default()));
                add_fields(lines, &own, &variant.fields, |_| true);
            }
            (&item.attrs, format!("enum{} {}", text(&item.generics), text(&item.generics.where_clause)))
        }
        Item::Struct(item) => {
            let is_open = add_fields(lines, path, &item.fields, is_public);
            let (generics, bounds) = (text(&item.generics), text(&item.generics.where_clause));
            let private = if is_open { "" } else { " with private fields" };
            (&item.attrs, format!("struct{generics}{private} {bounds}"))
        }
        Item::Trait(item) => {
            item.items.iter().for_each(|item| add_trait_item(lines, path, item));
            let (generics, supertraits) = (text(&item.generics), text(&item.supertraits));
            (&item.attrs, format!("{} trait{generics}: {supertraits}", text(item.unsafety)))
        }
        _ => return,
    };
    let non_exhaustive = attributes.iter().any(|attribute| attribute.path().is_ident("non_exhaustive"));
    let line = line.trim().trim_end_matches(':');
    lines.insert(format!("{path} {}{line}", if non_exhaustive { "non_exhaustive " } else { "" }));
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("derive")) {
        let _ = attribute.parse_nested_meta(|derived| {
            lines.extend(derived.path.segments.last().map(|name| format!("{path} impl {}", name.ident)));
            Ok(())
        });
    }
}

/// Adds the lines of the public fields, as decided by `is_public`. Returns whether all fields are public.
fn add_fields(
    lines: &mut BTreeSet<String>,
    path: &str,
    fields: &Fields,
    is_public: impl Fn(&Visibility) -> bool,
) -> bool {
    let (public, private): (Vec<_>, Vec<_>) =
        fields.iter().enumerate().partition(|(_, field)| is_public(&field.vis));
    for (index, field) in public {
        let name = field.ident.as_ref().map_or(index.to_string(), ToString::to_string);
        lines.insert(format!("{path}::{name} field {}", text(&field.ty)));
    }
    private.is_empty()
}

/// Adds the line of an item of the trait whose path is `path`. An item with a default is called provided.
fn add_trait_item(lines: &mut BTreeSet<String>, path: &str, item: &TraitItem) {
    let (attributes, name, line, is_provided) = match item {
        TraitItem::Fn(item) => (&item.attrs, &item.sig.ident, of_function(&item.sig), item.default.is_some()),
        TraitItem::Const(item) => {
            (&item.attrs, &item.ident, format!("const {}", text(&item.ty)), item.default.is_some())
        }
        TraitItem::Type(item) => {
            let bounds = format!("type{}: {}", text(&item.generics), text(&item.bounds));
            (&item.attrs, &item.ident, bounds.trim_end_matches([':', ' ']).to_owned(), item.default.is_some())
        }
        _ => return,
    };
    if !is_hidden(attributes) {
        lines.insert(format!("{path}::{name} {}{line}", if is_provided { "provided " } else { "" }));
    }
}

/// Returns the visibility, attributes and name of an item. `None` for kinds that the listing does not have.
pub(crate) fn parts(item: &Item) -> Option<(&Visibility, &[Attribute], &syn::Ident)> {
    Some(match item {
        Item::Const(item) => (&item.vis, &item.attrs, &item.ident),
        Item::Enum(item) => (&item.vis, &item.attrs, &item.ident),
        Item::Fn(item) => (&item.vis, &item.attrs, &item.sig.ident),
        Item::Static(item) => (&item.vis, &item.attrs, &item.ident),
        Item::Struct(item) => (&item.vis, &item.attrs, &item.ident),
        Item::Trait(item) => (&item.vis, &item.attrs, &item.ident),
        Item::Type(item) => (&item.vis, &item.attrs, &item.ident),
        _ => return None,
    })
}

/// Tests for `pub` without a restriction.
pub(crate) fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

/// Tests for `#[doc(hidden)]`.
pub(crate) fn is_hidden(attributes: &[Attribute]) -> bool {
    let hidden =
        |attribute: &Attribute| attribute.parse_args::<syn::Ident>().is_ok_and(|name| name == "hidden");
    attributes.iter().any(|attribute| attribute.path().is_ident("doc") && hidden(attribute))
}
