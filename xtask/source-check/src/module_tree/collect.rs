//! Content of one module: definitions, child modules, `use` declarations and paths.

use std::collections::BTreeSet;

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemMod, UseTree, Visibility};

/// One name brought into scope by a `use` declaration, or a glob.
#[derive(Debug)]
pub struct Import {
    /// Name in the scope; `*` for a glob.
    pub name: String,
    /// Path that it stands for.
    pub path: Vec<String>,
    /// Line in the file.
    pub line: usize,
    /// Visible outside the module.
    pub public: bool,
}

/// A path in the code.
#[derive(Debug)]
pub struct Mention {
    /// Its segments.
    pub path: Vec<String>,
    /// Line in the file.
    pub line: usize,
}

/// Contents of a module.
#[derive(Default)]
pub struct Contents<'ast> {
    /// Names of definitions.
    pub definitions: BTreeSet<String>,
    /// Macros exported from the crate.
    pub exported_macros: Vec<String>,
    /// Child modules.
    pub children: Vec<&'ast ItemMod>,
    /// `use` declarations.
    pub imports: Vec<Import>,
    /// Paths in the code.
    pub mentions: Vec<Mention>,
    /// Blocks around the place that is visited.
    depth: usize,
}

/// Reads a module's items.
pub fn collect(items: &[Item]) -> Contents<'_> {
    let mut contents = Contents::default();
    for item in items {
        contents.visit_item(item);
    }
    contents
}

/// The file that `#[path = "..."]` names.
pub fn path_attribute(module: &ItemMod) -> Option<String> {
    module.attrs.iter().find_map(|attribute| {
        let syn::Meta::NameValue(value) = &attribute.meta else { return None };
        let syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(text), .. }) = &value.value else { return None };
        value.path.is_ident("path").then(|| text.value())
    })
}

/// True for `#[test]` and for `#[cfg(test)]` and its like.
fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let syn::Meta::List(list) = &attribute.meta else { return attribute.path().is_ident("test") };
        let words: Vec<String> = flatten(list.tokens.clone()).map(|token| token.to_string()).collect();
        list.path.is_ident("cfg")
            && words.iter().any(|word| word == "test")
            && !words.iter().any(|word| word == "not")
    })
}

/// All tokens but the groups' delimiters.
fn flatten(tokens: TokenStream) -> Box<dyn Iterator<Item = TokenTree>> {
    Box::new(tokens.into_iter().flat_map(|token| match token {
        TokenTree::Group(group) => flatten(group.stream()),
        other => Box::new(std::iter::once(other)),
    }))
}

