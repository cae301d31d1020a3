//! One step of the estimator: from a sample to an estimate. The only place where readings are checked and the equations
//! are combined.

use serde::{Deserialize, Serialize};

use crate::calibration::OutputSensor;
use crate::estimate::{Estimate, Expected, Observed};
use crate::health::{HealthState, RegressionSample};
use crate::model::flow_balance::{Balance, OperatingPoint};
use crate::params::Params;
use crate::reading::{Channel, Fault, Reading, Sample};
use crate::reason::Reason;
use crate::standard_error::kou_standard_error;
use crate::units::{LeakageCoefficient, Micros, Ratio};

/// State of the estimator between two steps.
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

    /// State before the first sample, with a restored health state of whatever clock: the first sample is rejected as
    /// [`Reason::TimeReversed`], and the block that was being filled is begun anew.
    #[must_use]
    pub const fn with_health(health: HealthState) -> Self {
        Self { last_time: Some(Micros(u64::MAX)), samples: 0, valid: 0, health }
    }

    /// Number of samples so far; saturates instead of wrapping.
    #[must_use]
    pub const fn samples(&self) -> u32 {
        self.samples
    }

    /// Number of samples with a valid expected and a valid observed part.
    #[must_use]
    pub const fn valid(&self) -> u32 {
        self.valid
    }

    /// Learned state of health monitoring.
    #[must_use]
    pub const fn health(&self) -> &HealthState {
        &self.health
    }
}

/// Estimates leakage and health from one sample.
///
/// Every number of a valid part is finite. A part that is not valid carries the first reason found, in the order of the
/// checks: time, sensors in the order of [`Channel::ALL`], operating point, law, result. The crate's front page shows a
/// complete example.
#[must_use]
pub fn step(params: &Params, state: &mut State, sample: &Sample) -> Estimate {
    state.samples = state.samples.saturating_add(1);
    let reversed = state.last_time.is_some_and(|last| sample.time < last);
    // The new time is stored in any case: after a clock was set back, only one sample is lost.
    state.last_time = Some(sample.time);
    let (expected, observed) = if reversed {
        reject(params, state, sample, Reason::TimeReversed)
    } else {
        evaluate(params, state, sample)
    };
    if expected.is_ok() && observed.is_ok() {
        state.valid = state.valid.saturating_add(1);
    }
    Estimate { time: sample.time, expected, observed, health: state.health.status() }
}

/// Expected and observed part of an estimate.
type EstimateParts = (Result<Expected, Reason>, Result<Observed, Reason>);

/// Rejects a sample for one reason.
#[inline(always)]
fn reject(params: &Params, state: &mut State, sample: &Sample, reason: Reason) -> EstimateParts {
    state.health.skip(&params.context, sample.time, reason);
    (Err(reason), Err(reason))
}

/// Evaluates a sample whose time is valid.
#[inline(always)]
fn evaluate(params: &Params, state: &mut State, sample: &Sample) -> EstimateParts {
    let at = match operating_point(params, sample) {
        Ok(at) => at,
        Err(reason) => return reject(params, state, sample, reason),
    };
    let balance = params.context.reduced.balance(&at);
    let expected = expect(params, &at, &balance);
    let ratio = measured_ratio(params, &at, sample);
    let observed = match ratio {
        Ok(ratio) => observe(params, &at, &balance, ratio),
        Err(reason) => Err(reason),
    };
    // Also with ratios above the leak-free one: omitting such samples would bias the learned mean.
    match (&expected, ratio) {
        (Ok(expected), Ok(ratio)) => {
            update_health(params, &mut state.health, sample.time, &at, &balance, expected, ratio);
        }
        (Err(reason), _) => state.health.skip(&params.context, sample.time, *reason),
        (_, Err(reason)) => state.health.skip(&params.context, sample.time, reason),
    }
    (expected, observed)
}

/// Updates health with a valid sample.
#[inline(always)]
fn update_health(
    params: &Params,
    state: &mut HealthState,
    time: Micros,
    at: &OperatingPoint,
    balance: &Balance,
    expected: &Expected,
    ratio: Ratio,
) {
    let regression = RegressionSample {
        ratio_residual: expected.ratio.get().abs() - ratio.get().abs(),
        ratio_per_kou: 1.0 / balance.kou_per_ratio(),
        kou_law: expected.kou.get(),
        ratio: ratio.get().abs(),
        n_p_rpm: at.pump_speed.get(),
        p_h_mpa: at.high_pressure.get(),
        t_b_c: at.oil_temperature.get(),
        alpha: at.displacement.get().abs(),
        chi: balance.compression_loss().get(),
    };
    state.update(&params.context, time, &regression);
}

