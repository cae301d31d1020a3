//! Bench tables and logs of hydrostatic drives: columns, units, mappings of foreign names, and located errors.

pub mod bench;
pub mod input;
pub mod log;
pub mod table;

pub use bench::{BenchPoint, read_bench, without_repeats};
pub use input::{InputError, Range, TomlFile};
pub use log::{LogReader, LogRow};
pub use table::{Cell, Conversion, Mapping, Quantity, Select, Source, Table};
