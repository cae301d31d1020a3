//! Parts of a machine as checked values. Ranges and defaults: `fields.rs`.

/// Oil properties. Temperature dependence is linear about `reference_c`; its coefficients are relative changes per
/// kelvin.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct OilProperties {
    /// Density at the standard atmosphere and `reference_c`.
    pub density_kg_m3: f64,
    /// Bulk modulus beta_0 of the oil without air at `reference_c`.
    pub bulk_modulus_mpa: f64,
    /// Volume fraction c of undissolved air at the standard atmosphere.
    pub air_fraction: f64,
    /// Exponent lambda of the air's change of state.
    pub heat_capacity_ratio: f64,
    /// Constant A of Walther's viscosity law log10 log10(nu + 0.7) = A - B log10(T/K).
    pub walther_a: f64,
    /// Constant B of Walther's viscosity law.
    pub walther_b: f64,
    /// Vapour pressure, the floor of every chamber's pressure.
    pub vapour_pressure_mpa_abs: f64,
    /// Temperature at which density and bulk modulus are given.
    pub reference_c: f64,
    /// Relative change of the bulk modulus per kelvin; negative for real oils, 0 by default.
    pub bulk_modulus_per_k: f64,
    /// Relative change of the density per kelvin; negative for real oils, 0 by default.
    pub density_per_k: f64,
}

/// Circuit: the two pressures that every model needs, and the dynamics for the lumped model.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Circuit {
    /// Gauge pressure of the low line.
    pub low_pressure_mpa: f64,
    /// Gauge pressure in the cases of pump and motor.
    pub case_pressure_mpa: f64,
    /// Volumes and valves, when the file has them.
    pub dynamics: Option<CircuitDynamics>,
}

/// Volumes, charge pump and valves of the closed circuit (paper fig. 1).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CircuitDynamics {
    /// Volume of line A, the high line at positive displacement.
    pub line_a_volume_cm3: f64,
    /// Volume of line B.
    pub line_b_volume_cm3: f64,
    /// Volume between charge pump, relief valve 4 and the check valves.
    pub charge_gallery_volume_cm3: f64,
    /// Volume between shuttle valve 9 and relief valve 10.
    pub flushing_gallery_volume_cm3: f64,
    /// Charge pump 3.
    pub charge_pump: ChargePump,
    /// Relief valve 4, from the charge gallery to the case.
    pub charge_relief: ReliefValve,
    /// Check valves 5 and 6, from the charge gallery into either line.
    pub check_valve: OpeningValve,
    /// Shuttle valve 9, from the line that is low to the flushing gallery.
    pub shuttle: OpeningValve,
    /// Relief valve 10, from the flushing gallery to the case.
    pub flushing_relief: ReliefValve,
    /// Relief valves from each line to the charge gallery, when fitted.
    pub high_relief: Option<ReliefValve>,
}

/// Charge pump 3. A displacement of 0 shuts the charge circuit off.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ChargePump {
    /// Displacement per revolution of its own shaft.
    pub displacement_cm3_per_rev: f64,
    /// Drive of its shaft.
    pub drive: ChargeDrive,
}

/// Drive of the charge pump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChargeDrive {
    /// A motor of its own at this speed, r/min.
    OwnSpeedRpm(f64),
    /// The main pump's shaft, with this ratio of charge-pump speed to main-pump speed.
    PumpShaftRatio(f64),
}

/// Relief valve: shut below cracking, then flow in proportion to the pressure above it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ReliefValve {
    /// Pressure difference across the valve at which it passes `rated_flow_l_min`.
    pub setting_mpa: f64,
    /// Flow at the setting.
    pub rated_flow_l_min: f64,
    /// Rise from cracking to the setting.
    pub override_mpa: f64,
}

/// Valve whose flow area grows with a pressure difference: shut below cracking, fully open above.
///
/// A check valve opens by the difference across itself; the low side of the shuttle valve by the difference between the
/// lines.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct OpeningValve {
    /// Pressure difference at which it starts to open.
    pub crack_mpa: f64,
    /// Pressure difference at which it is fully open.
    pub full_open_mpa: f64,
    /// Flow area when fully open.
    pub area_mm2: f64,
}

