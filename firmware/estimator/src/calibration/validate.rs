//! Validation of a calibration: every number finite and within its range, and the parts consistent.
//!
//! The ranges are those of axial-piston units and mineral or synthetic oils, wide enough for any machine that the flow
//! balance describes and narrow enough that a confused unit (bar for MPa, K for degC) is detected.

use super::configuration::{Calibration, OutputSensor};
use super::error::{CalibrationError, consistent, in_range};
use crate::model::calibrated_region::Direction;
use crate::model::flow_balance::{ReducedConfig, ReducedModel};
use crate::model::oil_compression::{Compression, MAX_PRESSURE_MPA_ABS, MIN_PRESSURE_MPA_ABS, OilConfig};
use crate::model::sqrt::square_root;
use crate::units::{Megapascal, MegapascalAbs};

/// Lowest gauge pressure that the oil's table covers, MPa.
fn lowest_mpa() -> f32 {
    MegapascalAbs(MIN_PRESSURE_MPA_ABS).to_gauge().get()
}

/// Highest gauge pressure that the estimator accepts, MPa.
fn highest_mpa() -> f32 {
    MegapascalAbs(MAX_PRESSURE_MPA_ABS).to_gauge().get() - 1.0
}

pub(crate) fn oil(oil: &OilConfig) -> Result<(), CalibrationError> {
    in_range("oil.bulk_modulus_mpa", oil.bulk_modulus_mpa, 300.0, 5000.0)?;
    in_range("oil.air_fraction", oil.air_fraction, 0.0, 0.1)?;
    in_range("oil.heat_capacity_ratio", oil.heat_capacity_ratio, 1.0, 1.67)?;
    in_range("oil.bulk_modulus_per_k", oil.bulk_modulus_per_k, -0.01, 0.0)?;
    in_range("oil.reference_c", oil.reference.get(), -50.0, 150.0)
}

/// Softening of the bulk modulus must leave a positive modulus over the whole temperature span.
fn oil_over_temperature(c: &Calibration) -> Result<(), CalibrationError> {
    let hottest =
        1.0 + c.oil.bulk_modulus_per_k * (c.sensor_ranges.temperature_max.get() - c.oil.reference.get());
    consistent(
        "oil.bulk_modulus_per_k",
        hottest >= 0.2,
        "the bulk modulus falls below a fifth at the highest temperature",
    )
}

pub(crate) fn reduced(k: &ReducedConfig) -> Result<(), CalibrationError> {
    in_range("reduced.pump_displacement_cm3_per_rev", k.pump_displacement.get(), 0.1, 5000.0)?;
    in_range("reduced.motor_displacement_cm3_per_rev", k.motor_displacement.get(), 0.1, 5000.0)?;
    let (pump, motor) = (k.pump_displacement.get(), k.motor_displacement.get());
    in_range("reduced.pump_dead_volume_cm3", k.pump_dead_volume.get(), 0.0, 5.0 * pump)?;
    in_range("reduced.motor_dead_volume_cm3", k.motor_dead_volume.get(), 0.0, 5.0 * motor)?;
    in_range("reduced.leaking_chambers", k.leaking_chambers, 0.5, 40.0)?;
    in_range("reduced.fewer_leaking_per_rpm", k.fewer_leaking_per_rpm, -0.02, 0.02)?;
    in_range("reduced.fewer_leaking_per_root_mpa", k.fewer_leaking_per_root_mpa, -2.0, 2.0)?;
    // More than a hundredth of the pump's flow at 1000 r/min and 100 MPa is a broken valve plate, not a groove.
    let groove = 1e-3 * pump;
    in_range("reduced.groove_flow_l_min_per_root_mpa", k.groove_flow, -groove, groove)?;
    in_range("reduced.case_pressure_mpa", k.case_pressure.get(), -0.05, 2.0)
}

