//! Identification, calibration and replay of the shipped synthetic records, and the error messages of invalid input.

mod support;

use std::path::Path;

use kou_estimator::record;
use support::{Folder, failure, host_sim, json, root};

const MACHINE: &str = "host-sim/machines/reference.toml";
const BENCH: &str = "tests/data/bench_45.csv";
const DRIVE: &str = "tests/data/drive.csv";

fn identify(folder: &Folder, name: &str) -> serde_json::Value {
    identify_by(folder, name, "rom", "joint")
}

fn identify_by(folder: &Folder, name: &str, model: &str, scheme: &str) -> serde_json::Value {
    let out = folder.path(name);
    let arguments = [
        "identify",
        "--bench",
        BENCH,
        "--machine",
        MACHINE,
        "--model",
        model,
        "--scheme",
        scheme,
        "--json",
        "--out",
    ];
    json(arguments.into_iter().chain([out.to_str().unwrap()]))
}

/// Identification of a bench table with the reference machine.
fn identify_arguments<'a>(bench: &'a Path, out: &'a Path) -> [&'a str; 8] {
    let (bench, out) = (bench.to_str().unwrap(), out.to_str().unwrap());
    ["identify", "--bench", bench, "--machine", MACHINE, "--out", out, "--json"]
}

/// True leakage coefficient of each point of the shipped bench table, its last column.
fn truth() -> Vec<f64> {
    let text = std::fs::read_to_string(root().join(BENCH)).unwrap();
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .map(|line| line.rsplit(',').next().unwrap().parse().unwrap())
        .collect()
}

#[test]
fn val_identified_coefficients_agree_with_the_synthetic_truth() {
    let folder = Folder::new();
    let report = identify_by(&folder, "cal.toml", "full", "joint");
    let points = report["points"].as_array().unwrap();
    assert_eq!(points.len(), 45);
    let mut sum = 0.0;
    for (point, truth) in points.iter().zip(truth()) {
        sum += (point["kou"].as_f64().unwrap() / truth - 1.0).abs();
    }
    let mean_pct = 100.0 * sum / 45.0;
    println!("mean error of Kou {mean_pct:.2} %, of the ratio {} %", report["ratio_error_mean_pct"]);
    // Random errors: 0.028 % of ratio (two speeds at 0.02 %) is 0.36 to 2.5 % of Kou over the grid, on average 0.7 %.
    // Systematic errors of the speed sensors are identified as displacement, to 0.05 %, which is 1.5 % of Kou; that of
    // pressure is 0.5 % of Kou. Together 1.7 %.
    assert!(mean_pct < 2.0, "{mean_pct}");
    // The misfit of a quadratic is 1.8 % of Kou, which is 0.1 % of the ratio for a leakage of 6 % of the flow; noise 0.028 %.
    assert!(report["ratio_error_mean_pct"].as_f64().unwrap() < 0.15);
    assert_eq!(report["dropped_terms"].as_array().unwrap().len(), 0);
    assert!(report["condition_number"].as_f64().unwrap() < 400.0);
    for name in ["a11", "a22", "a33", "a12", "a13", "a23", "b1", "b2", "b3", "c"] {
        assert!(report["law"]["normalised"][name].is_number() && report["law"]["physical"][name].is_number());
    }
}

