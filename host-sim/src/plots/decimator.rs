//! Min-max decimation: of each pixel column of a curve, the lowest and the highest point.
//!
//! A spike of one sample therefore remains visible, which every tenth sample would most often lose. Where a curve is
//! interrupted it stays interrupted, unless the interruption is narrower than a column. Memory is bounded however long the
//! curve is.

/// A curve decimated in columns of equal width. Abscissae must not fall.
#[doc(alias = "downsampling")]
#[derive(Debug, Clone)]
pub struct MinMaxDecimator {
    start: Option<f64>,
    column_width: f64,
    max_columns: usize,
    grows: bool,
    columns: Vec<Option<PixelColumn>>,
    interrupted: bool,
}

/// Extremes of the points in one column.
#[derive(Debug, Clone, Copy)]
struct PixelColumn {
    low: (f64, f64),
    high: (f64, f64),
    /// Whether a new segment begins here.
    begins: bool,
}

impl PixelColumn {
    /// Extremes of this column and the one to its right.
    fn merge(self, right: Self) -> Self {
        Self {
            low: if right.low.1 < self.low.1 { right.low } else { self.low },
            high: if right.high.1 > self.high.1 { right.high } else { self.high },
            begins: self.begins,
        }
    }
}

impl MinMaxDecimator {
    /// Decimator of a curve whose end is not known yet: columns of `finest_width` at first, and twice as wide whenever there
    /// would be more than `max_columns` of them. In the end at least half as many span the curve.
    #[must_use]
    pub fn growing(finest_width: f64, max_columns: usize) -> Self {
        Self {
            start: None,
            column_width: finest_width,
            max_columns: max_columns.max(2),
            grows: true,
            columns: vec![],
            interrupted: true,
        }
    }

    /// Decimator of `count` columns from `start` to `end`.
    #[must_use]
    pub fn over(start: f64, end: f64, count: usize) -> Self {
        let max_columns = count.max(1);
        Self {
            start: Some(start),
            column_width: (end - start) / max_columns as f64,
            max_columns,
            grows: false,
            columns: vec![],
            interrupted: true,
        }
    }

    /// Adds a point; one that is not finite interrupts the curve.
    pub fn push(&mut self, x: f64, y: f64) {
        if !(x.is_finite() && y.is_finite()) {
            self.interrupt();
            return;
        }
        let start = *self.start.get_or_insert(x);
        let column_at = |width: f64| if width > 0.0 { ((x - start) / width) as usize } else { 0 };
        while self.grows && column_at(self.column_width) >= self.max_columns {
            self.halve();
        }
        let index = column_at(self.column_width).min(self.max_columns - 1);
        if self.columns.len() <= index {
            self.columns.resize(index + 1, None);
        }
        let point = PixelColumn { low: (x, y), high: (x, y), begins: self.interrupted };
        if let Some(column) = self.columns.get_mut(index) {
            *column = Some(column.map_or(point, |left| left.merge(point)));
        }
        self.interrupted = false;
    }

    /// Interrupts the curve: the next point is not joined to the last one.
    pub fn interrupt(&mut self) {
        self.interrupted = true;
    }

    /// Whether it holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Segments of the curve: of each column one point, or two where they are at least `min_height` apart (the height of a
    /// pixel, or 0 for all).
    #[must_use]
    pub fn segments(&self, min_height: f64) -> Vec<Vec<(f64, f64)>> {
        let mut segments: Vec<Vec<(f64, f64)>> = Vec::new();
        for column in self.columns.iter().flatten() {
            if column.begins || segments.is_empty() {
                segments.push(Vec::new());
            }
            let Some(segment) = segments.last_mut() else { continue };
            let (first, last) = if column.low.0 <= column.high.0 {
                (column.low, column.high)
            } else {
                (column.high, column.low)
            };
            segment.push(first);
            if last != first && (last.1 - first.1).abs() >= min_height {
                segment.push(last);
            }
        }
        segments
    }

    /// All points it holds, with a point that is not finite after each segment.
    #[must_use]
    pub fn points(&self) -> Vec<(f64, f64)> {
        self.segments(0.0)
            .into_iter()
            .flat_map(|segment| segment.into_iter().chain([(f64::NAN, f64::NAN)]))
            .collect()
    }

