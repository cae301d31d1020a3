//! Curves over one axis, written as CSV and drawn as SVG.

use std::path::Path;

use plotters::prelude::*;

use super::Failure;
use crate::plots::decimator::Columns;
use kou_records::InputError;

const SIZE: (u32, u32) = (900, 560);
const COLOURS: [RGBColor; 4] =
    [RGBColor(31, 119, 180), RGBColor(214, 39, 40), RGBColor(44, 160, 44), RGBColor(148, 103, 189)];

/// One curve.
pub(super) struct Series {
    name: String,
    points: Vec<(f64, f64)>,
}

impl Series {
    pub(super) fn new(name: impl Into<String>, points: impl Iterator<Item = (f64, f64)>) -> Self {
        Self { name: name.into(), points: points.collect() }
    }
}

/// Curves with a common abscissa; `x` and `y` are column names with units.
pub(super) struct Lines {
    pub(super) title: &'static str,
    pub(super) x: &'static str,
    pub(super) y: &'static str,
    pub(super) series: Vec<Series>,
}

impl Lines {
    /// Writes long-form CSV: series, abscissa, ordinate.
    pub(super) fn write_csv(&self, path: &Path) -> Result<(), Failure> {
        let fail = |e: csv::Error| InputError::new(format!("cannot be written: {e}")).at_file(path);
        let mut writer = csv::Writer::from_path(path).map_err(fail)?;
        writer.write_record(["series", self.x, self.y]).map_err(fail)?;
        for series in &self.series {
            for (x, y) in &series.points {
                writer
                    .write_record([series.name.as_str(), &format!("{x:.9}"), &format!("{y:.9}")])
                    .map_err(fail)?;
            }
        }
        writer.flush().map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(path))?;
        Ok(())
    }

    /// Draws SVG.
    pub(super) fn draw(&self, path: &Path) -> Result<(), Failure> {
        self.try_draw(path).map_err(|e| InputError::new(format!("cannot be drawn: {e}")).at_file(path).into())
    }

    fn try_draw(&self, path: &Path) -> Result<(), Box<dyn std::error::Error>> {
        let all = || self.series.iter().flat_map(|s| s.points.iter().copied());
        let span = |of: fn((f64, f64)) -> f64| {
            all().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let ((x0, x1), (y0, y1)) = (span(|p| p.0), span(|p| p.1));
        if !(x0 < x1 && y0.is_finite() && y1.is_finite()) {
            return Err("there is nothing to draw".into());
        }
        let margin = 0.06 * (y1 - y0).max(1e-9 * y1.abs().max(1.0));
        let root = SVGBackend::new(path, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let root = root.titled(self.title, ("sans-serif", 20))?;
        let mut chart = ChartBuilder::on(&root)
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(70)
            .build_cartesian_2d(x0..x1, (y0 - margin)..(y1 + margin))?;
        chart.configure_mesh().x_desc(self.x).y_desc(self.y).light_line_style(TRANSPARENT).draw()?;
        let (wide, tall) = chart.plotting_area().dim_in_pixel();
        for (series, colour) in self.series.iter().zip(COLOURS.iter().cycle().copied()) {
            // What the pixels can show; the CSV has all points.
            let mut columns = Columns::over(x0, x1, wide as usize);
            series.points.iter().for_each(|(x, y)| columns.add(*x, *y));
            let stretches = columns.stretches((y1 - y0 + 2.0 * margin) / f64::from(tall)).into_iter();
            chart
                .draw_series(stretches.map(|s| PathElement::new(s, colour.stroke_width(2))))?
                .label(series.name.clone())
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        }
        chart.configure_series_labels().background_style(WHITE.mix(0.85)).border_style(BLACK).draw()?;
        root.present()?;
        Ok(())
    }
}
