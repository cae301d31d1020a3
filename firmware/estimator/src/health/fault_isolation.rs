//! What else than wear could explain a deficit of ratio, told apart by its signature over operating points.
//!
//! Each explanation predicts how the deficit varies: leakage grows with pressure over speed, a wrong scale of a speed or
//! of the displacement does not, an offset of a speed sensor fades with speed, and so on. After a change the deficit is
//! regressed on each signature alone; what an explanation leaves unexplained, against the best one, says whether it
//! remains. Where operating points do not vary, all remain: then the data cannot tell, and wear is not blamed.

use serde::{Deserialize, Serialize};

use super::averaging::Terms;
use crate::model::flow_balance::ReducedModel;
use crate::model::leakage_law::Law;

/// A possible explanation of a deficit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Cause {
    /// All gaps have widened alike: leakage in proportion to the law.
    Wear,
    /// An added leak that behaves like an orifice.
    Orifice,
    /// The scale of a speed, or of the flow meter: a factor on the ratio.
    SpeedScale,
    /// An offset of the pump's speed.
    PumpSpeedOffset,
    /// An offset of the motor's speed.
    MotorSpeedOffset,
    /// An offset of the pressure.
    Pressure,
    /// An offset of the oil temperature.
    Temperature,
    /// An offset of the displacement.
    Displacement,
    /// Air in the oil, or an oil of another compressibility.
    Oil,
}

impl Cause {
    /// Every cause, leakage first.
    pub const ALL: [Self; CAUSES] = [
        Self::Wear,
        Self::Orifice,
        Self::SpeedScale,
        Self::PumpSpeedOffset,
        Self::MotorSpeedOffset,
        Self::Pressure,
        Self::Temperature,
        Self::Displacement,
        Self::Oil,
    ];

    /// Name as reports print it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Wear => "wear",
            Self::Orifice => "orifice",
            Self::SpeedScale => "speed_scale",
            Self::PumpSpeedOffset => "pump_speed_offset",
            Self::MotorSpeedOffset => "motor_speed_offset",
            Self::Pressure => "pressure_offset",
            Self::Temperature => "temperature_offset",
            Self::Displacement => "displacement_offset",
            Self::Oil => "oil",
        }
    }
}

/// Number of causes.
pub const CAUSES: usize = 9;

/// A set of causes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Causes(u16);

impl Causes {
    /// The empty set.
    #[must_use]
    pub const fn none() -> Self {
        Self(0)
    }

    /// Whether the set holds a cause.
    #[must_use]
    pub fn contains(self, cause: Cause) -> bool {
        self.0 & (1 << cause as u16) != 0
    }

    /// Whether nothing but leakage is in the set, and something is.
    #[must_use]
    pub fn only_leakage(self) -> bool {
        let leakage = (1 << Cause::Wear as u16) | (1 << Cause::Orifice as u16);
        self.0 != 0 && self.0 & !leakage == 0
    }

    /// Whether leakage is not in the set, and something is.
    #[must_use]
    pub fn no_leakage(self) -> bool {
        self.0 != 0 && !self.contains(Cause::Wear) && !self.contains(Cause::Orifice)
    }

    fn with(self, cause: Cause) -> Self {
        Self(self.0 | (1 << cause as u16))
    }

    /// The causes in the set.
    pub fn iter(self) -> impl Iterator<Item = Cause> {
        Cause::ALL.into_iter().filter(move |cause| self.contains(*cause))
    }
}

/// Number of causes of [`signatures_of_leakage`].
pub(super) const LEAKAGE_SIGNATURES: usize = 5;
/// Number of causes of [`signatures_of_others`].
pub(super) const OTHER_SIGNATURES: usize = CAUSES - LEAKAGE_SIGNATURES;

