//! Records in flash: calibration, learned health, fault memory, operating counters.
//!
//! | module | duty |
//! |---|---|
//! | [`store`](mod@store) | redundant record store: each record in two copies |
//! | [`framing`] | frame of a record: schema, sequence number, CRC; migration |
//! | [`records`] | record types |
//!
//! Power may fail at any byte of a write: the next read returns either the old record or the new one, intact, and
//! further writes succeed. A damaged copy is restored from the other one. `docs/storage.md` describes layout,
//! sequence and limits.
//!
//! A write must be awaited to its end, by a task of its own; never within `select` or a timeout, which would drop the
//! flash driver in the middle of an operation.

pub mod framing;
pub mod records;
pub mod store;

pub use framing::{Record, RecordKind};
pub use records::{CrashReport, HealthRecord, OperatingCounters, StoredCalibration, UpdateCounter};
pub use store::{BUFFER_LEN, MIN_BYTES, RegionError, RepairReport, Store, StoreError};
