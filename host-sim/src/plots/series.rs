//! Series of a chart: named points and how they are marked.

/// Half width of a 95 % confidence interval, in standard errors.
const CONFIDENCE: f64 = 1.96;

/// Marks by which a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marks {
    /// Points joined by a line.
    Line,
    /// Single points, with error bars where they have a standard error.
    Dots,
    /// A line within its 95 % confidence band.
    Band,
}

/// A data point, with its standard error where it has one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DataPoint {
    /// Abscissa.
    pub x: f64,
    /// Ordinate.
    pub y: f64,
    /// Standard error of the ordinate.
    pub standard_error: Option<f64>,
}

impl DataPoint {
    /// A point with a standard error.
    #[must_use]
    pub const fn with_error(x: f64, y: f64, standard_error: f64) -> Self {
        Self { x, y, standard_error: Some(standard_error) }
    }

    /// Bounds of the 95 % confidence interval.
    #[must_use]
    pub fn interval(&self) -> [f64; 2] {
        let half = CONFIDENCE * self.standard_error.unwrap_or(0.0);
        [self.y - half, self.y + half]
    }

    /// Whether the point can be drawn.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.x.is_finite() && self.interval().into_iter().all(f64::is_finite)
    }
}

impl From<(f64, f64)> for DataPoint {
    fn from((x, y): (f64, f64)) -> Self {
        Self { x, y, standard_error: None }
    }
}

/// One series. A point that is not finite interrupts a line.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Marks.
    pub marks: Marks,
    /// Points; those of a long line in the order of their abscissae.
    pub points: Vec<DataPoint>,
}

impl Series {
    /// A series of points.
    #[must_use]
    pub fn new<P: Into<DataPoint>>(
        name: impl Into<String>,
        marks: Marks,
        points: impl IntoIterator<Item = P>,
    ) -> Self {
        Self { name: name.into(), marks, points: points.into_iter().map(Into::into).collect() }
    }

    /// A line through points.
    #[must_use]
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name, Marks::Line, points)
    }

    /// The points that can be drawn.
    pub(super) fn finite(&self) -> impl DoubleEndedIterator<Item = &DataPoint> {
        self.points.iter().filter(|point| point.is_finite())
    }
}
