//! Arguments of `evaluate` and `verify`: a machine and its calibration.

use std::path::PathBuf;

use kou_estimator::{Calibration, Params};
use kou_lumped::machine::Machine;
use kou_records::InputError;
use kou_records::calibration;

use super::failure::Failure;

/// A machine and its calibration.
#[derive(Debug, clap::Args)]
pub struct CalibratedArgs {
    /// Machine file (TOML); it must be the calibration's.
    #[arg(long, value_name = "M.toml")]
    pub machine: PathBuf,
    /// Calibration: TOML or binary record.
    #[arg(long, value_name = "CAL.toml")]
    pub calibration: PathBuf,
}

impl CalibratedArgs {
    /// Reads the files; the calibration also in the estimator's form.
    ///
    /// # Errors
    /// A file that cannot be read or holds an impossible value, a calibration that the controller would reject or that is
    /// of another type of machine.
    pub fn read(&self) -> Result<(Machine, Calibration, Params), Failure> {
        let machine = Machine::load(&self.machine)?;
        let (calibration, params) = calibration::read_checked(&self.calibration)?;
        if calibration.machine.name.as_str() != machine.name() {
            let error = InputError::new("is of another machine than the machine file")
                .at_file(&self.calibration)
                .with_value(&calibration.machine.name)
                .with_allowed(machine.name());
            return Err(error.into());
        }
        Ok((machine, calibration, params))
    }
}
