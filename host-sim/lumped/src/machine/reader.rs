//! Range and consistency checks between the file as written and the checked [`Machine`].

use crate::input::{InvalidInput, Range, TomlFile};

use super::parts::{
    Case, ChargeDrive, ChargePump, CheckValve, Circuit, CircuitDynamics, FlowMeter, Friction, Groove, Oil,
    PlateGeometry, Receiver, Relief, Shuttle, Swash, Unit, ValvePlate,
};
use super::{Machine, SCHEMA, plate_table, raw};

/// Water is near 1000, phosphate esters near 1150, light oils near 700.
const DENSITY: Range = Range::new(500.0, 1500.0, "kg/m3");
const BULK_MODULUS: Range = Range::new(100.0, 10_000.0, "MPa");
/// Above a fifth of air by volume Wylie's mixture is foam, which none of the models describe.
const AIR_FRACTION: Range = Range::new(0.0, 0.2, "");
const HEAT_CAPACITY_RATIO: Range = Range::new(1.0, 2.0, "");
const WALTHER_A: Range = Range::new(2.0, 20.0, "");
const WALTHER_B: Range = Range::new(0.5, 10.0, "");
/// The upper end stays well below the atmosphere, so that every case drain is liquid.
const VAPOUR_PRESSURE: Range = Range::new(1.0e-6, 0.05, "MPa absolute");
const TEMPERATURE: Range = Range::new(-40.0, 150.0, "degC");
/// With the temperature range above, larger slopes would make the property vanish somewhere.
const PER_K: Range = Range::new(-0.01, 0.01, "1/K");
const LOW_PRESSURE: Range = Range::new(0.0, 10.0, "MPa");
const CASE_PRESSURE: Range = Range::new(-0.05, 2.0, "MPa");
const VOLUME: Range = Range::new(1.0, 100_000.0, "cm3");
const RELIEF_SETTING: Range = Range::new(0.01, 150.0, "MPa");
const RELIEF_FLOW: Range = Range::new(0.1, 10_000.0, "L/min");
const OVERRIDE: Range = Range::new(0.001, 50.0, "MPa");
const VALVE_PRESSURE: Range = Range::new(0.0, 10.0, "MPa");
const VALVE_AREA: Range = Range::new(0.1, 10_000.0, "mm2");
const DISPLACEMENT: Range = Range::new(0.1, 5000.0, "cm3/rev");
const CHARGE_DISPLACEMENT: Range = Range::new(0.0, 1000.0, "cm3/rev");
const CHARGE_SPEED: Range = Range::new(0.0, 10_000.0, "r/min");
const CHARGE_RATIO: Range = Range::new(0.0, 10.0, "");
/// Fewer than three pistons cannot turn a shaft past dead centre; no real unit has more than fifteen.
const PISTONS: Range = Range::new(3.0, 15.0, "pistons");
const INERTIA: Range = Range::new(1.0e-4, 1000.0, "kg m2");
const COULOMB: Range = Range::new(0.0, 10_000.0, "N m");
const VISCOUS: Range = Range::new(0.0, 100.0, "N m s");
const DISCHARGE: Range = Range::new(0.1, 1.0, "");
const PORT_ARC: Range = Range::new(1.0, 119.0, "deg");
const RADIUS: Range = Range::new(1.0, 1000.0, "mm");
const WIDTH: Range = Range::new(0.1, 500.0, "mm");
/// Negative: the port is already open at dead centre (underlap).
const LAND: Range = Range::new(-20.0, 60.0, "deg");
const GROOVE_ARC: Range = Range::new(0.1, 40.0, "deg");
const GROOVE_AREA: Range = Range::new(0.0, 500.0, "mm2");
const TIME_CONSTANT: Range = Range::new(0.0, 10.0, "s");
/// A full stroke in less than a millisecond would be a blow, not a movement.
const SWASH_RATE: Range = Range::new(0.01, 1000.0, "1/s");
const FACTOR: Range = Range::new(0.5, 2.0, "");

/// Checks a factor that scales a machine's property.
pub(super) fn factor(what: &str, value: f64) -> Result<(), InvalidInput> {
    if FACTOR.contains(value) {
        Ok(())
    } else {
        Err(InvalidInput::new(format!("{what} is out of range")).with_value(value).with_allowed(FACTOR))
    }
}

