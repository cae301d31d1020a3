//! Bad input of the lumped model's commands ends in exit code 2 with cause and value, never in a panic or a hang.

mod support;

use std::path::PathBuf;
use std::process::Output;

use support::host_sim;

const REFERENCE: &str = include_str!("../machines/reference.toml");

fn machine(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("machines").join(name)
}

/// Runs a command of the lumped model on the reference machine.
fn on_reference(command: &str, extra: &[&str]) -> Output {
    let file = machine("reference.toml");
    host_sim([command, "--machine", file.to_str().unwrap()].iter().chain(extra))
}

fn simulate(extra: &[&str]) -> Output {
    on_reference("simulate", extra)
}

/// The step response of the paper's fig. 7.
fn step(extra: &[&str]) -> Output {
    let point = ["--n-p-rpm", "2000", "--load-nm", "1671"];
    on_reference("step", &[&point, extra].concat())
}

fn error_text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn values_out_of_range_are_named_with_value_and_range() {
    for (args, cause, value) in [
        (&["--n-p-rpm", "0", "--p-h-mpa", "30"][..], "pump speed", "0"),
        (&["--n-p-rpm", "-500", "--p-h-mpa", "30"], "pump speed", "-500"),
        (&["--n-p-rpm", "NaN", "--p-h-mpa", "30"], "pump speed", "NaN"),
        (&["--n-p-rpm", "2000", "--p-h-mpa", "-0.2"], "high pressure", "-0.2"),
        (&["--n-p-rpm", "2000", "--p-h-mpa", "1.6"], "high pressure", "1.6"),
        (&["--n-p-rpm", "2000", "--p-h-mpa", "500"], "high pressure", "500"),
        (&["--n-p-rpm", "2000", "--p-h-mpa", "30", "--step-deg", "30"], "step size", "30"),
        (&["--n-p-rpm", "2000", "--p-h-mpa", "30", "--step-deg", "0"], "step size", "0"),
        (&["--n-p-rpm", "2000", "--p-h-mpa", "30", "--alpha", "0"], "displacement fraction", "0"),
        (&["--n-p-rpm", "2000", "--p-h-mpa", "30", "--alpha", "1.5"], "displacement fraction", "1.5"),
        (&["--n-p-rpm", "2000", "--p-h-mpa", "30", "--kou", "-0.1"], "leakage coefficient", "-0.1"),
        (&["--n-p-rpm", "2000", "--p-h-mpa", "30", "--t-b-c", "400"], "temperature", "400"),
        (&["--n-p-rpm", "2000", "--load-nm", "-5"], "load", "-5"),
    ] {
        let output = simulate(args);
        let text = error_text(&output);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {text}");
        assert!(text.contains(cause) && text.contains(value) && text.contains("allowed"), "{args:?}: {text}");
        assert!(output.stdout.is_empty(), "{args:?}");
    }
}

#[test]
fn a_pressure_that_leakage_makes_unreachable_is_named() {
    let output = simulate(&["--n-p-rpm", "500", "--p-h-mpa", "50", "--kou", "2"]);
    assert_eq!(output.status.code(), Some(2));
    let text = error_text(&output);
    assert!(text.contains("50 MPa cannot be reached") && text.contains("leakage"), "{text}");
    let output = simulate(&["--n-p-rpm", "2000", "--load-nm", "100000", "--kou", "0.1"]);
    assert_eq!(output.status.code(), Some(2), "{}", error_text(&output));
    assert!(error_text(&output).contains("load of 100000 N m"), "{}", error_text(&output));
}

