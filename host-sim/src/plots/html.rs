//! Figures of an HTML page: a chart as inline SVG with interactive read-out.
//!
//! The drawing is the same as in a file, each series in a group of its own. The page's script adds a reading under the
//! pointer and switches series by the buttons of the legend. Every text is escaped, since names come from files.

use std::error::Error;
use std::fmt::Write;

use kou_records::InputError;
use plotters::prelude::*;

use super::chart::Chart;
use super::render::{Area, Axes, Renderer, colour};

/// Size of a figure in its own units.
const SIZE: (u32, u32) = (560, 360);
/// Pixels to a unit: a browser and a printer show more than one.
const PIXELS: u32 = 2;

/// Escapes what HTML would take for markup.
#[must_use]
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A chart as a `<figure>`.
///
/// # Errors
/// When the chart cannot be drawn.
pub fn figure(chart: &Chart) -> Result<String, InputError> {
    let svg = svg(chart)
        .map_err(|e| InputError::new(format!("the chart `{}` cannot be drawn: {e}", chart.title)))?;
    let legend: String = chart
        .series
        .iter()
        .enumerate()
        .map(|(number, series)| {
            let name = escape(&series.name);
            let RGBColor(r, g, b) = colour(number);
            format!(
                r#"<button type="button" data-toggle="{number}"><i style="background:rgb({r},{g},{b})"></i>{name}</button>"#
            )
        })
        .collect();
    let (title, (width, height)) = (escape(&chart.title), (SIZE.0 * PIXELS, SIZE.1 * PIXELS));
    Ok(format!(
        "<figure><figcaption>{title}</figcaption><svg viewBox=\"0 0 {width} {height}\" role=\"img\" \
         aria-label=\"{title}\">{svg}</svg><div class=\"legend\">{legend}</div></figure>\n"
    ))
}

/// The drawing: grid, then a group for each series with invisible circles that carry the readings.
fn svg(chart: &Chart) -> Result<String, Box<dyn Error>> {
    let renderer = Renderer::new(chart, PIXELS);
    let mut svg = layer(&renderer, |axes| renderer.draw_grid(axes))?;
    for (number, series) in chart.series.iter().enumerate() {
        let mut readings = String::new();
        let drawn = layer(&renderer, |axes| {
            for point in series.finite() {
                let (x, y) = axes.backend_coord(&(point.x, point.y));
                let error = point.standard_error.map_or(String::new(), |se| format!(" +- {}", decimal(se)));
                let reading = format!("{}: {}, {}{error}", series.name, decimal(point.x), decimal(point.y));
                write!(
                    readings,
                    r#"<circle class="reading" cx="{x}" cy="{y}" r="{}"><title>{}</title></circle>"#,
                    6 * PIXELS,
                    escape(&reading)
                )?;
            }
            renderer.draw_series(axes, number)
        })?;
        write!(svg, r#"<g class="series" data-series="{number}">{drawn}{readings}</g>"#)?;
    }
    Ok(svg)
}

/// Drawing of `draw` on the axes, without the enclosing `<svg>`.
fn layer(
    renderer: &Renderer<'_>,
    draw: impl FnOnce(&mut Axes<'_, '_>) -> Result<(), Box<dyn Error>>,
) -> Result<String, Box<dyn Error>> {
    let mut document = String::new();
    {
        let root: Area<'_> =
            SVGBackend::with_string(&mut document, (SIZE.0 * PIXELS, SIZE.1 * PIXELS)).into_drawing_area();
        let mut axes = renderer.axes(&root)?;
        draw(&mut axes)?;
        root.present()?;
    }
    let inner = document.split_once('>').and_then(|(_, rest)| rest.rsplit_once("</svg>"));
    Ok(inner.map_or("", |(inner, _)| inner.trim()).to_owned())
}

/// A number with six decimal places at most.
fn decimal(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text.is_empty() || text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::super::series::{DataPoint, Marks, Series};
    use super::*;

    #[test]
    fn names_cannot_break_out_of_the_page_and_odd_data_cannot_break_the_chart() {
        let points = [
            DataPoint::from((1.0, f64::NAN)),
            DataPoint::with_error(2.0, 3.0, 0.1),
            DataPoint::from((2.0, 3.0)),
        ];
        let series = vec![Series::new("a\"><blink", Marks::Dots, points)];
        let html = figure(&Chart::new("<script>", "<i>", "y", series)).unwrap();
        for wrong in ["<script>", "<blink", "<i>", "NaN"] {
            assert!(!html.contains(wrong), "{wrong}");
        }
        assert_eq!(html.matches(r#"<circle class="reading""#).count(), 2);
    }

    #[test]
    fn numbers_have_no_idle_zeros() {
        assert_eq!([0.0, -0.0, 12.5, -1e-9, 100.0].map(decimal), ["0", "0", "12.5", "0", "100"]);
    }
}
