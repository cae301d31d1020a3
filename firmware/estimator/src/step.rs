//! One step: a sample in, an estimate out. The only place where readings are judged and the parts are put together.

use serde::{Deserialize, Serialize};

use crate::calibration::Output;
use crate::estimate::{Estimate, Expected, Reason, Seen};
use crate::health::{HealthState, Terms};
use crate::params::Params;
use crate::reading::{Channel, Fault, Reading, Sample};
use crate::reduced::{Balance, OperatingPoint};
use crate::uncertainty::kou_standard_error;
use crate::units::{LeakageCoefficient, Micros, Ratio};

/// What the estimator remembers between two steps.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct State {
    last_time: Option<Micros>,
    samples: u32,
    valid: u32,
    health: HealthState,
}

impl State {
    /// State before the first sample.
    #[must_use]
    pub const fn new() -> Self {
        Self { last_time: None, samples: 0, valid: 0, health: HealthState::new() }
    }

    /// State before the first sample of a machine of which this much has been learned before, by whatever clock: the first
    /// sample is refused as [`Reason::TimeReversed`], and what health had begun to collect is collected anew.
    #[must_use]
    pub const fn with_health(health: HealthState) -> Self {
        Self { last_time: Some(Micros(u64::MAX)), samples: 0, valid: 0, health }
    }

    /// Number of samples seen; stays at its maximum instead of wrapping.
    #[must_use]
    pub const fn samples(&self) -> u32 {
        self.samples
    }

    /// Number of samples of which every part was valid.
    #[must_use]
    pub const fn valid(&self) -> u32 {
        self.valid
    }

    /// What has been learned of the machine's health.
    #[must_use]
    pub const fn health(&self) -> &HealthState {
        &self.health
    }
}

/// Makes the estimate for one sample.
///
/// Every number of a valid part is finite. A part that is not valid carries the first reason found, in the order in
/// which this function looks: time, sensors in the order of [`Channel::ALL`], operating point, law, result.
#[must_use]
pub fn step(params: &Params, state: &mut State, sample: &Sample) -> Estimate {
    state.samples = state.samples.saturating_add(1);
    let reversed = state.last_time.is_some_and(|last| sample.time < last);
    // The new time is taken over in any case: after a clock was set back, only one sample is lost.
    state.last_time = Some(sample.time);
    let (expected, seen) = if reversed {
        refused(params, state, sample, Reason::TimeReversed)
    } else {
        judge(params, state, sample)
    };
    if expected.is_ok() && seen.is_ok() {
        state.valid = state.valid.saturating_add(1);
    }
    Estimate { time: sample.time, expected, seen, health: state.health.told() }
}

/// Both parts of an estimate.
type Parts = (Result<Expected, Reason>, Result<Seen, Reason>);

#[inline(always)]
fn refused(params: &Params, state: &mut State, sample: &Sample, reason: Reason) -> Parts {
    state.health.skip(params, sample.time, reason);
    (Err(reason), Err(reason))
}

#[inline(always)]
fn judge(params: &Params, state: &mut State, sample: &Sample) -> Parts {
    let at = match operating_point(params, sample) {
        Ok(at) => at,
        Err(reason) => return refused(params, state, sample, reason),
    };
    let balance = params.reduced.balance(&at);
    let expected = expect(params, &at, &balance);
    let ratio = measured_ratio(params, &at, sample);
    let seen = match ratio {
        Ok(ratio) => see(params, &at, &balance, ratio),
        Err(reason) => Err(reason),
    };
    // Also with ratios above the leak-free one: to leave such samples out would bias the learned mean.
    match (&expected, ratio) {
        (Ok(expected), Ok(ratio)) => {
            learn(params, &mut state.health, sample.time, &at, &balance, expected, ratio);
        }
        (Err(reason), _) => state.health.skip(params, sample.time, *reason),
        (_, Err(reason)) => state.health.skip(params, sample.time, reason),
    }
    (expected, seen)
}

/// Hands a valid sample on to health.
#[inline(always)]
fn learn(
    params: &Params,
    state: &mut HealthState,
    time: Micros,
    at: &OperatingPoint,
    balance: &Balance,
    expected: &Expected,
    ratio: Ratio,
) {
    let terms = Terms {
        deficit: expected.ratio.get().abs() - ratio.get().abs(),
        ratio_per_kou: 1.0 / balance.kou_per_ratio(),
        kou_law: expected.kou.get(),
        ratio: ratio.get().abs(),
        n_p_rpm: at.pump_speed.get(),
        p_h_mpa: at.high_pressure.get(),
        t_b_c: at.oil_temperature.get(),
        alpha: at.displacement.get().abs(),
        chi: balance.compression_loss().get(),
    };
    state.takes(params, time, &terms);
}

