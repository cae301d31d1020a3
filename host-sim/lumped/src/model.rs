//! Lumped model of one machine, with the oil tables that its operating points need.

use std::sync::{Arc, Mutex};

use crate::error::SimError;
use crate::invalid_input::InvalidInput;
use crate::machine::Machine;
use crate::oil::OilTable;
use crate::plant::Plant;
use crate::value_range::ValueRange;

/// Leakage coefficients (Kou) for which the laminar law holds; beyond, a chamber would not hold pressure at all.
pub const KOU: ValueRange = ValueRange::new(0.0, 100.0, "(L/min)/MPa");
/// Oil temperatures in the cache; a bench has three.
const CACHED_TEMPERATURES: usize = 8;

/// Lumped-parameter model of one machine; may be shared between threads, caches oil tables.
#[derive(Debug)]
pub struct LumpedModel {
    machine: Machine,
    oils: Mutex<Vec<(f64, Arc<OilTable>)>>,
}

impl LumpedModel {
    /// Model of a machine.
    ///
    /// # Errors
    /// When the machine file lacks parts that the lumped model needs; names them.
    pub fn new(machine: &Machine) -> Result<Self, SimError> {
        machine.lumped_parts()?;
        Ok(Self { machine: machine.clone(), oils: Mutex::new(Vec::new()) })
    }

    /// The machine.
    #[must_use]
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// The oil at a temperature.
    ///
    /// # Errors
    /// When the temperature is outside its range.
    pub fn oil(&self, t_c: f64) -> Result<Arc<OilTable>, SimError> {
        let mut oils = self.oils.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some((_, oil)) = oils.iter().find(|(t, _)| *t == t_c) {
            return Ok(Arc::clone(oil));
        }
        let oil = Arc::new(OilTable::new(self.machine.oil(), t_c)?);
        if oils.len() >= CACHED_TEMPERATURES {
            oils.remove(0);
        }
        oils.push((t_c, Arc::clone(&oil)));
        Ok(oil)
    }

    /// The plant at oil temperature `t_b_c`, every chamber of pump and motor leaking with `kou`.
    ///
    /// # Errors
    /// When temperature or coefficient are outside their ranges.
    pub fn plant(&self, t_b_c: f64, kou_l_min_mpa: f64) -> Result<Plant, SimError> {
        if !KOU.contains(kou_l_min_mpa) {
            let error = InvalidInput::new("leakage coefficient is out of range").with_value(kou_l_min_mpa);
            return Err(error.with_allowed(KOU).into());
        }
        Plant::new(&self.machine, self.oil(t_b_c)?, kou_l_min_mpa)
    }
}