/// Deficit of ratio per unit of each of the first causes at a block, in the order of [`Cause::ALL`].
#[inline]
pub(super) fn signatures_of_leakage(law: &Law, mean: &Terms) -> [f32; LEAKAGE_SIGNATURES] {
    let wear = mean.ratio_per_kou * mean.kou_law;
    let [per_rpm, ..] = law.gradient([mean.n_p_rpm, mean.p_h_mpa, mean.t_b_c]);
    let per_n = 1.0 / mean.n_p_rpm;
    [
        wear,
        // An orifice passes sqrt(p), so its part of Kou falls with 1/sqrt(p).
        mean.ratio_per_kou * inverse_root(mean.p_h_mpa),
        mean.ratio,
        mean.ratio * per_n + wear * per_n - mean.ratio_per_kou * per_rpm,
        -per_n,
    ]
}

/// The same for the causes that follow.
#[inline]
pub(super) fn signatures_of_others(model: &ReducedModel, law: &Law, mean: &Terms) -> [f32; OTHER_SIGNATURES] {
    let reduced = model.config();
    let per_b = 1.0 / (reduced.motor_displacement.get() + reduced.motor_dead_volume.get() * mean.chi);
    let full_cm3 = reduced.pump_displacement.get();
    // What compression acts on, per unit of what the motor swallows.
    let carried = (reduced.pump_dead_volume.get()
        + 0.5 * full_cm3 * (1.0 + mean.alpha)
        + mean.ratio * reduced.motor_dead_volume.get())
        * per_b;
    let wear = mean.ratio_per_kou * mean.kou_law;
    let [_, per_mpa, per_kelvin] = law.gradient([mean.n_p_rpm, mean.p_h_mpa, mean.t_b_c]);
    let to_case_mpa = mean.p_h_mpa - reduced.case_pressure.get();
    let per_p = 1.0 / if to_case_mpa > 0.1 { to_case_mpa } else { 0.1 };
    let compression = model.compression();
    let slope_per_mpa = compression.slope_per_mpa(crate::units::Celsius(mean.t_b_c));
    [
        -carried * slope_per_mpa - wear * per_p - mean.ratio_per_kou * per_mpa,
        carried * mean.chi * compression.softening_per_k() - mean.ratio_per_kou * per_kelvin,
        full_cm3 * (1.0 - 0.5 * mean.chi) * per_b,
        carried,
    ]
}

/// Both in one.
#[inline]
pub(super) fn joined(
    [wear, orifice, scale, pump, motor]: [f32; LEAKAGE_SIGNATURES],
    [pressure, temperature, displacement, oil]: [f32; OTHER_SIGNATURES],
) -> [f32; CAUSES] {
    [wear, orifice, scale, pump, motor, pressure, temperature, displacement, oil]
}

/// `1/sqrt(p)` to 2e-3: a signature's shape, not a quantity.
fn inverse_root(p_mpa: f32) -> f32 {
    let guess = micromath::F32Ext::invsqrt(p_mpa.max(0.1));
    guess * (1.5 - 0.5 * p_mpa * guess * guess)
}

/// Regression of the deficit on every signature alone, since a change.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Diagnosis {
    with_deficit: [f32; CAUSES],
    with_itself: [f32; CAUSES],
    blocks: u32,
}

/// Difference in fit, in units of chi-squared, at which a cause is ruled out against the best one: a likelihood ratio of
/// e^12.
const RULED_OUT: f32 = 25.0;
/// The same per decision, however many there are. What the law misses and what was learned wrongly before the change
/// stay the same at every visit of an operating point, so that their share of a difference grows as fast as the
/// evidence does: a cause is ruled out only where it leaves more than the law's own misfit unexplained.
const RULED_OUT_PER_DECISION: f32 = 0.8;
/// How much clearer it must be that the temperature alone is wrong, and nothing has worn: law and temperature sensor err
/// in nearly the same way over operating points.
const SURER: f32 = 3.0;

/// Blocks after which old ones fade, so that the diagnosis follows the machine.
const MEMORY_BLOCKS: u32 = 4000;

