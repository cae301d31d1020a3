//! Arrows between modules: who names what, and where.

use crate::module_tree::{ModuleId, ModuleTree, Resolution, SourceModule};

/// A module names an item of another module.
#[derive(Debug)]
pub struct Edge {
    /// Module that names it.
    pub from: ModuleId,
    /// Module that defines it.
    pub to: ModuleId,
    /// Modules that the path goes through.
    pub through: Vec<ModuleId>,
    /// Line of the path in the naming module's file.
    pub line: usize,
    /// The path as written.
    pub path: String,
    /// A re-export that the module itself does not use.
    pub is_facade: bool,
}

/// All arrows of a tree, those between modules of one file left out.
pub fn edges(tree: &ModuleTree) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (from, module) in tree.modules.iter().enumerate() {
        let mut push = |found: Option<Resolution>, path: &[String], line: usize, is_facade: bool| {
            let Some(found) = found.filter(|found| found.is_item) else { return };
            if tree.module(found.module).file != module.file {
                let Resolution { module: to, through, .. } = found;
                edges.push(Edge { from, to, through, line, path: path.join("::"), is_facade });
            }
        };
        let mentioned = module.mentioned();
        for import in module.imports.iter().filter(|import| import.name != "*") {
            let found = tree.resolve(from, &import.path);
            // A private import counts even where nothing names it: a trait in scope is used by its methods.
            let is_facade = import.public && !mentioned.contains(import.name.as_str());
            push(found, &import.path, import.line, is_facade);
        }
        for mention in &module.mentions {
            if !is_import_of_item(tree, from, module, mention.path.first()) {
                push(tree.resolve(from, &mention.path), &mention.path, mention.line, false);
            }
        }
    }
    edges
}

/// True when a path begins with an imported item: the import is the arrow then.
fn is_import_of_item(
    tree: &ModuleTree,
    from: ModuleId,
    module: &SourceModule,
    first: Option<&String>,
) -> bool {
    let mut named = module.imports.iter().filter(|import| Some(&import.name) == first);
    named.any(|import| tree.resolve(from, &import.path).is_some_and(|found| found.is_item))
}
