//! Instructions and sizes, counted by `firmware/checks/instructions` in QEMU.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, ensure};

use super::figure::{Figure, figure};
use crate::command::CommandLine;
use crate::setup::QEMU;

/// One instruction advances the guest's clock by 2^10 ns, and nothing else does: the same count on every run. The counting
/// firmware relies on exactly this.
const INSTRUCTION_CLOCK: &str = "shift=10,sleep=off";
/// A run needs one second; a loaded machine may need more.
const TIMEOUT: Duration = Duration::from_secs(120);

/// Fewest samples that must have been valid, of a thousand, for the worst step to mean anything.
const MIN_VALID_PER_MILLE: u64 = 300;

/// A figure's key, the firmware's name for it, its meaning and its unit.
type CountedFigure = (&'static str, &'static str, &'static str, &'static str);

/// Counts of the estimator built for speed.
pub fn figures(elf: &Path) -> Result<Vec<Figure>> {
    read(
        elf,
        &[
            ("law_instructions", "law_instructions", "law", "instructions"),
            (
                "law_forward_inverse_instructions",
                "law_forward_inverse_instructions",
                "law + forward + inverse",
                "instructions",
            ),
            (
                "step_typical_instructions",
                "step_typical_instructions",
                "step, typical sample",
                "instructions",
            ),
            (
                "step_worst_instructions",
                "step_worst_instructions",
                "step, worst of 8000 samples, good and faulty, and of two drives",
                "instructions",
            ),
            ("state_bytes", "state_bytes", "State", "bytes"),
            ("params_bytes", "params_bytes", "Params", "bytes"),
            ("sample_bytes", "sample_bytes", "Sample", "bytes"),
            ("estimate_bytes", "estimate_bytes", "Estimate", "bytes"),
            ("calibration_bytes", "calibration_bytes", "Calibration", "bytes"),
        ],
    )
}

/// Counts of the estimator built for size, as on the vehicle's board.
pub fn vehicle_figures(elf: &Path) -> Result<Vec<Figure>> {
    read(
        elf,
        &[
            (
                "g474_step_typical_instructions",
                "step_typical_instructions",
                "G474 firmware: step, typical sample",
                "instructions",
            ),
            (
                "g474_step_worst_instructions",
                "step_worst_instructions",
                "G474 firmware: step, worst of the same samples",
                "instructions",
            ),
        ],
    )
}

/// Runs the counting firmware and reads the lines that it prints.
fn read(elf: &Path, wanted: &[CountedFigure]) -> Result<Vec<Figure>> {
    let args = ["-M", "mps2-an386", "-display", "none", "-monitor", "none", "-serial", "none"];
    let output = CommandLine::new(QEMU, &args)
        .args(["-semihosting-config", "enable=on,target=native", "-icount", INSTRUCTION_CLOCK, "-kernel"])
        .args([elf])
        .output_within(TIMEOUT)?;
    let printed = format!("{}{}", output.stdout, output.stderr);
    ensure!(output.status.success(), "counting instructions failed ({}):\n{printed}", output.status);
    let value = |name: &str| -> Result<u64> {
        let mut lines = output.stdout.lines().filter_map(|line| line.split_once(' '));
        let (_, value) = lines.find(|(key, _)| *key == name).with_context(|| {
            format!("the counting firmware did not print `{name}`. It printed:\n{printed}")
        })?;
        value.trim().parse().with_context(|| format!("`{name} {value}` is no number"))
    };
    let (samples, valid) = (value("samples")?, value("samples_valid")?);
    ensure!(
        valid * 1000 >= samples * MIN_VALID_PER_MILLE,
        "only {valid} of {samples} samples were valid: the worst step would be that of a rejected sample"
    );
    wanted.iter().map(|(key, name, what, unit)| Ok(figure(key, what, unit, value(name)?))).collect()
}
