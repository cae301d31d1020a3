//! Equations of the drive: oil compression, flow balance, leakage law and the region in which the law was calibrated.
//!
//! Nothing here depends on readings, on a calibration as a whole or on what was learned.

pub(crate) mod calibrated_model;
pub mod calibrated_region;
pub mod flow_balance;
pub mod leakage_law;
pub mod oil_compression;
pub(crate) mod sqrt;
