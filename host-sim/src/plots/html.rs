//! One chart as inline SVG: axes with round ticks, lines, dots with error bars, bands, and a legend.
//!
//! The drawing stands by itself; the page's script only adds what paper has not: a reading under the pointer and series
//! that can be switched off. Every text is escaped, since names come from files.

use std::fmt::Write;

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Joined by lines.
    Line,
    /// Single points, with error bars where they have errors.
    Dots,
    /// The area within the errors, around a line.
    Band,
}

/// A point, with its standard error where it has one.
pub type Point = (f64, f64, Option<f64>);

/// One series.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Style.
    pub style: Style,
    /// Points.
    pub points: Vec<Point>,
}

/// One chart.
#[derive(Debug, Clone)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// What the horizontal axis shows, with its unit.
    pub x: &'static str,
    /// What the vertical axis shows, with its unit.
    pub y: &'static str,
    /// Series, drawn in this order.
    pub series: Vec<Series>,
}

/// Distinguishable for all kinds of colour vision and in grey (Okabe and Ito).
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#333333"];
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 360.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 48.0;
/// Half the width of a 95 % interval in standard errors.
const CONFIDENCE: f64 = 1.96;

/// `text` without anything that HTML would take for markup.
#[must_use]
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Round numbers that divide a range into some five parts.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / 5.0;
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= rough).unwrap_or(rough);
    let first = (low / step).ceil() * step;
    (0..12).map(|i| first + step * f64::from(i)).take_while(|t| *t <= high + 1e-9 * step).collect()
}

fn label(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text.is_empty() || text == "-0" { "0".into() } else { text.into() }
}

/// Range of the data, widened; never empty.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for v in values.filter(|v| v.is_finite()) {
        low = low.min(v);
        high = high.max(v);
    }
    if low > high {
        return [0.0, 1.0];
    }
    let margin = 0.05 * (high - low).max(1e-9 * high.abs()).max(1e-9);
    [low - margin, high + margin]
}

impl Chart {
    /// The chart as a `<figure>`.
    #[must_use]
    pub fn html(&self) -> String {
        let all = || self.series.iter().flat_map(|s| &s.points);
        let [x0, x1] = range(all().map(|p| p.0));
        let with_errors = all().flat_map(|p| {
            let half = CONFIDENCE * p.2.unwrap_or(0.0);
            [p.1 - half, p.1 + half]
        });
        let [y0, y1] = range(with_errors);
        let at = |(x, y): (f64, f64)| {
            (
                LEFT + (x - x0) / (x1 - x0) * (WIDTH - LEFT - RIGHT),
                HEIGHT - BOTTOM - (y - y0) / (y1 - y0) * (HEIGHT - TOP - BOTTOM),
            )
        };
        let mut svg = String::new();
        // Writing to a String cannot fail; `ok` says that this is known.
        for t in ticks(x0, x1) {
            let x = at((t, y0)).0;
            let bottom = HEIGHT - BOTTOM;
            write!(svg, r#"<path class="grid" d="M{x:.1} {TOP}V{bottom}"/><text x="{x:.1}" y="{:.1}" text-anchor="middle">{}</text>"#, bottom + 16.0, label(t)).ok();
        }
        for t in ticks(y0, y1) {
            let y = at((x0, t)).1;
            let right = WIDTH - RIGHT;
            write!(svg, r#"<path class="grid" d="M{LEFT} {y:.1}H{right}"/><text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#, LEFT - 6.0, y + 4.0, label(t)).ok();
        }
        write!(
            svg,
            r#"<text x="{:.0}" y="{:.0}" text-anchor="middle">{}</text>"#,
            0.5 * (LEFT + WIDTH),
            HEIGHT - 10.0,
            escape(self.x)
        )
        .ok();
        write!(
            svg,
            r#"<text transform="translate(16 {:.0})rotate(-90)" text-anchor="middle">{}</text>"#,
            0.5 * (HEIGHT - BOTTOM + TOP),
            escape(self.y)
        )
        .ok();
        for (i, series) in self.series.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            write!(svg, r#"<g class="series" data-series="{i}" fill="{colour}" stroke="{colour}">"#).ok();
            svg += &series.draw(at);
            svg += "</g>";
        }
        let legend: String = self
            .series
            .iter()
            .enumerate()
            .map(|(i, s)| {
                let colour = COLOURS[i % COLOURS.len()];
                format!(r#"<button type="button" data-toggle="{i}"><i style="background:{colour}"></i>{}</button>"#, escape(&s.name))
            })
            .collect();
        format!(
            "<figure><figcaption>{}</figcaption><svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">{svg}</svg>\
             <div class=\"legend\">{legend}</div></figure>\n",
            escape(&self.title),
            escape(&self.title)
        )
    }
}

impl Series {
    fn draw(&self, at: impl Fn((f64, f64)) -> (f64, f64)) -> String {
        let mut svg = String::new();
        let path = |points: &mut dyn Iterator<Item = (f64, f64)>| {
            let mut d = String::new();
            for (i, p) in points.enumerate() {
                let (x, y) = at(p);
                write!(d, "{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" }).ok();
            }
            d
        };
        if self.style == Style::Band {
            let half = |p: &Point| CONFIDENCE * p.2.unwrap_or(0.0);
            let mut outline = self
                .points
                .iter()
                .map(|p| (p.0, p.1 + half(p)))
                .chain(self.points.iter().rev().map(|p| (p.0, p.1 - half(p))));
            write!(svg, r#"<path d="{}Z" fill-opacity=".15" stroke="none"/>"#, path(&mut outline)).ok();
        }
        if self.style != Style::Dots {
            write!(
                svg,
                r#"<path d="{}" fill="none" stroke-width="1.8"/>"#,
                path(&mut self.points.iter().map(|p| (p.0, p.1)))
            )
            .ok();
        }
        for p in &self.points {
            let (x, y) = at((p.0, p.1));
            if !(x.is_finite() && y.is_finite()) {
                continue;
            }
            if let (Style::Dots, Some(se)) = (self.style, p.2) {
                let (low, high) = (at((p.0, p.1 - CONFIDENCE * se)).1, at((p.0, p.1 + CONFIDENCE * se)).1);
                write!(svg, r#"<path d="M{x:.1} {low:.1}V{high:.1}" stroke-width="1"/>"#).ok();
            }
            let radius = if self.style == Style::Dots { 3.2 } else { 1.6 };
            let error = p.2.map_or(String::new(), |se| format!(" +- {}", label(se)));
            let reading = format!("{}: {}, {}{error}", self.name, label(p.0), label(p.1));
            write!(
                svg,
                r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}"><title>{}</title></circle>"#,
                escape(&reading)
            )
            .ok();
        }
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 1.0), [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
        assert_eq!(ticks(950.0, 2890.0), [1000.0, 1500.0, 2000.0, 2500.0]);
    }

    #[test]
    fn names_cannot_break_out_of_the_page_and_odd_data_cannot_break_the_chart() {
        let chart = Chart {
            title: "<script>".into(),
            x: "x",
            y: "y",
            series: vec![Series {
                name: "a\"><blink".into(),
                style: Style::Dots,
                points: vec![(1.0, f64::NAN, None), (2.0, 3.0, Some(0.1)), (2.0, 3.0, None)],
            }],
        };
        let html = chart.html();
        assert!(!html.contains("<script>") && !html.contains("<blink") && !html.contains("NaN"));
        assert_eq!(html.matches("<circle").count(), 2);
    }
}
