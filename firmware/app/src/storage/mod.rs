//! What the controller keeps in flash: calibration, learned health, fault memory, hours and restarts.
//!
//! | module | duty |
//! |---|---|
//! | [`store`](mod@store) | records in flash, each twice, by kind |
//! | [`record`] | the frame of a record: schema, sequence number, CRC; migration |
//! | [`kinds`] | the records that there are |
//! | [`calibration`] | which calibration is live after a start |
//! | [`ram`] | a flash in RAM that can lose its supply, for emulators and tests |
//!
//! Power may fail at any byte of any write: what is read afterwards is the old record or the new one, whole, and writing
//! works again. A damaged bit is corrected from the record's twin. `docs/storage.md` has layout, sequence and limits.
//!
//! A write must be awaited to its end. A task of its own does it; never a `select` or a time-out, which would drop the
//! flash driver in the middle of an operation.

pub mod calibration;
pub mod kinds;
pub mod ram;
pub mod record;
pub mod store;
#[cfg(test)]
mod tests;

pub use calibration::{Live, Loaded, Place, load};
pub use kinds::{HealthRecord, Life, ResetCause, StopNote, StoredCalibration, UpdateCounter};
pub use ram::RamFlash;
pub use record::{Kind, Record};
pub use store::{BUFFER_LEN, Healed, MIN_BYTES, SetUpError, Store, StoreError};
