//! Tuning constants of health monitoring: every number that is a judgement and not a law of nature.
//!
//! Each states its unit, its source and its sensitivity: what halving or doubling it changes, where that follows from
//! the equations or was measured (`docs/health/theory.md`). What a calibration engineer sets is in
//! [`crate::calibration::HealthConfig`]; a *decision* is a plateau of `misfit_blocks` blocks that share one misfit of
//! the law.

// Averaging

/// Longest gap between two samples of one block, in blocks.
///
/// Source: chosen; blocks on either side of a longer gap say nothing about each other's steadiness. Sensitivity: not
/// measured; twice the value admits samples twice as far apart to one mean.
pub(super) const MAX_GAP_BLOCKS: u64 = 4;

// Steady-state detection: R-statistic and the floors of the gate

/// Weight of a new value in the moving average of the R-statistic, `lambda_1`; no unit.
///
/// Source: chosen for blocks of half a second; the method is that of Cao and Rhinehart 1995. Sensitivity: a ramp lags
/// by `1/lambda_1` values, so half the value doubles what a ramp contributes.
pub(super) const AVERAGE_WEIGHT: f32 = 0.3;

/// Weight of a new squared distance from the moving average, `lambda_2`; no unit.
///
/// Source: as [`AVERAGE_WEIGHT`]. Sensitivity: half the value roughly doubles the number of blocks (seven) for which
/// the gate stays closed after a jump.
pub(super) const DISTANCE_WEIGHT: f32 = 0.2;

/// Weight of a new squared difference of successive values, `lambda_3`; no unit.
///
/// Source: as [`AVERAGE_WEIGHT`]. Sensitivity: half the value smooths the noise estimate over twice as many blocks; its
/// effect on false alarms was not measured.
pub(super) const DIFFERENCE_WEIGHT: f32 = 0.2;

/// Largest ratio `R` that counts as steady; no unit.
///
/// Source: noise alone exceeds it in about 2 % of values with the weights above (unit test
/// `noise_alone_is_steady_and_a_ramp_is_not`). Sensitivity: a lower value closes the gate on noise, a higher one admits
/// slow ramps.
pub(super) const R_CRITICAL: f32 = 2.5;

/// Change between two values that restarts the filter, in floors.
///
/// Source: chosen above what noise does; the square of a larger change would keep the gate closed for half a minute.
/// Sensitivity: not measured.
pub(super) const JUMP_FLOORS: f32 = 4.0;

/// Deviation from which a restarted filter decays, in floors.
///
/// Source: with [`DISTANCE_WEIGHT`] the gate opens after `ln(RESTART_FLOORS^2)/-ln(1 - 0.2)`, that is seven values.
/// Sensitivity: half the value opens it with the next value, twice the value after thirteen.
pub(super) const RESTART_FLOORS: f32 = 2.0;

/// Root mean square deviation of pump speed that counts as steady, relative.
///
/// Source: changes Kou by less than a per cent (`docs/health/theory.md`). Sensitivity: twice the value admits twice the error
/// of a block's balance.
pub(super) const SPEED_FLOOR: f32 = 0.005;

/// Root mean square deviation of pressure that counts as steady, in MPa.
///
/// Source: within a block of 0.5 s it is a compression flow of some 0.05 L/min per litre of line against a leakage of
/// 28 L/min. Sensitivity: in proportion.
pub(super) const PRESSURE_FLOOR_MPA: f32 = 0.4;

/// Root mean square deviation of the displacement fraction that counts as steady; no unit.
///
/// Source: changes Kou by less than a per cent (`docs/health/theory.md`). Sensitivity: in proportion.
pub(super) const DISPLACEMENT_FLOOR: f32 = 0.003;

/// Root mean square deviation of the ratio residual that counts as steady; no unit.
///
/// Source: changes Kou by less than a per cent (`docs/health/theory.md`). Sensitivity: in proportion.
pub(super) const RATIO_RESIDUAL_FLOOR: f32 = 0.004;

// Recursive estimation of level, ratio offset and slopes