/// Parses and checks a whole file.
pub(super) fn machine(file: &TomlFile) -> Result<Machine, InvalidInput> {
    let raw: raw::File = file.parse()?;
    if raw.schema != SCHEMA {
        return Err(file.error_at("schema", "is not a layout this program knows").with_allowed(SCHEMA));
    }
    if raw.name.trim().is_empty() || raw.name.len() > 100 {
        return Err(file.error_at("name", "must have 1 to 100 characters"));
    }
    let oil = oil(file, &raw.oil)?;
    let circuit = circuit(file, &raw.circuit)?;
    let pump = unit(file, "pump", &raw.pump)?;
    let receiver = match (&raw.motor, &raw.flow_meter) {
        (Some(motor), None) => {
            if motor.swash.is_some() {
                return Err(file.error_at("motor.swash", "does not exist: the motor's displacement is fixed"));
            }
            Receiver::Motor(unit(file, "motor", motor)?)
        }
        (None, Some(meter)) => Receiver::FlowMeter(FlowMeter {
            reference_displacement_cm3_per_rev: file.check(
                "flow_meter.reference_displacement_cm3_per_rev",
                meter.reference_displacement_cm3_per_rev,
                DISPLACEMENT,
            )?,
        }),
        (Some(_), Some(_)) => {
            return Err(file.error_at("flow_meter", "stands beside [motor]: a machine has one or the other"));
        }
        (None, None) => return Err(file.error_at("motor", "is missing: give [motor] or [flow_meter]")),
    };
    Ok(Machine { name: raw.name, oil, circuit, pump, receiver })
}

fn oil(file: &TomlFile, raw: &raw::Oil) -> Result<Oil, InvalidInput> {
    let check = |key: &str, value, range| file.check(&format!("oil.{key}"), value, range);
    Ok(Oil {
        density_kg_m3: check("density_kg_m3", raw.density_kg_m3.unwrap_or(860.0), DENSITY)?,
        bulk_modulus_mpa: check("bulk_modulus_mpa", raw.bulk_modulus_mpa, BULK_MODULUS)?,
        air_fraction: check("air_fraction", raw.air_fraction, AIR_FRACTION)?,
        heat_capacity_ratio: check("heat_capacity_ratio", raw.heat_capacity_ratio, HEAT_CAPACITY_RATIO)?,
        walther_a: check("walther_a", raw.walther_a.unwrap_or(5.51884), WALTHER_A)?,
        walther_b: check("walther_b", raw.walther_b.unwrap_or(2.10704), WALTHER_B)?,
        vapour_pressure_mpa_abs: check(
            "vapour_pressure_mpa_abs",
            raw.vapour_pressure_mpa_abs.unwrap_or(0.0005),
            VAPOUR_PRESSURE,
        )?,
        reference_c: check("reference_c", raw.reference_c.unwrap_or(60.0), TEMPERATURE)?,
        bulk_modulus_per_k: check("bulk_modulus_per_k", raw.bulk_modulus_per_k.unwrap_or(0.0), PER_K)?,
        density_per_k: check("density_per_k", raw.density_per_k.unwrap_or(0.0), PER_K)?,
    })
}

fn circuit(file: &TomlFile, raw: &raw::Circuit) -> Result<Circuit, InvalidInput> {
    let low_pressure_mpa = file.check("circuit.low_pressure_mpa", raw.low_pressure_mpa, LOW_PRESSURE)?;
    let case_pressure_mpa = file.check("circuit.case_pressure_mpa", raw.case_pressure_mpa, CASE_PRESSURE)?;
    let dynamics = raw.dynamics.as_ref().map(|d| dynamics(file, d)).transpose()?;
    Ok(Circuit { low_pressure_mpa, case_pressure_mpa, dynamics })
}

