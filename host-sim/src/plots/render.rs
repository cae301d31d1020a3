//! Drawing of a chart on an SVG area: axes, series, legend; the palette and the fonts of every plot.

use std::error::Error;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::chart::Chart;
use super::decimator::MinMaxDecimator;
use super::series::{Marks, Series};

/// Distinguishable for all kinds of colour vision and in grey (Okabe and Ito).
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(51, 51, 51),
];
const FONT: &str = "sans-serif";
/// Points of a line up to which each gets a dot of its own.
const FEW_POINTS: usize = 40;

/// An area to draw on.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// The axes of a chart on an area.
pub(super) type Axes<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Colour of the series with this number.
pub(super) fn colour(number: usize) -> RGBColor {
    PALETTE.iter().cycle().nth(number).copied().unwrap_or(BLACK)
}

/// A chart with its ranges, drawn `pixels` to a unit of length.
pub(super) struct Renderer<'c> {
    chart: &'c Chart,
    x_range: Range<f64>,
    y_range: Range<f64>,
    pixels: u32,
}

impl<'c> Renderer<'c> {
    pub(super) fn new(chart: &'c Chart, pixels: u32) -> Self {
        Self { chart, x_range: chart.x_range(), y_range: chart.y_range(), pixels }
    }

    /// The axes on an area; nothing is drawn.
    pub(super) fn axes<'a, 'b>(&self, area: &'a Area<'b>) -> Result<Axes<'a, 'b>, Box<dyn Error>> {
        Ok(ChartBuilder::on(area)
            .margin(8 * self.pixels)
            // Room for the half of the last tick's label.
            .margin_right(18 * self.pixels)
            .x_label_area_size(36 * self.pixels)
            .y_label_area_size(64 * self.pixels)
            .build_cartesian_2d(self.x_range.clone(), self.y_range.clone())?)
    }

    /// Draws frame, grid, ticks and labels.
    pub(super) fn draw_grid(&self, axes: &mut Axes<'_, '_>) -> Result<(), Box<dyn Error>> {
        axes.configure_mesh()
            .x_desc(self.chart.x_label)
            .y_desc(self.chart.y_label)
            .light_line_style(TRANSPARENT)
            .label_style((FONT, 13 * self.pixels))
            .axis_desc_style((FONT, 14 * self.pixels))
            .draw()?;
        Ok(())
    }

    /// Draws one series, and enters it in the legend.
    pub(super) fn draw_series(&self, axes: &mut Axes<'_, '_>, number: usize) -> Result<(), Box<dyn Error>> {
        let Some(series) = self.chart.series.get(number) else { return Ok(()) };
        let (colour, pixels) = (colour(number), self.pixels);
        if series.marks == Marks::Band {
            let upper = series.finite().map(|point| (point.x, point.interval()[1]));
            let lower = series.finite().rev().map(|point| (point.x, point.interval()[0]));
            let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
            axes.draw_series([Polygon::new(outline, colour.mix(0.15))])?;
        }
        let shows_dots = series.marks == Marks::Dots || series.points.len() <= FEW_POINTS;
        if shows_dots {
            let bars = series.finite().filter(|point| point.standard_error.is_some()).map(|point| {
                let [low, high] = point.interval();
                PathElement::new([(point.x, low), (point.x, high)], colour.stroke_width(pixels))
            });
            if series.marks == Marks::Dots {
                axes.draw_series(bars)?;
            }
            let radius = if series.marks == Marks::Dots { 3 } else { 2 } * pixels;
            axes.draw_series(series.finite().map(|p| Circle::new((p.x, p.y), radius, colour.filled())))?;
        }
        let segments = if series.marks == Marks::Dots { vec![] } else { self.segments(axes, series) };
        // Noisy signals would be one broad band otherwise.
        let width = if self.chart.clips_spikes { 1 } else { 2 };
        let (single, joined): (Vec<_>, Vec<_>) = segments.into_iter().partition(|s| s.len() < 2);
        axes.draw_series(single.into_iter().flatten().map(|at| Circle::new(at, pixels, colour.filled())))?;
        let paths = joined.into_iter().map(|s| PathElement::new(s, colour.stroke_width(width * pixels)));
        axes.draw_series(paths)?
            .label(series.name.clone())
            .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
        Ok(())
    }

    /// Draws the legend where it covers least.
    pub(super) fn draw_legend<'a, 'b: 'a>(&self, axes: &mut Axes<'a, 'b>) -> Result<(), Box<dyn Error>> {
        axes.configure_series_labels()
            .position(self.emptiest_place())
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.3))
            .label_font((FONT, 13 * self.pixels))
            .draw()?;
        Ok(())
    }

    /// The segments of a line: all points, or as many as the pixels can show.
    fn segments(&self, axes: &Axes<'_, '_>, series: &Series) -> Vec<Vec<(f64, f64)>> {
        let (wide, tall) = axes.plotting_area().dim_in_pixel();
        if series.points.len() <= wide as usize {
            let segments = series.points.split(|point| !point.is_finite());
            return segments.map(|points| points.iter().map(|p| (p.x, p.y)).collect()).collect();
        }
        let mut decimator = MinMaxDecimator::over(self.x_range.start, self.x_range.end, wide as usize);
        series.points.iter().for_each(|point| decimator.push(point.x, point.y));
        decimator.segments((self.y_range.end - self.y_range.start) / f64::from(tall))
    }

    /// The place of the legend with the fewest points behind it: a third of the width, a quarter of the height.
    fn emptiest_place(&self) -> SeriesLabelPosition {
        use SeriesLabelPosition::{
            LowerLeft, LowerRight, MiddleLeft, MiddleMiddle, MiddleRight, UpperLeft, UpperRight,
        };
        let share = |range: &Range<f64>, value: f64| (value - range.start) / (range.end - range.start);
        let mut behind = [
            (UpperLeft, [0.0, 0.75], 0_usize),
            (UpperRight, [0.65, 0.75], 0),
            (LowerLeft, [0.0, 0.0], 0),
            (LowerRight, [0.65, 0.0], 0),
            (MiddleLeft, [0.0, 0.375], 0),
            (MiddleRight, [0.65, 0.375], 0),
            (MiddleMiddle, [0.325, 0.375], 0),
        ];
        for series in &self.chart.series {
            for pair in series.points.windows(2) {
                let [a, b] = pair else { continue };
                // Between points far apart the line itself may be behind the legend.
                for part in [0.0, 0.25, 0.5, 0.75, 1.0] {
                    let x = share(&self.x_range, a.x + part * (b.x - a.x));
                    let y = share(&self.y_range, a.y + part * (b.y - a.y));
                    for (_, [left, bottom], count) in &mut behind {
                        let is_behind =
                            (*left..*left + 0.35).contains(&x) && (*bottom..*bottom + 0.25).contains(&y);
                        *count += usize::from(is_behind);
                    }
                }
            }
        }
        behind.into_iter().min_by_key(|(.., count)| *count).map_or(UpperLeft, |(place, ..)| place)
    }
}
