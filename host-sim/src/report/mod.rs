//! The report that a calibration engineer signs: one HTML file without anything from the network.
//!
//! | module | duty |
//! |---|---|
//! | `study` | the numbers: three schemes compared, curves of the full model |
//! | `plots` | the paper's figures 8, 12, 13, 14 and 16 for this machine, and residuals |
//! | `tables` | the numbers as tables and sentences |
//! | `chart` | one chart as inline SVG |
//!
//! The page works from a mail attachment and on paper; its script adds readings under the pointer and a legend that
//! switches series.

mod chart;
mod plots;
mod study;
mod tables;

pub use study::Study;

use kou_lumped::machine::Machine;

/// Skeleton with style and script.
const PAGE: &str = include_str!("page.html");

/// The whole page.
#[must_use]
pub fn html(machine: &Machine, study: &Study) -> String {
    let title = format!("Leakage calibration: {}", machine.name());
    let body = format!(
        "<h1>{}</h1>\n{}<div class=\"charts\">\n{}</div>\n{}",
        chart::escape(&title),
        tables::head(study),
        plots::all(machine, study).iter().map(chart::Chart::html).collect::<String>(),
        tables::tail(study)
    );
    PAGE.replace("@TITLE@", &chart::escape(&title)).replace("@BODY@", &body)
}
