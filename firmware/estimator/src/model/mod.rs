//! Equations of the drive: oil compression, flow balance, leakage law and the region in which the law was calibrated.
//!
//! Pure functions of operating point and constants: no readings, no calibration as a whole, no learned state. The
//! module imports nothing of the crate but the unit types.

pub mod calibrated_region;
pub mod flow_balance;
pub mod leakage_law;
pub mod oil_compression;
pub(crate) mod sqrt;
