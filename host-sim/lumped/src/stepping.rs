//! Batches of time steps, dispatched to the vector instructions of the processor.
//!
//! The kernels are plain arithmetic on vectors of four lanes. One dispatch per batch lets the compiler use 256-bit
//! instructions where they exist without a special build; no operation is fused or reordered, so results do not depend
//! on the version that runs.

use crate::error::SimError;
use crate::integrator::Integrator;
use crate::plant_state::{PlantInputs, PlantState};

/// Callback after every step of a batch: records, averages, checks.
pub trait StepObserver {
    /// Processes the state after a step of `h` seconds.
    fn observe(&mut self, state: &PlantState, h: f64);
}

impl StepObserver for () {
    #[inline(always)]
    fn observe(&mut self, _state: &PlantState, _h: f64) {}
}

struct StepBatch<'a, 'p, O> {
    integrator: &'a mut Integrator<'p>,
    state: &'a mut PlantState,
    inputs: &'a PlantInputs,
    h: f64,
    steps: u64,
    observer: &'a mut O,
}

impl<O: StepObserver> pulp::NullaryFnOnce for StepBatch<'_, '_, O> {
    type Output = Result<(), SimError>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        for _ in 0..self.steps {
            self.integrator.step(self.state, self.inputs, self.h)?;
            self.observer.observe(self.state, self.h);
        }
        Ok(())
    }
}

/// Advances the state by `steps` steps of `h` seconds.
///
/// # Errors
/// As [`Integrator::step`].
pub fn advance<O: StepObserver>(
    integrator: &mut Integrator<'_>,
    state: &mut PlantState,
    inputs: &PlantInputs,
    h: f64,
    steps: u64,
    observer: &mut O,
) -> Result<(), SimError> {
    pulp::Arch::new().dispatch(StepBatch { integrator, state, inputs, h, steps, observer })
}
