//! Reduced model of the controller behind the [`PlantModel`] interface, with the estimator's own code.

use kou_estimator::model::flow_balance::{ReducedConfig, ReducedModel};
use kou_estimator::model::oil_compression::OilConfig;
use kou_estimator::units::{LeakageCoefficient, Ratio};
use kou_lumped::OperatingPoint;
use kou_records::InputError;

use crate::convert::{estimator_point, single};
use crate::machine_parameters::MachineParameters;
use crate::plant_model::{MachineCorrection, PlantError, PlantModel, SteadyResponse};

/// Reduced model of a machine: closed form, with inverse and derivatives.
#[derive(Debug, Clone)]
pub struct ReducedPlant {
    file: ReducedConfig,
    file_oil: OilConfig,
    file_low_mpa: f64,
    model: ReducedModel,
}

impl ReducedPlant {
    /// Reduced model of a machine, with the constants of theory.
    ///
    /// # Errors
    /// Constants rejected by the estimator.
    pub fn new(machine: impl Into<MachineParameters>) -> Result<Self, InputError> {
        let machine = machine.into();
        Self::with(machine.reduced_config(), machine.oil_config(), machine.low_pressure_mpa)
    }

    /// Reduced model with given constants.
    ///
    /// # Errors
    /// Constants rejected by the estimator.
    pub fn with(config: ReducedConfig, oil: OilConfig, low_mpa: f64) -> Result<Self, InputError> {
        let model = ReducedModel::new(&config, &oil).map_err(|e| InputError::new(e.to_string()))?;
        Ok(Self { file: config, file_oil: oil, file_low_mpa: low_mpa, model })
    }

    /// Constants and oil of the corrected machine.
    #[must_use]
    pub fn configs(&self, correction: MachineCorrection) -> (ReducedConfig, OilConfig) {
        let (mut config, mut oil) = (self.file, self.file_oil);
        config.pump_displacement.0 *= single(correction.displacement);
        config.pump_dead_volume.0 *= single(correction.displacement);
        oil.bulk_modulus_mpa *= single(correction.bulk);
        (config, oil)
    }

    /// Reduced model of the corrected machine.
    ///
    /// # Errors
    /// Factors rejected by the estimator.
    pub fn with_correction(&self, correction: MachineCorrection) -> Result<Self, InputError> {
        let (config, oil) = self.configs(correction);
        let model = ReducedModel::new(&config, &oil).map_err(|e| InputError::new(e.to_string()))?;
        Ok(Self { model, ..self.clone() })
    }

    /// Speed ratio.
    #[must_use]
    pub fn ratio(&self, at: &OperatingPoint, kou: f64) -> f64 {
        let point = estimator_point(at, self.file_low_mpa);
        f64::from(self.model.balance(&point).ratio(LeakageCoefficient(single(kou))).get())
    }

    /// Leakage coefficient for a speed ratio; negative above the leak-free ratio.
    #[must_use]
    pub fn kou(&self, at: &OperatingPoint, ratio: f64) -> f64 {
        let point = estimator_point(at, self.file_low_mpa);
        f64::from(self.model.balance(&point).kou(Ratio(single(ratio))).get())
    }

    /// Derivative `d|r|/dKou`, negative.
    #[must_use]
    pub fn slope(&self, at: &OperatingPoint) -> f64 {
        let point = estimator_point(at, self.file_low_mpa);
        -1.0 / f64::from(self.model.balance(&point).kou_per_ratio())
    }
}

impl PlantModel for ReducedPlant {
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<SteadyResponse, PlantError> {
        Ok(SteadyResponse { ratio: self.ratio(at, kou), p_l_mpa: at.p_l_mpa.unwrap_or(self.file_low_mpa) })
    }

    fn corrected(&self, correction: MachineCorrection) -> Result<Box<dyn PlantModel + '_>, InputError> {
        Ok(Box::new(self.with_correction(correction)?))
    }
}
