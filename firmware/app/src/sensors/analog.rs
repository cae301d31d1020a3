//! One analogue channel: conversions in, readings out.
//!
//! Every conversion is checked in this order: present; inside the electrical window (open, short); inside the
//! declared range; no further from the last accepted value than the machine can have moved since (rate); not
//! bit-identical for too long while the machine works (stuck). Accepted values pass a first-order low-pass filter. A
//! failure becomes the reading's fault once confirmed; until then the reading repeats the last accepted value with
//! its own, older time stamp, so that no value is invented and the estimator's age limit still applies.
//!
//! A channel may remember its last good value ([`AnalogConfig::return_rate_per_s`]): a signal that returns from a
//! failure further away than the quantity can have moved in the meantime is then not accepted merely because it is
//! constant.
//!
//! One channel alone cannot detect an offset or slow drift inside the range: see
//! [`plausibility`](super::plausibility).

use kou_estimator::units::Micros;
use kou_estimator::{Fault, Reading};

use super::adc::{AdcCounts, ConversionError};
use super::config::{ConfigError, consistent, integer, number};
use super::debounce::{DebounceConfig, DebounceParams, DebounceState};
use super::scale::Scale;
use super::unit::SensorUnit;

/// Filter and checks of a channel. Rates and bands are in the channel's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AnalogConfig<U> {
    /// Time between two conversions, 100 to 1 000 000 us.
    pub period_us: u32,
    /// Time constant of the low-pass filter, 0 (none) to 60 s.
    pub filter_s: f32,
    /// Smallest value within the sensor's range.
    pub lowest: U,
    /// Largest value within the sensor's range.
    pub highest: U,
    /// Fastest possible change by the machine, per second; above 0.
    pub max_rate_per_s: f32,
    /// Fastest possible change of the quantity while the signal was bad, per second; above 0. A signal that returns
    /// further away remains a rate fault until enough time has passed. `None` accepts any value.
    pub return_rate_per_s: Option<f32>,
    /// Noise of a single conversion: smaller changes are never too fast; 0 or more.
    pub noise_band: f32,
    /// Time for which conversions may be bit-identical while the machine works, in ms; `None` disables the check.
    /// Only for a channel whose noise reaches the last bit.
    pub stuck_ms: Option<u32>,
    /// Confirmation and healing.
    pub debounce: DebounceConfig,
}

/// Checked channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnalogParams<U> {
    scale: Scale<U>,
    config: AnalogConfig<U>,
    debounce: DebounceParams,
    /// Filter gain per conversion.
    gain: f32,
    stuck_after: u32,
}

impl<U: SensorUnit> AnalogParams<U> {
    /// Checks a channel's configuration.
    ///
    /// # Errors
    /// The first field out of range or inconsistent.
    pub fn new(scale: Scale<U>, config: &AnalogConfig<U>) -> Result<Self, ConfigError> {
        integer("period_us", config.period_us, 100, 1_000_000)?;
        number("filter_s", config.filter_s, 0.0, 60.0)?;
        number("lowest", config.lowest.bare(), -1e4, 1e4)?;
        number("highest", config.highest.bare(), -1e4, 1e4)?;
        consistent("highest", config.highest.bare() > config.lowest.bare(), "it must lie above lowest")?;
        number("max_rate_per_s", config.max_rate_per_s, 1e-3, 1e6)?;
        number("noise_band", config.noise_band, 0.0, 1e4)?;
        if let Some(rate) = config.return_rate_per_s {
            number("return_rate_per_s", rate, 1e-3, 1e6)?;
        }
        if let Some(ms) = config.stuck_ms {
            integer("stuck_ms", ms, 10, 3_600_000)?;
        }
        let period_s = config.period_us as f32 * 1e-6;
        let gain = if config.filter_s > 0.0 { -libm::expm1f(-period_s / config.filter_s) } else { 1.0 };
        let stuck_after =
            config.stuck_ms.map_or(u32::MAX, |ms| (ms.saturating_mul(1000) / config.period_us).max(1));
        let debounce = DebounceParams::new(&config.debounce)?;
        Ok(Self { scale, config: *config, debounce, gain, stuck_after })
    }
}

