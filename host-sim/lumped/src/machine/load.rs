//! Loading of a machine file: the fields' values, and the checks of values against each other.

use std::path::Path;

use crate::invalid_input::InvalidInput;
use crate::value_range::ValueRange;

use super::definition::Machine;
use super::fields::SCHEMA;
use super::parts::{
    ChargeDrive, ChargePump, Circuit, CircuitDynamics, FlowMeter, FlowReceiver, OilProperties, OpeningValve,
    PistonUnit, PlateGeometry, PortAreas, ReliefValve, ShaftFriction, SilencingGroove, SwashActuator,
    ValvePlate,
};
use super::plate_table;
use super::reader::FieldReader;
use super::source::MachineSource;

impl Machine {
    /// Reads and checks a machine file.
    ///
    /// # Errors
    /// Any key that is missing, unknown, of the wrong type or out of range, with file, line and allowed range.
    pub fn load(path: &Path) -> Result<Self, InvalidInput> {
        machine(&MachineSource::read(path)?)
    }

    /// Checks the text of a machine file; area tables that it names are looked up in the folder of `path`.
    ///
    /// # Errors
    /// As [`Machine::load`].
    pub fn from_text(path: &Path, text: &str) -> Result<Self, InvalidInput> {
        machine(&MachineSource::parse(path, text.to_string())?)
    }
}

fn machine(source: &MachineSource) -> Result<Machine, InvalidInput> {
    if source.item("motor.swash").is_some() {
        return Err(source.error_at("motor.swash", "does not exist: the motor's displacement is fixed"));
    }
    let fields = FieldReader::new(source)?;
    if source.item("schema").and_then(toml_edit::Item::as_integer) != Some(SCHEMA) {
        let error = source.error_at("schema", "is a version of the layout that this program does not know");
        return Err(error.with_allowed(SCHEMA));
    }
    let name = fields.text("name").unwrap_or_default();
    if name.trim().is_empty() || name.len() > 100 {
        return Err(source.error_at("name", "must have 1 to 100 characters"));
    }
    Ok(Machine {
        name: name.to_string(),
        oil: oil(&fields)?,
        circuit: circuit(&fields)?,
        pump: piston_unit(&fields, "pump")?,
        receiver: receiver(&fields)?,
        missing_for_lumped_model: fields.missing_for_lumped_model(),
    })
}

fn oil(fields: &FieldReader<'_>) -> Result<OilProperties, InvalidInput> {
    Ok(OilProperties {
        density_kg_m3: fields.number("oil.density_kg_m3")?,
        bulk_modulus_mpa: fields.number("oil.bulk_modulus_mpa")?,
        air_fraction: fields.number("oil.air_fraction")?,
        heat_capacity_ratio: fields.number("oil.heat_capacity_ratio")?,
        walther_a: fields.number("oil.walther_a")?,
        walther_b: fields.number("oil.walther_b")?,
        vapour_pressure_mpa_abs: fields.number("oil.vapour_pressure_mpa_abs")?,
        reference_c: fields.number("oil.reference_c")?,
        bulk_modulus_per_k: fields.number("oil.bulk_modulus_per_k")?,
        density_per_k: fields.number("oil.density_per_k")?,
    })
}

fn receiver(fields: &FieldReader<'_>) -> Result<FlowReceiver, InvalidInput> {
    const DISPLACEMENT: &str = "flow_meter.reference_displacement_cm3_per_rev";
    match (fields.has("motor"), fields.has("flow_meter")) {
        (true, false) => Ok(FlowReceiver::Motor(piston_unit(fields, "motor")?)),
        (false, true) => Ok(FlowReceiver::FlowMeter(FlowMeter {
            reference_displacement_cm3_per_rev: fields.number(DISPLACEMENT)?,
        })),
        (true, true) => Err(fields
            .source()
            .error_at("flow_meter", "and `motor` exclude each other: a machine has one or the other")),
        (false, false) => Err(fields.source().error_at("motor", "is missing: give [motor] or [flow_meter]")),
    }
}

