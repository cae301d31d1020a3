//! What identification needs of a model: the speed ratio at an operating point, for a leakage coefficient.
//!
//! Two models give it, the reduced model of the controller and the full lumped model. Both can be had of the same machine
//! with another pump displacement or another bulk modulus, because these two alias into leakage and are identified with
//! it ([`Change`]). The reduced model also gives derivatives, in closed form or by differences; the full model never
//! needs them (`docs/identification.md`).

use kou_estimator::oil::OilConfig;
use kou_estimator::reduced::{OperatingPoint as EstimatorPoint, ReducedConfig, ReducedModel};
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, Ratio, RevPerMin};

use crate::calibration::{oil_config, reduced_config};
pub use kou_lumped::OperatingPoint;
use kou_lumped::machine::Machine;
use kou_lumped::{LumpedModel, SimError, SolverSettings, SteadyCase, SteadyPoint};
use kou_records::BenchPoint;
use kou_records::InputError;

/// Operating point at which a bench point was measured.
#[must_use]
pub fn operating_point(p: &BenchPoint) -> OperatingPoint {
    OperatingPoint {
        n_p_rpm: p.n_p_rpm,
        p_h_mpa: p.p_h_mpa,
        p_l_mpa: p.p_l_mpa,
        t_b_c: p.t_b_c,
        alpha: p.alpha,
    }
}

/// How a machine differs from its file: factors on pump displacement (with its dead volume) and bulk modulus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Factor on the displacement of the pump.
    pub displacement: f64,
    /// Factor on the bulk modulus of the oil.
    pub bulk: f64,
}

impl Change {
    /// The machine as its file says.
    pub const NONE: Self = Self { displacement: 1.0, bulk: 1.0 };

    /// The changed machine.
    ///
    /// # Errors
    /// Factors that no machine has.
    pub fn of(self, machine: &Machine) -> Result<Machine, InputError> {
        machine
            .with_pump_displacement_factor(self.displacement)
            .and_then(|machine| machine.with_bulk_modulus_factor(self.bulk))
            .map_err(plant_error)
    }
}

/// What a model says about a steady point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solved {
    /// Speed ratio, with the displacement's sign.
    pub ratio: f64,
    /// Low pressure that belongs to it, gauge.
    pub p_l_mpa: f64,
}

/// A model of one machine.
pub trait RatioModel: Sync {
    /// The steady point with this leakage coefficient, which is not negative.
    ///
    /// # Errors
    /// A point that the model does not reach.
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<Solved, SimError>;

    /// The same model of a changed machine. Changes do not add up: each is relative to the machine file.
    ///
    /// # Errors
    /// Factors that no machine has.
    fn changed(&self, change: Change) -> Result<Box<dyn RatioModel + '_>, InputError>;
}

/// The full model.
#[derive(Debug)]
pub struct FullRatio {
    model: LumpedModel,
    file: Machine,
    settings: SolverSettings,
}

impl FullRatio {
    /// The full model of a machine.
    ///
    /// # Errors
    /// When the machine file lacks parts that the full model needs.
    pub fn new(machine: &Machine) -> Result<Self, InputError> {
        Self::of(machine, machine.clone())
    }

    fn of(file: &Machine, changed: Machine) -> Result<Self, InputError> {
        let model = LumpedModel::new(&changed).map_err(plant_error)?;
        Ok(Self { model, file: file.clone(), settings: SolverSettings::default() })
    }
}

fn plant_error(error: impl std::fmt::Display) -> InputError {
    InputError::new(error.to_string())
}

impl RatioModel for FullRatio {
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<Solved, SimError> {
        let case = SteadyCase::at(at, kou);
        let point = match SteadyPoint::solve_with(&self.model, &case, &self.settings) {
            // Near a slow beat of the two ripples the last digit takes many windows; one digit less is still enough.
            Err(SimError::NotSteady { .. }) => {
                let coarse = SolverSettings { tolerance: 4.0 * self.settings.tolerance, ..self.settings };
                SteadyPoint::solve_with(&self.model, &case, &coarse)
            }
            other => other,
        }?;
        Ok(Solved { ratio: point.ratio, p_l_mpa: point.p_l_mpa })
    }

