//! Gate: only blocks in which the drive is steady are used.

use serde::{Deserialize, Serialize};

use super::averaging::Block;
use super::r_statistic::SteadyFilter;
use crate::reason::Reason;

/// Why the gate is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Closed {
    /// The sample has no valid measured ratio, or lies where the law does not hold.
    Sample(Reason),
    /// No block has been filled since the start or since the last sample that could not be used.
    Filling,
    /// The block before was too long ago to say whether this one is steady.
    AfterGap,
    /// Pump speed is not steady.
    SpeedUnsteady,
    /// Pressure is not steady.
    PressureUnsteady,
    /// Displacement is not steady.
    DisplacementUnsteady,
    /// The deficit of ratio is not steady.
    RatioUnsteady,
}

impl Closed {
    /// Name as reports print it; a sample's reason is told by [`Reason::name`] besides.
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

/// Deviations that change the balance by less than a per cent of Kou, see `docs/health/theory.md`.
const SPEED_FLOOR: f32 = 0.005;
const PRESSURE_FLOOR_MPA: f32 = 0.4;
const DISPLACEMENT_FLOOR: f32 = 0.003;
const DEFICIT_FLOOR: f32 = 0.004;

/// The filters of the four signals that must be steady.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Gate {
    speed: SteadyFilter,
    pressure: SteadyFilter,
    displacement: SteadyFilter,
    deficit: SteadyFilter,
}

impl Gate {
    /// A gate that has seen nothing.
    pub const fn new() -> Self {
        Self {
            speed: SteadyFilter::new(0.0),
            pressure: SteadyFilter::new(0.0),
            displacement: SteadyFilter::new(0.0),
            deficit: SteadyFilter::new(0.0),
        }
    }

    /// Begins with a block before which samples were missing.
    pub fn restart(&mut self, block: &Block) {
        let mean = &block.mean;
        self.speed = SteadyFilter::new(mean.n_p_rpm);
        self.pressure = SteadyFilter::new(mean.p_h_mpa);
        self.displacement = SteadyFilter::new(mean.alpha);
        self.deficit = SteadyFilter::new(mean.deficit);
    }

    /// Whether pump speed is steady. Every filter takes every block, so that it knows the present when the gate opens.
    pub fn speed(&mut self, block: &Block) -> bool {
        let n_p_rpm = block.mean.n_p_rpm;
        self.speed.takes(n_p_rpm, SPEED_FLOOR * n_p_rpm)
    }

    /// Whether pressure is steady.
    pub fn pressure(&mut self, block: &Block) -> bool {
        self.pressure.takes(block.mean.p_h_mpa, PRESSURE_FLOOR_MPA)
    }

    /// Whether displacement is steady.
    pub fn displacement(&mut self, block: &Block) -> bool {
        self.displacement.takes(block.mean.alpha, DISPLACEMENT_FLOOR)
    }

    /// Whether the deficit of ratio is steady.
    pub fn deficit(&mut self, block: &Block) -> bool {
        self.deficit.takes(block.mean.deficit, DEFICIT_FLOOR)
    }
}

#[cfg(test)]
mod tests {
    use super::super::averaging::Terms;
    use super::*;
    use crate::units::Micros;

    const MEAN: Terms = Terms {
        deficit: 0.01,
        ratio_per_kou: 0.5,
        kou_law: 0.06,
        ratio: 0.95,
        n_p_rpm: 2000.0,
        p_h_mpa: 25.0,
        t_b_c: 60.0,
        alpha: 1.0,
        chi: 0.02,
    };

    fn block(mean: Terms) -> Block {
        Block { time: Micros(0), mean, count: 50, after_gap: false }
    }

    /// Which of speed, pressure, displacement and deficit are steady in the last of twenty blocks.
    fn steady(of: impl Fn(f32) -> Terms) -> [bool; 4] {
        let mut gate = Gate::new();
        gate.restart(&block(of(0.0)));
        let mut last = [false; 4];
        for i in 1..=20_u8 {
            let block = block(of(f32::from(i)));
            last =
                [gate.speed(&block), gate.pressure(&block), gate.displacement(&block), gate.deficit(&block)];
        }
        last
    }

    #[test]
    fn ramp_of_one_signal_closes_the_gate_for_that_signal_alone() {
        assert_eq!(steady(|_| MEAN), [true; 4]);
        // Each by one floor per block: a moving average with weight 0.3 lags by some three of them.
        let ramps: [&dyn Fn(f32) -> Terms; 4] = [
            &|t| Terms { n_p_rpm: 2000.0 + 10.0 * t, ..MEAN },
            &|t| Terms { p_h_mpa: 25.0 + 0.4 * t, ..MEAN },
            &|t| Terms { alpha: 0.9 + 0.003 * t, ..MEAN },
            &|t| Terms { deficit: 0.01 + 0.004 * t, ..MEAN },
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
        assert_eq!(steady(|t| Terms { p_h_mpa: 25.0 + 0.04 * t, ..MEAN }), [true; 4]);
    }
}
