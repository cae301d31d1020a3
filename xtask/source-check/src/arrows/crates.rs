//! Forbidden arrows between packages, from their manifests.

use std::collections::{BTreeMap, VecDeque};

use super::rules::{CrateRule, FILE, Rules};
use crate::packages::{Metadata, PackageMetadata};

/// Every forbidden dependency, and rules about packages that do not exist. Dependencies of tests are not looked at.
pub fn complaints(metadata: &Metadata, rules: &Rules) -> Vec<String> {
    let package = |name: &str| metadata.packages.iter().find(|package| package.name == name);
    let mut complaints = Vec::new();
    for rule in rules.crates.iter().chain(&rules.external) {
        let mut named: Vec<&str> = vec![&rule.from];
        if rules.crates.iter().any(|other| std::ptr::eq(other, rule)) {
            named.extend(rule.to.iter().map(String::as_str));
        }
        for gone in named.into_iter().filter(|name| *name != "*" && package(name).is_none()) {
            complaints.push(format!(
                "{FILE} has a rule for the package `{gone}`, which does not exist: it protects nothing. Name the package by its \
                 present name"
            ));
        }
        for from in metadata.packages.iter().filter(|from| applies(rule, from)) {
            for chain in chains(metadata, from) {
                let (Some(last), Some(needed)) = (chain.last(), chain.get(1)) else { continue };
                let is_ours = package(last).is_some();
                let is_external = rules.external.iter().any(|other| std::ptr::eq(other, rule));
                if is_ours == is_external || !rule.to.iter().any(|to| matches(to, last)) {
                    continue;
                }
                let manifest = metadata.relative(&from.manifest_path);
                complaints.push(format!(
                    "{}:{}: `{}` depends on `{last}` ({}): {}. Instead: {}",
                    manifest.display(),
                    line_of(from, needed),
                    from.name,
                    chain.join(" -> "),
                    rule.reason,
                    rule.instead
                ));
            }
        }
    }
    complaints
}

fn applies(rule: &CrateRule, package: &PackageMetadata) -> bool {
    match rule.from.as_str() {
        "*" => {
            package.has_library() && !rule.to.contains(&package.name) && !rule.except.contains(&package.name)
        }
        name => name == package.name,
    }
}

fn matches(pattern: &str, name: &str) -> bool {
    pattern.strip_suffix('*').map_or(pattern == name, |prefix| name.starts_with(prefix))
}

/// For each package that one needs at first or second hand, the shortest chain of packages from the one to it.
fn chains<'a>(metadata: &'a Metadata, from: &'a PackageMetadata) -> Vec<Vec<&'a str>> {
    let mut chains: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    let mut queue = VecDeque::from([vec![from.name.as_str()]]);
    while let Some(chain) = queue.pop_front() {
        let last = chain.last().copied().unwrap_or_default();
        let Some(package) = metadata.packages.iter().find(|package| package.name == last) else { continue };
        for needed in package.needs(false).filter(|needed| *needed != from.name) {
            if !chains.contains_key(needed) {
                let longer: Vec<&str> = chain.iter().copied().chain([needed]).collect();
                chains.insert(needed, longer.clone());
                queue.push_back(longer);
            }
        }
    }
    chains.into_values().collect()
}

/// Line of a manifest that names a dependency.
fn line_of(package: &PackageMetadata, needed: &str) -> usize {
    let text = std::fs::read_to_string(&package.manifest_path).unwrap_or_default();
    text.lines()
        .position(|line| line.trim_start().trim_start_matches('"').starts_with(needed))
        .map_or(1, |at| at + 1)
}
