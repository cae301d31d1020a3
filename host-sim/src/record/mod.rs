//! Records: logs become samples for the estimator, bench tables become operating points for identification.

mod bench;
mod log;

pub use bench::{BenchPoint, read_bench, without_repeats};
pub use log::{LogReader, LogRow};
