//! Configuration of a toothed wheel and its pickup, and the limits derived from it.

use super::super::config::{ConfigError, consistent, integer, number};
use super::super::debounce::{DebounceConfig, DebounceParams};

/// Lost edges tolerated in addition to the reference gap.
const LOST: u8 = 2;
/// Margin above `max_rpm` before an edge counts as too early.
const TOO_SOON: f32 = 1.3;

/// Toothed wheel and its pickup.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PickupConfig {
    /// Pitches per revolution including those of missing reference teeth; 1 to 400.
    pub teeth: u32,
    /// Consecutive missing teeth at a reference mark, 0 to 3.
    pub gap_teeth: u8,
    /// Maximum speed of the shaft, 10 to 20 000 r/min.
    pub max_rpm: f32,
    /// Clock rate of the counter that stamps the edges, 10 kHz to 200 MHz.
    pub counter_hz: u32,
    /// Averaging time of the speed, 1 to 1000 ms; at least one pitch is averaged.
    pub window_ms: u32,
    /// Time without an edge that means standstill, 10 to 5000 ms. The counter must not wrap within it.
    pub zero_ms: u32,
    /// Confirmation and healing of faults, in edges.
    pub debounce: DebounceConfig,
}

/// Checked pickup.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PickupParams {
    /// r/min times counts per pitch.
    pub(super) rpm_counts: f32,
    pub(super) max_rpm: f32,
    pub(super) soonest: u64,
    pub(super) longest_gap: u8,
    pub(super) window: u64,
    pub(super) zero: u64,
    pub(super) counts_per_ms: u32,
    pub(super) debounce: DebounceParams,
}

impl PickupParams {
    /// Checks a pickup's configuration.
    ///
    /// # Errors
    /// The first field out of range or inconsistent.
    pub fn new(config: &PickupConfig) -> Result<Self, ConfigError> {
        integer("teeth", config.teeth, 1, 400)?;
        integer("gap_teeth", u32::from(config.gap_teeth), 0, 3)?;
        consistent(
            "gap_teeth",
            u32::from(config.gap_teeth) * 4 < config.teeth,
            "fewer than a quarter of the teeth may be missing",
        )?;
        number("max_rpm", config.max_rpm, 10.0, 20_000.0)?;
        integer("counter_hz", config.counter_hz, 10_000, 200_000_000)?;
        integer("window_ms", config.window_ms, 1, 1000)?;
        integer("zero_ms", config.zero_ms, 10, 5000)?;
        let counts_per_ms = config.counter_hz / 1000;
        let counts = |ms: u32| u64::from(ms) * u64::from(counts_per_ms);
        let rpm_counts = 60.0 * config.counter_hz as f32 / config.teeth as f32;
        let soonest = rpm_counts / (TOO_SOON * config.max_rpm);
        // At least two counts per pitch, else the stamps cannot resolve the maximum speed.
        number("counter_hz per tooth", soonest, 2.0, f32::MAX)?;
        Ok(Self {
            rpm_counts,
            max_rpm: config.max_rpm,
            soonest: soonest as u64,
            longest_gap: config.gap_teeth + LOST + 1,
            window: counts(config.window_ms),
            zero: counts(config.zero_ms),
            counts_per_ms,
            debounce: DebounceParams::new(&config.debounce)?,
        })
    }

    /// Counts of the timer per millisecond.
    #[must_use]
    pub const fn counts_per_ms(&self) -> u32 {
        self.counts_per_ms
    }
}