/// Axial-piston unit: pump or motor.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PistonUnit {
    /// Displacement per revolution at full swash.
    pub displacement_cm3_per_rev: f64,
    /// Number of pistons.
    pub pistons: usize,
    /// Volume left in ONE chamber at top dead centre and full swash.
    pub dead_volume_cm3: f64,
    /// Valve plate, when the file has it.
    pub valve_plate: Option<ValvePlate>,
    /// Moment of inertia of the shaft with everything rigidly on it.
    pub inertia_kg_m2: Option<f64>,
    /// Shaft friction.
    pub friction: ShaftFriction,
    /// Swash actuator, when the file has it (pump).
    pub swash: Option<SwashActuator>,
}

impl PistonUnit {
    /// Stroke volume V_s of one piston at full swash: D/Z.
    #[must_use]
    pub fn stroke_volume_cm3(&self) -> f64 {
        self.displacement_cm3_per_rev / self.pistons as f64
    }
}

/// Shaft friction torque: a constant part against the motion and a part in proportion to speed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct ShaftFriction {
    /// Constant part.
    pub coulomb_nm: f64,
    /// Part in proportion to speed.
    pub viscous_nm_s: f64,
}

/// Swash actuator: first-order lag with a limited rate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SwashActuator {
    /// Time constant of the lag; 0 is a pure ramp.
    pub time_constant_s: f64,
    /// Largest rate, full displacements per second.
    pub rate_per_s: f64,
}

/// Ports between chambers and kidneys: from geometry or from a table.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ValvePlate {
    /// Discharge coefficient C_d of the ports.
    pub discharge_coefficient: f64,
    /// Source of the port areas.
    pub areas: PortAreas,
}

/// Source of a valve plate's areas.
#[derive(Debug, Clone, PartialEq)]
pub enum PortAreas {
    /// Cylinder port, kidneys, lands and grooves.
    Geometry(PlateGeometry),
    /// Angle against area, as it comes from CAD or CFD.
    Table(PlateTable),
}

/// Geometry of a valve plate (paper fig. 3): two equal kidneys with a silencing groove at each end.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct PlateGeometry {
    /// Angle covered by one cylinder port.
    pub port_arc_deg: f64,
    /// Radius of the kidneys' centre line.
    pub kidney_radius_mm: f64,
    /// Radial width of kidney and cylinder port.
    pub kidney_width_mm: f64,
    /// Angle between the edge of a cylinder port at dead centre and the nearest kidney edge.
    pub seal_land_deg: f64,
    /// Groove at the end of a kidney that a chamber meets first in forward rotation.
    pub entry_groove: SilencingGroove,
    /// Groove at the end of a kidney that a chamber leaves last.
    pub exit_groove: SilencingGroove,
}

/// Silencing groove: area grows with the square of the angle by which the port has reached into it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SilencingGroove {
    /// Angle by which it reaches from the kidney's edge into the land.
    pub arc_deg: f64,
    /// Area where it meets the kidney.
    pub area_mm2: f64,
}

/// Areas against angle over one revolution; the first and the last row describe the same angle.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PlateTable {
    /// Angle of the chamber from its top dead centre, 0 to 360, increasing.
    pub angle_deg: Vec<f64>,
    /// Area to the kidney of line A.
    pub area_a_mm2: Vec<f64>,
    /// Area to the kidney of line B.
    pub area_b_mm2: Vec<f64>,
}

/// Receiver of the pump's flow.
#[derive(Debug, Clone, PartialEq)]
pub enum FlowReceiver {
    /// A piston motor.
    Motor(PistonUnit),
    /// A flow meter at the pump's outlet.
    FlowMeter(FlowMeter),
}

/// Flow meter instead of a motor: flow is reported as the speed ratio of an ideal motor of this displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct FlowMeter {
    /// Displacement, per revolution, of the ideal motor that represents the meter.
    pub reference_displacement_cm3_per_rev: f64,
}

/// Parts that only the lumped model needs, all present.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct LumpedParts<'a> {
    /// Volumes and valves.
    pub dynamics: &'a CircuitDynamics,
    /// The pump's valve plate.
    pub pump_plate: &'a ValvePlate,
    /// The pump's swash actuator.
    pub swash: SwashActuator,
    /// Motor.
    pub motor: &'a PistonUnit,
    /// The motor's valve plate.
    pub motor_plate: &'a ValvePlate,
    /// The motor's inertia.
    pub motor_inertia_kg_m2: f64,
}