#[test]
fn replay_estimates_the_drive_and_counts_every_injected_fault() {
    let folder = Folder::new();
    identify(&folder, "cal.toml");
    let (cal, est, svg) = (folder.path("cal.toml"), folder.path("est.csv"), folder.path("est.svg"));
    let arguments = [
        "replay",
        "--log",
        DRIVE,
        "--calibration",
        cal.to_str().unwrap(),
        "--out",
        est.to_str().unwrap(),
        "--plot",
        svg.to_str().unwrap(),
        "--json",
    ];
    let report = json(arguments);
    assert_eq!(report["samples"], 4800);
    // Row ranges of the generator.
    for (reason, count) in [
        ("p_h:open", 20),
        ("p_h:not_finite", 5),
        ("p_h:out_of_range", 5),
        ("n_m:missing", 30),
        ("n_m:stuck", 10),
        ("t_b:short", 30),
        ("t_b:not_finite", 5),
        ("displacement_too_small", 200),
    ] {
        assert_eq!(report["rejected"][reason], count, "{reason}");
    }
    let rejected: u64 = report["rejected"].as_object().unwrap().values().map(|v| v.as_u64().unwrap()).sum();
    assert_eq!(report["accepted"].as_u64().unwrap() + rejected, 4800);
    assert!(report["samples_per_s"].as_f64().unwrap() > 0.0 && report["kou_mean"].as_f64().unwrap() > 0.0);

    // The leak that begins at 340 s is 1.35 times the law; before, the machine is as calibrated.
    let text = std::fs::read_to_string(est).unwrap();
    let mut lines = text.lines();
    let column = lines.next().unwrap().split(',').position(|c| c == "wear_ratio").unwrap();
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let Ok(wear) = cells[column].parse::<f64>() else { continue };
        let time: f64 = cells[0].parse().unwrap();
        if time < 340.0 { before.push(wear) } else { after.push(wear) }
    }
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    println!("wear ratio {:.4} before the leak, {:.4} after", mean(&before), mean(&after));
    // The misfit of the law is some 0.8 %; the noise of means over thousands of samples is negligible.
    assert!((mean(&before) - 1.0).abs() < 0.02, "{}", mean(&before));
    assert!((mean(&after) - 1.35).abs() < 0.03, "{}", mean(&after));
    let picture = std::fs::read_to_string(svg).unwrap();
    // Three measured curves and two expected ones: about one point for each of the 1000 pixels of the width.
    for (colour, curves) in [("#0072B2", 3), ("#D55E00", 2)] {
        let drawn = picture.lines().filter(|line| line.starts_with("<polyline") && line.contains(colour));
        let points: usize = drawn.map(|line| line.matches(',').count()).sum();
        assert!((800 * curves..2000 * curves).contains(&points), "{colour}: {points}");
    }
    // At most twice as many points, of eight characters each, and axes.
    assert!(picture.len() < 100_000, "{} bytes", picture.len());
}

#[test]
fn shipped_records_equal_the_output_of_the_generator() {
    let folder = Folder::new();
    let (bench, drive) = (folder.path("b.csv"), folder.path("d.csv"));
    let output = host_sim([
        "synth",
        "--machine",
        MACHINE,
        "--seed",
        "1",
        "--class",
        "A",
        "--out",
        bench.to_str().unwrap(),
        "--drive",
        drive.to_str().unwrap(),
    ]);
    assert!(output.status.success());
    for (made, shipped) in [(bench, BENCH), (drive, DRIVE)] {
        let shipped = std::fs::read_to_string(root().join(shipped)).unwrap();
        assert!(shipped.starts_with("# SYNTHETIC"));
        assert!(std::fs::read_to_string(made).unwrap() == shipped, "regenerate with `host-sim synth`");
    }
}

#[test]
fn toml_and_record_convert_both_ways_without_loss() {
    let folder = Folder::new();
    identify(&folder, "cal.toml");
    identify(&folder, "cal.bin");
    let from_toml = kou_records::calibration::read(&folder.path("cal.toml")).unwrap();
    let from_record = kou_records::calibration::read(&folder.path("cal.bin")).unwrap();
    assert_eq!(from_toml, from_record);
    let again = folder.path("again.toml");
    kou_records::calibration::write(&again, &from_record).unwrap();
    assert_eq!(std::fs::read(again).unwrap(), std::fs::read(folder.path("cal.toml")).unwrap());
}

#[test]
fn prop_every_finite_f32_survives_the_toml_form() {
    let folder = Folder::new();
    identify(&folder, "cal.toml");
    let good = kou_records::calibration::read(&folder.path("cal.toml")).unwrap();
    // A multiplicative walk through the bit patterns: 20 000 values of every exponent and sign.
    let mut bits = 1_u32;
    let mut buffer = [0_u8; record::calibration::MAX_LEN];
    for _ in 0..2_000 {
        let mut calibration = good.clone();
        for slot in [
            &mut calibration.law.a11,
            &mut calibration.law.a22,
            &mut calibration.law.a33,
            &mut calibration.law.c,
        ] {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let value = f32::from_bits(bits);
            *slot = if value.is_finite() { value } else { -0.0 };
        }
        let text = kou_records::calibration::to_toml(&calibration).unwrap();
        let file = kou_records::TomlFile::from_text("c.toml".as_ref(), text).unwrap();
        let back = kou_records::calibration::from_toml(&file).unwrap();
        // Compared as records, so that the sign of zero counts.
        let length = record::calibration::encode(&calibration, &mut buffer).unwrap();
        let wanted = buffer[..length].to_vec();
        let length = record::calibration::encode(&back, &mut buffer).unwrap();
        assert_eq!(wanted, buffer[..length]);
    }
}

