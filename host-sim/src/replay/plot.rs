//! Picture of a replay: measured and expected ratio, leakage coefficient seen and by the law, and their quotient.

use std::path::Path;

use kou_estimator::Estimate;
use plotters::coord::Shift;
use plotters::prelude::*;

use crate::plots::decimator::Columns;
use kou_records::InputError;

const SIZE: (u32, u32) = (1100, 900);
const MEASURED: RGBColor = RGBColor(31, 119, 180);
const EXPECTED: RGBColor = RGBColor(214, 39, 40);

/// Width of the columns in which points are kept at first, s: no log is sampled more finely.
const FINEST_S: f64 = 1e-3;
/// Columns kept at most: at least one for each pixel.
const KEPT: usize = 2 * SIZE.0 as usize;

/// What a picture shows: each curve thinned to the pixels, spikes and interruptions included.
#[derive(Debug, Clone)]
pub struct Trace {
    ratio_seen: Columns,
    ratio_law: Columns,
    kou_seen: Columns,
    kou_law: Columns,
    wear: Columns,
}

impl Default for Trace {
    fn default() -> Self {
        let columns = || Columns::growing(FINEST_S, KEPT);
        Self {
            ratio_seen: columns(),
            ratio_law: columns(),
            kou_seen: columns(),
            kou_law: columns(),
            wear: columns(),
        }
    }
}

impl Trace {
    fn curves(&mut self) -> [&mut Columns; 5] {
        let Self { ratio_seen, ratio_law, kou_seen, kou_law, wear } = self;
        [ratio_seen, ratio_law, kou_seen, kou_law, wear]
    }

    /// Adds a sample; samples that were not accepted leave a gap.
    pub fn add(&mut self, time_s: f64, estimate: &Estimate) {
        let (Ok(seen), Ok(expected)) = (estimate.observed, estimate.expected) else {
            self.curves().into_iter().for_each(Columns::interrupt);
            return;
        };
        let [ratio_seen, ratio_law] = [seen.ratio, expected.ratio].map(|ratio| f64::from(ratio.get()));
        let [kou_seen, kou_law] = [seen.kou, expected.kou].map(|kou| f64::from(kou.get()));
        let values = [ratio_seen, ratio_law, kou_seen, kou_law, kou_seen / kou_law];
        for (curve, value) in self.curves().into_iter().zip(values) {
            curve.add(time_s, value);
        }
    }
}

/// A curve: name, colour, points.
type Series<'a> = (&'static str, RGBColor, &'a Columns);

/// Draws the picture as SVG.
///
/// # Errors
/// When no sample was accepted or the file cannot be written.
pub fn draw(path: &Path, title: &str, trace: &Trace) -> Result<(), InputError> {
    if trace.ratio_seen.is_empty() {
        return Err(InputError::new("there is nothing to draw: no sample was accepted").at_file(path));
    }
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|e| InputError::new(format!("its folder cannot be made: {e}")).at_file(path))?;
    }
    draw_panels(path, title, trace)
        .map_err(|e| InputError::new(format!("cannot be drawn: {e}")).at_file(path))
}

fn draw_panels(path: &Path, title: &str, trace: &Trace) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::new(path, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, ("sans-serif", 20))?;
    let panels: [(&str, &[Series<'_>]); 3] = [
        (
            "speed ratio n_m/n_p",
            &[
                ("measured", MEASURED, &trace.ratio_seen),
                ("by law and reduced model", EXPECTED, &trace.ratio_law),
            ],
        ),
        (
            "Kou, (L/min)/MPa per chamber",
            &[("seen", MEASURED, &trace.kou_seen), ("by the law", EXPECTED, &trace.kou_law)],
        ),
        ("Kou seen / Kou by the law", &[("wear ratio", MEASURED, &trace.wear)]),
    ];
    for (area, (label, series)) in root.split_evenly((panels.len(), 1)).iter().zip(panels) {
        panel(area, label, series)?;
    }
    root.present()?;
    Ok(())
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    label: &str,
    series: &[Series<'_>],
) -> Result<(), Box<dyn std::error::Error>> {
    let points = || series.iter().flat_map(|(.., curve)| curve.stretches(0.0)).flatten();
    let (start, end) = points().fold((f64::MAX, f64::MIN), |(a, b), (t, _)| (a.min(t), b.max(t)));
    // The middle 99.6 % sets the scale, so that a single spike does not flatten the picture.
    let mut values: Vec<f64> = points().map(|(_, value)| value).collect();
    values.sort_by(f64::total_cmp);
    let at = |q: f64| values.get((q * (values.len() - 1) as f64) as usize).copied().unwrap_or_default();
    let (low, high) = (at(0.002), at(0.998));
    let margin = 0.08 * (high - low).max(1e-6);
    let (bottom, top) = (low - margin, high + margin);
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(64)
        .build_cartesian_2d(start..end.max(start + 1e-9), bottom..top)?;
    chart
        .configure_mesh()
        .x_desc("time, s")
        .y_desc(label)
        .light_line_style(TRANSPARENT)
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 14))
        .draw()?;
    let (wide, tall) = chart.plotting_area().dim_in_pixel();
    for (name, colour, curve) in series {
        let colour = *colour;
        let stretches = curve.thinned(start, end, wide as usize).stretches((top - bottom) / f64::from(tall));
        let (alone, joined): (Vec<_>, Vec<_>) = stretches.into_iter().partition(|s| s.len() == 1);
        chart.draw_series(alone.into_iter().flatten().map(|at| Circle::new(at, 1, colour.filled())))?;
        chart
            .draw_series(joined.into_iter().map(|stretch| PathElement::new(stretch, colour)))?
            .label(*name)
            .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
    }
    chart
        .configure_series_labels()
        // The ratio jumps between both directions: the middle is free. The others fill their scale from below.
        .position(if low < 0.0 && high > 0.0 {
            SeriesLabelPosition::MiddleLeft
        } else {
            SeriesLabelPosition::UpperLeft
        })
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.3))
        .label_font(("sans-serif", 13))
        .draw()?;
    Ok(())
}
