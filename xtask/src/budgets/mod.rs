//! Budgets of the firmware: instructions, bytes and stack against the committed limits. Method of each count: `docs/budgets.md`.

mod boards;
mod call_graph;
mod count;
mod elf;
mod executors;
mod figure;
mod limits;
mod stack;
mod thumb;

use std::process::ExitCode;

use anyhow::Result;
use serde_json::{Map, Value, json};

use crate::folders::out_dir;
use crate::host_sim::{HostSim, number};
use crate::workspace::Workspace;
use crate::{firmware, setup};

use figure::{Figure, bytes};
pub use limits::BudgetLimits;

/// Firmware that counts instructions.
const COUNTING: &str = "kou-check-instructions";

/// The estimator alone, linked by the panic-path check.
const ESTIMATOR_ONLY: &str = "kou-check-panic-never";

/// Sets up, measures, prints; fails when a limit is exceeded or a figure cannot be measured.
pub fn run(as_json: bool) -> Result<ExitCode> {
    setup::run()?;
    let workspace = Workspace::load()?;
    let limits = BudgetLimits::load()?;
    let (figures, complaints) = measured(&workspace, &limits);
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

/// Prints the deepest call paths of the estimator alone and of each controller's firmware.
pub fn stacks() -> Result<()> {
    setup::run()?;
    let workspace = Workspace::load()?;
    print!("{}", stack::estimator_call_paths(&firmware::build_check(&workspace, ESTIMATOR_ONLY)?)?);
    print!(
        "{}",
        executors::call_paths(&firmware::build_for(&workspace, firmware::VEHICLE_BOARD)?, &boards::G474)?
    );
    print!("{}", executors::call_paths(&firmware::build_controller(&workspace)?, &boards::QEMU)?);
    Ok(())
}

/// Measures, prints, and returns every complaint; none when all figures are within their limits.
pub fn complaints(workspace: &Workspace) -> Result<Vec<String>> {
    let limits = BudgetLimits::load()?;
    let (figures, complaints) = measured(workspace, &limits);
    print!("{}", table(&figures, &limits));
    Ok(complaints)
}

/// A measurement of some of the figures.
type FigureSource = fn(&Workspace) -> Result<Vec<Figure>>;

/// All figures that can be measured, and every complaint. A source that fails does not hide the figures of the others.
fn measured(workspace: &Workspace, limits: &BudgetLimits) -> (Vec<Figure>, Vec<String>) {
    let sources: [FigureSource; 6] =
        [counted, estimator_alone, board_sections, board_stack, controller_sections, vehicle_sections];
    let mut figures = Vec::new();
    let mut complaints = Vec::new();
    for source in sources {
        match source(workspace) {
            Ok(found) => figures.extend(found),
            Err(error) => complaints.push(format!("{error:#}")),
        }
    }
    complaints.extend(limits.compare(&figures));
    (figures, complaints)
}

fn counted(workspace: &Workspace) -> Result<Vec<Figure>> {
    let mut figures = count::figures(&firmware::build_check(workspace, COUNTING)?)?;
    figures.extend(count::vehicle_figures(&firmware::build_check_as_vehicle(workspace, COUNTING)?)?);
    Ok(figures)
}

/// Sizes and stacks of the estimator linked alone.
fn estimator_alone(workspace: &Workspace) -> Result<Vec<Figure>> {
    let elf = firmware::build_check(workspace, ESTIMATOR_ONLY)?;
    let sizes = elf::sizes(&elf)?;
    let mut figures = vec![
        bytes("estimator_flash_bytes", "estimator alone: flash", sizes.flash()),
        bytes("estimator_ram_bytes", "estimator alone: static RAM", sizes.ram()),
    ];
    figures.extend(stack::estimator_figures(&elf)?);
    Ok(figures)
}

/// Sizes of the firmware that runs in QEMU.
fn board_sections(workspace: &Workspace) -> Result<Vec<Figure>> {
    let sizes = elf::sizes(&firmware::build_for_qemu(workspace)?)?;
    Ok(vec![
        bytes("firmware_text_bytes", "QEMU firmware: code", sizes.text),
        bytes("firmware_rodata_bytes", "QEMU firmware: constants", sizes.rodata),
        bytes("firmware_data_bytes", "QEMU firmware: initialised RAM", sizes.data),
        bytes("firmware_flash_bytes", "QEMU firmware: flash (code, constants, initial RAM)", sizes.flash()),
        bytes("firmware_ram_bytes", "QEMU firmware: static RAM (initialised and zeroed)", sizes.ram()),
    ])
}

/// Measured stack depth of the firmware over the shipped log in QEMU: the firmware paints its stack and reports how much of
/// the paint is gone.
fn board_stack(workspace: &Workspace) -> Result<Vec<Figure>> {
    firmware::build_for_qemu(workspace)?;
    let host_sim = HostSim::as_tested(workspace)?;
    let calibration = out_dir("budgets")?.join("calibration.toml");
    host_sim.identify(&calibration)?;
    let report = host_sim.pil(&calibration)?;
    let depth = number(&report, "stack_high_water_bytes")?;
    let what = "QEMU firmware: deepest stack measured over the shipped log";
    Ok(vec![bytes("firmware_stack_bytes", what, depth as u64)])
}

/// Sizes and stacks of the controller that runs in QEMU.
fn controller_sections(workspace: &Workspace) -> Result<Vec<Figure>> {
    let elf = firmware::build_controller(workspace)?;
    let sizes = elf::sizes(&elf)?;
    let mut figures = vec![
        bytes(
            "controller_flash_bytes",
            "QEMU controller: flash (code, constants, initial RAM)",
            sizes.flash(),
        ),
        bytes("controller_ram_bytes", "QEMU controller: static RAM", sizes.ram()),
    ];
    figures.extend(executors::figures(&elf, &boards::QEMU, sizes.ram())?);
    Ok(figures)
}

/// Sizes and stacks of the firmware for the vehicle's board.
fn vehicle_sections(workspace: &Workspace) -> Result<Vec<Figure>> {
    let elf = firmware::build_for(workspace, firmware::VEHICLE_BOARD)?;
    let sizes = elf::sizes(&elf)?;
    let mut figures = vec![
        bytes("g474_flash_bytes", "G474 firmware: flash (code, constants, initial RAM)", sizes.flash()),
        bytes("g474_ram_bytes", "G474 firmware: static RAM", sizes.ram()),
    ];
    figures.extend(executors::figures(&elf, &boards::G474, sizes.ram())?);
    Ok(figures)
}

fn table(figures: &[Figure], limits: &BudgetLimits) -> String {
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

fn to_json(figures: &[Figure], limits: &BudgetLimits, complaints: &[String]) -> Value {
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
