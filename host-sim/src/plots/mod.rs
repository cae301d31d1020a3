//! Plots: every chart of the tool, as an SVG file, as a figure of an HTML page and as CSV.
//!
//! | module | duty |
//! |---|---|
//! | [`series`] | data of one curve: line, dots with error bars, or confidence band |
//! | [`chart`] | axes with their series, axis ranges, long-form CSV |
//! | [`decimator`] | min-max decimation of long curves in bounded memory |
//! | `render` | drawing of a chart with `plotters`; the palette and the fonts |
//! | [`svg_file`] | charts stacked in one SVG file |
//! | [`html`] | one chart as an HTML figure with readings and a legend that switches series |

pub mod chart;
pub mod decimator;
pub mod html;
mod render;
pub mod series;
pub mod svg_file;

pub use chart::Chart;
pub use decimator::MinMaxDecimator;
pub use series::{DataPoint, Marks, Series};
