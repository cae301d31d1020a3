//! Failures of commands and their exit codes.

use std::process::ExitCode;

use kou_lumped::SimError;
use kou_records::InputError;

use crate::pil::PilError;
use crate::pil::plant::LoopError;

/// Failure of a command.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Bad input: exit code 2.
    #[error(transparent)]
    Input(#[from] InputError),
    /// Bad machine file or value for the lumped model: exit code 2.
    #[error(transparent)]
    Machine(#[from] kou_lumped::InvalidInput),
    /// A check failed: exit code 1.
    #[error("{0}")]
    Check(String),
}

impl Failure {
    /// Exit code: 2 for bad input, 1 for a failed check.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Input(_) | Self::Machine(_) => ExitCode::from(2),
            Self::Check(_) => ExitCode::from(1),
        }
    }
}

impl From<SimError> for Failure {
    fn from(error: SimError) -> Self {
        match error {
            SimError::Input(error) => error.into(),
            // The requested point does not exist: bad input.
            SimError::Unreachable { .. } | SimError::Output(_) => {
                Self::Input(InputError::new(error.to_string()))
            }
            other => Self::Check(other.to_string()),
        }
    }
}

impl From<PilError> for Failure {
    fn from(error: PilError) -> Self {
        Self::Check(error.to_string())
    }
}

impl From<LoopError> for Failure {
    fn from(error: LoopError) -> Self {
        match error {
            LoopError::Input(error) => error.into(),
            LoopError::Simulation(error) => Self::Check(error.to_string()),
            LoopError::Pil(error) => error.into(),
        }
    }
}