fn machine(c: &Calibration) -> Result<(), CalibrationError> {
    let m = &c.machine;
    in_range("machine.pump_pistons", f32::from(m.pump_pistons), 3.0, 25.0)?;
    match m.output {
        OutputSensor::Motor => in_range("machine.motor_pistons", f32::from(m.motor_pistons), 3.0, 25.0)?,
        OutputSensor::FlowMeter => {
            consistent("machine.motor_pistons", m.motor_pistons == 0, "a flow meter has no pistons")?;
            let dead = c.reduced.motor_dead_volume.get();
            consistent("reduced.motor_dead_volume_cm3", dead == 0.0, "a flow meter has no dead volume")?;
        }
    }
    // A fitted displacement that far from the data sheet means a wrong machine file, not a fit.
    let near = |fitted: f32, nominal: f32| (fitted - nominal).abs() <= 0.2 * nominal;
    in_range("machine.pump_displacement_cm3_per_rev", m.pump_displacement.get(), 0.1, 5000.0)?;
    in_range("machine.motor_displacement_cm3_per_rev", m.motor_displacement.get(), 0.1, 5000.0)?;
    let too_far = "differs from the data sheet's by more than 20 %";
    let pump = near(c.reduced.pump_displacement.get(), m.pump_displacement.get());
    consistent("reduced.pump_displacement_cm3_per_rev", pump, too_far)?;
    let motor = near(c.reduced.motor_displacement.get(), m.motor_displacement.get());
    consistent("reduced.motor_displacement_cm3_per_rev", motor, too_far)?;
    // The corrections to the number of leaking chambers are small; half of it at the ends of the spans is no
    // correction.
    let root = square_root(c.sensor_ranges.pressure_max.get());
    let fewer = (c.reduced.fewer_leaking_per_rpm * c.sensor_ranges.speed_max.get()).abs()
        + (c.reduced.fewer_leaking_per_root_mpa * root).abs();
    let few = fewer <= 0.5 * c.reduced.leaking_chambers;
    consistent(
        "reduced.fewer_leaking_per_rpm",
        few,
        "changes the number of leaking chambers by more than half",
    )?;
    let chambers = f32::from(m.pump_pistons) + f32::from(m.motor_pistons);
    consistent(
        "reduced.leaking_chambers",
        c.reduced.leaking_chambers <= chambers,
        "more chambers leak than there are",
    )?;
    in_range("machine.low_pressure_mpa", m.low_pressure.get(), lowest_mpa(), 10.0)
}

fn law(c: &Calibration) -> Result<(), CalibrationError> {
    let k = &c.law;
    // Normalised variables are of order 1, so coefficients beyond 100 (L/min)/MPa are a fit that blew up.
    for (field, value) in [
        ("law.a11", k.a11),
        ("law.a22", k.a22),
        ("law.a33", k.a33),
        ("law.a12", k.a12),
        ("law.a13", k.a13),
        ("law.a23", k.a23),
        ("law.b1", k.b1),
        ("law.b2", k.b2),
        ("law.b3", k.b3),
        ("law.c", k.c),
    ] {
        in_range(field, value, -100.0, 100.0)?;
    }
    in_range("law.n_max_rpm", k.n_max.get(), 50.0, 20_000.0)?;
    in_range("law.p_max_mpa", k.p_max.get(), 1.0, 100.0)?;
    in_range("law.t_max_c", k.t_max.get(), 10.0, 200.0)?;
    in_range("law.residual_se", k.residual_se.get(), 0.0, 10.0)?;
    // Standard errors of single coefficients may exceed the coefficients, but not by orders of magnitude.
    in_range("law.error_root.rest", k.covariance_factor.remainder.get(), 0.0, 10.0)?;
    k.covariance_factor
        .rows()
        .into_iter()
        .flatten()
        .try_for_each(|v| in_range("law.error_root", *v, -100.0, 100.0))
}

fn region(c: &Calibration) -> Result<(), CalibrationError> {
    for (bound, direction) in c.region.bounds().into_iter().zip(Direction::ALL) {
        let field = region_field(direction);
        in_range(field, bound.min, -20.0, 20.0)?;
        in_range(field, bound.max, -20.0, 20.0)?;
        consistent(field, bound.min <= bound.max, "min is above max")?;
    }
    // A normaliser is the largest value of its variable, so a region far beyond 1 has another law's normalisers.
    for (bound, direction) in c.region.bounds().into_iter().zip(Direction::ALL).take(3) {
        consistent(
            region_field(direction),
            bound.max <= 1.5 && bound.max > 0.0,
            "does not fit the law's normalisers",
        )?;
    }
    Ok(())
}

const fn region_field(direction: Direction) -> &'static str {
    match direction {
        Direction::Speed => "region.speed",
        Direction::Pressure => "region.pressure",
        Direction::Temperature => "region.temperature",
        Direction::SpeedPlusPressure => "region.speed_plus_pressure",
        Direction::SpeedMinusPressure => "region.speed_minus_pressure",
        Direction::SpeedPlusTemperature => "region.speed_plus_temperature",
        Direction::SpeedMinusTemperature => "region.speed_minus_temperature",
        Direction::PressurePlusTemperature => "region.pressure_plus_temperature",
        Direction::PressureMinusTemperature => "region.pressure_minus_temperature",
    }
}

