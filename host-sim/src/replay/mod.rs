//! Replay: a recorded log through the estimator, sample by sample, exactly as the firmware would see it.

mod health;
mod output;
mod summary;
mod trace;

pub use health::{HealthFigures, HealthSummary};
pub use output::EstimateWriter;
pub use summary::{Figures, Summary, reason_label};
pub use trace::EstimateTrace;
