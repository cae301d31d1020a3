//! What the firmware costs, against the committed limits. How each figure is counted: `docs/budgets.md`.

mod count;
mod elf;
mod limits;
mod stack;
mod thumb;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use serde_json::{Map, Value, json};

use crate::host_sim::{HostSim, number, out_dir};
use crate::workspace::Workspace;
use crate::{firmware, setup};

pub use limits::Limits;

/// The estimator alone, linked by the panic-path check.
const ESTIMATOR_ONLY: &str = "kou-check-panic-never";

/// One figure and its limit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// Name in `limits.toml` and in the JSON.
    pub key: &'static str,
    /// Meaning, for people.
    pub what: &'static str,
    /// Unit, for people.
    pub unit: &'static str,
    /// Value.
    pub value: u64,
}

/// A figure without its limit.
pub const fn figure(key: &'static str, what: &'static str, unit: &'static str, value: u64) -> Figure {
    Figure { key, what, unit, value }
}

/// Sets up, measures, prints; fails when a limit is exceeded.
pub fn run(as_json: bool) -> Result<ExitCode> {
    setup::run()?;
    let workspace = Workspace::load()?;
    let limits = Limits::load()?;
    let figures = measure(&workspace)?;
    let complaints = limits.judge(&figures);
    if as_json {
        eprint!("{}", table(&figures, &limits));
        println!("{}", to_json(&figures, &limits, &complaints));
    } else {
        print!("{}", table(&figures, &limits));
    }
    for complaint in &complaints {
        eprintln!("error: {complaint}");
    }
    Ok(if complaints.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Measures and judges: every complaint, none when all is within its limits.
pub fn complaints(workspace: &Workspace) -> Result<Vec<String>> {
    let limits = Limits::load()?;
    let figures = measure(workspace)?;
    print!("{}", table(&figures, &limits));
    Ok(limits.judge(&figures))
}

fn measure(workspace: &Workspace) -> Result<Vec<Figure>> {
    let mut figures = count::figures(&firmware::build_check(workspace, "kou-check-instructions")?)?;
    let alone = firmware::build_check(workspace, ESTIMATOR_ONLY)?;
    let sizes = elf::sizes(&alone)?;
    figures.push(figure("estimator_flash_bytes", "estimator alone: flash", "bytes", sizes.flash()));
    figures.push(figure("estimator_ram_bytes", "estimator alone: static RAM", "bytes", sizes.ram()));
    figures.extend(stack::estimator_figures(&alone)?);
    figures.extend(board_figures(workspace)?);
    Ok(figures)
}

/// Of the firmware that runs in QEMU.
fn board_figures(workspace: &Workspace) -> Result<[Figure; 6]> {
    let sizes = elf::sizes(&firmware::build_for_qemu(workspace)?)?;
    let host_sim = HostSim::as_tested(workspace)?;
    let calibration: PathBuf = out_dir("budgets")?.join("calibration.toml");
    host_sim.identify(&calibration)?;
    let report = host_sim.pil(&calibration)?;
    let stack = number(&report, "stack_high_water_bytes")
        .context("the firmware reports the deepest stack that it used; without it there is no figure")?;
    Ok([
        figure("firmware_text_bytes", "QEMU firmware: code", "bytes", sizes.text),
        figure("firmware_rodata_bytes", "QEMU firmware: constants", "bytes", sizes.rodata),
        figure("firmware_data_bytes", "QEMU firmware: initialised RAM", "bytes", sizes.data),
        figure(
            "firmware_flash_bytes",
            "QEMU firmware: flash (code, constants, initial RAM)",
            "bytes",
            sizes.flash(),
        ),
        figure(
            "firmware_ram_bytes",
            "QEMU firmware: static RAM (initialised and zeroed)",
            "bytes",
            sizes.ram(),
        ),
        figure(
            "firmware_stack_bytes",
            "QEMU firmware: deepest stack seen over the shipped log",
            "bytes",
            stack as u64,
        ),
    ])
}

fn table(figures: &[Figure], limits: &Limits) -> String {
    let mut text = format!("\n{:<66} {:>8} {:>8}\n", "budget", "value", "limit");
    for f in figures {
        let limit = limits.of(f.key).map_or("none".to_owned(), |limit| limit.to_string());
        let mark = if limits.of(f.key).is_some_and(|limit| f.value <= limit) { "" } else { "  EXCEEDED" };
        text += &format!("{:<66} {:>8} {:>8} {}{mark}\n", f.what, f.value, limit, f.unit);
    }
    text
}

fn to_json(figures: &[Figure], limits: &Limits, complaints: &[String]) -> Value {
    let mut object = Map::new();
    let mut allowed = Map::new();
    for f in figures {
        object.insert(f.key.to_owned(), json!(f.value));
        allowed.insert(f.key.to_owned(), json!(limits.of(f.key)));
    }
    object.insert("limits".to_owned(), Value::Object(allowed));
    object.insert("exceeded".to_owned(), json!(complaints));
    Value::Object(object)
}