    fn changed(&self, change: Change) -> Result<Box<dyn RatioModel + '_>, InputError> {
        Ok(Box::new(Self::of(&self.file, change.of(&self.file)?)?))
    }
}

/// The reduced model, by the estimator's own code.
#[derive(Debug, Clone)]
pub struct ReducedRatio {
    file: ReducedConfig,
    file_oil: OilConfig,
    file_low_mpa: f64,
    model: ReducedModel,
}

#[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
const fn single(value: f64) -> f32 {
    value as f32
}

impl ReducedRatio {
    /// The reduced model of a machine with the constants of theory.
    ///
    /// # Errors
    /// Constants that the estimator refuses.
    pub fn new(machine: &Machine) -> Result<Self, InputError> {
        Self::with(reduced_config(machine), oil_config(machine), machine.circuit().low_pressure_mpa)
    }

    /// The reduced model with given constants.
    ///
    /// # Errors
    /// Constants that the estimator refuses.
    pub fn with(config: ReducedConfig, oil: OilConfig, low_mpa: f64) -> Result<Self, InputError> {
        let model = ReducedModel::new(&config, &oil).map_err(|e| InputError::new(e.to_string()))?;
        Ok(Self { file: config, file_oil: oil, file_low_mpa: low_mpa, model })
    }

    /// Constants and oil after a change.
    #[must_use]
    pub fn configs(&self, change: Change) -> (ReducedConfig, OilConfig) {
        let (mut config, mut oil) = (self.file, self.file_oil);
        config.pump_displacement.0 *= single(change.displacement);
        config.pump_dead_volume.0 *= single(change.displacement);
        oil.bulk_modulus_mpa *= single(change.bulk);
        (config, oil)
    }

    /// The reduced model of the changed machine.
    ///
    /// # Errors
    /// Factors that the estimator refuses.
    pub fn with_change(&self, change: Change) -> Result<Self, InputError> {
        let (config, oil) = self.configs(change);
        let model = ReducedModel::new(&config, &oil).map_err(|e| InputError::new(e.to_string()))?;
        Ok(Self { model, ..self.clone() })
    }

    fn point(&self, at: &OperatingPoint) -> EstimatorPoint {
        EstimatorPoint {
            pump_speed: RevPerMin(single(at.n_p_rpm)),
            high_pressure: Megapascal(single(at.p_h_mpa)),
            low_pressure: Megapascal(single(at.p_l_mpa.unwrap_or(self.file_low_mpa))),
            oil_temperature: Celsius(single(at.t_b_c)),
            displacement: Ratio(single(at.alpha)),
        }
    }

    /// Speed ratio.
    #[must_use]
    pub fn ratio(&self, at: &OperatingPoint, kou: f64) -> f64 {
        f64::from(self.model.balance(&self.point(at)).ratio(LeakageCoefficient(single(kou))).get())
    }

    /// Leakage coefficient that explains a ratio; negative above the leak-free ratio.
    #[must_use]
    pub fn kou(&self, at: &OperatingPoint, ratio: f64) -> f64 {
        f64::from(self.model.balance(&self.point(at)).kou(Ratio(single(ratio))).get())
    }

    /// `d|r|/dKou`, negative.
    #[must_use]
    pub fn slope(&self, at: &OperatingPoint) -> f64 {
        -1.0 / f64::from(self.model.balance(&self.point(at)).kou_per_ratio())
    }
}

impl RatioModel for ReducedRatio {
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<Solved, SimError> {
        Ok(Solved { ratio: self.ratio(at, kou), p_l_mpa: at.p_l_mpa.unwrap_or(self.file_low_mpa) })
    }

    fn changed(&self, change: Change) -> Result<Box<dyn RatioModel + '_>, InputError> {
        Ok(Box::new(self.with_change(change)?))
    }
}
