//! Gate: only blocks in which the drive is steady are used.

use serde::{Deserialize, Serialize};

use super::block::Block;
use super::steady::SteadyFilter;
use crate::estimate::Reason;

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

/// Deviations that change the balance by less than a per cent of Kou, see `docs/health.md`.
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
