//! Reads the modules of a crate from its source files, and lists the files whose items each file uses.
//!
//! A name is followed through `use` and `pub use` to the file that defines it. A re-export does not count as a use.
//! Items with `#[cfg(test)]` or `#[cfg(doc)]` are left out; any other `cfg` counts as true.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::ToTokens;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use syn::visit::Visit;
use syn::{Expr, ExprLit, Item, ItemMod, ItemUse, Lit, Meta, UseTree, Visibility};

/// For each file the files that it uses, with the names that it uses.
pub(crate) type Uses = BTreeMap<PathBuf, BTreeMap<PathBuf, BTreeSet<String>>>;

#[derive(Default)]
pub(crate) struct Crate {
    modules: Vec<Module>,
    /// Public types, each with the file that defines it.
    pub(crate) public_types: Vec<(String, PathBuf)>,
}

#[derive(Default)]
struct Module {
    file: PathBuf,
    parent: usize,
    children: HashMap<String, usize>,
    items: HashSet<String>,
    imports: Imports,
    /// Paths that the code uses.
    used: Vec<Vec<String>>,
}

/// Names that the `use` declarations of a module import.
#[derive(Default)]
struct Imports {
    /// The path of each imported name.
    names: HashMap<String, Vec<String>>,
    /// Paths of `use path::*`.
    globs: Vec<Vec<String>>,
    /// Paths that are imported for the module's own code.
    private: Vec<Vec<String>>,
}

/// The destination of a path.
#[derive(Clone, Copy)]
enum Target {
    Module(usize),
    /// An item that is defined in this module.
    ItemIn(usize),
}

impl Crate {
    /// Reads the crate whose root is this file.
    pub(crate) fn read(root: &Path) -> Self {
        let mut read = Self::default();
        read.read_file(root, root.parent().expect("a folder"), 0);
        read
    }

    /// Reads a file of the module tree; the files of its child modules lie in `folder`.
    fn read_file(&mut self, file: &Path, folder: &Path, parent: usize) -> usize {
        let text = std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let syntax = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        self.read_items(syntax.items, file, folder, parent)
    }

    fn read_items(&mut self, items: Vec<Item>, file: &Path, folder: &Path, parent: usize) -> usize {
        let index = self.modules.len();
        self.modules.push(Module { file: file.to_owned(), parent, ..Module::default() });
        for item in items {
            let tokens = item.to_token_stream();
            if left_out(&tokens) {
                continue;
            }
            if let Item::Mod(module) = item {
                let name = module.ident.to_string();
                let child = self.read_child(module, file, folder, index);
                self.modules[index].children.insert(name, child);
                continue;
            }
            let module = &mut self.modules[index];
            module.imports.visit_item(&item);
            if !matches!(item, Item::Use(_)) {
                find_paths(tokens, &mut module.used);
            }
            for Definition { name, public_type } in definitions(&item) {
                if public_type {
                    self.public_types.push((name.clone(), file.to_owned()));
                }
                module.items.insert(name);
            }
        }
        let private = std::mem::take(&mut self.modules[index].imports.private);
        self.modules[index].used.extend(private);
        index
    }

    fn read_child(&mut self, module: ItemMod, file: &Path, folder: &Path, parent: usize) -> usize {
        let below = folder.join(module.ident.to_string());
        let path = module.attrs.iter().find_map(|attribute| match &attribute.meta {
            Meta::NameValue(pair) if pair.path.is_ident("path") => match &pair.value {
                Expr::Lit(ExprLit { lit: Lit::Str(path), .. }) => Some(path.value()),
                _ => None,
            },
            _ => None,
        });
        let (beside, inside) = (below.with_extension("rs"), below.join("mod.rs"));
        match (module.content, path) {
            (Some((_, items)), _) => self.read_items(items, file, &below, parent),
            (None, Some(path)) => {
                let path = file.parent().expect("a folder").join(path);
                self.read_file(&path, path.parent().expect("a folder"), parent)
            }
            (None, None) => self.read_file(if beside.exists() { &beside } else { &inside }, &below, parent),
        }
    }

