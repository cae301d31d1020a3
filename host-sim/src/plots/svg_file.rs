//! SVG files: charts stacked under one heading.

use std::error::Error;
use std::path::Path;

use kou_records::InputError;
use plotters::prelude::*;

use super::chart::Chart;
use super::render::Renderer;
use crate::output_file::create_folder_of;

/// Size of a chart by itself, pixels.
const SINGLE: (u32, u32) = (900, 560);
/// Size of one of several charts, pixels.
const STACKED: (u32, u32) = (1100, 300);
/// Pixels across which a curve is drawn at most.
pub const MAX_WIDTH: u32 = 1100;

/// Draws charts one above the other, under a heading.
///
/// # Errors
/// When a chart has no point, or the file cannot be written.
pub fn draw(path: &Path, title: &str, charts: &[Chart]) -> Result<(), InputError> {
    if charts.is_empty() || charts.iter().any(Chart::is_empty) {
        return Err(InputError::new("there is nothing to draw").at_file(path));
    }
    create_folder_of(path)?;
    draw_charts(path, title, charts)
        .map_err(|e| InputError::new(format!("cannot be drawn: {e}")).at_file(path))
}

/// Draws one chart under its own title.
///
/// # Errors
/// As of [`draw`].
pub fn draw_single(path: &Path, chart: &Chart) -> Result<(), InputError> {
    draw(path, &chart.title, std::slice::from_ref(chart))
}

fn draw_charts(path: &Path, title: &str, charts: &[Chart]) -> Result<(), Box<dyn Error>> {
    let size = match charts {
        [_] => SINGLE,
        _ => (STACKED.0, STACKED.1 * charts.len() as u32),
    };
    let root = SVGBackend::new(path, size).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, ("sans-serif", 20))?;
    for (area, chart) in root.split_evenly((charts.len(), 1)).iter().zip(charts) {
        let renderer = Renderer::new(chart, 1);
        let mut axes = renderer.axes(area)?;
        renderer.draw_grid(&mut axes)?;
        for number in 0..chart.series.len() {
            renderer.draw_series(&mut axes, number)?;
        }
        renderer.draw_legend(&mut axes)?;
    }
    root.present()?;
    Ok(())
}
