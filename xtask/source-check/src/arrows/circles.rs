//! Circles of imports: among the files of a crate, and among the modules below one module.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;

use super::edges::Edge;
use crate::module_tree::{ModuleId, ModuleTree};

/// Arrows by their two ends, each with the places that name something.
type Arrows<'a> = BTreeMap<(&'a str, &'a str), Vec<&'a Edge>>;

/// A complaint for each set of files, or of sibling modules, that know each other in a circle.
pub fn complaints(tree: &ModuleTree, edges: &[Edge]) -> Vec<String> {
    let used = || edges.iter().filter(|edge| !edge.is_facade);
    let mut files = Arrows::new();
    for edge in used() {
        files.entry((tree.file(edge.from), tree.file(edge.to))).or_default().push(edge);
    }
    // Siblings: the two different modules below the nearest common one that the arrow leads from and to.
    let mut siblings: BTreeMap<ModuleId, Arrows<'_>> = BTreeMap::new();
    for edge in used() {
        let (from, to) = (tree.ancestry(edge.from), tree.ancestry(edge.to));
        let split = from.iter().zip(&to).position(|(from, to)| from != to);
        let Some(split) = split.filter(|split| *split > 0) else { continue };
        let ends = (tree.module(from[split]).path.as_str(), tree.module(to[split]).path.as_str());
        siblings.entry(from[split - 1]).or_default().entry(ends).or_default().push(edge);
    }
    // Modules that are one file each are found as files.
    let parents: BTreeSet<&str> = tree
        .modules
        .iter()
        .filter(|module| !module.children.is_empty())
        .map(|module| module.path.as_str())
        .collect();
    let has_children = |circle: &[&str]| circle.iter().any(|path| parents.contains(path));
    let mut complaints = circles("files", tree, &files, &|_| true);
    for arrows in siblings.values() {
        complaints.extend(circles("modules", tree, arrows, &has_children));
    }
    complaints
}

fn circles(
    what: &str,
    tree: &ModuleTree,
    arrows: &Arrows<'_>,
    counts: &dyn Fn(&[&str]) -> bool,
) -> Vec<String> {
    let graph: DiGraphMap<&str, ()> = arrows.keys().copied().collect();
    let circles = tarjan_scc(&graph).into_iter().filter(|circle| circle.len() > 1 && counts(circle));
    let mut complaints: Vec<String> = circles.map(|circle| describe(what, &circle, tree, arrows)).collect();
    complaints.sort();
    complaints
}

fn describe(what: &str, circle: &[&str], tree: &ModuleTree, arrows: &Arrows<'_>) -> String {
    let members: BTreeSet<&str> = circle.iter().copied().collect();
    let mut inside = arrows.clone();
    inside.retain(|(from, to), _| members.contains(from) && members.contains(to));
    let shortest = members.iter().filter_map(|start| shortest_way_back(start, &inside)).min_by_key(Vec::len);
    let mut text = format!(
        "import circle of {} {what}; its shortest way round: {}. Data flows one way: move what both sides need into a module of \
         its own that imports neither, or pass it as an argument. All arrows inside the circle:",
        members.len(),
        shortest.unwrap_or_default().join(" -> ")
    );
    for ((_, to), places) in inside {
        let mut by_file: BTreeMap<&str, (usize, BTreeSet<&str>)> = BTreeMap::new();
        for edge in places {
            let (line, names) = by_file.entry(tree.file(edge.from)).or_insert((edge.line, BTreeSet::new()));
            *line = edge.line.min(*line);
            names.insert(&edge.path);
        }
        for (file, (line, names)) in by_file {
            let names: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
            text += &format!("\n  {file}:{line} -> {to}: {}", names.join(", "));
        }
    }
    text
}

/// Breadth first from one end back to itself.
fn shortest_way_back<'a>(start: &'a str, arrows: &Arrows<'a>) -> Option<Vec<&'a str>> {
    let mut came_from: BTreeMap<&str, &str> = BTreeMap::new();
    let mut queue = VecDeque::from([start]);
    while let Some(at) = queue.pop_front() {
        for (_, next) in arrows.keys().filter(|(from, _)| *from == at) {
            if *next == start {
                let mut way = vec![start, at];
                let mut back = at;
                while back != start {
                    back = came_from.get(back)?;
                    way.push(back);
                }
                way.reverse();
                return Some(way);
            }
            if !came_from.contains_key(next) {
                came_from.insert(next, at);
                queue.push_back(next);
            }
        }
    }
    None
}
