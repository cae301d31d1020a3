//! Fault cases other than wear, each with the cause that a diagnosis must not rule out.

use std::sync::Arc;

use kou_estimator::CalibrationError;
use kou_estimator::Params;
use kou_estimator::health::Cause;
use kou_estimator::model::flow_balance::ReducedModel;
use kou_estimator::model::oil_compression::OilConfig;

use super::simulated_drive::{DriveEvent, SensorOffset};

/// Volume fractions of free air to which that of the oil rises: entrained air, and foam drawn in from a low tank.
const AIR: [(&str, f32); 2] = [("air_2_pct", 0.02), ("air_5_pct", 0.05)];

/// A fault and its true cause.
#[derive(Debug, Clone)]
pub struct FaultCase {
    /// Name in reports.
    pub name: &'static str,
    /// Event that sets the fault.
    pub event: DriveEvent,
    /// True cause.
    pub cause: Cause,
}

/// Fault cases: offsets of 2 % of each sensor's span, both ways, and air in the oil.
///
/// # Errors
/// When the machine's oil already carries so much air that more is out of range.
pub fn fault_cases(params: &Params, oil: &OilConfig) -> Result<Vec<FaultCase>, CalibrationError> {
    let ranges = params.sensor_ranges();
    let speed = 0.02 * f64::from(ranges.speed_max.get());
    let pressure = 0.02 * f64::from(ranges.pressure_max.get() - ranges.pressure_min.get());
    let temperature = 0.02 * f64::from(ranges.temperature_max.get() - ranges.temperature_min.get());
    let mut faults: Vec<FaultCase> = [
        ("pressure_up", SensorOffset::Pressure(pressure), Cause::Pressure),
        ("pressure_down", SensorOffset::Pressure(-pressure), Cause::Pressure),
        ("temperature_up", SensorOffset::Temperature(temperature), Cause::Temperature),
        ("temperature_down", SensorOffset::Temperature(-temperature), Cause::Temperature),
        ("pump_speed_up", SensorOffset::PumpSpeed(speed), Cause::PumpSpeedOffset),
        ("pump_speed_down", SensorOffset::PumpSpeed(-speed), Cause::PumpSpeedOffset),
        ("motor_speed_up", SensorOffset::MotorSpeed(speed), Cause::MotorSpeedOffset),
        ("motor_speed_down", SensorOffset::MotorSpeed(-speed), Cause::MotorSpeedOffset),
        // Span -1 to 1.
        ("displacement_down", SensorOffset::Displacement(-0.04), Cause::Displacement),
    ]
    .map(|(name, fault, cause)| FaultCase { name, event: DriveEvent::Sensor(fault), cause })
    .into();
    for (name, air_fraction) in AIR {
        let aerated = ReducedModel::new(params.reduced().config(), &OilConfig { air_fraction, ..*oil })?;
        faults.push(FaultCase { name, event: DriveEvent::Oil(Arc::new(aerated)), cause: Cause::Oil });
    }
    Ok(faults)
}