    /// The uses between the files of the crate.
    pub(crate) fn uses(&self) -> Uses {
        let mut uses = Uses::new();
        for (index, module) in self.modules.iter().enumerate() {
            for path in &module.used {
                let Some(Target::ItemIn(definer)) = self.resolve(index, path, false, 0) else { continue };
                let definer = &self.modules[definer].file;
                if *definer != module.file {
                    let names = uses.entry(module.file.clone()).or_default().entry(definer.clone()).or_default();
                    // For `Type::function` this is the name of the type.
                    let name = path.iter().find(|name| name.starts_with(char::is_uppercase)).or(path.last());
                    names.extend(name.cloned());
                }
            }
        }
        uses
    }

    /// Follows a path written in a module; `goes_on` is true for the beginning of a longer path. `None` for items of
    /// other crates.
    fn resolve(&self, index: usize, path: &[String], goes_on: bool, depth: usize) -> Option<Target> {
        let (first, rest) = path.split_first()?;
        let mut target = match first.as_str() {
            "crate" => Target::Module(0),
            "self" => Target::Module(index),
            "super" => Target::Module(self.modules[index].parent),
            name => self.find(index, name, goes_on || !rest.is_empty(), depth)?,
        };
        for (k, name) in rest.iter().enumerate() {
            let Target::Module(module) = target else { break };
            target = match name.as_str() {
                "self" => target,
                "super" => Target::Module(self.modules[module].parent),
                name => match self.find(module, name, goes_on || k + 1 < rest.len(), depth) {
                    Some(found) => found,
                    None if self.modules[module].imports.names.contains_key(name) => return None,
                    // The item is defined by a macro.
                    None => Target::ItemIn(module),
                },
            };
        }
        Some(target)
    }

    /// Looks up a name in a module. If a module and a function share it, the module is returned for a path that goes on.
    fn find(&self, index: usize, name: &str, goes_on: bool, depth: usize) -> Option<Target> {
        const DEEPEST: usize = 8;
        if depth > DEEPEST {
            return None;
        }
        let module = &self.modules[index];
        let child = module.children.get(name).map(|&child| Target::Module(child));
        let item = module.items.contains(name).then_some(Target::ItemIn(index));
        let imported = || self.resolve(index, module.imports.names.get(name)?, goes_on, depth + 1);
        let by_glob = || {
            let sources = module.imports.globs.iter().filter_map(|path| self.resolve(index, path, true, depth + 1));
            sources.into_iter().find_map(|source| match source {
                Target::Module(source) if source != index => self.find(source, name, goes_on, depth + 1),
                _ => None,
            })
        };
        let nearest = if goes_on { child.or(item) } else { item };
        nearest.or_else(imported).or(child).or_else(by_glob)
    }
}

impl Visit<'_> for Imports {
    fn visit_item_use(&mut self, declaration: &ItemUse) {
        let private = matches!(declaration.vis, Visibility::Inherited);
        self.add(&declaration.tree, &mut Vec::new(), private);
    }
}

impl Imports {
    fn add(&mut self, tree: &UseTree, path: &mut Vec<String>, private: bool) {
        let length = path.len();
        let mut bind = |path: &[String], last: String, name: String| {
            let path: Vec<String> = path.iter().cloned().chain((last != "self").then_some(last)).collect();
            let name = if name == "self" { path.last().cloned().unwrap_or_default() } else { name };
            if private {
                self.private.push(path.clone());
            }
            self.names.insert(name, path);
        };
        match tree {
            UseTree::Path(step) => {
                path.push(step.ident.to_string());
                self.add(&step.tree, path, private);
            }
            UseTree::Name(last) => bind(path, last.ident.to_string(), last.ident.to_string()),
            UseTree::Rename(last) => bind(path, last.ident.to_string(), last.rename.to_string()),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.add(tree, path, private)),
            UseTree::Glob(_) => self.globs.push(path.clone()),
        }
        path.truncate(length);
    }
}

