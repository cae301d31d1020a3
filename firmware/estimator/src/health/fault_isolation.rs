//! Fault isolation: which causes, wear or others, can explain a change of the ratio residual.
//!
//! Every cause has a signature: the ratio residual that it adds per unit, as a function of the operating point. Leakage
//! grows with pressure over speed, a wrong scale of a speed or of the displacement does not, an offset of a speed
//! sensor fades with speed, and so on. After a change the residual is regressed on each signature alone; a cause is
//! excluded when its fit is worse than the best one by more than a threshold (likelihood-ratio test; Isermann 2006).
//! Where operating points do not vary, all causes remain: the data cannot distinguish them, and wear is not diagnosed.

use serde::{Deserialize, Serialize};

use super::averaging::RegressionSample;
use super::tuning::{
    CAUSE_MEMORY_BLOCKS, EXCLUSION_CHI2, EXCLUSION_CHI2_PER_DECISION, SIGNATURE_PRESSURE_MIN_MPA,
    TEMPERATURE_MARGIN,
};
use crate::model::flow_balance::ReducedModel;
use crate::model::leakage_law::Law;

/// Possible cause of a ratio residual.
#[doc(alias = "fault isolation")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Cause {
    /// All gaps have widened alike: leakage in proportion to the law.
    Wear,
    /// An additional leak that behaves like an orifice.
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
    /// Air in the oil, or oil of another compressibility.
    Oil,
}

