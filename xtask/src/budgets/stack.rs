//! Worst-case stack depth of the estimator's entry points.

use std::path::Path;

use anyhow::Result;

use super::call_graph::CallGraph;
use super::figure::{Figure, bytes};

/// Entry points, as the check that links the estimator alone names them, with key and meaning of their figure.
const ENTRY_POINTS: [(&str, &str, &str); 5] = [
    ("kou_step", "step_stack_bytes", "step: stack, static bound"),
    ("kou_params_new", "params_new_stack_bytes", "Params::new: stack, static bound"),
    ("kou_params_replace", "params_replace_stack_bytes", "Params::replace: stack, static bound"),
    ("kou_record_decode", "record_decode_stack_bytes", "record decode: stack, static bound"),
    ("kou_record_encode", "record_encode_stack_bytes", "record encode: stack, static bound"),
];

/// Stack depth of each entry point that firmware calls.
pub fn estimator_figures(elf: &Path) -> Result<Vec<Figure>> {
    let graph = CallGraph::load(elf, &[], &[], &[])?;
    let figures =
        ENTRY_POINTS.iter().map(|(name, key, what)| Ok(bytes(key, what, graph.depth_of(name)?.into())));
    figures.collect()
}

/// The deepest call path of each entry point, as a table for people.
pub fn estimator_call_paths(elf: &Path) -> Result<String> {
    let graph = CallGraph::load(elf, &[], &[], &[])?;
    ENTRY_POINTS.iter().map(|(name, ..)| graph.describe(name, None)).collect()
}
