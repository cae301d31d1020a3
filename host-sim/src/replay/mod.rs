//! Replay: a recorded log through the estimator, sample by sample, exactly as the firmware would process it.
//!
//! | module | duty |
//! |---|---|
//! | `output` | estimates as CSV |
//! | `summary`, `health` | statistics of a log: ratio and leakage, health monitoring |
//! | `labels` | names of reasons in reports |
//! | `trace` | the plot |

mod health;
mod labels;
mod output;
mod summary;
mod trace;

pub use health::{HealthFigures, HealthSummary};
pub use labels::reason_label;
pub use output::EstimateWriter;
pub use summary::{Figures, Summary};
pub use trace::EstimateTrace;
