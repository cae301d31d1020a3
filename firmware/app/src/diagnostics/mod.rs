//! Diagnostics: trouble codes, the fault memory, crash records and reset causes.
//!
//! | module | duty |
//! |---|---|
//! | [`dtc`] | diagnostic faults and their trouble codes (SPN and FMI of SAE J1939-73) |
//! | [`dtc_memory`] | fault memory: active and previous trouble codes with freeze frames |
//! | [`update_rejection`] | reasons for which a calibration update is rejected |
//! | [`reset_cause`] | cause of the last restart |
//! | [`crash_log`] | crash record in memory that survives a reset |
//! | [`backtrace`] | return addresses found on the stack, for a crash record |
//!
//! The detector of a fault debounces it (the sensor drivers, and [`kou_estimator::health`] for wear); the memory stores the
//! result. The bus reports it as DM1 and DM2, flash preserves it over a restart. `docs/can.md` lists every code.

pub mod backtrace;
pub mod crash_log;
pub mod dtc;
pub mod dtc_memory;
pub mod reset_cause;
pub mod update_rejection;

pub use crash_log::CrashRecord;
pub use dtc::{Dtc, FaultCode, Lamp};
pub use dtc_memory::{CAPACITY, DtcEntry, DtcList, DtcReport, FaultMemory, FreezeFrame};
pub use reset_cause::ResetCause;
pub use update_rejection::RejectReason;
