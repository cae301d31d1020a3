//! Every field of the machine file, described once: key, kind, range, need and meaning.
//!
//! The reader takes keys, types, ranges and defaults from [`FIELDS`], and the table in `docs/full-model/machine.md` is
//! printed from it. Ranges that depend on another value of the file are checked in `load.rs` and stated here in words.

use crate::value_range::ValueRange;

use FieldKind::{BoundByOther, Integer, Number, Table, Text};
use FieldNeed::{Default, ExactlyOneOf, LumpedModel, Optional, Required};

/// Version of the machine file's layout.
pub const SCHEMA: i64 = 1;

/// Field or table of the machine file.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct MachineField {
    /// Dotted key; `{a,b}` stands for two keys of the same kind.
    pub key: &'static str,
    /// Type and range.
    pub kind: FieldKind,
    /// Whether a file may omit it.
    pub need: FieldNeed,
    /// Meaning, one sentence.
    pub meaning: &'static str,
}

/// Type and range of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FieldKind {
    /// Table of further fields.
    Table,
    /// Text.
    Text,
    /// Integer in a range.
    Integer(ValueRange),
    /// Number in a range.
    Number(ValueRange),
    /// Number whose range depends on another value of the file.
    BoundByOther {
        /// Unit.
        unit: &'static str,
        /// Allowed values, in words.
        allowed: &'static str,
    },
}

/// Whether a file may omit a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FieldNeed {
    /// Must be present wherever its table is.
    Required,
    /// May be absent; this value then holds.
    Default(f64),
    /// May be absent.
    Optional,
    /// May be absent; the reduced model does without it, the lumped model does not.
    LumpedModel,
    /// Either this or the named field or group of fields.
    ExactlyOneOf(&'static str),
}

impl MachineField {
    /// Whether the description holds for a dotted key.
    #[must_use]
    pub fn describes(&self, key: &str) -> bool {
        matches_pattern(self.key, key)
    }

    /// Dotted keys for which the description holds.
    #[must_use]
    pub fn keys(&self) -> Vec<String> {
        let Some((before, rest)) = self.key.split_once('{') else { return vec![self.key.to_string()] };
        let Some((names, after)) = rest.split_once('}') else { return vec![self.key.to_string()] };
        let tails = Self { key: after, ..*self }.keys();
        let with_tails = |name: &str| -> Vec<String> {
            tails.iter().map(|tail| format!("{before}{name}{tail}")).collect()
        };
        names.split(',').flat_map(with_tails).collect()
    }
}

fn matches_pattern(pattern: &str, key: &str) -> bool {
    let alternatives = pattern.split_once('{').and_then(|(before, rest)| {
        let (names, after) = rest.split_once('}')?;
        Some((before, names, after))
    });
    let Some((before, names, after)) = alternatives else { return pattern == key };
    let Some(rest) = key.strip_prefix(before) else { return false };
    names.split(',').any(|name| rest.strip_prefix(name).is_some_and(|rest| matches_pattern(after, rest)))
}

const fn field(key: &'static str, kind: FieldKind, need: FieldNeed, meaning: &'static str) -> MachineField {
    MachineField { key, kind, need, meaning }
}

const fn number(min: f64, max: f64, unit: &'static str) -> FieldKind {
    Number(ValueRange::new(min, max, unit))
}

const VOLUME: FieldKind = number(1.0, 100_000.0, "cm3");
const DISPLACEMENT: FieldKind = number(0.1, 5000.0, "cm3/rev");
// With the temperature range, larger coefficients would make the property vanish somewhere.
const PER_KELVIN: FieldKind = number(-0.01, 0.01, "1/K");
const GEOMETRY: FieldNeed = ExactlyOneOf("`table`");

