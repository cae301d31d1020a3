//! What goes wrong beside wear, and the cause that a diagnosis must not rule out for it.

use std::sync::Arc;

use kou_estimator::CalibrationError;
use kou_estimator::Params;
use kou_estimator::health::Cause;
use kou_estimator::model::flow_balance::ReducedModel;
use kou_estimator::model::oil_compression::OilConfig;

use super::world::{Event, Fault};

/// Volume fractions of free air to which that of the oil rises: entrained air, and foam drawn in from a low tank.
const AIR: [(&str, f32); 2] = [("air_2_pct", 0.02), ("air_5_pct", 0.05)];

/// One of them.
#[derive(Debug, Clone)]
pub struct Named {
    /// Name in reports.
    pub name: &'static str,
    /// What happens.
    pub event: Event,
    /// What a diagnosis would call it.
    pub cause: Cause,
}

/// Offsets of 2 % of each sensor's span, both ways, and air in the oil.
///
/// # Errors
/// When the machine's oil already carries so much air that more of it is no oil.
pub fn faults(params: &Params, oil: &OilConfig) -> Result<Vec<Named>, CalibrationError> {
    let ranges = params.sensor_ranges();
    let speed = 0.02 * f64::from(ranges.speed_max.get());
    let pressure = 0.02 * f64::from(ranges.pressure_max.get() - ranges.pressure_min.get());
    let temperature = 0.02 * f64::from(ranges.temperature_max.get() - ranges.temperature_min.get());
    let mut faults: Vec<Named> = [
        ("pressure_up", Fault::PressureOffset(pressure), Cause::Pressure),
        ("pressure_down", Fault::PressureOffset(-pressure), Cause::Pressure),
        ("temperature_up", Fault::TemperatureOffset(temperature), Cause::Temperature),
        ("temperature_down", Fault::TemperatureOffset(-temperature), Cause::Temperature),
        ("pump_speed_up", Fault::PumpSpeedOffset(speed), Cause::PumpSpeedOffset),
        ("pump_speed_down", Fault::PumpSpeedOffset(-speed), Cause::PumpSpeedOffset),
        ("motor_speed_up", Fault::MotorSpeedOffset(speed), Cause::MotorSpeedOffset),
        ("motor_speed_down", Fault::MotorSpeedOffset(-speed), Cause::MotorSpeedOffset),
        // Span -1 to 1.
        ("displacement_down", Fault::DisplacementOffset(-0.04), Cause::Displacement),
    ]
    .map(|(name, fault, cause)| Named { name, event: Event::Sensor(fault), cause })
    .into();
    for (name, air_fraction) in AIR {
        let aerated = ReducedModel::new(params.reduced().config(), &OilConfig { air_fraction, ..*oil })?;
        faults.push(Named { name, event: Event::Oil(Arc::new(aerated)), cause: Cause::Oil });
    }
    Ok(faults)
}