fn circuit(fields: &FieldReader<'_>) -> Result<Circuit, InvalidInput> {
    Ok(Circuit {
        low_pressure_mpa: fields.number("circuit.low_pressure_mpa")?,
        case_pressure_mpa: fields.number("circuit.case_pressure_mpa")?,
        dynamics: fields.has("circuit.dynamics").then(|| dynamics(fields)).transpose()?,
    })
}

fn dynamics(fields: &FieldReader<'_>) -> Result<CircuitDynamics, InvalidInput> {
    let high_relief = "circuit.dynamics.high_relief";
    Ok(CircuitDynamics {
        line_a_volume_cm3: fields.number("circuit.dynamics.line_a_volume_cm3")?,
        line_b_volume_cm3: fields.number("circuit.dynamics.line_b_volume_cm3")?,
        charge_gallery_volume_cm3: fields.number("circuit.dynamics.charge_gallery_volume_cm3")?,
        flushing_gallery_volume_cm3: fields.number("circuit.dynamics.flushing_gallery_volume_cm3")?,
        charge_pump: charge_pump(fields)?,
        charge_relief: relief_valve(fields, "circuit.dynamics.charge_relief")?,
        check_valve: opening_valve(fields, "circuit.dynamics.check_valve")?,
        shuttle: opening_valve(fields, "circuit.dynamics.shuttle")?,
        flushing_relief: relief_valve(fields, "circuit.dynamics.flushing_relief")?,
        high_relief: fields.has(high_relief).then(|| relief_valve(fields, high_relief)).transpose()?,
    })
}

fn charge_pump(fields: &FieldReader<'_>) -> Result<ChargePump, InvalidInput> {
    const PUMP: &str = "circuit.dynamics.charge_pump";
    let speed_rpm = fields.optional("circuit.dynamics.charge_pump.speed_rpm")?;
    let ratio = fields.optional("circuit.dynamics.charge_pump.pump_shaft_ratio")?;
    let drive = match (speed_rpm, ratio) {
        (Some(rpm), None) => ChargeDrive::OwnSpeedRpm(rpm),
        (None, Some(ratio)) => ChargeDrive::PumpShaftRatio(ratio),
        _ => {
            let message = "needs exactly one of speed_rpm and pump_shaft_ratio";
            return Err(fields.source().error_at(PUMP, message));
        }
    };
    let displacement_cm3_per_rev = fields.number("circuit.dynamics.charge_pump.displacement_cm3_per_rev")?;
    Ok(ChargePump { displacement_cm3_per_rev, drive })
}

fn relief_valve(fields: &FieldReader<'_>, key: &str) -> Result<ReliefValve, InvalidInput> {
    let setting_mpa = fields.number(&format!("{key}.setting_mpa"))?;
    let rated_flow_l_min = fields.number(&format!("{key}.rated_flow_l_min"))?;
    let reason = "is above the setting, so the valve would crack below zero";
    let override_mpa = fields.at_most(&format!("{key}.override_mpa"), setting_mpa, reason)?;
    Ok(ReliefValve { setting_mpa, rated_flow_l_min, override_mpa })
}

fn opening_valve(fields: &FieldReader<'_>, key: &str) -> Result<OpeningValve, InvalidInput> {
    let crack_mpa = fields.number(&format!("{key}.crack_mpa"))?;
    let full_open = ValueRange::new(crack_mpa + 0.01, 10.0 + 0.01, "MPa");
    Ok(OpeningValve {
        crack_mpa,
        full_open_mpa: fields.bound(&format!("{key}.full_open_mpa"), full_open)?,
        area_mm2: fields.number(&format!("{key}.area_mm2"))?,
    })
}