    /// Merges columns in pairs.
    fn halve(&mut self) {
        self.column_width *= 2.0;
        self.columns = self
            .columns
            .chunks(2)
            .map(|pair| pair.iter().flatten().copied().reduce(PixelColumn::merge))
            .collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAX_COLUMNS: usize = 100;

    fn of(points: impl Iterator<Item = (f64, f64)>) -> MinMaxDecimator {
        let mut decimator = MinMaxDecimator::growing(0.01, MAX_COLUMNS);
        points.for_each(|(x, y)| decimator.push(x, y));
        decimator
    }

    #[test]
    fn prop_a_spike_of_one_sample_stays_wherever_it_is_and_however_long_the_curve() {
        for length in [10_u32, 99, 1000, 12_345] {
            for at in (0..length).step_by(1 + length as usize / 50) {
                let decimator = of((0..length).map(|i| {
                    let up = if i == at { 5.0 } else { 0.0 };
                    let down = if i + 1 == length - at { 3.0 } else { 0.0 };
                    (0.01 * f64::from(i), up - down)
                }));
                let mut coarser = MinMaxDecimator::over(0.0, 0.01 * f64::from(length), MAX_COLUMNS / 2);
                decimator.points().into_iter().for_each(|(x, y)| coarser.push(x, y));
                for got in [decimator, coarser] {
                    let segments = got.segments(0.0);
                    assert_eq!(segments.len(), 1);
                    assert!(segments[0].len() <= 2 * MAX_COLUMNS, "{}", segments[0].len());
                    assert!(segments[0].is_sorted_by(|a, b| a.0 < b.0));
                    let highest = segments[0].iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
                    let lowest = segments[0].iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
                    // The middle sample of an odd number has both.
                    let both = 2 * at + 1 == length;
                    assert_eq!(highest, (0.01 * f64::from(at), if both { 2.0 } else { 5.0 }));
                    assert!(both || lowest == (0.01 * f64::from(length - 1 - at), -3.0), "{lowest:?}");
                }
            }
        }
    }

    #[test]
    fn a_curve_of_no_more_points_than_columns_stays_as_it_is() {
        let points: Vec<(f64, f64)> = (0..90_i32).map(|i| (f64::from(i), f64::from(i * i % 17))).collect();
        let mut decimator = MinMaxDecimator::over(0.0, 89.0, 90);
        points.iter().for_each(|(x, y)| decimator.push(*x, *y));
        // Both ends among them.
        assert_eq!(decimator.segments(0.0), [points]);
    }

    #[test]
    fn points_within_the_height_of_a_pixel_are_one_and_others_two() {
        let mut decimator = MinMaxDecimator::over(0.0, 10.0, 10);
        // In each column a pair; the difference grows from column to column.
        for i in 0..10_i32 {
            decimator.push(f64::from(i) + 0.2, 0.0);
            decimator.push(f64::from(i) + 0.7, 0.1 * f64::from(i + 1));
        }
        assert_eq!(decimator.segments(0.45)[0].len(), 4 + 2 * 6);
        assert_eq!(decimator.segments(0.0)[0].len(), 20);
    }

    #[test]
    fn an_interruption_stays_unless_it_is_narrower_than_a_column_and_a_point_alone_is_a_segment() {
        let mut decimator = MinMaxDecimator::growing(1.0, MAX_COLUMNS);
        for i in 0..1000 {
            match i {
                300..500 => decimator.interrupt(),
                // Columns are 16 wide at the end: within one of them.
                706..708 => decimator.push(f64::from(i), f64::NAN),
                _ => decimator.push(f64::from(i), 1.0),
            }
        }
        decimator.interrupt();
        decimator.push(1100.0, 1.0);
        let ends: Vec<(f64, f64)> =
            decimator.segments(0.0).iter().map(|s| (s[0].0, s[s.len() - 1].0)).collect();
        let [(a, b), (c, d), (e, f)] = ends[..] else { panic!("{ends:?}") };
        assert!(a == 0.0 && (284.0..300.0).contains(&b) && (500.0..516.0).contains(&c), "{ends:?}");
        assert!((984.0..1000.0).contains(&d) && (e, f) == (1100.0, 1100.0), "{ends:?}");
    }

    #[test]
    fn odd_points_do_no_harm() {
        let mut decimator = MinMaxDecimator::over(0.0, 0.0, 0);
        assert!(decimator.is_empty() && decimator.segments(0.0).is_empty());
        for x in [0.0, -1.0, 1e300, f64::INFINITY, f64::NAN] {
            decimator.push(x, 1.0);
        }
        assert_eq!(decimator.segments(0.0).len(), 1);
        // A clock that was set: columns as wide as needed, in a bounded time.
        let jump = of([(0.0, 1.0), (0.01, 2.0), (1e18, 3.0)].into_iter());
        assert_eq!(jump.segments(0.0).concat().len(), 3);
    }
}