impl Cause {
    /// Every cause, leakage first.
    pub const ALL: [Self; CAUSE_COUNT] = [
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
pub const CAUSE_COUNT: usize = 9;

/// Set of causes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Causes(u16);

impl Causes {
    /// The empty set.
    #[must_use]
    pub const fn none() -> Self {
        Self(0)
    }

    /// Whether the set contains a cause.
    #[must_use]
    pub fn contains(self, cause: Cause) -> bool {
        self.0 & (1 << cause as u16) != 0
    }

    /// Whether the set is not empty and contains leakage only.
    #[must_use]
    pub fn only_leakage(self) -> bool {
        let leakage = (1 << Cause::Wear as u16) | (1 << Cause::Orifice as u16);
        self.0 != 0 && self.0 & !leakage == 0
    }

    /// Whether the set is not empty and contains no leakage.
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

/// Number of causes in [`leakage_signatures`].
pub(super) const LEAKAGE_SIGNATURES: usize = 5;
/// Number of causes in [`other_signatures`].
pub(super) const OTHER_SIGNATURES: usize = CAUSE_COUNT - LEAKAGE_SIGNATURES;

/// Signatures of leakage and of the speed sensors: ratio residual per unit of the cause, in the order of
/// [`Cause::ALL`].
#[inline]
pub(super) fn leakage_signatures(law: &Law, mean: &RegressionSample) -> [f32; LEAKAGE_SIGNATURES] {
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

/// Signatures of the remaining causes, in the order of [`Cause::ALL`].
#[inline]
pub(super) fn other_signatures(
    model: &ReducedModel,
    law: &Law,
    mean: &RegressionSample,
) -> [f32; OTHER_SIGNATURES] {
    let reduced = model.config();
    let per_intake = 1.0 / (reduced.motor_displacement.get() + reduced.motor_dead_volume.get() * mean.chi);
    let full_cm3 = reduced.pump_displacement.get();
    // Compressed volume per unit of the motor's intake.
    let compressed = (reduced.pump_dead_volume.get()
        + 0.5 * full_cm3 * (1.0 + mean.alpha)
        + mean.ratio * reduced.motor_dead_volume.get())
        * per_intake;
    let wear = mean.ratio_per_kou * mean.kou_law;
    let [_, per_mpa, per_kelvin] = law.gradient([mean.n_p_rpm, mean.p_h_mpa, mean.t_b_c]);
    let to_case_mpa = mean.p_h_mpa - reduced.case_pressure.get();
    let per_p =
        1.0 / if to_case_mpa > SIGNATURE_PRESSURE_MIN_MPA { to_case_mpa } else { SIGNATURE_PRESSURE_MIN_MPA };
    let compression = model.compression();
    let slope_per_mpa = compression.slope_per_mpa(crate::units::Celsius(mean.t_b_c));
    [
        -compressed * slope_per_mpa - wear * per_p - mean.ratio_per_kou * per_mpa,
        compressed * mean.chi * compression.softening_per_k() - mean.ratio_per_kou * per_kelvin,
        full_cm3 * (1.0 - 0.5 * mean.chi) * per_intake,
        compressed,
    ]
}

/// Signatures of all causes, in the order of [`Cause::ALL`].
#[inline]
pub(super) fn all_signatures(
    [wear, orifice, scale, pump, motor]: [f32; LEAKAGE_SIGNATURES],
    [pressure, temperature, displacement, oil]: [f32; OTHER_SIGNATURES],
) -> [f32; CAUSE_COUNT] {
    [wear, orifice, scale, pump, motor, pressure, temperature, displacement, oil]
}

/// `1/sqrt(p)` to 2e-3, which suffices for the shape of a signature.
fn inverse_root(p_mpa: f32) -> f32 {
    let guess = micromath::F32Ext::invsqrt(p_mpa.max(SIGNATURE_PRESSURE_MIN_MPA));
    guess * (1.5 - 0.5 * p_mpa * guess * guess)
}

/// Regression of the ratio residual on every signature alone, since the last change.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CauseRegression {
    /// Weighted sums of signature times residual.
    residual_products: [f32; CAUSE_COUNT],
    /// Weighted sums of squared signatures.
    signature_products: [f32; CAUSE_COUNT],
    blocks: u32,
}

impl CauseRegression {
    /// Regression without blocks.
    #[must_use]
    pub const fn new() -> Self {
        Self { residual_products: [0.0; CAUSE_COUNT], signature_products: [0.0; CAUSE_COUNT], blocks: 0 }
    }

    /// Adds a block: its signatures, the residual that the parameters before the change leave, and its noise variance.
    pub(super) fn push(&mut self, signatures: &[f32; CAUSE_COUNT], residual: f32, noise_variance: f32) {
        let weight = 1.0 / noise_variance;
        let fade =
            if self.blocks >= CAUSE_MEMORY_BLOCKS { 1.0 - 1.0 / CAUSE_MEMORY_BLOCKS as f32 } else { 1.0 };
        let weighted = weight * residual;
        for ((residual_products, signature_products), signature) in
            self.residual_products.iter_mut().zip(&mut self.signature_products).zip(signatures)
        {
            *residual_products = fade * *residual_products + weighted * signature;
            *signature_products = fade * *signature_products + weight * signature * signature;
        }
        self.blocks = self.blocks.saturating_add(1);
    }

    /// Number of blocks.
    #[must_use]
    pub fn blocks(&self) -> u32 {
        self.blocks
    }

    /// Effective number of blocks: old ones fade.
    #[must_use]
    pub fn weight(&self) -> f32 {
        (if self.blocks < CAUSE_MEMORY_BLOCKS { self.blocks } else { CAUSE_MEMORY_BLOCKS }) as f32
    }

    /// Reduction of chi-squared by each cause.
    #[must_use]
    pub fn explained(&self) -> [f32; CAUSE_COUNT] {
        let mut explained = [0.0; CAUSE_COUNT];
        for ((value, residual_products), signature_products) in
            explained.iter_mut().zip(&self.residual_products).zip(&self.signature_products)
        {
            if *signature_products > 0.0 {
                *value = residual_products * residual_products / signature_products;
            }
        }
        explained
    }
}

/// Difference in chi-squared at which a cause is excluded after a number of decisions.
pub fn exclusion_threshold(decisions: f32) -> f32 {
    let by_misfit = EXCLUSION_CHI2_PER_DECISION * decisions;
    if by_misfit > EXCLUSION_CHI2 { by_misfit } else { EXCLUSION_CHI2 }
}

/// Causes that remain possible: those whose fit is worse than the best one by less than `threshold`.
#[must_use]
pub fn possible_causes(explained: &[f32; CAUSE_COUNT], threshold: f32) -> Causes {
    // A comparison, since `max` would be a function call.
    let best = explained.iter().fold(0.0, |best, value| if *value > best { *value } else { best });
    let mut causes = Causes::default();
    for (value, cause) in explained.iter().zip(Cause::ALL) {
        if best - value < threshold {
            causes = causes.with(cause);
        }
    }
    let [wear, ..] = explained;
    if causes == Causes::none().with(Cause::Temperature) && best - wear < TEMPERATURE_MARGIN * threshold {
        causes = causes.with(Cause::Wear);
    }
    causes
}

#[cfg(test)]
mod tests {
    use super::*;

    const DECISIONS: f32 = 100.0;

    fn with(fits: &[(Cause, f32)]) -> Causes {
        let mut explained = [0.0; CAUSE_COUNT];
        for (cause, fit) in fits {
            explained[*cause as usize] = *fit;
        }
        possible_causes(&explained, exclusion_threshold(DECISIONS))
    }

    #[test]
    fn cause_that_explains_less_by_no_more_than_the_laws_misfit_could_remains() {
        // 100 decisions: 80 units may come of the misfit.
        let both = with(&[(Cause::Wear, 500.0), (Cause::Temperature, 421.0)]);
        assert!(both.contains(Cause::Wear) && both.contains(Cause::Temperature) && !both.only_leakage());
        let wear = with(&[(Cause::Wear, 500.0), (Cause::Temperature, 419.0)]);
        assert!(wear.only_leakage());
        // With few decisions the evidence threshold applies: 25 units.
        let mut explained = [0.0; CAUSE_COUNT];
        explained[Cause::Wear as usize] = 24.0;
        assert_eq!(possible_causes(&explained, exclusion_threshold(1.0)).iter().count(), CAUSE_COUNT);
    }

    #[test]
    fn temperature_alone_is_isolated_only_where_the_evidence_is_three_times_as_strong() {
        let both = with(&[(Cause::Temperature, 500.0), (Cause::Wear, 261.0)]);
        assert!(both.contains(Cause::Wear) && !both.no_leakage() && !both.only_leakage());
        assert!(with(&[(Cause::Temperature, 500.0), (Cause::Wear, 259.0)]).no_leakage());
        // Another sensor is isolated by the plain threshold.
        assert!(with(&[(Cause::MotorSpeedOffset, 500.0), (Cause::Wear, 261.0)]).no_leakage());
    }
}
