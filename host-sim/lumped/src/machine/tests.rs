//! Machine file: the shipped machines load; invalid files are rejected with position, value and range.

use std::path::{Path, PathBuf};

use super::{Machine, plate_table};
use crate::invalid_input::InvalidInput;

const REFERENCE: &str = include_str!("../../../machines/reference.toml");

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines").join(name)
}

fn load(text: &str) -> Result<Machine, InvalidInput> {
    Machine::from_text(Path::new("m.toml"), text)
}

/// The reference file with one piece of text replaced, which must be there.
fn edited(from: &str, to: &str) -> String {
    assert!(REFERENCE.contains(from), "the reference file no longer has `{from}`");
    REFERENCE.replacen(from, to, 1)
}

#[test]
fn shipped_machines_load_and_are_complete() {
    for (name, pistons) in [("reference.toml", 9), ("seven-piston.toml", 7)] {
        let machine = Machine::load(&shipped(name)).unwrap();
        assert_eq!(machine.pump().pistons, pistons);
        assert!(machine.lumped_parts().is_ok());
    }
}

#[test]
fn rig_without_a_motor_needs_only_the_reduced_models_values() {
    let text = "schema = 1\nname = \"rig\"\n\
        [oil]\nbulk_modulus_mpa = 1400.0\nair_fraction = 0.005\nheat_capacity_ratio = 1.4\n\
        [circuit]\nlow_pressure_mpa = 0.0\ncase_pressure_mpa = 0.0\n\
        [pump]\ndisplacement_cm3_per_rev = 10.0\npistons = 9\ndead_volume_cm3 = 0.5\n\
        [flow_meter]\nreference_displacement_cm3_per_rev = 10.0\n";
    let machine = load(text).unwrap();
    assert!((machine.reference_displacement_cm3_per_rev() - 10.0).abs() < 1e-12);
    let error = machine.lumped_parts().unwrap_err().to_string();
    for part in ["[circuit.dynamics]", "[pump.valve_plate]", "[pump.swash]", "[motor]"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn every_bad_value_is_rejected_with_line_value_and_range() {
    let cases = [
        ("dead_volume_cm3 = 10.03 ", "dead_volume_cm3 = -10.03 ", "pump.dead_volume_cm3", "-10.03"),
        ("bulk_modulus_mpa = 1314.0", "bulk_modulus_mpa = nan", "oil.bulk_modulus_mpa", "NaN"),
        ("air_fraction = 0.002", "air_fraction = 0.5", "oil.air_fraction", "0.5"),
        ("pistons = 9", "pistons = 0", "pump.pistons", "0"),
        ("line_a_volume_cm3 = 600.0", "line_a_volume_cm3 = 0.0", "line_a_volume_cm3", "0"),
        ("vapour_pressure_mpa_abs = 0.0005", "vapour_pressure_mpa_abs = 0.09", "vapour_pressure", "0.09"),
        ("override_mpa = 0.3 ", "override_mpa = 3.0 ", "override_mpa", "3"),
        ("full_open_mpa = 0.3,", "full_open_mpa = 0.05,", "full_open_mpa", "0.05"),
    ];
    for (from, to, key, value) in cases {
        let error = load(&edited(from, to)).unwrap_err();
        let shown = error.to_string();
        assert!(error.line().is_some(), "{shown}");
        assert!(shown.contains(key) && shown.contains(value), "{shown}");
        assert!(error.allowed.is_some(), "{shown}");
    }
}

#[test]
fn unknown_missing_and_exclusive_keys_are_rejected() {
    let unknown = load(&edited("air_fraction = 0.002", "air_fraction = 0.002\nair_content = 1")).unwrap_err();
    assert!(unknown.to_string().contains("air_content"), "{unknown}");
    assert!(unknown.line().is_some());
    let missing = load(&edited("bulk_modulus_mpa = 1314.0", "")).unwrap_err();
    assert!(missing.to_string().contains("bulk_modulus_mpa"), "{missing}");
    let doubled = load(&format!("{REFERENCE}\n[flow_meter]\nreference_displacement_cm3_per_rev = 10.0\n"));
    assert!(doubled.unwrap_err().to_string().contains("one or the other"));
    let schema = load(&edited("schema = 1", "schema = 2")).unwrap_err();
    assert!(schema.to_string().contains("schema"), "{schema}");
}

#[test]
fn kidney_that_never_opens_is_rejected() {
    let text = edited("port_arc_deg = 28.0", "port_arc_deg = 39.0").replacen(
        "seal_land_deg = 4.0",
        "seal_land_deg = 60.0",
        1,
    );
    assert!(load(&text).is_ok(), "10.5 deg of half kidney are left");
    let text = edited("pistons = 9", "pistons = 3")
        .replacen("port_arc_deg = 28.0", "port_arc_deg = 100.0", 1)
        .replacen("seal_land_deg = 4.0", "seal_land_deg = 45.0", 1)
        .replacen("dead_volume_cm3 = 10.03", "dead_volume_cm3 = 30.0", 1);
    let error = load(&text).unwrap_err().to_string();
    assert!(error.contains("never open"), "{error}");
}

#[test]
fn plate_table_is_checked_row_by_row() {
    let parse = |text: &str| plate_table::parse(Path::new("t.csv"), text.as_bytes());
    let good = "angle_deg,area_a_mm2,area_b_mm2\n0,0,0\n90,0,300\n180,0,0\n270,300,0\n360,0,0\n";
    assert_eq!(parse(good).unwrap().angle_deg.len(), 5);
    for (bad, what, line) in [
        (good.replace("90,0,300", "90,-1,300"), "out of range", Some(3)),
        (good.replace("180,0,0", "80,0,0"), "increase", Some(4)),
        (good.replace("360,0,0", "350,0,0"), "end at 360", None),
        (good.replace("270,300,0", "270,0,0"), "never opens", None),
        (good.replace("270,300,0", "270,x,0"), "invalid", Some(5)),
        (good.replace("0,0,0\n90", "0,5,0\n90"), "differs", None),
    ] {
        let error = parse(&bad).unwrap_err();
        assert!(error.to_string().contains(what), "{error}");
        assert_eq!(error.line(), line, "{error}");
    }
}

#[test]
fn factors_scale_and_are_bounded() {
    let machine = load(REFERENCE).unwrap();
    let scaled = machine.with_pump_displacement_factor(1.01).unwrap();
    assert!((scaled.pump().displacement_cm3_per_rev - 303.9595).abs() < 1e-9);
    assert!(machine.with_bulk_modulus_factor(f64::NAN).is_err());
}