impl Diagnosis {
    /// Nothing taken yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { with_deficit: [0.0; CAUSES], with_itself: [0.0; CAUSES], blocks: 0 }
    }

    /// Takes the deficit of a block, less what was explained before the change, with the variance of its noise.
    pub(super) fn takes(&mut self, signatures: &[f32; CAUSES], deficit: f32, noise_variance: f32) {
        let weight = 1.0 / noise_variance;
        let keep = if self.blocks >= MEMORY_BLOCKS { 1.0 - 1.0 / MEMORY_BLOCKS as f32 } else { 1.0 };
        let weighted = weight * deficit;
        for ((with_deficit, with_itself), signature) in
            self.with_deficit.iter_mut().zip(&mut self.with_itself).zip(signatures)
        {
            *with_deficit = keep * *with_deficit + weighted * signature;
            *with_itself = keep * *with_itself + weight * signature * signature;
        }
        self.blocks = self.blocks.saturating_add(1);
    }

    /// Blocks taken.
    #[must_use]
    pub fn blocks(&self) -> u32 {
        self.blocks
    }

    /// Blocks that count: old ones fade.
    #[must_use]
    pub fn weight(&self) -> f32 {
        (if self.blocks < MEMORY_BLOCKS { self.blocks } else { MEMORY_BLOCKS }) as f32
    }

    /// What each cause explains, in units of chi-squared.
    #[must_use]
    pub fn explained(&self) -> [f32; CAUSES] {
        let mut explained = [0.0; CAUSES];
        for ((value, with_deficit), with_itself) in
            explained.iter_mut().zip(&self.with_deficit).zip(&self.with_itself)
        {
            if *with_itself > 0.0 {
                *value = with_deficit * with_deficit / with_itself;
            }
        }
        explained
    }
}

/// Difference in fit from which a cause is ruled out after a number of decisions.
pub fn ruled_out_after(decisions: f32) -> f32 {
    let of_misfit = RULED_OUT_PER_DECISION * decisions;
    if of_misfit > RULED_OUT { of_misfit } else { RULED_OUT }
}

/// The causes that remain: those that explain as much as the best but for less than `ruled_out`.
#[must_use]
pub fn remaining(explained: &[f32; CAUSES], ruled_out: f32) -> Causes {
    // A comparison, since `max` would be a call of a function.
    let best = explained.iter().fold(0.0, |best, value| if *value > best { *value } else { best });
    let mut causes = Causes::default();
    for (value, cause) in explained.iter().zip(Cause::ALL) {
        if best - value < ruled_out {
            causes = causes.with(cause);
        }
    }
    let [wear, ..] = explained;
    if causes == Causes::none().with(Cause::Temperature) && best - wear < SURER * ruled_out {
        causes = causes.with(Cause::Wear);
    }
    causes
}

#[cfg(test)]
mod tests {
    use super::*;

    const DECISIONS: f32 = 100.0;

    fn with(fits: &[(Cause, f32)]) -> Causes {
        let mut explained = [0.0; CAUSES];
        for (cause, fit) in fits {
            explained[*cause as usize] = *fit;
        }
        remaining(&explained, ruled_out_after(DECISIONS))
    }

    #[test]
    fn cause_that_explains_less_by_no_more_than_the_laws_misfit_could_remains() {
        // 100 decisions: 80 units are what the misfit may do.
        let both = with(&[(Cause::Wear, 500.0), (Cause::Temperature, 421.0)]);
        assert!(both.contains(Cause::Wear) && both.contains(Cause::Temperature) && !both.only_leakage());
        let wear = with(&[(Cause::Wear, 500.0), (Cause::Temperature, 419.0)]);
        assert!(wear.only_leakage());
        // With few decisions evidence itself is short: 25 units.
        let mut explained = [0.0; CAUSES];
        explained[Cause::Wear as usize] = 24.0;
        assert_eq!(remaining(&explained, ruled_out_after(1.0)).iter().count(), CAUSES);
    }

    #[test]
    fn temperature_alone_is_believed_only_where_it_is_three_times_clearer() {
        let both = with(&[(Cause::Temperature, 500.0), (Cause::Wear, 261.0)]);
        assert!(both.contains(Cause::Wear) && !both.no_leakage() && !both.only_leakage());
        assert!(with(&[(Cause::Temperature, 500.0), (Cause::Wear, 259.0)]).no_leakage());
        // Another sensor is believed at once.
        assert!(with(&[(Cause::MotorSpeedOffset, 500.0), (Cause::Wear, 261.0)]).no_leakage());
    }
}