/// State of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnalogState {
    debounce: DebounceState,
    /// Last accepted value before the filter, and its time.
    accepted: Option<(Micros, f32)>,
    /// Last reading before a fault was confirmed, and its time.
    trusted: Option<(Micros, f32)>,
    filtered: f32,
    last: Option<AdcCounts>,
    same: u32,
    now: Micros,
}

impl AnalogState {
    /// State before the first conversion.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            debounce: DebounceState::new(),
            accepted: None,
            trusted: None,
            filtered: 0.0,
            last: None,
            same: 0,
            now: Micros(0),
        }
    }

    /// Processes one conversion. `live` means that the machine works, so that its signals must vary.
    pub fn observe<U: SensorUnit>(
        &mut self,
        params: &AnalogParams<U>,
        now: Micros,
        conversion: Result<AdcCounts, ConversionError>,
        live: bool,
    ) {
        self.now = now;
        let checked = self.check(params, now, conversion, live);
        if let Ok(value) = checked {
            self.filtered = match self.accepted {
                Some(_) => self.filtered + params.gain * (value - self.filtered),
                None => value,
            };
            self.accepted = Some((now, value));
            if self.debounce.fault().is_none() {
                self.trusted = Some((now, self.filtered));
            }
        }
        let confirmed = self.debounce.update(&params.debounce, checked.map(|_| ()));
        let jumps = checked == Err(Fault::Rate) && self.debounce.fault().is_some();
        if confirmed || jumps {
            // The signal after a confirmed fault starts anew, at any value; while it keeps jumping, so does each
            // value, or else the last outlier would be the reference of the good ones after it. Only `trusted`
            // persists.
            self.accepted = None;
        }
    }

    /// Present reading: the filtered value, or the confirmed fault.
    #[must_use]
    pub fn reading<U: SensorUnit>(&self) -> Reading<U> {
        match (self.debounce.fault(), self.accepted) {
            (Some(fault), _) => Reading::failed(self.now, fault),
            (None, Some((time, _))) => Reading::new(time, U::from_bare(self.filtered)),
            (None, None) => Reading::failed(self.now, Fault::Missing),
        }
    }

    fn check<U: SensorUnit>(
        &mut self,
        params: &AnalogParams<U>,
        now: Micros,
        conversion: Result<AdcCounts, ConversionError>,
        live: bool,
    ) -> Result<f32, Fault> {
        let config = &params.config;
        let counts = conversion.map_err(|_| Fault::Missing)?;
        self.same = if live && self.last == Some(counts) { self.same.saturating_add(1) } else { 0 };
        self.last = Some(counts);
        let value = params.scale.value(counts)?.bare();
        if value < config.lowest.bare() || value > config.highest.bare() {
            return Err(Fault::OutOfRange);
        }
        if let Some((then, before)) = self.accepted {
            if (value - before).abs() > reach(config.noise_band, config.max_rate_per_s, then, now) {
                return Err(Fault::Rate);
            }
        } else if let (Some((then, before)), Some(rate)) = (self.trusted, config.return_rate_per_s)
            && (value - before).abs() > reach(config.noise_band, rate, then, now)
        {
            return Err(Fault::Rate);
        }
        if self.same >= params.stuck_after {
            return Err(Fault::Stuck);
        }
        Ok(value)
    }
}

/// Largest plausible distance from the previous value.
fn reach(noise_band: f32, rate_per_s: f32, then: Micros, now: Micros) -> f32 {
    noise_band + rate_per_s * (now.0.saturating_sub(then.0) as f32 * 1e-6)
}

impl Default for AnalogState {
    fn default() -> Self {
        Self::new()
    }
}