/// Standard deviation of the level before anything was learned; no unit (leakage over the law's).
///
/// Source: the machine may have worn since it was calibrated; the intervals of machines worn by 0.3 (1 sigma) hold
/// (`host-sim evaluate`, 1000 trials: 97.6 % in the first quarter of an hour, 94.8 % later). Sensitivity: not
/// measured.
pub(super) const LEVEL_SD_START: f32 = 0.3;

/// Largest variance of the level; no unit.
///
/// Source: [`LEVEL_SD_START`] squared: what is known right after a step. Sensitivity: as that of [`LEVEL_SD_START`].
pub(super) const LEVEL_VARIANCE_MAX: f32 = 0.09;

/// Smallest variance of the ratio offset at the start; no unit.
///
/// Source: sensors that are declared perfect are good to 0.01 %. Sensitivity: none where `sensor_errors.ratio_relative`
/// is above 0.01 %.
pub(super) const OFFSET_VARIANCE_MIN: f32 = 1e-8;

/// Standard deviation of the slopes of the level with normalised pressure and temperature at the start; no unit.
///
/// Source: chosen; wider than what `host-sim evaluate` draws. Sensitivity: it is what makes the intervals of the first
/// quarter of an hour too long (97.6 % instead of 95 %); halving it was not measured.
pub(super) const SLOPE_SD: f32 = 0.15;

/// Bounds of level less 1, ratio offset and both slopes; no unit.
///
/// Source: level: a twentieth to 21 times the law's leakage; ratio offset: 5 %, above which a speed sensor is broken;
/// slopes: four [`SLOPE_SD`]. Sensitivity: none within them.
pub(super) const PARAMETER_BOUNDS: [(f32, f32); 4] = [(-0.95, 20.0), (-0.05, 0.05), (-0.6, 0.6), (-0.6, 0.6)];

/// Normalised pressure and temperature at which the slopes contribute nothing; no unit.
///
/// Source: the middle of where machines work, so that level and slopes are nearly uncorrelated. Sensitivity: a shift
/// moves the point at which the level is stated; not measured.
pub(super) const SLOPE_PIVOTS: [f32; 2] = [0.55, 0.7];

/// Smallest element of `D` of the UD factors, which bounds every variance from below; square of a parameter's unit.
///
/// Source: keeps the gain positive in f32 however long the filter runs (unit test
/// `variances_stay_above_their_bound_however_much_is_learned`); a standard deviation of 1e-5. Sensitivity: none within
/// orders of magnitude.
pub(super) const D_MIN: f32 = 1e-10;

/// Variance added to that of a block's noise, so that it is positive with perfect sensors and a perfect law; no unit.
///
/// Source: a ratio error of 1e-6, far below any sensor's. Sensitivity: none.
pub(super) const NOISE_VARIANCE_MIN: f32 = 1e-12;

/// Variance by which the level is forgotten with each block in the first half of the hold-off after a change; no unit.
///
/// Source: the level then follows within some eight blocks, since it may still grow. Sensitivity: half the value takes
/// `sqrt(2)` times as many blocks.
pub(super) const HOLDOFF_VARIANCE: f32 = 1e-4;

/// Longest time without a used block that counts as driving, in microseconds.
///
/// Source: a day; a clock that jumped is not a day of wear. Sensitivity: bounds the forgetting after a pause; none in
/// continuous driving.
pub(super) const MAX_PAUSE_US: u64 = 24 * 3_600_000_000;

/// Share of the law's misfit that no driving averages out; no unit.
///
/// Source: `1/sqrt(3)`: a smooth misfit has some three independent values over the envelope. Sensitivity: a part of the
/// level's standard error in proportion; with this value 94.8 % of levels lie within their 95 % intervals
/// (`host-sim evaluate`, 1000 trials).
pub(super) const MISFIT_SHARE: f32 = 0.58;

// Change detection: hold-off

/// Hold-off after the start before changes are tested, in decisions.
///
/// Source: chosen; besides, the hold-off lasts until the level is learned to [`LEARNED_SD`]. Sensitivity: not measured;
/// a fault in this time becomes part of the reference.
pub(super) const START_HOLDOFF_DECISIONS: f32 = 7.0;