fn sensors(c: &Calibration) -> Result<(), CalibrationError> {
    let e = &c.sensor_errors;
    in_range("sensor_errors.ratio_relative", e.ratio_relative, 0.0, 0.2)?;
    in_range("sensor_errors.high_pressure_relative", e.high_pressure_relative, 0.0, 0.2)?;
    in_range("sensor_errors.oil_temperature_k", e.oil_temperature.get(), 0.0, 50.0)?;
    in_range("sensor_errors.displacement", e.displacement.get(), 0.0, 0.5)?;
    let r = &c.sensor_ranges;
    in_range("sensor_ranges.speed_max_rpm", r.speed_max.get(), 10.0, 20_000.0)?;
    in_range("sensor_ranges.pressure_min_mpa", r.pressure_min.get(), lowest_mpa(), 10.0)?;
    in_range("sensor_ranges.pressure_max_mpa", r.pressure_max.get(), 1.0, highest_mpa())?;
    in_range("sensor_ranges.temperature_min_c", r.temperature_min.get(), -60.0, 100.0)?;
    in_range("sensor_ranges.temperature_max_c", r.temperature_max.get(), 0.0, 200.0)?;
    in_range("sensor_ranges.flow_max_l_min", r.flow_max.get(), 0.1, 50_000.0)?;
    consistent(
        "sensor_ranges.pressure_min_mpa",
        r.pressure_min < r.pressure_max,
        "is not below pressure_max_mpa",
    )?;
    let ordered = r.temperature_min < r.temperature_max;
    consistent("sensor_ranges.temperature_min_c", ordered, "is not below temperature_max_c")?;
    let low = c.machine.low_pressure;
    let inside = low >= r.pressure_min && low < r.pressure_max;
    consistent("machine.low_pressure_mpa", inside, "lies outside the pressure sensor's range")
}

fn limits(c: &Calibration) -> Result<(), CalibrationError> {
    let l = &c.limits;
    // 1 ms is the fastest sample period of the firmware, 1 min the slowest plausible log.
    let age = (1_000..=60_000_000).contains(&l.max_age_us);
    consistent("limits.max_age_us", age, "allowed: 1000 to 60000000 microseconds")?;
    in_range("limits.min_pump_speed_rpm", l.min_pump_speed.get(), 1.0, 5_000.0)?;
    in_range("limits.min_displacement", l.min_displacement.get(), 0.01, 1.0)?;
    in_range("limits.min_pressure_difference_mpa", l.min_pressure_difference.get(), 0.1, 50.0)?;
    in_range("limits.max_kou_l_min_mpa", l.max_kou.get(), 1e-4, 100.0)?;
    let below = l.min_pump_speed < c.sensor_ranges.speed_max;
    consistent("limits.min_pump_speed_rpm", below, "is not below sensor_ranges.speed_max_rpm")?;
    // Leakage is driven by p_H - p_c; the smallest accepted p_H must lie above the case.
    let lowest_high = Megapascal(c.sensor_ranges.pressure_min.get() + l.min_pressure_difference.get());
    let driven = lowest_high.get() - c.reduced.case_pressure.get() > 0.01;
    consistent(
        "limits.min_pressure_difference_mpa",
        driven,
        "the high line could lie below the case pressure",
    )
}

/// Validates a calibration.
///
/// # Errors
/// The first field that is not finite, out of range or inconsistent.
pub fn all(c: &Calibration) -> Result<(), CalibrationError> {
    oil(&c.oil)?;
    reduced(&c.reduced)?;
    machine(c)?;
    law(c)?;
    region(c)?;
    sensors(c)?;
    oil_over_temperature(c)?;
    limits(c)?;
    c.health.check()
}

impl ReducedModel {
    /// Checks the constants of a reduced model and prepares it, without a law: identification needs it before one
    /// exists.
    ///
    /// # Errors
    /// The first field that is not finite or out of range.
    pub fn new(reduced: &ReducedConfig, oil: &OilConfig) -> Result<Self, CalibrationError> {
        self::oil(oil)?;
        self::reduced(reduced)?;
        Ok(Self::from_checked(*reduced, Compression::from_checked(oil)))
    }
}
