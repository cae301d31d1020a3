//! The machine file as it is written: same keys, no checks. Unknown keys are refused here.

use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub schema: i64,
    pub name: String,
    pub oil: Oil,
    pub circuit: Circuit,
    pub pump: Unit,
    pub motor: Option<Unit>,
    pub flow_meter: Option<FlowMeter>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Oil {
    pub density_kg_m3: Option<f64>,
    pub bulk_modulus_mpa: f64,
    pub air_fraction: f64,
    pub heat_capacity_ratio: f64,
    pub walther_a: Option<f64>,
    pub walther_b: Option<f64>,
    pub vapour_pressure_mpa_abs: Option<f64>,
    pub reference_c: Option<f64>,
    pub bulk_modulus_per_k: Option<f64>,
    pub density_per_k: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Circuit {
    pub low_pressure_mpa: f64,
    pub case_pressure_mpa: f64,
    pub dynamics: Option<Dynamics>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Dynamics {
    pub line_a_volume_cm3: f64,
    pub line_b_volume_cm3: f64,
    pub charge_gallery_volume_cm3: f64,
    pub flushing_gallery_volume_cm3: f64,
    pub charge_pump: ChargePump,
    pub charge_relief: Relief,
    pub check_valve: Valve,
    pub shuttle: Valve,
    pub flushing_relief: Relief,
    pub high_relief: Option<Relief>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ChargePump {
    pub displacement_cm3_per_rev: f64,
    pub speed_rpm: Option<f64>,
    pub pump_shaft_ratio: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Relief {
    pub setting_mpa: f64,
    pub rated_flow_l_min: f64,
    pub override_mpa: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Valve {
    pub crack_mpa: f64,
    pub full_open_mpa: f64,
    pub area_mm2: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Unit {
    pub displacement_cm3_per_rev: f64,
    pub pistons: i64,
    pub dead_volume_cm3: f64,
    pub inertia_kg_m2: Option<f64>,
    pub coulomb_friction_nm: Option<f64>,
    pub viscous_friction_nm_s: Option<f64>,
    pub valve_plate: Option<Plate>,
    pub swash: Option<Swash>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Plate {
    pub discharge_coefficient: f64,
    pub table: Option<String>,
    pub port_arc_deg: Option<f64>,
    pub kidney_radius_mm: Option<f64>,
    pub kidney_width_mm: Option<f64>,
    pub seal_land_deg: Option<f64>,
    pub entry_groove: Option<Groove>,
    pub exit_groove: Option<Groove>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Groove {
    pub arc_deg: f64,
    pub area_mm2: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Swash {
    pub time_constant_s: f64,
    pub rate_per_s: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FlowMeter {
    pub reference_displacement_cm3_per_rev: f64,
}
