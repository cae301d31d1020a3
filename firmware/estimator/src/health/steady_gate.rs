//! Steady-state gate: admits only blocks in which the drive is steady.

use serde::{Deserialize, Serialize};

use super::averaging::Block;
use super::r_statistic::RStatistic;
use super::tuning::{DISPLACEMENT_FLOOR, PRESSURE_FLOOR_MPA, RATIO_RESIDUAL_FLOOR, SPEED_FLOOR};
use crate::reason::Reason;

/// Reason for which the gate is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GateClosed {
    /// The sample has no valid measured ratio, or lies where the law does not hold.
    Sample(Reason),
    /// No block has been filled since the start or since the last invalid sample.
    Filling,
    /// A gap separates the block from the one before, so that its steadiness is unknown.
    AfterGap,
    /// Pump speed is not steady.
    SpeedUnsteady,
    /// Pressure is not steady.
    PressureUnsteady,
    /// Displacement is not steady.
    DisplacementUnsteady,
    /// The ratio residual is not steady.
    RatioUnsteady,
}

impl GateClosed {
    /// Name as reports print it; [`Reason::name`] adds the reason of an invalid sample.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sample(_) => "sample",
            Self::Filling => "filling",
            Self::AfterGap => "after_gap",
            Self::SpeedUnsteady => "speed_unsteady",
            Self::PressureUnsteady => "pressure_unsteady",
            Self::DisplacementUnsteady => "displacement_unsteady",
            Self::RatioUnsteady => "ratio_unsteady",
        }
    }
}

/// Steady-state detectors of the four signals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SteadyGate {
    speed: RStatistic,
    pressure: RStatistic,
    displacement: RStatistic,
    ratio_residual: RStatistic,
}

impl SteadyGate {
    /// Gate before the first block.
    pub const fn new() -> Self {
        Self {
            speed: RStatistic::new(0.0),
            pressure: RStatistic::new(0.0),
            displacement: RStatistic::new(0.0),
            ratio_residual: RStatistic::new(0.0),
        }
    }

    /// Restarts with a block after a gap.
    pub fn restart(&mut self, block: &Block) {
        let mean = &block.mean;
        self.speed = RStatistic::new(mean.n_p_rpm);
        self.pressure = RStatistic::new(mean.p_h_mpa);
        self.displacement = RStatistic::new(mean.alpha);
        self.ratio_residual = RStatistic::new(mean.ratio_residual);
    }

    /// Whether pump speed is steady. Every detector receives every block, so that it is up to date when the gate opens.
    pub fn speed(&mut self, block: &Block) -> bool {
        let n_p_rpm = block.mean.n_p_rpm;
        self.speed.push(n_p_rpm, SPEED_FLOOR * n_p_rpm)
    }

    /// Whether pressure is steady.
    pub fn pressure(&mut self, block: &Block) -> bool {
        self.pressure.push(block.mean.p_h_mpa, PRESSURE_FLOOR_MPA)
    }

    /// Whether displacement is steady.
    pub fn displacement(&mut self, block: &Block) -> bool {
        self.displacement.push(block.mean.alpha, DISPLACEMENT_FLOOR)
    }

    /// Whether the ratio residual is steady.
    pub fn ratio_residual(&mut self, block: &Block) -> bool {
        self.ratio_residual.push(block.mean.ratio_residual, RATIO_RESIDUAL_FLOOR)
    }
}

#[cfg(test)]
mod tests {
    use super::super::averaging::RegressionSample;
    use super::*;
    use crate::units::Micros;

    const MEAN: RegressionSample = RegressionSample {
        ratio_residual: 0.01,
        ratio_per_kou: 0.5,
        kou_law: 0.06,
        ratio: 0.95,
        n_p_rpm: 2000.0,
        p_h_mpa: 25.0,
        t_b_c: 60.0,
        alpha: 1.0,
        chi: 0.02,
    };

    fn block(mean: RegressionSample) -> Block {
        Block { time: Micros(0), mean, count: 50, after_gap: false }
    }

    /// Which of speed, pressure, displacement and ratio residual are steady in the last of twenty blocks.
    fn steady(of: impl Fn(f32) -> RegressionSample) -> [bool; 4] {
        let mut gate = SteadyGate::new();
        gate.restart(&block(of(0.0)));
        let mut last = [false; 4];
        for i in 1..=20_u8 {
            let block = block(of(f32::from(i)));
            last = [
                gate.speed(&block),
                gate.pressure(&block),
                gate.displacement(&block),
                gate.ratio_residual(&block),
            ];
        }
        last
    }

    #[test]
    fn ramp_of_one_signal_closes_the_gate_for_that_signal_alone() {
        assert_eq!(steady(|_| MEAN), [true; 4]);
        // Each by one floor per block: a moving average with weight 0.3 lags by some three of them.
        let ramps: [&dyn Fn(f32) -> RegressionSample; 4] = [
            &|t| RegressionSample { n_p_rpm: 2000.0 + 10.0 * t, ..MEAN },
            &|t| RegressionSample { p_h_mpa: 25.0 + 0.4 * t, ..MEAN },
            &|t| RegressionSample { alpha: 0.9 + 0.003 * t, ..MEAN },
            &|t| RegressionSample { ratio_residual: 0.01 + 0.004 * t, ..MEAN },
        ];
        for (i, ramp) in ramps.into_iter().enumerate() {
            let got = steady(ramp);
            for (k, steady) in got.into_iter().enumerate() {
                assert_eq!(steady, k != i, "ramp {i}: {got:?}");
            }
        }
    }

    #[test]
    fn slow_change_below_the_floor_leaves_the_gate_open() {
        assert_eq!(steady(|t| RegressionSample { p_h_mpa: 25.0 + 0.04 * t, ..MEAN }), [true; 4]);
    }
}