fn dynamics(file: &TomlFile, raw: &raw::Dynamics) -> Result<CircuitDynamics, InvalidInput> {
    let key = |name: &str| format!("circuit.dynamics.{name}");
    let volume = |name: &str, value| file.check(&key(name), value, VOLUME);
    let charge_pump = &raw.charge_pump;
    let drive = match (charge_pump.speed_rpm, charge_pump.pump_shaft_ratio) {
        (Some(rpm), None) => {
            ChargeDrive::OwnSpeedRpm(file.check(&key("charge_pump.speed_rpm"), rpm, CHARGE_SPEED)?)
        }
        (None, Some(ratio)) => ChargeDrive::PumpShaftRatio(file.check(
            &key("charge_pump.pump_shaft_ratio"),
            ratio,
            CHARGE_RATIO,
        )?),
        _ => {
            return Err(
                file.error_at(&key("charge_pump"), "needs exactly one of speed_rpm and pump_shaft_ratio")
            );
        }
    };
    let check_valve = {
        let (crack_mpa, full_open_mpa, area_mm2) = valve(file, &key("check_valve"), &raw.check_valve)?;
        CheckValve { crack_mpa, full_open_mpa, area_mm2 }
    };
    let shuttle = {
        let (crack_mpa, full_open_mpa, area_mm2) = valve(file, &key("shuttle"), &raw.shuttle)?;
        Shuttle { crack_mpa, full_open_mpa, area_mm2 }
    };
    Ok(CircuitDynamics {
        line_a_volume_cm3: volume("line_a_volume_cm3", raw.line_a_volume_cm3)?,
        line_b_volume_cm3: volume("line_b_volume_cm3", raw.line_b_volume_cm3)?,
        charge_gallery_volume_cm3: volume("charge_gallery_volume_cm3", raw.charge_gallery_volume_cm3)?,
        flushing_gallery_volume_cm3: volume("flushing_gallery_volume_cm3", raw.flushing_gallery_volume_cm3)?,
        charge_pump: ChargePump {
            displacement_cm3_per_rev: file.check(
                &key("charge_pump.displacement_cm3_per_rev"),
                charge_pump.displacement_cm3_per_rev,
                CHARGE_DISPLACEMENT,
            )?,
            drive,
        },
        charge_relief: relief(file, &key("charge_relief"), &raw.charge_relief)?,
        check_valve,
        shuttle,
        flushing_relief: relief(file, &key("flushing_relief"), &raw.flushing_relief)?,
        high_relief: raw.high_relief.as_ref().map(|r| relief(file, &key("high_relief"), r)).transpose()?,
    })
}

fn relief(file: &TomlFile, key: &str, raw: &raw::Relief) -> Result<Relief, InvalidInput> {
    let setting_mpa = file.check(&format!("{key}.setting_mpa"), raw.setting_mpa, RELIEF_SETTING)?;
    let rated_flow_l_min =
        file.check(&format!("{key}.rated_flow_l_min"), raw.rated_flow_l_min, RELIEF_FLOW)?;
    let override_mpa = file.check(&format!("{key}.override_mpa"), raw.override_mpa, OVERRIDE)?;
    if override_mpa > setting_mpa {
        return Err(file
            .error_at(
                &format!("{key}.override_mpa"),
                "is above the setting, so the valve would crack below zero",
            )
            .with_allowed(Range::new(OVERRIDE.min, setting_mpa, "MPa")));
    }
    Ok(Relief { setting_mpa, rated_flow_l_min, override_mpa })
}

fn valve(file: &TomlFile, key: &str, raw: &raw::Valve) -> Result<(f64, f64, f64), InvalidInput> {
    let crack = file.check(&format!("{key}.crack_mpa"), raw.crack_mpa, VALVE_PRESSURE)?;
    // A poppet that snaps open within less than 0.01 MPa would need its own dynamics to be well-posed.
    let above = Range::new(crack + 0.01, VALVE_PRESSURE.max + 0.01, "MPa");
    let full_open = file.check(&format!("{key}.full_open_mpa"), raw.full_open_mpa, above)?;
    let area = file.check(&format!("{key}.area_mm2"), raw.area_mm2, VALVE_AREA)?;
    Ok((crack, full_open, area))
}