struct Definition {
    name: String,
    public_type: bool,
}

fn definitions(item: &Item) -> Vec<Definition> {
    let (ident, types_visibility) = match item {
        Item::Struct(item) => (&item.ident, Some(&item.vis)),
        Item::Enum(item) => (&item.ident, Some(&item.vis)),
        Item::Union(item) => (&item.ident, Some(&item.vis)),
        Item::Trait(item) => (&item.ident, Some(&item.vis)),
        Item::Type(item) => (&item.ident, Some(&item.vis)),
        Item::Const(item) => (&item.ident, None),
        Item::Static(item) => (&item.ident, None),
        Item::Fn(item) => (&item.sig.ident, None),
        Item::Macro(item) => match &item.ident {
            Some(ident) => (ident, None),
            None => return types_in_macro(item.mac.tokens.clone()),
        },
        _ => return Vec::new(),
    };
    let public_type = matches!(types_visibility, Some(Visibility::Public(_)));
    vec![Definition { name: ident.to_string(), public_type }]
}

/// Definitions of public types in the tokens of a macro call.
fn types_in_macro(tokens: TokenStream) -> Vec<Definition> {
    let tokens: Vec<String> = tokens.into_iter().map(|token| token.to_string()).collect();
    let types = tokens.windows(3).filter(|three| three[0] == "pub" && ["struct", "enum"].contains(&three[1].as_str()));
    types.map(|three| Definition { name: three[2].clone(), public_type: true }).collect()
}

/// True if one of the first attributes of an item restricts it to tests or documentation.
fn left_out(tokens: &TokenStream) -> bool {
    let mut tokens = tokens.clone().into_iter();
    while let (Some(TokenTree::Punct(sign)), Some(TokenTree::Group(attribute))) = (tokens.next(), tokens.next())
        && sign.as_char() == '#'
    {
        if is_for_tests(&attribute.stream()) {
            return true;
        }
    }
    false
}

fn is_for_tests(attribute: &TokenStream) -> bool {
    let text = attribute.to_string();
    text.starts_with("cfg") && !text.contains("not") && (text.contains("(test") || text.contains("(doc)"))
}

/// Finds paths in code: those of two names or more, and single names that begin with a capital letter or are called.
fn find_paths(tokens: TokenStream, found: &mut Vec<Vec<String>>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let sign =
        |at: usize, sign: char| matches!(tokens.get(at), Some(TokenTree::Punct(punct)) if punct.as_char() == sign);
    let separator = |at: usize| sign(at, ':') && sign(at + 1, ':');
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            TokenTree::Group(group) if at > 0 && sign(at - 1, '#') && is_for_tests(&group.stream()) => {
                let end = |at: &usize| {
                    sign(*at, ';')
                        || matches!(&tokens[*at], TokenTree::Group(group) if group.delimiter() == Delimiter::Brace)
                };
                at = (at + 1..tokens.len()).find(end).unwrap_or(tokens.len());
            }
            TokenTree::Group(group) => find_paths(group.stream(), found),
            TokenTree::Ident(ident) => {
                let begins = at == 0 || !(sign(at - 1, '.') || at > 1 && separator(at - 2));
                let mut path = vec![ident.to_string()];
                while separator(at + 1)
                    && let Some(TokenTree::Ident(next)) = tokens.get(at + 3)
                {
                    path.push(next.to_string());
                    at += 3;
                }
                let called = sign(at + 1, '!')
                    || matches!(tokens.get(at + 1), Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Parenthesis);
                if begins && (path.len() > 1 || called || path[0].starts_with(char::is_uppercase)) {
                    found.push(path);
                }
            }
            _ => {}
        }
        at += 1;
    }
}