/// Hold-off after a change, and number of decisions from which its causes are isolated.
///
/// Source: some five minutes of driving (240 blocks with the default configuration): fewer operating points do not
/// distinguish a slope from a misfit. Sensitivity: a second change in this time is not detected; half of it was not
/// measured.
pub(super) const DIAGNOSIS_DECISIONS: f32 = 16.0;

/// Standard error of the watched residual below which changes are tested; no unit (units of level).
///
/// Source: chosen: well below the smallest `report_change` of 5 %. Sensitivity: not measured; half the value prolongs
/// the hold-off after the start.
pub(super) const LEARNED_SD: f32 = 0.02;

// Change detection: steps by the cumulative sum

/// Change for which the cumulative sum is optimal, in multiples of `report_change`.
///
/// Source: a sum of log-likelihood ratios against a change of `mu` rises only above `mu/2`, so 2 makes it rise only
/// above the change worth a report (Page 1954). Sensitivity: with 1 it would rise from half of that change on.
pub(super) const DESIGN_CHANGES: f32 = 2.0;

/// Allowance for the uncertainty of the learned parameters, in their standard errors.
///
/// Source: two-sided 95 %. Sensitivity: not measured; matters only while the parameters are still being learned.
pub(super) const LEARNED_SIGMAS: f32 = 2.0;

/// Smallest threshold of the cumulative sum, as a log-likelihood ratio.
///
/// Source: `e^3`, below which single plateaus would decide. Sensitivity: none for false-alarm intervals above `e^3/2`
/// decisions, about a minute.
pub(super) const CUSUM_LIMIT_MIN: f32 = 3.0;

/// Largest contribution of one plateau to the cumulative sum, in thresholds.
///
/// Source: half of the blocks of a plateau must agree before a step is reported. Sensitivity: with 1 every block must
/// agree, with 4 a quarter.
pub(super) const PLATEAU_LIMITS: f32 = 2.0;

/// Smallest number of blocks among which [`PLATEAU_LIMITS`] is divided.
///
/// Source: with fewer blocks per plateau (slow logs) two blocks must agree. Sensitivity: none for `misfit_blocks` above
/// 4.
pub(super) const PLATEAU_BLOCKS_MIN: f32 = 4.0;

// Change detection: drifts

/// Blocks over which the reference of the drift detector is averaged.
///
/// Source: some half an hour of used blocks of 0.5 s, that is some two hours of driving. Sensitivity: a drift in this
/// time becomes part of the reference; not measured.
pub(super) const REFERENCE_BLOCKS: u16 = 4000;

/// Weight of a block in the slow mean that is compared with the reference; no unit.
///
/// Source: a lag of 200 blocks, small against hours of drift. Sensitivity: doubles or halves the lag.
pub(super) const SLOW_WEIGHT: f32 = 1.0 / 200.0;

/// Weight of a block in the reference regressor, once the first block has been included; no unit.
///
/// Source: a mean over some 64 blocks of the hold-off after the start. Sensitivity: not measured; a regressor that
/// moved with the load instead gave 16 false reports in 5000 h.
pub(super) const REGRESSOR_WEIGHT: f32 = 1.0 / 64.0;

/// Standard errors by which the slow mean must have left the reference, besides the change worth a report.
///
/// Source: two-sided 95 %; no false change in 1000 h (`host-sim evaluate --hours 1000 --runs 100 --seed 5`), drifts of
/// 1 % per hour reported at a median of 6.0 %. Sensitivity: halved or doubled it moves that report by one or two
/// standard errors (at most 2 % each); the rate of false reports with it was not measured.
pub(super) const DRIFT_SIGMAS: f32 = 2.0;

// Fault isolation

/// Difference in fit at which a cause is excluded against the best one, in units of chi-squared.
///
/// Source: a likelihood ratio of `e^12`. Sensitivity: decides alone only for the first 30 decisions, see
/// [`EXCLUSION_CHI2_PER_DECISION`].
pub(super) const EXCLUSION_CHI2: f32 = 25.0;

