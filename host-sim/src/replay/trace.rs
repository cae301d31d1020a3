//! Plot of a replay: measured and expected ratio, observed coefficient and the law's, and their quotient.

use std::path::Path;

use kou_estimator::Estimate;
use kou_records::InputError;

use crate::plots::{Chart, MinMaxDecimator, Series, svg_file};

/// Width of the finest columns, s: no log is sampled more finely.
const FINEST_S: f64 = 1e-3;
/// Largest number of columns: at least one for each pixel.
const MAX_COLUMNS: usize = 2 * svg_file::MAX_WIDTH as usize;

/// Estimates over time, decimated while they come: memory is bounded however long the log is.
#[derive(Debug, Clone)]
pub struct EstimateTrace {
    ratio_measured: MinMaxDecimator,
    ratio_law: MinMaxDecimator,
    kou_observed: MinMaxDecimator,
    kou_law: MinMaxDecimator,
    wear: MinMaxDecimator,
}

impl Default for EstimateTrace {
    fn default() -> Self {
        let decimator = || MinMaxDecimator::growing(FINEST_S, MAX_COLUMNS);
        Self {
            ratio_measured: decimator(),
            ratio_law: decimator(),
            kou_observed: decimator(),
            kou_law: decimator(),
            wear: decimator(),
        }
    }
}

impl EstimateTrace {
    fn curves(&mut self) -> [&mut MinMaxDecimator; 5] {
        let Self { ratio_measured, ratio_law, kou_observed, kou_law, wear } = self;
        [ratio_measured, ratio_law, kou_observed, kou_law, wear]
    }

    /// Adds a sample; one that was not accepted interrupts the curves.
    pub fn push(&mut self, time_s: f64, estimate: &Estimate) {
        let (Ok(seen), Ok(expected)) = (estimate.observed, estimate.expected) else {
            self.curves().into_iter().for_each(MinMaxDecimator::interrupt);
            return;
        };
        let [ratio_measured, ratio_law] = [seen.ratio, expected.ratio].map(|ratio| f64::from(ratio.get()));
        let [kou_observed, kou_law] = [seen.kou, expected.kou].map(|kou| f64::from(kou.get()));
        let values = [ratio_measured, ratio_law, kou_observed, kou_law, kou_observed / kou_law];
        for (curve, value) in self.curves().into_iter().zip(values) {
            curve.push(time_s, value);
        }
    }

    /// Draws the plot as SVG.
    ///
    /// # Errors
    /// When no sample was accepted or the file cannot be written.
    pub fn draw(&self, path: &Path, title: &str) -> Result<(), InputError> {
        if self.ratio_measured.is_empty() {
            return Err(InputError::new("there is nothing to draw: no sample was accepted").at_file(path));
        }
        let chart = |label: &'static str, curves: &[(&str, &MinMaxDecimator)]| Chart {
            clips_spikes: true,
            ..Chart::new(
                "",
                "time, s",
                label,
                curves.iter().map(|(name, curve)| Series::line(*name, curve.points())).collect(),
            )
        };
        let charts = [
            chart(
                "speed ratio n_m/n_p",
                &[("measured", &self.ratio_measured), ("by law and reduced model", &self.ratio_law)],
            ),
            chart(
                "Kou, (L/min)/MPa per chamber",
                &[("observed", &self.kou_observed), ("by the law", &self.kou_law)],
            ),
            chart("observed Kou / Kou by the law", &[("wear ratio", &self.wear)]),
        ];
        svg_file::draw(path, title, &charts)
    }
}