#[test]
fn invalid_bench_tables_are_reported_with_file_line_column_value_and_range() {
    let folder = Folder::new();
    let out = folder.path("cal.toml");
    let heading = "n_p_rpm,p_h_mpa,t_b_c,ratio\n";
    for (text, parts) in [
        ("1000,310.6,60,0.9\n", &["bench.csv:2", "p_h_mpa", "310.6", "0.5 to 100 MPa"][..]),
        ("1000,31,333.15,0.9\n", &["bench.csv:2", "t_b_c", "333.15", "-40 to 150 degC"]),
        ("1000,31,60,0.9\n0,31,60,0.9\n", &["bench.csv:3", "n_p_rpm", "`0`", "1 to 20000 r/min"]),
        ("1000,31,60,1.3\n", &["bench.csv:2", "ratio", "1.3", "-1.2 to 1.2"]),
        ("1000,31,60,-0.9\n", &["bench.csv:2", "ratio", "-0.9", "sign of the displacement"]),
        ("1000,31,60,NaN\n", &["bench.csv:2", "ratio", "NaN"]),
        ("1000,31,60,\n", &["bench.csv:2", "ratio", "missing"]),
        ("1000,31,sixty,0.9\n", &["bench.csv:2", "t_b_c", "sixty", "not a number"]),
        ("1000,31,60\n", &["bench.csv:2", "3 cells", "heading has 4"]),
        ("1000,31,60,0.999\n", &["bench.csv", "above the leak-free ratio", "0.96"]),
        ("", &["bench.csv", "no points"]),
    ] {
        let bench = folder.write("bench.csv", format!("{heading}{text}"));
        let error = failure(2, identify_arguments(&bench, &out));
        for part in parts {
            assert!(error.contains(part), "`{part}` is not in: {error}");
        }
        assert!(!out.exists(), "a calibration was written in spite of: {error}");
    }
}

#[test]
fn points_above_the_leak_free_ratio_are_reported_and_rejected() {
    let folder = Folder::new();
    let shipped = std::fs::read_to_string(root().join(BENCH)).unwrap();
    let mut lines: Vec<String> = shipped.lines().map(str::to_string).collect();
    // Above the leak-free ratio, which no leakage can explain.
    lines[10] = "1000.00,30.000,30.00,0.999000,0.04".to_string();
    let bench = folder.write("bench.csv", lines.join("\n"));
    let out = folder.path("cal.toml");
    let report = json(identify_arguments(&bench, &out));
    assert_eq!(report["points"].as_array().unwrap().len(), 44);
    assert_eq!(report["refused_points"][0]["line"], 11);
    assert_eq!(report["refused_points"][0]["reason"], "ratio_above_leak_free");
}

