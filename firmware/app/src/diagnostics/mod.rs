//! Troubles: their codes ([`code`]), and the memory that keeps them with what was measured when they first and last
//! occurred ([`memory`]).
//!
//! Who notices a trouble debounces it (the sensor drivers, and [`kou_estimator::health`] for wear); the memory takes the
//! outcome. CAN tells it as DM1 and DM2, flash keeps it over a restart. `docs/can.md` lists every code.

pub mod code;
pub mod memory;

pub use code::{Code, Dtc, Lamp};
pub use memory::{CAPACITY, Entry, FaultMemory, Snapshot, Trouble, Troubles};
