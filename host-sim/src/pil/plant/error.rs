//! Errors of a closed loop.

use kou_records::InputError;

use crate::pil::error::PilError;

/// Error that ends a closed loop.
#[derive(Debug, thiserror::Error)]
pub enum LoopError {
    /// Bad input.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The lumped model failed.
    #[error(transparent)]
    Simulation(#[from] kou_lumped::SimError),
    /// The firmware or its emulation failed.
    #[error(transparent)]
    Pil(#[from] PilError),
}
