//! The report that a calibration engineer signs: one HTML file without anything from the network.
//!
//! | module | duty |
//! |---|---|
//! | `study` | the numbers: three schemes compared, curves of the lumped model |
//! | `charts` | the paper's figures 8, 12, 13, 14 and 16 for this machine, and residuals |
//! | `tables` | the numbers as tables and sentences |
//!
//! The page works from a mail attachment and on paper; its script adds readings under the pointer and a legend that
//! switches series.

mod charts;
mod study;
mod tables;

pub use study::ReportStudy;

use kou_lumped::machine::Machine;
use kou_records::InputError;

use crate::plots::html::{escape, figure};

/// Skeleton with style and script.
const PAGE: &str = include_str!("page.html");

/// The HTML page.
///
/// # Errors
/// When a chart cannot be drawn.
pub fn html(machine: &Machine, study: &ReportStudy) -> Result<String, InputError> {
    let title = escape(&format!("Leakage calibration: {}", machine.name()));
    let figures: String = charts::all(machine, study).iter().map(figure).collect::<Result<_, _>>()?;
    let body = format!(
        "<h1>{title}</h1>\n{}<div class=\"charts\">\n{figures}</div>\n{}",
        tables::head(study),
        tables::tail(study)
    );
    Ok(PAGE.replace("@TITLE@", &title).replace("@BODY@", &body))
}