fn piston_unit(fields: &FieldReader<'_>, unit: &str) -> Result<PistonUnit, InvalidInput> {
    let key = |name: &str| format!("{unit}.{name}");
    let displacement_cm3_per_rev = fields.number(&key("displacement_cm3_per_rev"))?;
    let pistons = fields.number(&key("pistons"))? as usize;
    let stroke_cm3 = displacement_cm3_per_rev / pistons as f64;
    let dead_volumes = ValueRange::new(0.01 * stroke_cm3, 5.0 * stroke_cm3, "cm3");
    let swash = || -> Result<SwashActuator, InvalidInput> {
        Ok(SwashActuator {
            time_constant_s: fields.number(&key("swash.time_constant_s"))?,
            rate_per_s: fields.number(&key("swash.rate_per_s"))?,
        })
    };
    Ok(PistonUnit {
        displacement_cm3_per_rev,
        pistons,
        dead_volume_cm3: fields.bound(&key("dead_volume_cm3"), dead_volumes)?,
        valve_plate: fields
            .has(&key("valve_plate"))
            .then(|| valve_plate(fields, &key("valve_plate"), pistons))
            .transpose()?,
        inertia_kg_m2: fields.optional(&key("inertia_kg_m2"))?,
        friction: ShaftFriction {
            coulomb_nm: fields.number(&key("coulomb_friction_nm"))?,
            viscous_nm_s: fields.number(&key("viscous_friction_nm_s"))?,
        },
        swash: fields.has(&key("swash")).then(swash).transpose()?,
    })
}

fn valve_plate(fields: &FieldReader<'_>, plate: &str, pistons: usize) -> Result<ValvePlate, InvalidInput> {
    let key = |name: &str| format!("{plate}.{name}");
    let discharge_coefficient = fields.number(&key("discharge_coefficient"))?;
    let Some(table) = fields.text(&key("table")) else {
        let areas = PortAreas::Geometry(plate_geometry(fields, plate, pistons)?);
        return Ok(ValvePlate { discharge_coefficient, areas });
    };
    let geometry = ["port_arc_deg", "kidney_radius_mm", "kidney_width_mm", "seal_land_deg"];
    let grooves = ["entry_groove", "exit_groove"];
    if geometry.iter().chain(&grooves).any(|name| fields.has(&key(name))) {
        let message = "excludes the keys of the geometry: give one or the other";
        return Err(fields.source().error_at(&key("table"), message));
    }
    let areas = PortAreas::Table(plate_table::read(fields.source(), &key("table"), table)?);
    Ok(ValvePlate { discharge_coefficient, areas })
}

fn plate_geometry(
    fields: &FieldReader<'_>,
    plate: &str,
    pistons: usize,
) -> Result<PlateGeometry, InvalidInput> {
    let key = |name: &str| format!("{plate}.{name}");
    let geometric = |name: &str| match fields.optional(&key(name))? {
        Some(value) => Ok(value),
        None => Err(fields.source().error_at(&key(name), "is missing (or give `table`)")),
    };
    let groove = |name: &str| -> Result<SilencingGroove, InvalidInput> {
        if !fields.has(&key(name)) {
            return Ok(SilencingGroove { arc_deg: 1.0, area_mm2: 0.0 });
        }
        Ok(SilencingGroove {
            arc_deg: fields.number(&key(&format!("{name}.arc_deg")))?,
            area_mm2: fields.number(&key(&format!("{name}.area_mm2")))?,
        })
    };
    let port_arc_deg = geometric("port_arc_deg")?;
    let reason = "is above the piston pitch, so ports of neighbouring chambers would overlap";
    fields.at_most(&key("port_arc_deg"), 360.0 / pistons as f64, reason)?;
    let seal_land_deg = geometric("seal_land_deg")?;
    let kidney_half_deg = 90.0 - 0.5 * port_arc_deg - seal_land_deg;
    if kidney_half_deg <= 1.0 || kidney_half_deg >= 90.0 {
        let message = format!(
            "leaves a kidney of {:.1} deg for a port of {port_arc_deg} deg: the ports would never open, or the \
             kidneys would touch",
            2.0 * kidney_half_deg
        );
        let lands = ValueRange::new(-0.5 * port_arc_deg, 89.0 - 0.5 * port_arc_deg, "deg");
        return Err(fields.source().error_at(&key("seal_land_deg"), message).with_allowed(lands));
    }
    Ok(PlateGeometry {
        port_arc_deg,
        kidney_radius_mm: geometric("kidney_radius_mm")?,
        kidney_width_mm: geometric("kidney_width_mm")?,
        seal_land_deg,
        entry_groove: groove("entry_groove")?,
        exit_groove: groove("exit_groove")?,
    })
}