/// Every field of the machine file, in the order of the documentation.
pub const FIELDS: &[MachineField] = &[
    field("schema", Integer(ValueRange::new(1.0, 1.0, "")), Required, "Version of the layout."),
    field("name", Text, Required, "Name of the machine in reports, 1 to 100 characters."),
    field("oil", Table, Required, "Oil."),
    // Water is near 1000, phosphate esters near 1150, light oils near 700.
    field(
        "oil.density_kg_m3",
        number(500.0, 1500.0, "kg/m3"),
        Default(860.0),
        "Density at the standard atmosphere and `reference_c`.",
    ),
    field(
        "oil.bulk_modulus_mpa",
        number(100.0, 10_000.0, "MPa"),
        Required,
        "Bulk modulus beta_0 of the oil without air at `reference_c`.",
    ),
    // Above a fifth of air by volume Wylie's mixture is foam, which none of the models describe.
    field(
        "oil.air_fraction",
        number(0.0, 0.2, ""),
        Required,
        "Volume fraction c of undissolved air at the standard atmosphere.",
    ),
    field(
        "oil.heat_capacity_ratio",
        number(1.0, 2.0, ""),
        Required,
        "Polytropic exponent lambda of the air; 1.4 is adiabatic, 1 isothermal.",
    ),
    field("oil.walther_a", number(2.0, 20.0, ""), Default(5.51884), "Constant A of Walther's viscosity law."),
    field("oil.walther_b", number(0.5, 10.0, ""), Default(2.10704), "Constant B of Walther's viscosity law."),
    // The upper end stays well below the atmosphere, so that every case drain is liquid.
    field(
        "oil.vapour_pressure_mpa_abs",
        number(1.0e-6, 0.05, "MPa absolute"),
        Default(0.0005),
        "Vapour pressure, the floor of every chamber's pressure.",
    ),
    field(
        "oil.reference_c",
        number(-40.0, 150.0, "degC"),
        Default(60.0),
        "Temperature at which density and bulk modulus are given.",
    ),
    field(
        "oil.bulk_modulus_per_k",
        PER_KELVIN,
        Default(0.0),
        "Relative change of the bulk modulus per kelvin.",
    ),
    field("oil.density_per_k", PER_KELVIN, Default(0.0), "Relative change of the density per kelvin."),
    field("circuit", Table, Required, "Closed circuit; pressures are gauge."),
    field("circuit.low_pressure_mpa", number(0.0, 10.0, "MPa"), Required, "Pressure of the low line."),
    field(
        "circuit.case_pressure_mpa",
        number(-0.05, 2.0, "MPa"),
        Required,
        "Pressure in the cases of pump and motor.",
    ),
    field("circuit.dynamics", Table, LumpedModel, "Volumes and valves of the circuit."),
    field(
        "circuit.dynamics.{line_a,line_b}_volume_cm3",
        VOLUME,
        Required,
        "Volume of a line; A is the high line at positive displacement.",
    ),
    field(
        "circuit.dynamics.charge_gallery_volume_cm3",
        VOLUME,
        Required,
        "Volume between charge pump, charge relief valve and check valves.",
    ),
    field(
        "circuit.dynamics.flushing_gallery_volume_cm3",
        VOLUME,
        Required,
        "Volume between shuttle valve and flushing relief valve.",
    ),
    field("circuit.dynamics.charge_pump", Table, Required, "Charge pump, part 3 of the circuit."),
    field(
        "circuit.dynamics.charge_pump.displacement_cm3_per_rev",
        number(0.0, 1000.0, "cm3/rev"),
        Required,
        "Displacement per revolution of its own shaft; 0 shuts the charge circuit off.",
    ),
    field(
        "circuit.dynamics.charge_pump.speed_rpm",
        number(0.0, 10_000.0, "r/min"),
        ExactlyOneOf("`pump_shaft_ratio`"),
        "Speed of a charge pump with a motor of its own.",
    ),
    field(
        "circuit.dynamics.charge_pump.pump_shaft_ratio",
        number(0.0, 10.0, ""),
        ExactlyOneOf("`speed_rpm`"),
        "Speed of a geared charge pump over the speed of the main pump.",
    ),
    field("circuit.dynamics.charge_relief", Table, Required, "Relief valve 4, charge gallery to case."),
    field("circuit.dynamics.flushing_relief", Table, Required, "Relief valve 10, flushing gallery to case."),
    field(
        "circuit.dynamics.high_relief",
        Table,
        Optional,
        "Relief valves from either line to the charge gallery.",
    ),
    field(
        "circuit.dynamics.{charge,flushing,high}_relief.setting_mpa",
        number(0.01, 150.0, "MPa"),
        Required,
        "Pressure difference at `rated_flow_l_min`.",
    ),
    field(
        "circuit.dynamics.{charge,flushing,high}_relief.rated_flow_l_min",
        number(0.1, 10_000.0, "L/min"),
        Required,
        "Flow at the setting.",
    ),
    field(
        "circuit.dynamics.{charge,flushing,high}_relief.override_mpa",
        number(0.001, 50.0, "MPa"),
        Required,
        "Pressure rise from cracking to the setting; not above the setting.",
    ),
    field(
        "circuit.dynamics.check_valve",
        Table,
        Required,
        "Check valves 5 and 6, charge gallery to either line.",
    ),
    field("circuit.dynamics.shuttle", Table, Required, "Shuttle valve 9, low line to flushing gallery."),
    field(
        "circuit.dynamics.{check_valve,shuttle}.crack_mpa",
        number(0.0, 10.0, "MPa"),
        Required,
        "Pressure difference at which it starts to open; between the lines for the shuttle valve.",
    ),
    // A poppet that snaps open within less than 0.01 MPa would need its own dynamics to be well-posed.
    field(
        "circuit.dynamics.{check_valve,shuttle}.full_open_mpa",
        BoundByOther { unit: "MPa", allowed: "`crack_mpa` + 0.01 to 10.01" },
        Required,
        "Pressure difference at which it is fully open.",
    ),
    field(
        "circuit.dynamics.{check_valve,shuttle}.area_mm2",
        number(0.1, 10_000.0, "mm2"),
        Required,
        "Flow area when fully open.",
    ),
    field("pump", Table, Required, "Pump."),
    field("motor", Table, LumpedModel, "Motor; a test rig may have a flow meter instead."),
    field(
        "{pump,motor}.displacement_cm3_per_rev",
        DISPLACEMENT,
        Required,
        "Displacement at full swash angle.",
    ),
    // Fewer than three pistons cannot turn a shaft past dead centre; no real unit has more than fifteen.
    field("{pump,motor}.pistons", Integer(ValueRange::new(3.0, 15.0, "")), Required, "Number of pistons."),
    // Less than 1 % of the stroke volume cannot be machined; more than five strokes is a wrong unit.
    field(
        "{pump,motor}.dead_volume_cm3",
        BoundByOther { unit: "cm3", allowed: "0.01 to 5 stroke volumes of one piston" },
        Required,
        "Volume of ONE chamber at top dead centre and full swash angle.",
    ),
    field(
        "pump.inertia_kg_m2",
        number(1.0e-4, 1000.0, "kg m2"),
        Optional,
        "Moment of inertia of the pump's shaft.",
    ),
    field(
        "motor.inertia_kg_m2",
        number(1.0e-4, 1000.0, "kg m2"),
        LumpedModel,
        "Moment of inertia of the motor's shaft with everything rigidly on it.",
    ),
    field(
        "{pump,motor}.coulomb_friction_nm",
        number(0.0, 10_000.0, "N m"),
        Default(0.0),
        "Friction torque independent of speed.",
    ),
    field(
        "{pump,motor}.viscous_friction_nm_s",
        number(0.0, 100.0, "N m s"),
        Default(0.0),
        "Friction torque per speed in rad/s.",
    ),
    field("pump.swash", Table, LumpedModel, "Swash actuator: first-order lag with a rate limit."),
    field("pump.swash.time_constant_s", number(0.0, 10.0, "s"), Required, "Time constant; 0 is a pure ramp."),
    // A full stroke in less than a millisecond would be a blow, not a movement.
    field(
        "pump.swash.rate_per_s",
        number(0.01, 1000.0, "1/s"),
        Required,
        "Largest rate, full displacements per second.",
    ),
    field(
        "{pump,motor}.valve_plate",
        Table,
        LumpedModel,
        "Valve plate, from geometry or from a table of areas.",
    ),
    field(
        "{pump,motor}.valve_plate.discharge_coefficient",
        number(0.1, 1.0, ""),
        Required,
        "Discharge coefficient C_d of the ports.",
    ),
    field(
        "{pump,motor}.valve_plate.table",
        Text,
        ExactlyOneOf("the geometry"),
        "CSV file of areas in the machine file's folder.",
    ),
    field(
        "{pump,motor}.valve_plate.port_arc_deg",
        number(1.0, 119.0, "deg"),
        GEOMETRY,
        "Angle of one cylinder port; at most one piston pitch.",
    ),
    field(
        "{pump,motor}.valve_plate.kidney_radius_mm",
        number(1.0, 1000.0, "mm"),
        GEOMETRY,
        "Radius of the kidneys' centre line.",
    ),
    field(
        "{pump,motor}.valve_plate.kidney_width_mm",
        number(0.1, 500.0, "mm"),
        GEOMETRY,
        "Radial width of kidney and cylinder port.",
    ),
    // Negative: the port is already open at dead centre (underlap).
    field(
        "{pump,motor}.valve_plate.seal_land_deg",
        number(-20.0, 60.0, "deg"),
        GEOMETRY,
        "Angle from the edge of a port at dead centre to the next kidney; negative is underlap.",
    ),
    field(
        "{pump,motor}.valve_plate.{entry,exit}_groove",
        Table,
        Optional,
        "Silencing groove at the end of a kidney that a chamber meets first, and at the end it leaves last.",
    ),
    field(
        "{pump,motor}.valve_plate.{entry,exit}_groove.arc_deg",
        number(0.1, 40.0, "deg"),
        Required,
        "Angle from the kidney's edge to the groove's tip.",
    ),
    field(
        "{pump,motor}.valve_plate.{entry,exit}_groove.area_mm2",
        number(0.0, 500.0, "mm2"),
        Required,
        "Area where the groove meets the kidney.",
    ),
    field(
        "flow_meter",
        Table,
        ExactlyOneOf("`motor`"),
        "Flow meter at the pump's outlet, in place of a motor.",
    ),
    field(
        "flow_meter.reference_displacement_cm3_per_rev",
        DISPLACEMENT,
        Required,
        "Displacement of the ideal motor to whose speed the flow is converted.",
    ),
];
