//! Picture of a replay: measured and expected ratio, leakage coefficient seen and by the law, and their quotient.

use std::path::Path;

use kou_estimator::Estimate;
use plotters::coord::Shift;
use plotters::prelude::*;

use crate::input::InputError;

/// Points that a picture shows at most; longer logs are thinned evenly.
const MAX_POINTS: usize = 400;
const SIZE: (u32, u32) = (1100, 900);
const MEASURED: RGBColor = RGBColor(31, 119, 180);
const EXPECTED: RGBColor = RGBColor(214, 39, 40);

/// What a picture needs of each accepted sample.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    points: Vec<Point>,
    stride: usize,
    seen: usize,
}

#[derive(Debug, Clone, Copy)]
struct Point {
    time_s: f64,
    ratio_seen: f64,
    ratio_law: f64,
    kou_seen: f64,
    kou_law: f64,
}

impl Trace {
    /// Adds a sample; samples that were not accepted leave a gap.
    pub fn add(&mut self, time_s: f64, estimate: &Estimate) {
        let (Ok(seen), Ok(expected)) = (estimate.seen, estimate.expected) else { return };
        self.stride = self.stride.max(1);
        if self.seen.is_multiple_of(self.stride) {
            self.points.push(Point {
                time_s,
                ratio_seen: seen.ratio.get().into(),
                ratio_law: expected.ratio.get().into(),
                kou_seen: seen.kou.get().into(),
                kou_law: expected.kou.get().into(),
            });
        }
        self.seen += 1;
        // Memory stays bounded: when full, every second point goes and from now on only every second comes.
        if self.points.len() > 2 * MAX_POINTS {
            let mut index = 0;
            self.points.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.stride *= 2;
        }
    }
}

/// Curve or cloud: name, colour, whether as dots, and which value of a point.
type Series = (&'static str, RGBColor, bool, fn(&Point) -> f64);

/// Draws the picture as SVG.
///
/// # Errors
/// When no sample was accepted or the file cannot be written.
pub fn draw(path: &Path, title: &str, trace: &Trace) -> Result<(), InputError> {
    if trace.points.is_empty() {
        return Err(InputError::new("there is nothing to draw: no sample was accepted").at_file(path));
    }
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|e| InputError::new(format!("its folder cannot be made: {e}")).at_file(path))?;
    }
    draw_panels(path, title, &trace.points)
        .map_err(|e| InputError::new(format!("cannot be drawn: {e}")).at_file(path))
}

fn draw_panels(path: &Path, title: &str, points: &[Point]) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::new(path, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, ("sans-serif", 20))?;
    let panels: [(&str, &[Series]); 3] = [
        (
            "speed ratio n_m/n_p",
            &[
                ("measured", MEASURED, true, |p| p.ratio_seen),
                ("by law and reduced model", EXPECTED, true, |p| p.ratio_law),
            ],
        ),
        (
            "Kou, (L/min)/MPa per chamber",
            &[("seen", MEASURED, true, |p| p.kou_seen), ("by the law", EXPECTED, true, |p| p.kou_law)],
        ),
        ("Kou seen / Kou by the law", &[("wear ratio", MEASURED, true, |p| p.kou_seen / p.kou_law)]),
    ];
    for (area, (label, series)) in root.split_evenly((panels.len(), 1)).iter().zip(panels) {
        panel(area, label, series, points)?;
    }
    root.present()?;
    Ok(())
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    label: &str,
    series: &[Series],
    points: &[Point],
) -> Result<(), Box<dyn std::error::Error>> {
    let times = points.iter().map(|p| p.time_s);
    let (start, end) = times.fold((f64::MAX, f64::MIN), |(a, b), t| (a.min(t), b.max(t)));
    // The middle 99.6 % sets the scale, so that a single spike does not flatten the picture.
    let mut values: Vec<f64> = series.iter().flat_map(|(.., of)| points.iter().map(of)).collect();
    values.sort_by(f64::total_cmp);
    let at = |q: f64| values.get((q * (values.len() - 1) as f64) as usize).copied().unwrap_or_default();
    let (low, high) = (at(0.002), at(0.998));
    let margin = 0.08 * (high - low).max(1e-6);
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(64)
        .build_cartesian_2d(start..end.max(start + 1e-9), (low - margin)..(high + margin))?;
    chart
        .configure_mesh()
        .x_desc("time, s")
        .y_desc(label)
        .light_line_style(WHITE)
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 14))
        .draw()?;
    for (name, colour, dots, of) in series {
        let data = points.iter().map(|p| (p.time_s, of(p)));
        let drawn = if *dots {
            chart.draw_series(data.map(|at| Circle::new(at, 2, colour.filled())))?
        } else {
            chart.draw_series(LineSeries::new(data, colour))?
        };
        let colour = *colour;
        drawn.label(*name).legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
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
