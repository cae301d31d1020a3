//! Building the firmware: boards and checks, each with the target and profile of its folder's `.cargo/config.toml`.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::command::CommandLine;
use crate::folders::root;
use crate::workspace::{Package, TARGET, Workspace};

/// Board whose firmware runs in QEMU.
pub const QEMU_BOARD: &str = "kou-qemu-mps2-an386";

/// Board whose firmware a vehicle's controller runs.
pub const VEHICLE_BOARD: &str = "kou-nucleo-g474re";

/// Folder whose settings give the firmware's target and profile to crates that are not boards.
pub fn checks_dir() -> PathBuf {
    root().join("firmware/checks")
}

/// A cargo command on a board, in the board's folder, where its settings are.
pub fn on_board(board: &Package, args: &[&str]) -> CommandLine {
    CommandLine::cargo(args).dir(&board.folder)
}

/// A cargo command with the firmware's settings on crates that are not boards.
pub fn on_target(args: &[&str]) -> CommandLine {
    CommandLine::cargo(args).dir(&checks_dir())
}

/// The firmware that runs in QEMU, in release; returns the ELF.
pub fn build_for_qemu(workspace: &Workspace) -> Result<PathBuf> {
    build_for(workspace, QEMU_BOARD)
}

/// The controller that runs in QEMU, in release; returns the ELF.
pub fn build_controller(workspace: &Workspace) -> Result<PathBuf> {
    build_for_qemu(workspace)?;
    existing(workspace.firmware_elf("kou-qemu-controller"))
}

/// A board's firmware, in release; returns the ELF.
pub fn build_for(workspace: &Workspace, name: &str) -> Result<PathBuf> {
    for board in workspace.below("firmware/boards").filter(|board| board.name == name) {
        on_board(board, &["build", "--release"]).check()?;
    }
    existing(workspace.firmware_elf(name))
}

/// A check's binary in release; returns the ELF.
pub fn build_check(workspace: &Workspace, name: &str) -> Result<PathBuf> {
    on_target(&["build", "--release", "-p", name]).check()?;
    existing(workspace.firmware_elf(name))
}

/// The same with the settings of the vehicle's board, whose firmware is built for size.
pub fn build_check_as_vehicle(workspace: &Workspace, name: &str) -> Result<PathBuf> {
    for board in workspace.below("firmware/boards").filter(|board| board.name == VEHICLE_BOARD) {
        on_board(board, &["build", "--release", "-p", name]).check()?;
    }
    existing(workspace.firmware_elf(name))
}

fn existing(elf: PathBuf) -> Result<PathBuf> {
    anyhow::ensure!(
        Path::new(&elf).is_file(),
        "the build left no {}; does the folder's .cargo/config.toml set `build.target = \"{TARGET}\"`?",
        elf.display()
    );
    Ok(elf)
}
