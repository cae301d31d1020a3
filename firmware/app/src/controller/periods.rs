//! Periods of the tasks.

use embassy_time::Duration;

/// Period of task `sample`.
pub const SAMPLE_PERIOD: Duration = Duration::from_millis(1);
/// Period of task `estimate`.
pub const ESTIMATE_PERIOD: Duration = Duration::from_millis(10);
/// Period of task `publish`.
pub const PUBLISH_PERIOD: Duration = Duration::from_millis(10);
/// Period of task `storage`.
pub const STORAGE_PERIOD: Duration = Duration::from_secs(1);
/// Period of task `supervise`.
pub const SUPERVISE_PERIOD: Duration = Duration::from_millis(50);
/// Age at which an estimate is no longer published.
pub const MAX_ESTIMATE_AGE: Duration = Duration::from_millis(100);
