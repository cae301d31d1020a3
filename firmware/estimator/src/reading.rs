//! Readings: a time stamp plus a value or the fault for which there is none. There are no sentinel numbers.

use serde::{Deserialize, Serialize};

use crate::units::{Celsius, LitrePerMin, Megapascal, Micros, Ratio, RevPerMin};

/// Fault of a channel: the reason why it has no valid value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Fault {
    /// The machine has no such sensor. Not a failure: the calibration's constant is used where there is one.
    NotFitted,
    /// The sensor is fitted, but nothing has been received from it.
    Missing,
    /// Open circuit or signal below the electrical range.
    Open,
    /// Short circuit or signal above the electrical range.
    Short,
    /// The reading is older than the calibration's `limits.max_age_us`.
    Stale,
    /// The reading is stamped later than the sample that carries it.
    Future,
    /// The value lies outside the sensor's declared range.
    OutOfRange,
    /// The value is NaN or infinite.
    NotFinite,
    /// The value has been constant for longer than a live signal can be.
    Stuck,
    /// The value changed faster than the machine can.
    Rate,
    /// The value contradicts the other sensors.
    Implausible,
}

impl Fault {
    /// Every fault, in the order in which reports list them.
    pub const ALL: [Self; 11] = [
        Self::NotFitted,
        Self::Missing,
        Self::Open,
        Self::Short,
        Self::Stale,
        Self::Future,
        Self::OutOfRange,
        Self::NotFinite,
        Self::Stuck,
        Self::Rate,
        Self::Implausible,
    ];

    /// Name as reports print it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotFitted => "not_fitted",
            Self::Missing => "missing",
            Self::Open => "open",
            Self::Short => "short",
            Self::Stale => "stale",
            Self::Future => "future",
            Self::OutOfRange => "out_of_range",
            Self::NotFinite => "not_finite",
            Self::Stuck => "stuck",
            Self::Rate => "rate",
            Self::Implausible => "implausible",
        }
    }
}

/// A measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Channel {
    /// Pump speed `n_p`.
    PumpSpeed,
    /// Motor speed `n_m`.
    MotorSpeed,
    /// Pressure of the high line `p_H`.
    HighPressure,
    /// Pressure of the low line `p_L`.
    LowPressure,
    /// Temperature of the compensated (make-up) oil `T_b`.
    OilTemperature,
    /// Displacement fraction of the pump `alpha`.
    Displacement,
    /// Flow delivered into the high line, of a rig that has a flow meter instead of a motor.
    Flow,
}

impl Channel {
    /// Every channel, in the order in which a sample is checked.
    pub const ALL: [Self; 7] = [
        Self::PumpSpeed,
        Self::HighPressure,
        Self::LowPressure,
        Self::OilTemperature,
        Self::Displacement,
        Self::MotorSpeed,
        Self::Flow,
    ];

    /// Name as reports print it: the log's column without its unit.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PumpSpeed => "n_p",
            Self::MotorSpeed => "n_m",
            Self::HighPressure => "p_h",
            Self::LowPressure => "p_l",
            Self::OilTemperature => "t_b",
            Self::Displacement => "alpha",
            Self::Flow => "flow",
        }
    }
}

/// Time stamp plus a value or the fault for which there is none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading<U> {
    /// When the value was measured, or when its absence was established.
    pub time: Micros,
    /// The value or the fault.
    pub value: Result<U, Fault>,
}

impl<U> Reading<U> {
    /// Valid reading.
    #[must_use]
    pub const fn new(time: Micros, value: U) -> Self {
        Self { time, value: Ok(value) }
    }

    /// Reading without a value.
    #[must_use]
    pub const fn failed(time: Micros, fault: Fault) -> Self {
        Self { time, value: Err(fault) }
    }

    /// Reading of a sensor that the machine does not have.
    #[must_use]
    pub const fn not_fitted() -> Self {
        Self::failed(Micros(0), Fault::NotFitted)
    }
}

/// One set of readings at [`Sample::time`]: the input of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sample {
    /// Time at which the set was assembled.
    pub time: Micros,
    /// Pump speed `n_p`.
    pub pump_speed: Reading<RevPerMin>,
    /// Motor speed `n_m`; its sign is that of the displacement. Not fitted on a rig with a flow meter.
    pub motor_speed: Reading<RevPerMin>,
    /// Pressure of the high line, `p_H`, gauge.
    pub high_pressure: Reading<Megapascal>,
    /// Pressure of the low line, `p_L`, gauge. Where not fitted, the calibration's constant.
    pub low_pressure: Reading<Megapascal>,
    /// Temperature of the compensated oil `T_b`.
    pub oil_temperature: Reading<Celsius>,
    /// Displacement fraction of the pump, -1 to 1. Where not fitted, full displacement.
    pub displacement: Reading<Ratio>,
    /// Flow into the high line, at the line's pressure. Not fitted where there is a motor.
    pub flow: Reading<LitrePerMin>,
}

impl Sample {
    /// Sample at `time` in which no sensor has reported yet.
    #[must_use]
    pub const fn empty(time: Micros) -> Self {
        Self {
            time,
            pump_speed: Reading::failed(time, Fault::Missing),
            motor_speed: Reading::not_fitted(),
            high_pressure: Reading::failed(time, Fault::Missing),
            low_pressure: Reading::not_fitted(),
            oil_temperature: Reading::failed(time, Fault::Missing),
            displacement: Reading::not_fitted(),
            flow: Reading::not_fitted(),
        }
    }
}
