//! What identification needs of a model: the speed ratio at an operating point, for a leakage coefficient.
//!
//! Two models give it, the reduced model of the controller and the full lumped model. Both can be had of the same machine
//! with another pump displacement or another bulk modulus, because these two alias into leakage and are identified with
//! it ([`Change`]). The reduced model also gives derivatives, in closed form or by differences; the full model never
//! needs them (`docs/identification.md`).

use kou_estimator::model::oil_compression::OilConfig;
use kou_estimator::model::flow_balance::{OperatingPoint, ReducedConfig, ReducedModel};
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, Ratio, RevPerMin};

use crate::calibration::{oil_config, reduced_config};
use crate::full::{Held, Model, Operating, Settings, SimError, SteadyPoint};
use crate::input::InputError;
use crate::machine::Machine;
use crate::record::BenchPoint;

/// A steady operating point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct At {
    /// Pump speed.
    pub n_p_rpm: f64,
    /// High pressure, gauge.
    pub p_h_mpa: f64,
    /// Low pressure, gauge; nothing where it was not measured.
    pub p_l_mpa: Option<f64>,
    /// Oil temperature.
    pub t_b_c: f64,
    /// Displacement fraction.
    pub alpha: f64,
}

impl From<&BenchPoint> for At {
    fn from(p: &BenchPoint) -> Self {
        Self { n_p_rpm: p.n_p_rpm, p_h_mpa: p.p_h_mpa, p_l_mpa: p.p_l_mpa, t_b_c: p.t_b_c, alpha: p.alpha }
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
        machine.with_pump_displacement_factor(self.displacement)?.with_bulk_modulus_factor(self.bulk)
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
    fn solve(&self, at: &At, kou: f64) -> Result<Solved, SimError>;

    /// The same model of a changed machine. Changes do not add up: each is relative to the machine file.
    ///
    /// # Errors
    /// Factors that no machine has.
    fn changed(&self, change: Change) -> Result<Box<dyn RatioModel + '_>, InputError>;
}

/// The full model.
#[derive(Debug)]
pub struct FullRatio {
    model: Model,
    file: Machine,
    settings: Settings,
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
        let model = Model::new(&changed).map_err(input_error)?;
        Ok(Self { model, file: file.clone(), settings: Settings::default() })
    }
}

fn input_error(error: SimError) -> InputError {
    match error {
        SimError::Input(error) => error,
        other => InputError::new(other.to_string()),
    }
}

impl RatioModel for FullRatio {
    fn solve(&self, at: &At, kou: f64) -> Result<Solved, SimError> {
        let operating = Operating {
            n_p_rpm: at.n_p_rpm,
            held: Held::HighPressureMpa(at.p_h_mpa),
            t_b_c: at.t_b_c,
            alpha: at.alpha,
            kou_l_min_mpa: kou,
        };
        let point = match SteadyPoint::solve_with(&self.model, &operating, &self.settings) {
            // Near a slow beat of the two ripples the last digit takes many windows; one digit less is still enough.
            Err(SimError::NotSteady { .. }) => {
                let coarse = Settings { tolerance: 4.0 * self.settings.tolerance, ..self.settings };
                SteadyPoint::solve_with(&self.model, &operating, &coarse)
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

    fn point(&self, at: &At) -> OperatingPoint {
        OperatingPoint {
            pump_speed: RevPerMin(single(at.n_p_rpm)),
            high_pressure: Megapascal(single(at.p_h_mpa)),
            low_pressure: Megapascal(single(at.p_l_mpa.unwrap_or(self.file_low_mpa))),
            oil_temperature: Celsius(single(at.t_b_c)),
            displacement: Ratio(single(at.alpha)),
        }
    }

    /// Speed ratio.
    #[must_use]
    pub fn ratio(&self, at: &At, kou: f64) -> f64 {
        f64::from(self.model.balance(&self.point(at)).ratio(LeakageCoefficient(single(kou))).get())
    }

    /// Leakage coefficient that explains a ratio; negative above the leak-free ratio.
    #[must_use]
    pub fn kou(&self, at: &At, ratio: f64) -> f64 {
        f64::from(self.model.balance(&self.point(at)).kou(Ratio(single(ratio))).get())
    }

    /// `d|r|/dKou`, negative.
    #[must_use]
    pub fn slope(&self, at: &At) -> f64 {
        -1.0 / f64::from(self.model.balance(&self.point(at)).kou_per_ratio())
    }
}

impl RatioModel for ReducedRatio {
    fn solve(&self, at: &At, kou: f64) -> Result<Solved, SimError> {
        Ok(Solved { ratio: self.ratio(at, kou), p_l_mpa: at.p_l_mpa.unwrap_or(self.file_low_mpa) })
    }

    fn changed(&self, change: Change) -> Result<Box<dyn RatioModel + '_>, InputError> {
        Ok(Box::new(self.with_change(change)?))
    }
}
