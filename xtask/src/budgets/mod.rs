//! What the firmware costs, against the committed limits. How each figure is counted: `docs/budgets.md`.

mod boards;
mod count;
mod elf;
mod executors;
mod limits;
mod stack;
mod thumb;

use std::process::ExitCode;

use anyhow::Result;
use serde_json::{Map, Value, json};

use crate::host_sim::{HostSim, number, out_dir};
use crate::workspace::Workspace;
use crate::{firmware, setup};

pub use limits::Limits;

/// What counts instructions.
const COUNTING: &str = "kou-check-instructions";

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

/// Sets up, measures, prints; fails when a limit is exceeded or a figure cannot be had.
pub fn run(as_json: bool) -> Result<ExitCode> {
    setup::run()?;
    let workspace = Workspace::load()?;
    let limits = Limits::load()?;
    let (figures, complaints) = judged(&workspace, &limits);
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

/// Prints where the stacks of the estimator alone and of the vehicle's firmware are deepest.
pub fn stacks() -> Result<()> {
    setup::run()?;
    let workspace = Workspace::load()?;
    print!("{}", stack::estimator_ways(&firmware::build_check(&workspace, ESTIMATOR_ONLY)?)?);
    print!("{}", executors::ways(&firmware::build_for(&workspace, firmware::VEHICLE_BOARD)?, &boards::G474)?);
    print!("{}", executors::ways(&firmware::build_controller(&workspace)?, &boards::QEMU)?);
    Ok(())
}

/// Measures, prints, and returns every complaint: none when all is within its limits.
pub fn complaints(workspace: &Workspace) -> Result<Vec<String>> {
    let limits = Limits::load()?;
    let (figures, complaints) = judged(workspace, &limits);
    print!("{}", table(&figures, &limits));
    Ok(complaints)
}

/// A way to some of the figures.
type Source = fn(&Workspace) -> Result<Vec<Figure>>;

/// All figures that can be had, and every complaint. One source that fails does not hide the figures of the others.
fn judged(workspace: &Workspace, limits: &Limits) -> (Vec<Figure>, Vec<String>) {
    let sources: [Source; 6] =
        [counted, estimator_alone, board_sections, board_stack, controller_sections, vehicle_sections];
    let mut figures = Vec::new();
    let mut complaints = Vec::new();
    for source in sources {
        match source(workspace) {
            Ok(found) => figures.extend(found),
            Err(error) => complaints.push(format!("{error:#}")),
        }
    }
    complaints.extend(limits.judge(&figures));
    (figures, complaints)
}

fn counted(workspace: &Workspace) -> Result<Vec<Figure>> {
    let mut figures = count::figures(&firmware::build_check(workspace, COUNTING)?)?;
    figures.extend(count::vehicle_figures(&firmware::build_check_as_vehicle(workspace, COUNTING)?)?);
    Ok(figures)
}

/// Of the estimator linked alone.
fn estimator_alone(workspace: &Workspace) -> Result<Vec<Figure>> {
    let elf = firmware::build_check(workspace, ESTIMATOR_ONLY)?;
    let sizes = elf::sizes(&elf)?;
    let mut figures = vec![
        figure("estimator_flash_bytes", "estimator alone: flash", "bytes", sizes.flash()),
        figure("estimator_ram_bytes", "estimator alone: static RAM", "bytes", sizes.ram()),
    ];
    figures.extend(stack::estimator_figures(&elf)?);
    Ok(figures)
}

/// Of the firmware that runs in QEMU.
fn board_sections(workspace: &Workspace) -> Result<Vec<Figure>> {
    let sizes = elf::sizes(&firmware::build_for_qemu(workspace)?)?;
    Ok(vec![
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
    ])
}

/// How deep the stack of the firmware went while it worked through the shipped log in QEMU: the firmware paints its
/// stack and says how much of the paint is gone.
fn board_stack(workspace: &Workspace) -> Result<Vec<Figure>> {
    firmware::build_for_qemu(workspace)?;
    let host_sim = HostSim::as_tested(workspace)?;
    let calibration = out_dir("budgets")?.join("calibration.toml");
    host_sim.identify(&calibration)?;
    let report = host_sim.pil(&calibration)?;
    let bytes = number(&report, "stack_high_water_bytes")?;
    let what = "QEMU firmware: deepest stack seen over the shipped log";
    Ok(vec![figure("firmware_stack_bytes", what, "bytes", bytes as u64)])
}

/// Of the controller that runs in QEMU.
fn controller_sections(workspace: &Workspace) -> Result<Vec<Figure>> {
    let elf = firmware::build_controller(workspace)?;
    let sizes = elf::sizes(&elf)?;
    let mut figures = vec![
        figure(
            "controller_flash_bytes",
            "QEMU controller: flash (code, constants, initial RAM)",
            "bytes",
            sizes.flash(),
        ),
        figure("controller_ram_bytes", "QEMU controller: static RAM", "bytes", sizes.ram()),
    ];
    figures.extend(executors::figures(&elf, &boards::QEMU, sizes.ram())?);
    Ok(figures)
}

/// Of the firmware for the vehicle's board.
fn vehicle_sections(workspace: &Workspace) -> Result<Vec<Figure>> {
    let elf = firmware::build_for(workspace, firmware::VEHICLE_BOARD)?;
    let sizes = elf::sizes(&elf)?;
    let mut figures = vec![
        figure(
            "g474_flash_bytes",
            "G474 firmware: flash (code, constants, initial RAM)",
            "bytes",
            sizes.flash(),
        ),
        figure("g474_ram_bytes", "G474 firmware: static RAM", "bytes", sizes.ram()),
    ];
    figures.extend(executors::figures(&elf, &boards::G474, sizes.ram())?);
    Ok(figures)
}

fn table(figures: &[Figure], limits: &Limits) -> String {
    let mut text = format!("\n{:<66} {:>8} {:>8}\n", "budget", "value", "limit");
    for f in figures {
        let (limit, mark) = match limits.of(f.key) {
            None => ("none".to_owned(), "  NO LIMIT"),
            Some(limit) => (limit.to_string(), if f.value > limit { "  EXCEEDED" } else { "" }),
        };
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
