//! Many steps in one call, compiled for the vector instructions that the processor at hand has.
//!
//! The kernels are plain arithmetic on groups of four lanes. Dispatching once per batch of steps lets the compiler use
//! 256-bit instructions where they exist without asking for a special build; no operation is fused or reordered, so
//! results do not depend on which version runs.

use super::error::SimError;
use super::integrator::{Inputs, Integrator, State};

/// What is called after every step of a batch.
pub trait Observer {
    /// Sees the state after a step of `h` seconds.
    fn see(&mut self, state: &State, h: f64);
}

impl Observer for () {
    #[inline(always)]
    fn see(&mut self, _state: &State, _h: f64) {}
}

struct Batch<'a, 'p, O> {
    integrator: &'a mut Integrator<'p>,
    state: &'a mut State,
    inputs: &'a Inputs,
    h: f64,
    steps: u64,
    observer: &'a mut O,
}

impl<O: Observer> pulp::NullaryFnOnce for Batch<'_, '_, O> {
    type Output = Result<(), SimError>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        for _ in 0..self.steps {
            self.integrator.step(self.state, self.inputs, self.h)?;
            self.observer.see(self.state, self.h);
        }
        Ok(())
    }
}

/// Makes `steps` steps of `h` seconds.
///
/// # Errors
/// As [`Integrator::step`].
pub fn run<O: Observer>(
    integrator: &mut Integrator<'_>,
    state: &mut State,
    inputs: &Inputs,
    h: f64,
    steps: u64,
    observer: &mut O,
) -> Result<(), SimError> {
    pulp::Arch::new().dispatch(Batch { integrator, state, inputs, h, steps, observer })
}