#[test]
fn incomplete_tables_give_a_partial_law_and_name_the_undetermined_terms() {
    let folder = Folder::new();
    let shipped = std::fs::read_to_string(root().join(BENCH)).unwrap();
    let (heading, rows): (Vec<&str>, Vec<&str>) = {
        let all: Vec<&str> = shipped.lines().collect();
        (all[..4].to_vec(), all[4..].to_vec())
    };
    let run = |rows: &[&str]| {
        let text = heading.iter().chain(rows).copied().collect::<Vec<_>>().join("\n");
        let bench = folder.write("bench.csv", text);
        let out = folder.path("cal.toml");
        json(identify_arguments(&bench, &out))
    };
    let dropped = |report: &serde_json::Value| {
        report["dropped_terms"]
            .as_array()
            .unwrap()
            .iter()
            .map(|t| t.as_str().unwrap().to_string())
            .collect::<Vec<_>>()
    };
    // Two points of different speed and pressure: a constant and one slope.
    let two = run(&[rows[0], rows[20]]);
    assert_eq!((two["points"].as_array().unwrap().len(), dropped(&two).len()), (2, 8));
    // One temperature: no term that depends on it.
    let fixed: Vec<String> = rows[..15]
        .iter()
        .map(|row| {
            let mut cells: Vec<&str> = row.split(',').collect();
            cells[2] = "30.00";
            cells.join(",")
        })
        .collect();
    let one_temperature = run(&fixed.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(dropped(&one_temperature), ["b3", "a33", "a13", "a23"]);
    assert_eq!(one_temperature["law"]["normalised"]["b3"], 0.0);
    // A copied row counts once and is reported.
    let mut copied = rows.clone();
    copied.insert(7, rows[3]);
    let repeated = run(&copied);
    assert_eq!(repeated["points"].as_array().unwrap().len(), 45);
    assert_eq!(repeated["refused_points"][0]["line"], 12);
    assert_eq!(repeated["refused_points"][0]["reason"], "repeats line 8");
}

#[test]
fn file_of_200_megabytes_is_rejected_as_a_log() {
    use std::io::Write;
    let folder = Folder::new();
    let path = folder.path("huge.csv");
    let mut file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    writeln!(file, "n_p_rpm,p_h_mpa,t_b_c,ratio").unwrap();
    let block = "1000.00,30.000,60.00,0.91\n".repeat(1000);
    for _ in 0..8000 {
        file.write_all(block.as_bytes()).unwrap();
    }
    drop(file);
    assert!(std::fs::metadata(&path).unwrap().len() > 200_000_000);
    let out = folder.path("cal.toml");
    let arguments =
        ["identify", "--machine", MACHINE, "--bench", path.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let error = failure(2, arguments);
    assert!(error.contains("more than 10000 points") && error.contains("huge.csv:10002"), "{error}");
}

#[test]
fn invalid_logs_calibrations_and_mappings_are_reported_with_their_location() {
    let folder = Folder::new();
    // Two-step scheme: the calibration has the constants of the machine file, which are edited below.
    identify_by(&folder, "cal.toml", "rom", "paper");
    let good = std::fs::read_to_string(folder.path("cal.toml")).unwrap();
    let replay = |log: &str, calibration: &str, map: Option<&str>| {
        let mut arguments = vec!["replay", "--log", log, "--calibration", calibration];
        arguments.extend(map.iter().flat_map(|m| ["--map", m]));
        failure(2, arguments)
    };
    let has = |error: String, parts: &[&str]| {
        for part in parts {
            assert!(error.contains(part), "`{part}` is not in: {error}");
        }
    };
    let cal = folder.path("cal.toml").to_str().unwrap().to_string();
    // Logs.
    let log = folder
        .write("log.csv", "time_s,n_p_rpm,n_m_rpm,p_h_mpa,t_b_c\n0,1000,900,30,60\n1,1000,fast,30,60\n");
    has(replay(log.to_str().unwrap(), &cal, None), &["log.csv:3", "n_m_rpm", "fast", "stuck"]);
    let log = folder.write("log.csv", "time_s,n_p_rpm,n_m_rpm,p_h_mpa\n0,1000,900,30\n");
    has(replay(log.to_str().unwrap(), &cal, None), &["log.csv", "t_b_c", "n_p_rpm, n_m_rpm"]);
    let log = folder.write("log.csv", "time_s,n_p_rpm,p_h_mpa,t_b_c\n0,1000,30,60\n");
    has(replay(log.to_str().unwrap(), &cal, None), &["flow_l_min"]);
    let log = folder.write("log.csv", "time_s,n_p_rpm,n_m_rpm,p_h_mpa,t_b_c\nlater,1000,900,30,60\n");
    has(replay(log.to_str().unwrap(), &cal, None), &["log.csv:2", "time_s", "later"]);
    let log = folder.write("log.csv", b"time_s,n_p_rpm,n_m_rpm,p_h_mpa,t_b_c\n0,\xff\xfe,900,30,60\n");
    has(replay(log.to_str().unwrap(), &cal, None), &["log.csv", "UTF-8"]);
    has(replay("no/such/log.csv", &cal, None), &["no/such/log.csv", "cannot be opened"]);
    // Calibrations.
    let edits = [
        (
            "bulk_modulus_mpa = 1314.0",
            "bulk_modulus_mpa = 13140.0",
            &["bulk_modulus_mpa", "13140", "300 to 5000"][..],
        ),
        ("bulk_modulus_mpa = 1314.0", "bulk_modulus_mpa = nan", &["bulk_modulus_mpa", "not a finite number"]),
        ("leaking_chambers = 9.0", "leaking_chambers = 19.0", &["leaking_chambers", "more chambers leak"]),
        ("air_fraction", "air_faction", &["air_faction"]),
        ("schema = 3", "schema = 7", &["schema", "7", "allowed: 3"]),
        ("pump_pistons = 9", "pump_pistons = \"nine\"", &["nine", "u8"]),
    ];
    for (from, to, parts) in edits {
        assert!(good.contains(from), "{from}");
        let broken = folder.write("broken.toml", good.replace(from, to));
        let error = replay(DRIVE, broken.to_str().unwrap(), None);
        let line = good.lines().position(|l| l.contains(from)).unwrap() + 1;
        has(error.clone(), &[&format!("broken.toml:{line}:"), "column"]);
        has(error, parts);
    }
    // Calibration of another machine than the machine file.
    for command in ["verify", "evaluate"] {
        let arguments = [command, "--machine", "host-sim/machines/seven-piston.toml", "--calibration", &cal];
        has(failure(2, arguments), &["cal.toml", "another machine", "reference", "seven"]);
    }
    // A binary record with a flipped bit.
    identify(&folder, "cal.bin");
    let mut bytes = std::fs::read(folder.path("cal.bin")).unwrap();
    bytes[100] ^= 4;
    let flipped = folder.write("flipped.bin", bytes);
    has(replay(DRIVE, flipped.to_str().unwrap(), None), &["flipped.bin", "CRC-32"]);
    // Mappings.
    let map =
        folder.write("map.toml", "schema = 1\n[columns]\np_h_mpa = { from = \"PS9\", unit = \"bar\" }\n");
    has(replay(DRIVE, &cal, Some(map.to_str().unwrap())), &["drive.csv", "PS9", "n_m_rpm"]);
    let map =
        folder.write("map.toml", "schema = 1\n[columns]\np_h_mpa = { from = \"PS9\", unit = \"bars\" }\n");
    has(replay(DRIVE, &cal, Some(map.to_str().unwrap())), &["map.toml:3", "bars", "psi"]);
}

#[test]
fn foreign_columns_and_units_give_the_same_estimates_as_the_default_ones() {
    let folder = Folder::new();
    identify(&folder, "cal.toml");
    let cal = folder.path("cal.toml").to_str().unwrap().to_string();
    let ours = folder.write(
        "ours.csv",
        "time_s,n_p_rpm,n_m_rpm,p_h_mpa,t_b_c,alpha\n0,1200,1100,25,60,1\n0.1,1200,1101,26,60,1\n0.2,1200,1102,27,60,1\n",
    );
    let theirs = folder.write(
        "theirs.csv",
        "t/ms;Drehzahl P;Drehzahl M;Druck;Temperatur\n0;20;18,333333333333332;250;333,15\n\
         100;20;18,35;260;333,15\n200;20;18,366666666666667;270;-\n",
    );
    let map = folder.write(
        "map.toml",
        "schema = 1\ndelimiter = \";\"\ndecimal = \",\"\nmissing = [\"-\"]\n[columns]\ntime_s = { from = \"t/ms\", unit = \"ms\" }\n\
         n_p_rpm = { from = \"Drehzahl P\", unit = \"r/s\" }\nn_m_rpm = { from = \"Drehzahl M\", unit = \"r/s\" }\n\
         p_h_mpa = { from = \"Druck\", unit = \"bar\" }\nt_b_c = { from = \"Temperatur\", unit = \"K\" }\n\
         [constants]\nalpha = 1.0\n",
    );
    let (a, b) = (folder.path("a.csv"), folder.path("b.csv"));
    json([
        "replay",
        "--log",
        ours.to_str().unwrap(),
        "--calibration",
        &cal,
        "--out",
        a.to_str().unwrap(),
        "--json",
    ]);
    let report = json([
        "replay",
        "--log",
        theirs.to_str().unwrap(),
        "--calibration",
        &cal,
        "--map",
        map.to_str().unwrap(),
        "--out",
        b.to_str().unwrap(),
        "--json",
    ]);
    assert_eq!(report["rejected"]["t_b:missing"], 1);
    let (a, b) = (std::fs::read_to_string(a).unwrap(), std::fs::read_to_string(b).unwrap());
    for (one, two) in a.lines().zip(b.lines()).take(3) {
        let pairs = one.split(',').zip(two.split(','));
        for (x, y) in pairs {
            match (x.parse::<f64>(), y.parse::<f64>()) {
                // Conversion rounds to f32 once more: some 1e-7 of ratio, 1e-5 of Kou.
                (Ok(x), Ok(y)) => assert!((x - y).abs() <= 1e-4 * x.abs(), "{one}\n{two}"),
                _ => assert_eq!(x, y),
            }
        }
    }
}