fn attributes_of(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::ExternCrate(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::ForeignMod(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::TraitAlias(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

impl<'ast> Contents<'ast> {
    fn define(&mut self, name: &syn::Ident) {
        if self.depth == 0 {
            self.definitions.insert(name.to_string());
        }
    }

    fn mention(&mut self, path: Vec<String>, line: usize) {
        if path.first().is_some_and(|first| first != "Self") {
            self.mentions.push(Mention { path, line });
        }
    }

    fn import(&mut self, tree: &UseTree, path: &mut Vec<String>, public: bool) {
        let mut push = |name: &syn::Ident, path: &[String]| {
            let line = name.span().start().line;
            let (name, mut path) = (name.to_string(), path.to_vec());
            if path.last().is_some_and(|last| last == "self") && path.len() > 1 {
                path.pop();
            }
            let name = if name == "self" { path.last().cloned().unwrap_or(name) } else { name };
            self.imports.push(Import { name, path, line, public });
        };
        match tree {
            UseTree::Path(part) => {
                path.push(part.ident.to_string());
                self.import(&part.tree, path, public);
                path.pop();
            }
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.import(tree, path, public);
                }
            }
            UseTree::Name(leaf) => {
                path.push(leaf.ident.to_string());
                push(&leaf.ident, path);
                path.pop();
            }
            UseTree::Rename(leaf) => {
                path.push(leaf.ident.to_string());
                push(&leaf.rename, path);
                path.pop();
            }
            UseTree::Glob(glob) => {
                let line = glob.star_token.spans[0].start().line;
                self.imports.push(Import { name: "*".to_owned(), path: path.clone(), line, public });
            }
        }
    }

    /// Paths among the tokens of a macro call. With `anchored`, only those that begin at the crate or at a module: in a macro's
    /// own rules, single names belong to its callers.
    fn tokens(&mut self, tokens: TokenStream, anchored: bool) {
        let mut tokens = tokens.into_iter().peekable();
        // The two characters before the present token: `.` or `::` join a name to what came earlier.
        let mut before = [' '; 2];
        while let Some(token) = tokens.next() {
            let is_joined = before == [':', ':'] || (before[1] == '.' && before[0] != '.');
            before = [before[1], if let TokenTree::Punct(punct) = &token { punct.as_char() } else { ' ' }];
            match token {
                TokenTree::Group(group) => self.tokens(group.stream(), anchored),
                TokenTree::Ident(ident) if !is_joined => {
                    let line = ident.span().start().line;
                    let mut path = vec![ident.to_string()];
                    let mut rest = tokens.clone();
                    while let Some(segment) = after_double_colon(&mut rest) {
                        path.push(segment);
                        tokens = rest.clone();
                    }
                    let is_anchor = matches!(path[0].as_str(), "crate" | "self" | "super");
                    if (is_anchor && path.len() > 1) || !(anchored || is_anchor) {
                        self.mention(path, line);
                    }
                }
                TokenTree::Literal(literal) => {
                    // Attributes name functions in texts: `#[serde(with = "crate::form")]`.
                    let text = literal.to_string();
                    let text = text.trim_matches('"');
                    if text.starts_with("crate::")
                        && text.chars().all(|c| c.is_alphanumeric() || "_:".contains(c))
                    {
                        let path = text.split("::").map(str::to_owned).collect();
                        self.mention(path, literal.span().start().line);
                    }
                }
                TokenTree::Ident(_) | TokenTree::Punct(_) => {}
            }
        }
    }
}

/// The segment behind `::`, if that is what follows.
fn after_double_colon(tokens: &mut (impl Iterator<Item = TokenTree> + Clone)) -> Option<String> {
    for _ in 0..2 {
        let Some(TokenTree::Punct(punct)) = tokens.next() else { return None };
        if punct.as_char() != ':' {
            return None;
        }
    }
    match tokens.next() {
        Some(TokenTree::Ident(ident)) => Some(ident.to_string()),
        _ => None,
    }
}

impl<'ast> Visit<'ast> for Contents<'ast> {
    fn visit_item(&mut self, item: &'ast Item) {
        if is_test(attributes_of(item)) {
            return;
        }
        match item {
            Item::Const(item) => self.define(&item.ident),
            Item::Enum(item) => self.define(&item.ident),
            Item::Fn(item) => self.define(&item.sig.ident),
            Item::Static(item) => self.define(&item.ident),
            Item::Struct(item) => self.define(&item.ident),
            Item::Trait(item) => self.define(&item.ident),
            Item::TraitAlias(item) => self.define(&item.ident),
            Item::Type(item) => self.define(&item.ident),
            Item::Union(item) => self.define(&item.ident),
            _ => {}
        }
        visit::visit_item(self, item);
    }

    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        if self.depth == 0 {
            self.children.push(item);
        } else {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let public = !matches!(item.vis, Visibility::Inherited);
        self.import(&item.tree, &mut Vec::new(), public);
    }

    fn visit_item_macro(&mut self, item: &'ast syn::ItemMacro) {
        let Some(name) = &item.ident else { return visit::visit_item_macro(self, item) };
        self.define(name);
        if item.attrs.iter().any(|attribute| attribute.path().is_ident("macro_export")) {
            self.exported_macros.push(name.to_string());
        }
        self.tokens(item.mac.tokens.clone(), true);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.visit_path(&item.path);
        self.tokens(item.tokens.clone(), false);
    }

    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        match &attribute.meta {
            syn::Meta::List(list) if !list.path.is_ident("cfg") && !list.path.is_ident("doc") => {
                self.tokens(list.tokens.clone(), false);
            }
            _ => {}
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_visibility(&mut self, _: &'ast Visibility) {}

    fn visit_block(&mut self, block: &'ast syn::Block) {
        self.depth += 1;
        visit::visit_block(self, block);
        self.depth -= 1;
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let line = path.segments.first().map_or(0, |first| first.ident.span().start().line);
        let segments = path.segments.iter().map(|segment| segment.ident.to_string());
        // A leading `::` names another crate.
        let segments = path.leading_colon.iter().map(|_| "::".to_owned()).chain(segments);
        self.mention(segments.collect(), line);
        visit::visit_path(self, path);
    }

    fn visit_pat_ident(&mut self, pattern: &'ast syn::PatIdent) {
        let name = pattern.ident.to_string();
        if pattern.subpat.is_none() && name.starts_with(char::is_uppercase) {
            self.mention(vec![name], pattern.ident.span().start().line);
        }
        visit::visit_pat_ident(self, pattern);
    }
}
