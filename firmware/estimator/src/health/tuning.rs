//! Constants of judgement.

/// Standard deviation of the level before anything was learned: the machine may have worn since it was calibrated.
pub(super) const LEVEL_SD_START: f32 = 0.3;
