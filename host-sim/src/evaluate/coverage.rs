//! Coverage of confidence intervals: by time since the start, and by region of the envelope.
//!
//! A drive is one draw of the systematic errors, which dominate, so samples of one drive are not independent. Coverage is the
//! mean over drives, and its standard error that of their scatter.

use serde::Serialize;

/// Ends of the time windows, in hours; the first begins at the start.
pub const WINDOW_ENDS_H: [f64; 3] = [0.25, 1.5, f64::INFINITY];
/// Bounds between the thirds of the visited range, as fractions of the law's largest speed, pressure and temperature.
const THIRDS: [[f64; 2]; 3] = [[0.59, 0.78], [0.447, 0.673], [0.62, 0.8]];
/// Names of the dimensions of [`CoverageCounts::by_region`].
pub const DIMENSIONS: [&str; 3] = ["speed", "pressure", "temperature"];

/// Samples of an interval in one drive, and those in which it held the true value.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct HitCount {
    /// Samples of the interval.
    pub looks: u32,
    /// Samples that held the true value.
    pub hits: u32,
}

impl HitCount {
    fn push(&mut self, hit: bool) {
        self.looks += 1;
        self.hits += u32::from(hit);
    }
}

/// Counts of one quantity's 95 % interval in one drive.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct CoverageCounts {
    /// By time since the start, see [`WINDOW_ENDS_H`].
    pub by_time: [HitCount; 3],
    /// By lower, middle and upper third of speed, pressure and temperature.
    pub by_region: [[HitCount; 3]; 3],
}

impl CoverageCounts {
    /// Counts one sample at `time_h` and a normalised operating point.
    pub fn push(&mut self, time_h: f64, point: [f64; 3], hit: bool) {
        for (tally, end_h) in self.by_time.iter_mut().zip(WINDOW_ENDS_H) {
            if time_h <= end_h {
                tally.push(hit);
                break;
            }
        }
        for ((tallies, value), [low, high]) in self.by_region.iter_mut().zip(point).zip(THIRDS) {
            let third = usize::from(value > low) + usize::from(value > high);
            if let Some(tally) = tallies.get_mut(third) {
                tally.push(hit);
            }
        }
    }

    /// Counts of the first hour and a half, the first two windows.
    #[must_use]
    pub fn early(&self) -> HitCount {
        let [first, second, _] = self.by_time;
        HitCount { looks: first.looks + second.looks, hits: first.hits + second.hits }
    }

    /// Counts of the last window.
    #[must_use]
    pub fn late(&self) -> HitCount {
        self.by_time[2]
    }

    /// Counts of all windows.
    #[must_use]
    pub fn all(&self) -> HitCount {
        let (early, late) = (self.early(), self.late());
        HitCount { looks: early.looks + late.looks, hits: early.hits + late.hits }
    }
}

/// Coverage over drives, with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CoverageShare {
    /// Fraction of samples whose interval held the true value.
    pub share: f64,
    /// Standard error of the fraction, from the scatter of the drives.
    pub share_se: f64,
}

impl CoverageShare {
    /// Coverage over the drives that have samples.
    #[must_use]
    pub fn over(drives: impl Iterator<Item = HitCount>) -> Self {
        let shares: Vec<f64> =
            drives.filter(|t| t.looks > 0).map(|t| f64::from(t.hits) / f64::from(t.looks)).collect();
        let count = shares.len() as f64;
        let share = shares.iter().sum::<f64>() / count;
        let scatter2 = shares.iter().map(|s| (s - share).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
        Self { share, share_se: (scatter2 / count).sqrt() }
    }
}