/// The operating point, if every reading that it needs is good and the drive works there.
fn operating_point(params: &Params, sample: &Sample) -> Result<OperatingPoint, Reason> {
    let ranges = &params.ranges;
    let limits = &params.limits;
    let judge = Judge { now: sample.time, max_age_us: limits.max_age_us };

    let speed = ranges.speed_max.get();
    let pump_speed =
        judge.value(Channel::PumpSpeed, &sample.pump_speed, |n| (0.0..=speed).contains(&n.get()))?;
    let in_span = |p: f32| p >= ranges.pressure_min.get() && p <= ranges.pressure_max.get();
    let high_pressure = judge.value(Channel::HighPressure, &sample.high_pressure, |p| in_span(p.get()))?;
    let low_pressure = judge
        .optional(Channel::LowPressure, &sample.low_pressure, |p| in_span(p.get()))?
        .unwrap_or(params.low_pressure);
    let oil_temperature = judge.value(Channel::OilTemperature, &sample.oil_temperature, |t| {
        t >= &ranges.temperature_min && t <= &ranges.temperature_max
    })?;
    let displacement = judge
        .optional(Channel::Displacement, &sample.displacement, |a| (-1.0..=1.0).contains(&a.get()))?
        .unwrap_or(Ratio(1.0));

    if pump_speed < limits.min_pump_speed {
        return Err(Reason::SpeedTooLow);
    }
    if displacement.get().abs() < limits.min_displacement.get() {
        return Err(Reason::DisplacementTooSmall);
    }
    if high_pressure.get() - low_pressure.get() < limits.min_pressure_difference.get() {
        return Err(Reason::NotLoaded);
    }
    Ok(OperatingPoint { pump_speed, high_pressure, low_pressure, oil_temperature, displacement })
}

/// What law and reduced model expect.
fn expect(params: &Params, at: &OperatingPoint, balance: &Balance) -> Result<Expected, Reason> {
    let point = params.law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature);
    if let Some(direction) = params.region.outside(point) {
        return Err(Reason::OutsideRegion(direction));
    }
    let kou = params.law.evaluate(point);
    if kou.get() <= 0.0 {
        return Err(Reason::LawNotPositive);
    }
    let ratio = balance.ratio(kou);
    if ratio.get() * at.displacement.get() <= 0.0 {
        return Err(Reason::LeakageTakesFlow);
    }
    Ok(Expected {
        kou,
        kou_se: params.law.standard_error(point),
        ratio,
        volumetric_efficiency: params.reduced.volumetric_efficiency(at, ratio),
        leakage: balance.leakage(kou),
    })
}

/// The measured ratio, with the sign of the displacement.
fn measured_ratio(params: &Params, at: &OperatingPoint, sample: &Sample) -> Result<Ratio, Reason> {
    let judge = Judge { now: sample.time, max_age_us: params.limits.max_age_us };
    let ratio = match params.output {
        OutputSensor::Motor => {
            let limit = params.ranges.speed_max.get();
            let n_m = judge.value(Channel::MotorSpeed, &sample.motor_speed, |n| n.get().abs() <= limit)?;
            Ratio(n_m.get() / at.pump_speed.get())
        }
        OutputSensor::FlowMeter => {
            let limit = params.ranges.flow_max.get();
            let flow = judge.value(Channel::Flow, &sample.flow, |q| q.get().abs() <= limit)?;
            params.reduced.ratio_of_flow(at, flow)
        }
    };
    if ratio.get() * at.displacement.get() <= 0.0 { Err(Reason::RatioNotPositive) } else { Ok(ratio) }
}

/// What the measured ratio says.
fn see(params: &Params, at: &OperatingPoint, balance: &Balance, ratio: Ratio) -> Result<Seen, Reason> {
    let kou = balance.kou(ratio);
    if kou.get() < 0.0 {
        return Err(Reason::RatioAboveLeakFree);
    }
    if kou > params.limits.max_kou {
        return Err(Reason::KouImplausible);
    }
    let kou_se: LeakageCoefficient =
        kou_standard_error(&params.errors, &params.reduced, balance, at, ratio, kou);
    Ok(Observed {
        ratio,
        kou,
        kou_se,
        volumetric_efficiency: params.reduced.volumetric_efficiency(at, ratio),
        leakage: balance.leakage(kou),
    })
}

/// Turns a reading into a value that may be used, or a reason.
struct Judge {
    now: Micros,
    max_age_us: u32,
}

impl Judge {
    #[inline(always)]
    fn value<U: Copy + Into<f32>>(
        &self,
        channel: Channel,
        reading: &Reading<U>,
        in_range: impl Fn(&U) -> bool,
    ) -> Result<U, Reason> {
        let fault = match reading.value {
            Err(fault) => fault,
            Ok(value) if !value.into().is_finite() => Fault::NotFinite,
            Ok(_) if reading.time > self.now => Fault::Future,
            Ok(_) if self.now.0.saturating_sub(reading.time.0) > u64::from(self.max_age_us) => Fault::Stale,
            Ok(value) if !in_range(&value) => Fault::OutOfRange,
            Ok(value) => return Ok(value),
        };
        Err(Reason::Sensor(channel, fault))
    }

    /// As [`Self::value`], but a sensor that is not fitted is no fault.
    #[inline(always)]
    fn optional<U: Copy + Into<f32>>(
        &self,
        channel: Channel,
        reading: &Reading<U>,
        in_range: impl Fn(&U) -> bool,
    ) -> Result<Option<U>, Reason> {
        match reading.value {
            Err(Fault::NotFitted) => Ok(None),
            _ => self.value(channel, reading, in_range).map(Some),
        }
    }
}
