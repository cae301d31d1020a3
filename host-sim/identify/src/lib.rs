//! Identification of the leakage law of a hydrostatic drive from bench points.
//!
//! Input: steady operating points with measured speed ratios ([`kou_records::BenchPoint`]) and the parameters of the machine
//! ([`MachineParameters`]). Output: a calibration of the leakage estimator with its diagnostics ([`Identification`]). The plant
//! model is reached through one trait, [`PlantModel`]; its page shows how to put in another model.
//!
//! | module | content |
//! |---|---|
//! | [`plant_model`] | interface to the plant model |
//! | [`lumped_plant`], [`reduced_plant`] | its implementations: lumped model; reduced model of the controller |
//! | [`machine_parameters`] | parameters of the drive |
//! | [`joint_scheme`] | default scheme: law and machine parameters fitted together |
//! | [`two_step`], [`secant`] | the paper's scheme: Kou of each point, then the law |
//! | [`joint`] | weighted least squares with priors and robust weights |
//! | [`discrepancy`] | model discrepancy of the quadratic law, a Gaussian process |
//! | [`surrogate`], [`envelope`] | reduced model fitted to the plant model |
//! | [`experiment_design`] | proposals for further bench points |
//! | [`solution_cache`] | cache of plant-model solutions, for resuming an interrupted run |
//! | [`calibration`], [`sensor_class`] | assembly of the calibration |
//!
//! # Example
//!
//! The shipped bench table with the reduced model:
//!
//! ```
//! use std::path::Path;
//!
//! use kou_identify::calibration::CalibrationSettings;
//! use kou_identify::joint::Prior;
//! use kou_identify::{MachineParameters, SensorClass, joint_scheme};
//! use kou_lumped::machine::Machine;
//! use kou_records::{Mapping, read_bench};
//!
//! # let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
//! let machine = Machine::load(&project.join("host-sim/machines/reference.toml"))?;
//! let machine = MachineParameters::from(&machine);
//! let table = project.join("tests/data/bench_45.csv");
//! let points = read_bench(&table, &Mapping::default(), machine.reference_displacement_cm3_per_rev())?;
//! let settings = CalibrationSettings {
//!     serial: "12345".into(),
//!     date: "2026-11-22".into(),
//!     class: SensorClass::A,
//!     bench_crc32: 0,
//!     machine_crc32: 0,
//! };
//!
//! let result = joint_scheme::identify(&machine, &points, &settings, None, &Prior::default())?;
//! assert_eq!(result.points.len(), 45);
//! assert!(result.ratio_error_mean_pct < 0.2);
//! println!("{}", kou_records::calibration::to_toml(&result.calibration)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod calibration;
mod convert;
pub mod discrepancy;
pub mod envelope;
mod error_factor;
pub mod experiment_design;
mod identification;
pub mod joint;
pub mod joint_scheme;
mod law_fit;
pub mod lumped_plant;
pub mod machine_parameters;
mod outer_fit;
pub mod plant_model;
mod rank_revealing;
pub mod reduced_plant;
pub mod secant;
pub mod sensor_class;
pub mod solution_cache;
pub mod surrogate;
pub mod two_step;

pub use convert::{estimator_point, operating_point};
pub use identification::{FittedParameter, Identification, PointResult, RejectedPoint, ratio_by_law};
pub use kou_lumped::OperatingPoint;
pub use law_fit::{LawFit, TERMS, coefficients, normalised, phi, physical};
pub use lumped_plant::LumpedPlant;
pub use machine_parameters::{HydraulicUnit, MachineParameters, OilCompressibility, RatioReference};
pub use plant_model::{MachineCorrection, PlantError, PlantModel, SteadyResponse};
pub use reduced_plant::ReducedPlant;
pub use sensor_class::SensorClass;
pub use solution_cache::{CachedPlant, SolutionCache};