#[test]
fn bad_machines_are_rejected_with_line_and_range() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("m.toml");
    for (from, to, cause) in [
        ("line_a_volume_cm3 = 600.0", "line_a_volume_cm3 = -600.0", "line_a_volume_cm3"),
        ("seal_land_deg = 4.0", "seal_land_deg = 76.0", "seal_land_deg"),
        ("low_pressure_mpa = 1.5", "low_pressure_mpa = -0.2", "low_pressure_mpa"),
        ("inertia_kg_m2 = 0.3", "inertia_kg_m2 = 0.0", "inertia_kg_m2"),
    ] {
        assert!(REFERENCE.contains(from), "{from}");
        std::fs::write(&file, REFERENCE.replacen(from, to, 1)).unwrap();
        let output = host_sim([
            "simulate",
            "--machine",
            file.to_str().unwrap(),
            "--n-p-rpm",
            "2000",
            "--p-h-mpa",
            "30",
        ]);
        let text = error_text(&output);
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.contains(cause) && text.contains("allowed") && text.contains("m.toml:"), "{text}");
    }
}

#[test]
fn a_machine_without_the_lumped_models_parts_names_the_missing_ones() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("m.toml");
    let start = REFERENCE.find("[circuit.dynamics]").unwrap();
    let end = REFERENCE.find("[pump]").unwrap();
    std::fs::write(&file, format!("{}{}", &REFERENCE[..start], &REFERENCE[end..])).unwrap();
    let output =
        host_sim(["simulate", "--machine", file.to_str().unwrap(), "--n-p-rpm", "2000", "--p-h-mpa", "30"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(error_text(&output).contains("[circuit.dynamics]"), "{}", error_text(&output));
}

#[test]
fn a_step_response_that_does_not_settle_says_so() {
    let output = step(&["--duration-s", "0.05"]);
    assert_eq!(output.status.code(), Some(1), "{}", error_text(&output));
    assert!(error_text(&output).contains("no steady state"), "{}", error_text(&output));
}

#[test]
fn json_is_one_object_with_the_promised_fields() {
    let dir = tempfile::tempdir().unwrap();
    let waves = dir.path().join("w.csv");
    let output = simulate(&[
        "--n-p-rpm",
        "2000",
        "--p-h-mpa",
        "36.5",
        "--kou",
        "0.1",
        "--json",
        "--waveforms",
        waves.to_str().unwrap(),
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", error_text(&output));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for field in [
        "ratio",
        "p_h_mpa",
        "p_l_mpa",
        "torque_nm",
        "leakage_l_min",
        "ripple_p_h_mpa",
        "mass_balance_error",
        "sim_seconds",
        "wall_seconds",
    ] {
        assert!(json[field].as_f64().is_some_and(f64::is_finite), "{field}: {json}");
    }
    assert!(json["mass_balance_error"].as_f64().unwrap() < 1e-6);
    let csv = std::fs::read_to_string(&waves).unwrap();
    let heading: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    for column in [
        "time_s",
        "phi_p_deg",
        "phi_m_deg",
        "p_pump_9_mpa",
        "p_motor_1_mpa",
        "p_a_mpa",
        "torque_m_nm",
        "n_m_rpm",
    ] {
        assert!(heading.contains(&column), "{column}");
    }
    assert_eq!(csv.lines().count(), 1 + 7200);

    let output = step(&["--kou", "0.113", "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for field in ["n_m_steady_rpm", "overshoot_pct", "settling_s", "oscillation_hz"] {
        assert!(json[field].as_f64().is_some_and(f64::is_finite), "{field}: {json}");
    }
}

#[test]
fn paper_writes_every_figure_and_meets_the_published_values() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("figures");
    let output = on_reference("paper", &["--out", out.to_str().unwrap(), "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", error_text(&output));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["within"], true);
    // Each published number served to choose a constant of the reference machine, and the report says so.
    for value in json["values"].as_array().unwrap() {
        assert!(value["basis"].as_str().unwrap().starts_with("fitted"), "{value}");
    }
    for figure in ["fig3_port_areas", "fig4_bulk_modulus", "fig5_ripple", "fig7_step", "fig8_ratio"] {
        for kind in ["csv", "svg"] {
            let text = std::fs::read_to_string(out.join(format!("{figure}.{kind}"))).unwrap();
            assert!(text.len() > 1000, "{figure}.{kind} is nearly empty");
        }
    }
}
