//! Curves thinned to what a picture can show: in each column of its pixels the lowest and the highest point.
//!
//! A spike of one sample therefore stays, which every tenth sample would most often lose. Where a curve was interrupted it
//! stays interrupted, unless the interruption is narrower than a column. Memory is bounded however long the curve is.

/// A curve in columns. Abscissae must not fall.
#[derive(Debug, Clone)]
pub struct Columns {
    start: Option<f64>,
    width: f64,
    most: usize,
    grows: bool,
    cells: Vec<Option<Cell>>,
    interrupted: bool,
}

/// What a column holds.
#[derive(Debug, Clone, Copy)]
struct Cell {
    low: (f64, f64),
    high: (f64, f64),
    /// Not joined to the column before.
    begins: bool,
}

impl Cell {
    /// Both as one; `self` is the left one.
    fn with(self, right: Self) -> Self {
        Self {
            low: if right.low.1 < self.low.1 { right.low } else { self.low },
            high: if right.high.1 > self.high.1 { right.high } else { self.high },
            begins: self.begins,
        }
    }
}

impl Columns {
    /// Columns of a curve whose end is not known yet: `finest` wide at first, and twice as wide whenever there would be more
    /// than `most` of them. In the end at least half as many span the curve.
    #[must_use]
    pub fn growing(finest: f64, most: usize) -> Self {
        Self { start: None, width: finest, most: most.max(2), grows: true, cells: vec![], interrupted: true }
    }

    /// So many columns from `start` to `end`.
    #[must_use]
    pub fn over(start: f64, end: f64, count: usize) -> Self {
        let width = (end - start) / count.max(1) as f64;
        Self { start: Some(start), width, most: count.max(1), grows: false, cells: vec![], interrupted: true }
    }

    /// Adds a point; one that is not finite interrupts the curve.
    pub fn add(&mut self, x: f64, y: f64) {
        if !(x.is_finite() && y.is_finite()) {
            self.interrupt();
            return;
        }
        let start = *self.start.get_or_insert(x);
        let column = |width: f64| if width > 0.0 { ((x - start) / width) as usize } else { 0 };
        while self.grows && column(self.width) >= self.most {
            self.halve();
        }
        let index = column(self.width).min(self.most - 1);
        if self.cells.len() <= index {
            self.cells.resize(index + 1, None);
        }
        let cell = Cell { low: (x, y), high: (x, y), begins: self.interrupted };
        if let Some(place) = self.cells.get_mut(index) {
            *place = Some(place.map_or(cell, |left| left.with(cell)));
        }
        self.interrupted = false;
    }

    /// The next point is not joined to the last one.
    pub fn interrupt(&mut self) {
        self.interrupted = true;
    }

    /// Whether it has no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// The stretches of the curve: one point for each column, or two that are at least `least` apart (the height of a pixel; 0
    /// for whatever there is).
    #[must_use]
    pub fn stretches(&self, least: f64) -> Vec<Vec<(f64, f64)>> {
        let mut stretches: Vec<Vec<(f64, f64)>> = Vec::new();
        for cell in self.cells.iter().flatten() {
            if cell.begins || stretches.is_empty() {
                stretches.push(Vec::new());
            }
            let Some(stretch) = stretches.last_mut() else { continue };
            let (first, last) =
                if cell.low.0 <= cell.high.0 { (cell.low, cell.high) } else { (cell.high, cell.low) };
            stretch.push(first);
            if last != first && (last.1 - first.1).abs() >= least {
                stretch.push(last);
            }
        }
        stretches
    }

    /// The same in fewer columns.
    #[must_use]
    pub fn thinned(&self, start: f64, end: f64, count: usize) -> Self {
        let mut thinned = Self::over(start, end, count);
        for stretch in self.stretches(0.0) {
            thinned.interrupt();
            for (x, y) in stretch {
                thinned.add(x, y);
            }
        }
        thinned
    }

