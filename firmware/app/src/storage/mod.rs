//! What the controller keeps in flash: calibration, learned health, fault memory, hours and restarts.
//!
//! | module | duty |
//! |---|---|
//! | [`store`](mod@store) | records in flash, each twice, by kind |
//! | [`framing`] | frame of a record: schema, sequence number, CRC; migration |
//! | [`records`] | record types |
//!
//! Power may fail at any byte of any write: what is read afterwards is the old record or the new one, whole, and writing
//! works again. A damaged bit is corrected from the record's twin. `docs/storage.md` has layout, sequence and limits.
//!
//! A write must be awaited to its end. A task of its own does it; never a `select` or a time-out, which would drop the
//! flash driver in the middle of an operation.

pub mod framing;
pub mod records;
pub mod store;

pub use framing::{Record, RecordKind};
pub use records::{CrashReport, HealthRecord, OperatingCounters, StoredCalibration, UpdateCounter};
pub use store::{BUFFER_LEN, MIN_BYTES, RegionError, RepairReport, Store, StoreError};
