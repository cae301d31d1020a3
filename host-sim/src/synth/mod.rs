//! Synthetic records: bench tables and drive logs with a true leakage that is physical and not quadratic.
//!
//! Every file is marked as synthetic in its heading. The speed ratio comes from the lumped model, the leakage from laminar gaps
//! ([`kou_truth`]), and the readings from instruments with a systematic error each, within an ISO 4409 class, and random
//! errors. The same seed gives bench and drive the same instruments. Columns `kou_true` hold the truth and are ignored by
//! every reader.

mod bench;
mod drive;
mod instruments;
mod truth;

pub use bench::{PARTIAL, write_bench};
pub use drive::write_drive;
pub use instruments::{BENCH, DRIVE, Instruments, Sigmas};
pub use truth::{Gaps, kou_truth, viscosity_mm2_s};
