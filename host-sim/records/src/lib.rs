//! Measurement records of hydrostatic drives: bench tables, logs and calibration files.
//!
//! Reads CSV tables with foreign column names, units, delimiters and decimal commas through a [`Mapping`], and reports
//! invalid input with file, line, column, value and allowed range ([`InputError`]). Contains no physics; the only other crate
//! of this project that it uses is `kou-estimator`, for the types of samples and calibrations.
//!
//! | module | content |
//! |---|---|
//! | [`bench`](mod@bench) | bench tables: steady operating points with the measured speed ratio |
//! | [`log`] | time-series logs as estimator samples |
//! | [`calibration`] | calibration files, TOML and binary |
//! | [`table`] | streaming CSV reader under both |
//! | [`mapping`], [`quantity`] | columns, units, row filters; measured quantities |
//! | [`toml_file`], [`input_error`] | TOML with located errors; the error type |
//!
//! # Example
//!
//! A bench table with pressures in bar and a row filter:
//!
//! ```
//! use kou_records::{Mapping, TomlFile, read_bench};
//!
//! let folder = tempfile::tempdir()?;
//! let table = folder.path().join("bench.csv");
//! std::fs::write(&table, "speed,PH,T,ratio,valid\n1000,310.6,58.2,0.912,1\n1000,320.0,58.4,0.911,0\n")?;
//! let mapping = TomlFile::from_text(
//!     "mapping.toml".as_ref(),
//!     r#"
//!         schema = 1
//!         select = [{ column = "valid", ranges = [[1.0, 1.0]] }]
//!         [columns]
//!         n_p_rpm = "speed"
//!         p_h_mpa = { from = "PH", unit = "bar" }
//!         t_b_c = "T"
//!     "#
//!     .into(),
//! )?;
//!
//! let points = read_bench(&table, &Mapping::from_toml(&mapping)?, 210.0)?;
//! assert_eq!(points.len(), 1);
//! assert!((points[0].p_h_mpa - 31.06).abs() < 1e-9);
//!
//! // Without the mapping the pressure is missing, and the error names the columns that exist.
//! let error = read_bench(&table, &Mapping::default(), 210.0).unwrap_err();
//! assert!(error.to_string().contains("has no column `n_p_rpm`"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bench;
pub mod calibration;
pub mod input_error;
pub mod log;
pub mod mapping;
pub mod quantity;
pub mod table;
pub mod toml_file;

pub use bench::{BenchPoint, read_bench, split_duplicates};
pub use input_error::{AllowedRange, InputError};
pub use log::{LogReader, LogRow};
pub use mapping::{ColumnSource, Mapping, RowFilter};
pub use quantity::{MeasuredQuantity, UnitConversion};
pub use table::{Table, TableCell};
pub use toml_file::TomlFile;
