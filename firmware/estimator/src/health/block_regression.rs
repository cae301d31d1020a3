//! Regression model of a block: the ratio residual as a linear function of level, ratio offset and slopes.
//!
//! With `S = |dr/dKou|`, normalised pressure `y` and temperature `z` and the pivots of the slopes (`docs/health/theory.md`):
//!
//! ```text
//! ratio residual = S Kou_law (level + s_p (y - y_0) + s_T (z - z_0)) + |r| offset + noise
//! ```

use serde::{Deserialize, Serialize};

use super::averaging::{Block, RegressionSample};
use super::context::HealthContext;
use super::tuning::{NOISE_VARIANCE_MIN, SLOPE_PIVOTS};
use super::ud_rls::{PARAMETERS, UdFilter};
use crate::model::sqrt::square_root;
use crate::units::{Celsius, Megapascal, RevPerMin};

/// Regressor and noise of one block.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BlockRegression {
    /// Loss of ratio per unit of level.
    pub per_level: f32,
    /// Regressor of level, ratio offset and slopes.
    pub phi: [f32; PARAMETERS],
    /// Noise variance of the ratio residual, counted as if blocks were independent.
    pub noise_variance: f32,
}

/// Spread of a deviation from the learned parameters, in units of level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DeviationSpread {
    /// Standard error of the prediction by the learned parameters.
    pub learned_sd: f32,
    /// Noise variance of the block.
    pub noise2: f32,
}

impl DeviationSpread {
    /// Spread before the first block.
    pub const fn new() -> Self {
        Self { learned_sd: 0.0, noise2: 1.0 }
    }
}

impl BlockRegression {
    /// Regression before the first block.
    pub const fn new() -> Self {
        Self { per_level: 0.0, phi: [0.0; PARAMETERS], noise_variance: 1.0 }
    }

    /// Sets up the regression model of a block.
    #[inline(always)]
    pub(super) fn of(context: &HealthContext, block: &Block) -> Self {
        let config = &context.params.config;
        let mean = &block.mean;
        let per_level = mean.ratio_per_kou * mean.kou_law;
        let [pressure, temperature] = slope_regressors(context, mean);
        let phi = [per_level, mean.ratio, per_level * pressure, per_level * temperature];
        let misfit = config.law_misfit * per_level;
        let random = config.ratio_noise * mean.ratio;
        // The misfit is one value for as long as the operating point is; random errors are new in every sample.
        let noise_variance = misfit * misfit * config.misfit_blocks
            + random * random / block.count as f32
            + NOISE_VARIANCE_MIN;
        Self { per_level, phi, noise_variance }
    }

    /// Innovation of a ratio residual and its spread, in units of level.
    #[inline(always)]
    pub fn innovation(&self, filter: &UdFilter, ratio_residual: f32) -> (f32, DeviationSpread) {
        let innovation = filter.innovation(self.phi, ratio_residual, 0.0);
        let levels = 1.0 / self.per_level;
        let spread = DeviationSpread {
            learned_sd: square_root(innovation.variance) * levels,
            noise2: self.noise_variance * levels * levels,
        };
        (innovation.error * levels, spread)
    }

    /// Part of a ratio residual that given parameters leave unexplained.
    #[inline(always)]
    pub fn unexplained(&self, theta: [f32; PARAMETERS], ratio_residual: f32) -> f32 {
        let [p1, p2, p3, p4] = self.phi;
        let [t1, t2, t3, t4] = theta;
        ratio_residual - (p1 * t1 + p2 * t2 + p3 * t3 + p4 * t4)
    }
}

/// Normalised pressure and temperature of a block, relative to the slopes' pivots.
fn slope_regressors(context: &HealthContext, mean: &RegressionSample) -> [f32; 2] {
    let [_, y, z] =
        context.law.normalised(RevPerMin(mean.n_p_rpm), Megapascal(mean.p_h_mpa), Celsius(mean.t_b_c));
    let [pressure, temperature] = SLOPE_PIVOTS;
    [y - pressure, z - temperature]
}
