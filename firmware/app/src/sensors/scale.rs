//! Scaling of counts to engineering units, and the electrical window outside which a wire is broken or shorted.
//!
//! Four kinds of wiring, all read as a ratio `x` of the converter's reference voltage:
//!
//! ```text
//! current loop    x = I*R_shunt/V_ref                    4 to 20 mA over the span; NAMUR NE 43 bounds
//! ratiometric     x = (V/V_supply)*(V_supply/V_ref)      10 to 90 % of the supply over the span
//! PT1000, NTC     x = R/(R + R_pull_up)                  sensor to ground, pull-up to the reference
//! ```
//!
//! PT1000: `R = 1000*(1 + A*t + B*t^2 + C*(t - 100)*t^3)`, C only below zero (Callendar and van Dusen, IEC 60751).
//! NTC: `1/T = 1/298.15 K + ln(R/R_25)/beta`, good to some 1 K over 0 to 100 degC with the sheet's beta of that span.
//!
//! Twelve bits resolve 0.3 K of a PT1000 with a 2.2 kOhm pull-up; filter and noise of the last bit improve on that.

use core::marker::PhantomData;

use kou_estimator::Fault;
use kou_estimator::units::{Celsius, Megapascal, Ratio};

use super::adc::AdcCounts;
use super::config::{ConfigError, consistent, number};
use super::unit::SensorUnit;

/// Coefficients of IEC 60751.
const PT_A: f32 = 3.9083e-3;
const PT_B: f32 = -5.775e-7;
const PT_C: f32 = -4.183e-12;
const PT_OHM: f32 = 1000.0;
/// Zero of the Celsius scale and 25 degC, K.
const ZERO_K: f32 = 273.15;
const ROOM_K: f32 = 298.15;
/// Currents below and above which a loop counts as broken or shorted, mA (NAMUR NE 43).
const LOOP_BROKEN_MA: f32 = 3.6;
const LOOP_SHORTED_MA: f32 = 21.0;
/// Fractions of the supply below and above which a ratiometric sensor's wire counts as broken or shorted: half its
/// live zero.
const RATIOMETRIC_BROKEN: f32 = 0.05;
const RATIOMETRIC_SHORTED: f32 = 0.95;
/// Temperatures whose resistances mark a shorted or broken thermometer, degC: beyond any oil temperature.
const COLDEST_C: f32 = -60.0;
const HOTTEST_C: f32 = 250.0;

/// Sensor with a linear output, as specified by its data sheet and the board's circuit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LinearConfig<U> {
    /// 4 to 20 mA through a shunt to ground.
    CurrentLoop {
        /// Shunt, 10 to 1000 Ohm.
        shunt_ohm: f32,
        /// Reference voltage of the converter, 1 to 6 V; the shunt's voltage at 21 mA must stay below it.
        reference_v: f32,
        /// Value at 4 mA.
        at_zero: U,
        /// Value at 20 mA.
        at_span: U,
    },
    /// 0.5 to 4.5 V of a 5 V supply: 10 to 90 % of the actual supply.
    Ratiometric {
        /// Sensor supply at the converter's input (after any divider) relative to its reference voltage, 0.3 to 1.05.
        supply_over_reference: f32,
        /// Value at 10 % of the supply.
        at_zero: U,
        /// Value at 90 % of the supply.
        at_span: U,
    },
}

/// Resistive thermometer to ground with a pull-up to the converter's reference.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ThermometerConfig {
    /// Platinum, 1000 Ohm at 0 degC (IEC 60751).
    Pt1000 {
        /// Pull-up, 200 to 100 000 Ohm.
        pull_up_ohm: f32,
    },
    /// Thermistor.
    Ntc {
        /// Pull-up, 200 to 100 000 Ohm.
        pull_up_ohm: f32,
        /// Resistance at 25 degC, 100 to 1 000 000 Ohm.
        ohm_at_25_c: f32,
        /// Beta between 25 degC and about 85 degC, 2000 to 6000 K.
        beta_k: f32,
    },
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Curve {
    Linear { offset: f32, gain: f32 },
    Pt1000 { pull_up_over_r0: f32 },
    Ntc { pull_up_over_r25: f32, per_beta: f32 },
}

/// Checked scaling from counts to a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale<U> {
    curve: Curve,
    /// Limits of the electrical window, and the fault on each side.
    low: f32,
    high: f32,
    below: Fault,
    above: Fault,
    unit: PhantomData<U>,
}

impl<U: SensorUnit> Scale<U> {
    /// Quantity of a conversion.
    ///
    /// # Errors
    /// [`Fault::Open`] or [`Fault::Short`] outside the electrical window.
    pub fn value(&self, counts: AdcCounts) -> Result<U, Fault> {
        let share = counts.share();
        if share < self.low {
            return Err(self.below);
        }
        if share > self.high {
            return Err(self.above);
        }
        let bare = match self.curve {
            Curve::Linear { offset, gain } => offset + gain * share,
            Curve::Pt1000 { pull_up_over_r0 } => platinum_c(pull_up_over_r0 * share / (1.0 - share)),
            Curve::Ntc { pull_up_over_r25, per_beta } => {
                let log = libm::logf(pull_up_over_r25 * share / (1.0 - share));
                1.0 / (1.0 / ROOM_K + log * per_beta) - ZERO_K
            }
        };
        // The window excludes ratios of 0 and 1, so the result is finite; checked so that no NaN can propagate.
        if bare.is_finite() { Ok(U::from_bare(bare)) } else { Err(Fault::NotFinite) }
    }