/// The same per decision, however many there are, in units of chi-squared.
///
/// The law's misfit and what was learned wrongly before the change are the same at every visit of an operating point,
/// so their share of a difference grows as fast as evidence does: a cause is excluded only where it leaves more than
/// the law's own misfit unexplained.
///
/// Source: the 95 % quantile of the difference against the true cause per decision over 100 trials of `host-sim
/// evaluate`: 0.2 to 0.5 for sensor faults and leaks up to 10 %, 0.7 to 0.8 for leaks of 15 to 30 %. Sensitivity: with
/// 0, 3 of 100 temperature faults were confirmed as wear, and in 16 of 100 leaks of 10 % wear was excluded; with 0.8,
/// leaks of 10 % are confirmed in 7 of 100 within the hour instead of 48.
pub(super) const EXCLUSION_CHI2_PER_DECISION: f32 = 0.8;

/// Factor on the difference at which wear is excluded in favour of a temperature offset alone; no unit.
///
/// Source: law and temperature sensor err in nearly the same way over operating points. Sensitivity: not measured; with
/// 1 temperature is treated as every other cause.
pub(super) const TEMPERATURE_MARGIN: f32 = 3.0;

/// Blocks after which old ones fade from the regression on causes.
///
/// Source: some two hours of driving, so that the diagnosis follows the machine. Sensitivity: not measured.
pub(super) const CAUSE_MEMORY_BLOCKS: u32 = 4000;

/// Smallest pressure above the case at which a signature is formed, in MPa.
///
/// Source: guards a division; loaded operating points are far above it. Sensitivity: none.
pub(super) const SIGNATURE_PRESSURE_MIN_MPA: f32 = 0.1;

/// Blocks with the residual as before the change that end the suspicion of a sensor.
///
/// Source: some minutes of driving. Sensitivity: in proportion to the time for which health stays suspended after a
/// repair.
pub(super) const RECOVERY_BLOCKS: u16 = 300;

// Debouncing of diagnostic faults (as on-board diagnostics count driving cycles)

/// Decisions for a pending fault before it is confirmed, in blocks.
///
/// Source: chosen; the isolation before it has waited for [`DIAGNOSIS_DECISIONS`] already. Sensitivity: in proportion
/// to five seconds of driving.
pub(super) const CONFIRM_COUNT: u8 = 10;

/// Decisions against a confirmed fault before it is healed, in blocks.
///
/// Source: chosen: ten times [`CONFIRM_COUNT`]. Sensitivity: in proportion to fifty seconds of driving.
pub(super) const HEAL_COUNT: u8 = 100;

/// Healed decisions after which the history of a fault is erased, in blocks.
///
/// Source: chosen: some 140 hours of driving. Sensitivity: in proportion.
pub(super) const AGE_COUNT: u32 = 1_000_000;

// Prognosis

/// Blocks between two points of the trend.
///
/// Source: about five minutes of used blocks of 0.5 s. Sensitivity: none while far below [`TREND_MEMORY_H`].
pub(super) const TREND_BLOCKS: u16 = 600;

/// Time in which a point's weight falls to 1/e, in hours of driving with the gate open.
///
/// Source: chosen: long against the scatter of the level, short against a machine's life. Sensitivity: half the value
/// follows a change of slope twice as fast, with `2 sqrt(2)` times the standard error.
pub(super) const TREND_MEMORY_H: f32 = 20.0;

/// Shortest time from which a slope is stated, in hours of driving with the gate open.
///
/// Source: chosen; its standard error says how little an hour is worth. Sensitivity: none later.
pub(super) const TREND_MIN_H: f32 = 1.0;

/// Smallest weight of points from which a slope is stated, in points.
///
/// Source: a straight line and a residual need three. Sensitivity: none later.
pub(super) const TREND_MIN_WEIGHT: f32 = 3.0;

/// Number of successive points whose scatter counts as that of one, since neighbouring levels are correlated.
///
/// Source: chosen. Sensitivity: the slope's standard error grows with its root; its coverage was not measured.
pub(super) const CORRELATED_POINTS: f32 = 10.0;

/// Longest remaining life that is stated, in hours of driving with the gate open.
///
/// Source: beyond a drive's life. Sensitivity: none below it.
pub(super) const MAX_REMAINING_H: f32 = 20_000.0;

/// Standard errors of the slope at which the pessimistic remaining life is stated.
///
/// Source: two-sided 95 %. Sensitivity: in proportion.
pub(super) const REMAINING_SIGMAS: f32 = 2.0;
