//! Interface to the plant model: the steady speed ratio at an operating point for a leakage coefficient.
//!
//! The identification reaches every model of the drive through [`PlantModel`]. The crate brings two implementations, the
//! lumped model ([`LumpedPlant`](crate::LumpedPlant)) and the reduced model of the controller
//! ([`ReducedPlant`](crate::ReducedPlant)); any other model that gives a speed ratio can take their place.
//!
//! Pump displacement and bulk modulus alias into leakage and are therefore identified with it. A model must be available
//! with other values of both ([`MachineCorrection`]). Derivatives are never requested: they come from the reduced model
//! (`docs/identification.md`).

use kou_lumped::OperatingPoint;
use kou_records::InputError;

/// Correction of the machine file: factors on pump displacement (with its dead volume) and bulk modulus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MachineCorrection {
    /// Factor on the displacement of the pump.
    pub displacement: f64,
    /// Factor on the bulk modulus of the oil.
    pub bulk: f64,
}

impl MachineCorrection {
    /// No correction: the machine as described by its file.
    pub const NONE: Self = Self { displacement: 1.0, bulk: 1.0 };
}

/// Steady state computed by a plant model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyResponse {
    /// Speed ratio, with the sign of the displacement.
    pub ratio: f64,
    /// Low pressure of the steady state, gauge.
    pub p_l_mpa: f64,
}

/// Failure of a plant model at one operating point.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// No steady state exists with this leakage, for instance because the leakage exceeds the pump's flow.
    #[error("{0}")]
    Unreachable(String),
    /// Any other failure, for instance of convergence.
    #[error("{0}")]
    Failed(String),
}

/// Steady-state model of one machine.
///
/// # Example
///
/// The law of a drive whose model is a closure:
///
/// ```
/// use kou_identify::calibration::CalibrationSettings;
/// use kou_identify::secant::SecantSettings;
/// use kou_identify::{
///     HydraulicUnit, MachineCorrection, MachineParameters, OilCompressibility, OperatingPoint, PlantError, PlantModel,
///     RatioReference, SensorClass, SteadyResponse, two_step,
/// };
/// use kou_records::{BenchPoint, InputError};
///
/// /// Speed ratio from a closure, scaled with the displacement.
/// struct ToyPlant<'a>(&'a (dyn Fn(&OperatingPoint, f64) -> f64 + Sync), MachineCorrection);
///
/// impl PlantModel for ToyPlant<'_> {
///     fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<SteadyResponse, PlantError> {
///         let ratio = self.1.displacement * (self.0)(at, kou);
///         if ratio > 0.0 {
///             Ok(SteadyResponse { ratio, p_l_mpa: 1.5 })
///         } else {
///             Err(PlantError::Unreachable("the leakage exceeds the flow of the pump".into()))
///         }
///     }
///
///     fn corrected(&self, correction: MachineCorrection) -> Result<Box<dyn PlantModel + '_>, InputError> {
///         Ok(Box::new(ToyPlant(self.0, correction)))
///     }
/// }
///
/// let ratio = |at: &OperatingPoint, kou: f64| 0.99 - 30.0 * kou * at.p_h_mpa / at.n_p_rpm;
/// let plant = ToyPlant(&ratio, MachineCorrection::NONE);
///
/// // A bench of nine points with a leakage that rises with the pressure.
/// let mut points = Vec::new();
/// for (i, n_p_rpm) in [1000.0, 1800.0, 2600.0].into_iter().enumerate() {
///     for (j, p_h_mpa) in [10.0, 25.0, 40.0].into_iter().enumerate() {
///         let at = OperatingPoint { n_p_rpm, p_h_mpa, p_l_mpa: None, t_b_c: 60.0, alpha: 1.0 };
///         let ratio = plant.solve(&at, 0.03 + 0.0005 * p_h_mpa).map_err(|e| e.to_string())?.ratio;
///         let line = (3 * i + j) as u64 + 2;
///         points.push(BenchPoint { line, n_p_rpm, p_h_mpa, p_l_mpa: None, t_b_c: 60.0, alpha: 1.0, ratio });
///     }
/// }
///
/// let unit = HydraulicUnit { pistons: 9, displacement_cm3_per_rev: 210.0, dead_volume_cm3: 15.0 };
/// let machine = MachineParameters {
///     name: "toy".into(),
///     pump: unit,
///     reference: RatioReference::Motor(unit),
///     oil: OilCompressibility {
///         bulk_modulus_mpa: 1600.0,
///         air_fraction: 0.005,
///         heat_capacity_ratio: 1.4,
///         bulk_modulus_per_k: -0.003,
///         reference_c: 40.0,
///     },
///     low_pressure_mpa: 1.5,
///     case_pressure_mpa: 0.2,
/// };
/// let settings = CalibrationSettings {
///     serial: String::new(),
///     date: String::new(),
///     class: SensorClass::A,
///     bench_crc32: 0,
///     machine_crc32: 0,
/// };
/// let result = two_step::identify(&machine, &points, &settings, Some(&plant), &SecantSettings::default())
///     .map_err(|e| e.to_string())?;
/// assert_eq!(result.points.len(), 9);
/// for p in &result.points {
///     assert!((p.kou_law / (0.03 + 0.0005 * p.point.p_h_mpa) - 1.0).abs() < 0.02);
/// }
/// # Ok::<(), String>(())
/// ```
pub trait PlantModel: Sync {
    /// Steady state at an operating point with leakage coefficient `kou`, which is not negative.
    ///
    /// # Errors
    /// A point without a steady state, or a failure of the computation.
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<SteadyResponse, PlantError>;

    /// Model of the corrected machine. Corrections do not accumulate: each is relative to the machine file.
    ///
    /// # Errors
    /// Factors out of range.
    fn corrected(&self, correction: MachineCorrection) -> Result<Box<dyn PlantModel + '_>, InputError>;
}