    fn linear(config: &LinearConfig<U>) -> Result<Self, ConfigError> {
        let (zero, span, low, high) = match *config {
            LinearConfig::CurrentLoop { shunt_ohm, reference_v, .. } => {
                number("shunt_ohm", shunt_ohm, 10.0, 1000.0)?;
                number("reference_v", reference_v, 1.0, 6.0)?;
                let share_per_ma = shunt_ohm * 1e-3 / reference_v;
                let at = |ma: f32| ma * share_per_ma;
                (at(4.0), at(20.0), at(LOOP_BROKEN_MA), at(LOOP_SHORTED_MA))
            }
            LinearConfig::Ratiometric { supply_over_reference, .. } => {
                number("supply_over_reference", supply_over_reference, 0.3, 1.05)?;
                let at = |share: f32| share * supply_over_reference;
                (at(0.1), at(0.9), at(RATIOMETRIC_BROKEN), at(RATIOMETRIC_SHORTED))
            }
        };
        let (LinearConfig::CurrentLoop { at_zero, at_span, .. }
        | LinearConfig::Ratiometric { at_zero, at_span, .. }) = *config;
        let (at_zero, at_span) = (at_zero.bare(), at_span.bare());
        number("at_zero", at_zero, -1e4, 1e4)?;
        number("at_span", at_span, -1e4, 1e4)?;
        consistent("at_span", at_span > at_zero, "it must lie above at_zero")?;
        consistent("reference", high < 1.0, "a shorted wire would lie beyond the converter's reference")?;
        let gain = (at_span - at_zero) / (span - zero);
        let curve = Curve::Linear { offset: at_zero - gain * zero, gain };
        Ok(Self { curve, low, high, below: Fault::Open, above: Fault::Short, unit: PhantomData })
    }
}

impl Scale<Megapascal> {
    /// Scaling of a pressure sensor.
    ///
    /// # Errors
    /// The first field out of range.
    pub fn pressure(config: &LinearConfig<Megapascal>) -> Result<Self, ConfigError> {
        Self::linear(config)
    }
}

impl Scale<Ratio> {
    /// Scaling of a displacement (swash angle) sensor.
    ///
    /// # Errors
    /// The first field out of range.
    pub fn displacement(config: &LinearConfig<Ratio>) -> Result<Self, ConfigError> {
        Self::linear(config)
    }
}

impl Scale<Celsius> {
    /// Scaling of a thermometer.
    ///
    /// # Errors
    /// The first field out of range.
    pub fn temperature(config: &ThermometerConfig) -> Result<Self, ConfigError> {
        let pull_up = match *config {
            ThermometerConfig::Pt1000 { pull_up_ohm } | ThermometerConfig::Ntc { pull_up_ohm, .. } => {
                number("pull_up_ohm", pull_up_ohm, 200.0, 100_000.0)?;
                pull_up_ohm
            }
        };
        let share = |ohm: f32| ohm / (ohm + pull_up);
        let (curve, low, high) = match *config {
            ThermometerConfig::Pt1000 { .. } => {
                let curve = Curve::Pt1000 { pull_up_over_r0: pull_up / PT_OHM };
                (curve, share(platinum_ohm(COLDEST_C)), share(platinum_ohm(HOTTEST_C)))
            }
            ThermometerConfig::Ntc { ohm_at_25_c, beta_k, .. } => {
                number("ohm_at_25_c", ohm_at_25_c, 100.0, 1e6)?;
                number("beta_k", beta_k, 2000.0, 6000.0)?;
                let at = |c: f32| ohm_at_25_c * libm::expf(beta_k * (1.0 / (c + ZERO_K) - 1.0 / ROOM_K));
                let curve = Curve::Ntc { pull_up_over_r25: pull_up / ohm_at_25_c, per_beta: 1.0 / beta_k };
                (curve, share(at(HOTTEST_C)), share(at(COLDEST_C)))
            }
        };
        // Half a count from either end: a dead short must differ from the hottest thermistor.
        let (least, most) = (0.5 / 4096.0, 1.0 - 1.5 / 4096.0);
        let (low, high) = (low.max(least), high.min(most));
        Ok(Self { curve, low, high, below: Fault::Short, above: Fault::Open, unit: PhantomData })
    }
}

/// Resistance of a PT1000.
fn platinum_ohm(t_c: f32) -> f32 {
    let cubic = if t_c < 0.0 { PT_C * (t_c - 100.0) * t_c * t_c * t_c } else { 0.0 };
    PT_OHM * (1.0 + t_c * (PT_A + t_c * PT_B) + cubic)
}

/// Temperature of a PT1000 from its resistance relative to that at 0 degC, 0.7 to 2.
fn platinum_c(ratio: f32) -> f32 {
    // Root of the quadratic in the form without cancellation.
    let above = ratio - 1.0;
    let t = 2.0 * above / (PT_A + libm::sqrtf((PT_A * PT_A + 4.0 * PT_B * above).max(0.0)));
    if t >= 0.0 {
        return t;
    }
    // Below zero the fourth-degree term changes the result by up to 0.2 K (at -60 degC): one Newton step leaves 1e-3
    // K.
    let wrong = platinum_ohm(t) / PT_OHM - ratio;
    t - wrong / (PT_A + 2.0 * PT_B * t)
}