/// Operating point, if every reading it needs is valid and the drive is within the limits of the estimator.
fn operating_point(params: &Params, sample: &Sample) -> Result<OperatingPoint, Reason> {
    let ranges = &params.ranges;
    let limits = &params.limits;
    let check = ReadingCheck { now: sample.time, max_age_us: limits.max_age_us };

    let speed = ranges.speed_max.get();
    let pump_speed =
        check.value(Channel::PumpSpeed, &sample.pump_speed, |n| (0.0..=speed).contains(&n.get()))?;
    let in_span = |p: f32| p >= ranges.pressure_min.get() && p <= ranges.pressure_max.get();
    let high_pressure = check.value(Channel::HighPressure, &sample.high_pressure, |p| in_span(p.get()))?;
    let low_pressure = check
        .optional(Channel::LowPressure, &sample.low_pressure, |p| in_span(p.get()))?
        .unwrap_or(params.low_pressure);
    let oil_temperature = check.value(Channel::OilTemperature, &sample.oil_temperature, |t| {
        t >= &ranges.temperature_min && t <= &ranges.temperature_max
    })?;
    let displacement = check
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

/// Expected part: leakage law and flow balance at the operating point.
fn expect(params: &Params, at: &OperatingPoint, balance: &Balance) -> Result<Expected, Reason> {
    let point = params.context.law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature);
    if let Some(direction) = params.region.outside(point) {
        return Err(Reason::OutsideRegion(direction));
    }
    let kou = params.context.law.evaluate(point);
    if kou.get() <= 0.0 {
        return Err(Reason::LawNotPositive);
    }
    let ratio = balance.ratio(kou);
    if ratio.get() * at.displacement.get() <= 0.0 {
        return Err(Reason::LeakageTakesFlow);
    }
    Ok(Expected {
        kou,
        kou_se: params.context.law.standard_error(point),
        ratio,
        volumetric_efficiency: params.context.reduced.volumetric_efficiency(at, ratio),
        leakage: balance.leakage(kou),
    })
}

/// Measured speed ratio, with the sign of the displacement.
fn measured_ratio(params: &Params, at: &OperatingPoint, sample: &Sample) -> Result<Ratio, Reason> {
    let check = ReadingCheck { now: sample.time, max_age_us: params.limits.max_age_us };
    let ratio = match params.output {
        OutputSensor::Motor => {
            let limit = params.ranges.speed_max.get();
            let n_m = check.value(Channel::MotorSpeed, &sample.motor_speed, |n| n.get().abs() <= limit)?;
            Ratio(n_m.get() / at.pump_speed.get())
        }
        OutputSensor::FlowMeter => {
            let limit = params.ranges.flow_max.get();
            let flow = check.value(Channel::Flow, &sample.flow, |q| q.get().abs() <= limit)?;
            params.context.reduced.ratio_of_flow(at, flow)
        }
    };
    if ratio.get() * at.displacement.get() <= 0.0 { Err(Reason::RatioNotPositive) } else { Ok(ratio) }
}

/// Observed part: leakage coefficient by the inverse of the flow balance.
fn observe(
    params: &Params,
    at: &OperatingPoint,
    balance: &Balance,
    ratio: Ratio,
) -> Result<Observed, Reason> {
    let kou = balance.kou(ratio);
    if kou.get() < 0.0 {
        return Err(Reason::RatioAboveLeakFree);
    }
    if kou > params.limits.max_kou {
        return Err(Reason::KouImplausible);
    }
    let kou_se: LeakageCoefficient =
        kou_standard_error(&params.errors, &params.context.reduced, balance, at, ratio, kou);
    Ok(Observed {
        ratio,
        kou,
        kou_se,
        volumetric_efficiency: params.context.reduced.volumetric_efficiency(at, ratio),
        leakage: balance.leakage(kou),
    })
}

/// Validity check of readings: a usable value or a reason.
struct ReadingCheck {
    now: Micros,
    max_age_us: u32,
}

impl ReadingCheck {
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

    /// As [`Self::value`], but `None` for a sensor that is not fitted.
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