    /// Two columns each become one.
    fn halve(&mut self) {
        self.width *= 2.0;
        self.cells =
            self.cells.chunks(2).map(|pair| pair.iter().flatten().copied().reduce(Cell::with)).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST: usize = 100;

    fn of(points: impl Iterator<Item = (f64, f64)>) -> Columns {
        let mut columns = Columns::growing(0.01, MOST);
        points.for_each(|(x, y)| columns.add(x, y));
        columns
    }

    #[test]
    fn prop_a_spike_of_one_sample_stays_wherever_it_is_and_however_long_the_curve() {
        for length in [10_u32, 99, 1000, 12_345] {
            for at in (0..length).step_by(1 + length as usize / 50) {
                let columns = of((0..length).map(|i| {
                    let up = if i == at { 5.0 } else { 0.0 };
                    let down = if i + 1 == length - at { 3.0 } else { 0.0 };
                    (0.01 * f64::from(i), up - down)
                }));
                for got in [columns.clone(), columns.thinned(0.0, 0.01 * f64::from(length), MOST / 2)] {
                    let stretches = got.stretches(0.0);
                    assert_eq!(stretches.len(), 1);
                    assert!(stretches[0].len() <= 2 * MOST, "{}", stretches[0].len());
                    assert!(stretches[0].is_sorted_by(|a, b| a.0 < b.0));
                    let highest = stretches[0].iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
                    let lowest = stretches[0].iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
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
        let mut columns = Columns::over(0.0, 89.0, 90);
        points.iter().for_each(|(x, y)| columns.add(*x, *y));
        // Both ends among them.
        assert_eq!(columns.stretches(0.0), [points]);
    }

    #[test]
    fn what_is_within_the_height_of_a_pixel_is_one_point_and_what_is_not_is_two() {
        let mut columns = Columns::over(0.0, 10.0, 10);
        // In each column a pair; the difference grows from column to column.
        for i in 0..10_i32 {
            columns.add(f64::from(i) + 0.2, 0.0);
            columns.add(f64::from(i) + 0.7, 0.1 * f64::from(i + 1));
        }
        assert_eq!(columns.stretches(0.45)[0].len(), 4 + 2 * 6);
        assert_eq!(columns.stretches(0.0)[0].len(), 20);
    }

    #[test]
    fn an_interruption_stays_unless_it_is_narrower_than_a_column_and_a_point_alone_is_a_stretch() {
        let mut columns = Columns::growing(1.0, MOST);
        for i in 0..1000 {
            match i {
                300..500 => columns.interrupt(),
                // Columns are 16 wide at the end: within one of them.
                706..708 => columns.add(f64::from(i), f64::NAN),
                _ => columns.add(f64::from(i), 1.0),
            }
        }
        columns.interrupt();
        columns.add(1100.0, 1.0);
        let ends: Vec<(f64, f64)> =
            columns.stretches(0.0).iter().map(|s| (s[0].0, s[s.len() - 1].0)).collect();
        let [(a, b), (c, d), (e, f)] = ends[..] else { panic!("{ends:?}") };
        assert!(a == 0.0 && (284.0..300.0).contains(&b) && (500.0..516.0).contains(&c), "{ends:?}");
        assert!((984.0..1000.0).contains(&d) && (e, f) == (1100.0, 1100.0), "{ends:?}");
    }

    #[test]
    fn odd_points_are_taken_without_harm() {
        let mut columns = Columns::over(0.0, 0.0, 0);
        assert!(columns.is_empty() && columns.stretches(0.0).is_empty());
        for x in [0.0, -1.0, 1e300, f64::INFINITY, f64::NAN] {
            columns.add(x, 1.0);
        }
        assert_eq!(columns.stretches(0.0).len(), 1);
        // A clock that was set: columns as wide as it takes, in a bounded time.
        let jump = of([(0.0, 1.0), (0.01, 2.0), (1e18, 3.0)].into_iter());
        assert_eq!(jump.stretches(0.0).concat().len(), 3);
    }
}
