//! Controller tasks: sensors in, estimates out, at fixed periods and priorities, under a watchdog.
//!
//! ```text
//!            1 kHz            100 Hz               100 Hz
//! front end --> sample --sample--> estimate --estimate--> publish <--> CAN
//!                                    ^  |                 |   ^
//!            calibration, learned ---+--+--- learned   commands, answers
//!                                    |  v                 v   |
//!                                    storage (1 Hz) <-----------
//!                                      `--> flash
//!
//! every task --check-in--> supervise (20 Hz) --feeds--> watchdog
//! ```
//!
//! | task | period | priority | deadline | supervision timeout |
//! |---|---|---|---|---|
//! | [`run_sample`] | 1 ms | highest | 1 ms | 20 ms |
//! | [`run_estimate`] | 10 ms | high | 10 ms | 100 ms |
//! | [`run_publish`] | 10 ms | low | 10 ms | 1 s |
//! | [`run_storage`] | 1 s | low | 1 s | 10 s |
//! | [`run_supervise`] | 50 ms | low | 50 ms | the watchdog's time |
//!
//! The tasks contain no board code: a board supplies a [`FrontEnd`], a [`Publish`], a flash and a [`Watchdog`], and
//! runs each task in an executor of its priority. All tasks share one [`Controller`], which is a static. Tasks
//! exchange the latest value, not a queue: a late task finds a newer value. Only commands and answers of a
//! calibration update are queued, a few of each.
//!
//! Safe state: the firmware has no actuator, so it cannot disturb the drive. On any failure the estimate is published
//! as invalid with its reason ([`Controller::output`]), and silence on the bus lasts at most as long as the
//! watchdog's period.

mod can_task;
mod consistency;
mod estimate;
mod handover;
mod periodic;
mod periods;
mod publish;
mod sample;
mod shared;
mod storage_task;
mod supervisor;
mod task_stats;
mod write_schedule;

pub use can_task::{CanInterface, CanPort};
pub use estimate::run_estimate;
pub use handover::{Estimator, Handover};
pub use periodic::Ticker;
pub use periods::{
    ESTIMATE_PERIOD, MAX_ESTIMATE_AGE, PUBLISH_PERIOD, SAMPLE_PERIOD, STORAGE_PERIOD, SUPERVISE_PERIOD,
};
pub use publish::{Publish, run_publish};
pub use sample::{AdcSampler, EdgeTimer, FrontEnd, SensorsMemory, run_sample};
pub use shared::{Controller, NoEstimate};
pub use storage_task::{StartReason, StorageTask, run_storage};
pub use supervisor::{Supervisor, Task, Watchdog, run_supervise};
pub use task_stats::{AllTaskStats, TaskStats, TaskStatsSnapshot};
pub use write_schedule::{WriteScheduleConfig, WriteScheduleError, WriteScheduleParams};