fn unit(file: &TomlFile, key: &str, raw: &raw::Unit) -> Result<Unit, InvalidInput> {
    let check = |name: &str, value, range| file.check(&format!("{key}.{name}"), value, range);
    let displacement = check("displacement_cm3_per_rev", raw.displacement_cm3_per_rev, DISPLACEMENT)?;
    let pistons = check("pistons", raw.pistons as f64, PISTONS)? as usize;
    let stroke = displacement / pistons as f64;
    // Less than 1 % of the stroke volume cannot be machined; more than five strokes is a wrong unit.
    let dead = Range::new(0.01 * stroke, 5.0 * stroke, "cm3");
    let optional = |name: &str, value: Option<f64>, range| value.map(|v| check(name, v, range)).transpose();
    let swash = match &raw.swash {
        None => None,
        Some(swash) => Some(Swash {
            time_constant_s: check("swash.time_constant_s", swash.time_constant_s, TIME_CONSTANT)?,
            rate_per_s: check("swash.rate_per_s", swash.rate_per_s, SWASH_RATE)?,
        }),
    };
    Ok(Unit {
        displacement_cm3_per_rev: displacement,
        pistons,
        dead_volume_cm3: check("dead_volume_cm3", raw.dead_volume_cm3, dead)?,
        valve_plate: raw.valve_plate.as_ref().map(|p| plate(file, key, pistons, p)).transpose()?,
        inertia_kg_m2: optional("inertia_kg_m2", raw.inertia_kg_m2, INERTIA)?,
        friction: Friction {
            coulomb_nm: optional("coulomb_friction_nm", raw.coulomb_friction_nm, COULOMB)?.unwrap_or(0.0),
            viscous_nm_s: optional("viscous_friction_nm_s", raw.viscous_friction_nm_s, VISCOUS)?
                .unwrap_or(0.0),
        },
        swash,
    })
}

fn plate(file: &TomlFile, unit: &str, pistons: usize, raw: &raw::Plate) -> Result<ValvePlate, InvalidInput> {
    let key = |name: &str| format!("{unit}.valve_plate.{name}");
    let discharge_coefficient =
        file.check(&key("discharge_coefficient"), raw.discharge_coefficient, DISCHARGE)?;
    if let Some(name) = &raw.table {
        let geometry = [raw.port_arc_deg, raw.kidney_radius_mm, raw.kidney_width_mm, raw.seal_land_deg];
        if geometry.iter().any(Option::is_some) || raw.entry_groove.is_some() || raw.exit_groove.is_some() {
            return Err(file.error_at(&key("table"), "stands beside geometry keys: give one or the other"));
        }
        let table = plate_table::read(file, &key("table"), name)?;
        return Ok(ValvePlate { discharge_coefficient, case: Case::Table(table) });
    }
    let need = |name: &str, value: Option<f64>, range| match value {
        Some(value) => file.check(&key(name), value, range),
        None => Err(file.error_at(&key(name), "is missing (or give `table`)")),
    };
    let port_arc_deg = need("port_arc_deg", raw.port_arc_deg, PORT_ARC)?;
    // Ports of neighbouring chambers cannot overlap in the cylinder block.
    let pitch = Range::new(PORT_ARC.min, 360.0 / pistons as f64, "deg");
    file.check(&key("port_arc_deg"), port_arc_deg, pitch)?;
    let seal_land_deg = need("seal_land_deg", raw.seal_land_deg, LAND)?;
    let kidney_half_deg = 90.0 - 0.5 * port_arc_deg - seal_land_deg;
    if kidney_half_deg <= 1.0 || kidney_half_deg >= 90.0 {
        return Err(file
            .error_at(
                &key("seal_land_deg"),
                format!(
                    "leaves a kidney of {:.1} deg beside a port of {port_arc_deg} deg: the ports would never open, \
                     or the kidneys would touch",
                    2.0 * kidney_half_deg
                ),
            )
            .with_allowed(Range::new(-0.5 * port_arc_deg, 89.0 - 0.5 * port_arc_deg, "deg")));
    }
    let groove = |name: &str, groove: &Option<raw::Groove>| -> Result<Groove, InvalidInput> {
        let Some(groove) = groove else { return Ok(Groove { arc_deg: 1.0, area_mm2: 0.0 }) };
        Ok(Groove {
            arc_deg: file.check(&key(&format!("{name}.arc_deg")), groove.arc_deg, GROOVE_ARC)?,
            area_mm2: file.check(&key(&format!("{name}.area_mm2")), groove.area_mm2, GROOVE_AREA)?,
        })
    };
    Ok(ValvePlate {
        discharge_coefficient,
        case: Case::Geometry(PlateGeometry {
            port_arc_deg,
            kidney_radius_mm: need("kidney_radius_mm", raw.kidney_radius_mm, RADIUS)?,
            kidney_width_mm: need("kidney_width_mm", raw.kidney_width_mm, WIDTH)?,
            seal_land_deg,
            entry_groove: groove("entry_groove", &raw.entry_groove)?,
            exit_groove: groove("exit_groove", &raw.exit_groove)?,
        }),
    })
}
