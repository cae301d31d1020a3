//! Charts: series over two axes, the axes' ranges, and the data as CSV.

use std::ops::Range;
use std::path::Path;

use kou_records::InputError;

use super::series::{Marks, Series};
use crate::output_file::write_error;

/// Margin between data and axes, relative to the data's span.
const MARGIN: f64 = 0.06;
/// Quantiles of the ordinates between which an axis without spikes spans.
const WITHOUT_SPIKES: [f64; 2] = [0.002, 0.998];

/// A chart.
#[derive(Debug, Clone)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// Label of the horizontal axis, with its unit.
    pub x_label: &'static str,
    /// Label of the vertical axis, with its unit.
    pub y_label: &'static str,
    /// Series, drawn in this order.
    pub series: Vec<Series>,
    /// Whether the vertical axis spans the middle 99.6 % of the points, so that single spikes do not flatten the curves.
    pub clips_spikes: bool,
}

impl Chart {
    /// A chart whose axes span all points.
    #[must_use]
    pub fn new(
        title: impl Into<String>,
        x_label: &'static str,
        y_label: &'static str,
        series: Vec<Series>,
    ) -> Self {
        Self { title: title.into(), x_label, y_label, series, clips_spikes: false }
    }

    /// Whether there is nothing to draw.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.series.iter().all(|series| series.finite().next().is_none())
    }

    /// Range of the horizontal axis: exactly the data's, with a margin where dots would touch the frame.
    pub(super) fn x_range(&self) -> Range<f64> {
        let xs = self.series.iter().flat_map(|series| series.finite().map(|point| point.x));
        let margin = if self.series.iter().any(|series| series.marks == Marks::Dots) { MARGIN } else { 0.0 };
        widened(xs, margin)
    }

    /// Range of the vertical axis: the data's with their confidence intervals, and a margin.
    pub(super) fn y_range(&self) -> Range<f64> {
        let all = self.series.iter().flat_map(|series| series.finite());
        if !self.clips_spikes {
            return widened(all.flat_map(|point| point.interval()), MARGIN);
        }
        let mut values: Vec<f64> = all.map(|point| point.y).collect();
        values.sort_by(f64::total_cmp);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "an index within the values"
        )]
        let at = |share: f64| values.get((share * values.len().saturating_sub(1) as f64) as usize).copied();
        widened(WITHOUT_SPIKES.into_iter().filter_map(at), MARGIN)
    }

    /// Writes the data as long-form CSV: series, abscissa, ordinate.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_csv(&self, path: &Path, [x, y]: [&str; 2]) -> Result<(), InputError> {
        let mut writer = csv::Writer::from_path(path).map_err(write_error(path))?;
        writer.write_record(["series", x, y]).map_err(write_error(path))?;
        for series in &self.series {
            for point in &series.points {
                let cells = [series.name.clone(), format!("{:.9}", point.x), format!("{:.9}", point.y)];
                writer.write_record(cells).map_err(write_error(path))?;
            }
        }
        writer.flush().map_err(write_error(path))
    }
}

/// Range of values with a relative margin; never empty.
fn widened(values: impl Iterator<Item = f64>, margin: f64) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    let span = (high - low).max(1e-6 * high.abs().max(1.0));
    let low = low - margin * span;
    low..(high + margin * span).max(low + 1e-9 * span)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        Chart::new("", "x", "y", vec![Series::line("a", points)])
    }

    #[test]
    fn ranges_hold_all_points_and_are_never_empty() {
        for points in [vec![], vec![(f64::NAN, 1.0)], vec![(2.0, 3.0)], vec![(1e9, 0.0), (1e9, 0.0)]] {
            let chart = chart(points);
            for range in [chart.x_range(), chart.y_range()] {
                assert!(range.start < range.end && range.start.is_finite(), "{range:?}");
            }
        }
        let line = chart(vec![(0.0, -1.0), (1.0, f64::INFINITY), (2.0, 4.0)]);
        assert_eq!((line.x_range(), line.is_empty()), (0.0..2.0, false));
        assert!(line.y_range().start < -1.0 && line.y_range().end > 4.0);
    }

    #[test]
    fn a_spike_sets_no_axis_that_clips_spikes() {
        let spiky = |i: i32| (f64::from(i), if i == 500 { 1e3 } else { f64::from(i % 2) });
        let mut chart = chart((0..1000).map(spiky).collect());
        assert!(chart.y_range().end > 1e3);
        chart.clips_spikes = true;
        assert!(chart.y_range().end < 1.1);
    }
}
