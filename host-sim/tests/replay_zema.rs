//! Record of a real test rig with known pump leakage: identified on half of its healthy cycles, classified on the rest.
//!
//! The recorded data is not part of the project (CC BY 4.0, UCI data set 447). It is read from the folder that the variable
//! `KOU_DATA` names, else from `../shared/data` next to the project.

mod support;

use std::collections::BTreeMap;
use std::path::PathBuf;

use support::{Folder, json, root};

fn log() -> Option<PathBuf> {
    let folder = std::env::var_os("KOU_DATA").map_or_else(|| root().join("../shared/data"), PathBuf::from);
    let path = folder.join("zema_hydraulic_rig/log_1hz.csv");
    if path.exists() {
        return Some(path);
    }
    println!(
        "SKIPPED: replay_zema: no recorded data at {}; set KOU_DATA to the folder that holds it",
        path.display()
    );
    None
}

/// Identifies the rig on the even ones of its healthy cycles, and writes the calibration; what the command printed.
fn identify(log: &str, cal: &str) -> serde_json::Value {
    let healthy = "tests/data/zema_map_healthy_even.toml";
    let machine = "tests/data/zema_machine.toml";
    let (bench, scheme) = (["--bench", log], ["--scheme", "paper"]);
    let files = ["--machine", machine, "--map", healthy, "--out", cal, "--json"];
    json(["identify"].iter().chain(&bench).chain(&scheme).chain(&files).copied())
}

/// Replays the whole log and writes the estimates.
fn replay(log: &str, cal: &str, est: &str) {
    let map = "tests/data/zema_map.toml";
    json(["replay", "--log", log, "--calibration", cal, "--map", map, "--out", est, "--json"]);
}

/// Probability that a value of `b` is above one of `a`, ties counting half: area under the ROC curve.
fn auc(a: &[f64], b: &[f64]) -> f64 {
    let wins: f64 = b
        .iter()
        .map(|y| {
            a.iter()
                .map(|x| {
                    if y > x {
                        1.0
                    } else if y == x {
                        0.5
                    } else {
                        0.0
                    }
                })
                .sum::<f64>()
        })
        .sum();
    wins / (a.len() * b.len()) as f64
}

#[test]
fn replay_zema_leakage_labels_are_separated_over_both_oil_temperatures() {
    let Some(log) = log() else { return };
    let log = log.to_str().unwrap();
    let folder = Folder::new();
    let (cal, est) = (folder.path("zema.toml"), folder.path("zema.csv"));
    let (cal, est) = (cal.to_str().unwrap(), est.to_str().unwrap());
    let fit = identify(log, cal);
    // One speed only: every term with speed in it cannot be determined, and must not blow up.
    for term in ["b1", "a11", "a12", "a13"] {
        assert!(fit["dropped_terms"].as_array().unwrap().iter().any(|t| t == term), "{term}");
        assert_eq!(fit["law"]["normalised"][term], 0.0);
    }
    replay(log, cal, est);

    // Mean wear ratio of each cycle, without the cycles that the law was fitted to.
    let text = std::fs::read_to_string(est).unwrap();
    let mut lines = text.lines();
    let heading: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = |name: &str| heading.iter().position(|h| *h == name).unwrap();
    let (wear, cycle, label, cooler) =
        (at("wear_ratio"), at("cycle"), at("pump_leak_label"), at("cooler_pct"));
    let mut cycles: BTreeMap<u32, (u8, u8, Vec<f64>)> = BTreeMap::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let Ok(value) = cells[wear].parse::<f64>() else { continue };
        let (number, label): (u32, u8) = (cells[cycle].parse().unwrap(), cells[label].parse().unwrap());
        if label == 0 && number.is_multiple_of(2) {
            continue;
        }
        cycles.entry(number).or_insert((label, cells[cooler].parse().unwrap(), Vec::new())).2.push(value);
    }
    let mut by_label: [Vec<f64>; 3] = [const { Vec::new() }; 3];
    let mut coolers = std::collections::BTreeSet::new();
    for (label, cooler, values) in cycles.values() {
        coolers.insert(*cooler);
        by_label[usize::from(*label)].push(values.iter().sum::<f64>() / values.len() as f64);
    }
    let [none, weak, severe] = &by_label;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (first, second) = (auc(none, weak), auc(weak, severe));
    println!("cycles {} {} {}, coolers {coolers:?}", none.len(), weak.len(), severe.len());
    println!("mean wear ratio {:.4} {:.4} {:.4}", mean(none), mean(weak), mean(severe));
    println!("AUC 0 against 1: {first:.5}; 1 against 2: {second:.5}");
    assert_eq!(coolers.len(), 2, "both oil temperatures must be there");
    assert!(none.len() > 100 && weak.len() > 200 && severe.len() > 200);
    assert!(first >= 0.999 && second >= 0.995);
    // Held-out healthy cycles look healthy: the law's residual is 3 % of Kou, and 160 cycles average it out.
    assert!((mean(none) - 1.0).abs() < 0.01);
}

/// What the rig's log, one sample per second with five plateaus a minute, asks of health: blocks that span the pauses
/// between plateaus, and a misfit that is another one with every plateau.
const HEALTH: [(&str, &str); 4] = [
    ("block_us = 500000", "block_us = 5000000"),
    ("law_misfit = 0.02", "law_misfit = 0.03"),
    ("misfit_blocks = 15.0", "misfit_blocks = 2.0"),
    ("ratio_noise = 0.0007", "ratio_noise = 0.003"),
];

#[test]
fn replay_zema_every_change_of_the_leakage_label_is_reported_within_five_cycles_and_nothing_else() {
    let Some(log) = log() else { return };
    let log = log.to_str().unwrap();
    let folder = Folder::new();
    let (cal, est) = (folder.path("zema.toml"), folder.path("zema.csv"));
    let (cal, est) = (cal.to_str().unwrap(), est.to_str().unwrap());
    identify(log, cal);
    let mut text = std::fs::read_to_string(cal).unwrap();
    for (default, of_rig) in HEALTH {
        assert!(text.contains(default), "{default}");
        text = text.replace(default, of_rig);
    }
    std::fs::write(cal, text).unwrap();
    replay(log, cal, est);

    // Cycles in the order of time: label, changes reported so far.
    let text = std::fs::read_to_string(est).unwrap();
    let mut lines = text.lines();
    let heading: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = |name: &str| heading.iter().position(|h| *h == name).unwrap();
    let (changes, cycle, label) = (at("changes"), at("cycle"), at("pump_leak_label"));
    let mut cycles: Vec<(u32, String, u32)> = Vec::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let number = cells[cycle].parse().unwrap();
        if cycles.last().is_none_or(|last| last.0 != number) {
            cycles.push((number, cells[label].to_string(), 0));
        }
        cycles.last_mut().unwrap().2 = cells[changes].parse().unwrap();
    }
    let (mut delays, mut false_reports, mut waiting) = (Vec::new(), 0, None);
    for (i, pair) in cycles.windows(2).enumerate() {
        let [before, now] = pair else { unreachable!() };
        if now.1 != before.1 {
            assert_eq!(waiting, None, "the change before cycle {} was not reported", now.0);
            waiting = Some(i);
        }
        for _ in before.2..now.2 {
            match waiting.take() {
                Some(since) => delays.push(i - since + 1),
                None => false_reports += 1,
            }
        }
    }
    println!(
        "{} changes of label, reported in cycle {delays:?} after it; {false_reports} other reports",
        delays.len()
    );
    assert_eq!(waiting, None, "the last change was not reported");
    assert_eq!(delays.len(), 23, "twelve runs of labels at each of two oil temperatures");
    assert!(delays.iter().all(|d| *d <= 5));
    assert_eq!(false_reports, 0);
}
