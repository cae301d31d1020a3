//! Flow balance of the high-pressure line: the steady speed ratio from the leakage coefficient (reduced model), and its
//! inverse.
//!
//! Per revolution of the pump, with the compression loss `chi`, all volumes at the density of the high line (after Wang
//! et al. 2025; derived in `docs/reduced-model.md`):
//!
//! ```text
//! |alpha| D_p - (|alpha| D_p + Z_p V_0p') chi - (Lambda Kou (p_H - p_c) + G w)/n_p = |r| (D_m + Z_m V_0m chi)
//! V_0p' = V_0p + V_sp (1 - |alpha|)/2,   V_sp = D_p/Z_p,   w = sqrt(p_H - p_L)
//! Lambda = Lambda_0 - l_n |alpha| n_p - l_w w
//! ```
//!
//! The pump delivers its swept volume, less the compression loss of swept and dead volume, less leakage; the motor
//! takes in its swept volume plus the recompression of its dead volume. Silencing grooves that bridge the kidneys pass
//! `G w`; chambers in transition leak less, the more so the longer the transition lasts. The balance is linear in
//! `Kou`, so its inverse is closed: that inverse is the identification. Negative displacement exchanges the lines and
//! the sign of the ratio, nothing else. A flow meter instead of a motor is a motor without dead volume whose
//! displacement is the meter's reference displacement.

use serde::{Deserialize, Serialize};

use crate::model::oil_compression::{Compression, OilConfig};
use crate::model::sqrt::square_root;
use crate::units::{
    Celsius, CubicCentimetre, CubicCentimetrePerRev, LeakageCoefficient, LitrePerMin, Megapascal, Ratio,
    RevPerMin,
};

/// Cubic centimetres in a litre.
const CM3_PER_LITRE: f32 = 1000.0;

/// Constants of the flow balance as written in a calibration; fitted to the lumped model or to a bench.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReducedConfig {
    /// Effective displacement of the pump at full swash, `D_p`.
    #[serde(rename = "pump_displacement_cm3_per_rev")]
    pub pump_displacement: CubicCentimetrePerRev,
    /// Effective dead volume of all pump chambers together, `Z_p V_0p`, at full swash.
    #[serde(rename = "pump_dead_volume_cm3")]
    pub pump_dead_volume: CubicCentimetre,
    /// Effective displacement of the motor, `D_m`, or the flow meter's reference displacement.
    #[serde(rename = "motor_displacement_cm3_per_rev")]
    pub motor_displacement: CubicCentimetrePerRev,
    /// Effective dead volume of all motor chambers together, `Z_m V_0m`; zero for a flow meter.
    #[serde(rename = "motor_dead_volume_cm3")]
    pub motor_dead_volume: CubicCentimetre,
    /// Effective number of leaking chambers at rest, `Lambda_0`: `(Z_p + Z_m)/2` by theory.
    pub leaking_chambers: f32,
    /// Decrease of the number of leaking chambers per r/min of pump speed at full displacement, `l_n`.
    pub fewer_leaking_per_rpm: f32,
    /// Decrease of the number of leaking chambers per root of the pressure difference between the lines, `l_w`.
    pub fewer_leaking_per_root_mpa: f32,
    /// Flow from line to line through bridging silencing grooves at 1 MPa, `G`; negative where they feed the high line.
    #[serde(rename = "groove_flow_l_min_per_root_mpa")]
    pub groove_flow: f32,
    /// Case pressure `p_c`, gauge.
    #[serde(rename = "case_pressure_mpa")]
    pub case_pressure: Megapascal,
}

/// Steady operating point of the drive: the inputs of the flow balance other than leakage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OperatingPoint {
    /// Pump speed `n_p`, positive.
    pub pump_speed: RevPerMin,
    /// Pressure of the high line `p_H`, gauge, above that of the case.
    pub high_pressure: Megapascal,
    /// Pressure of the low line `p_L`, gauge.
    pub low_pressure: Megapascal,
    /// Temperature of the make-up oil `T_b`.
    pub oil_temperature: Celsius,
    /// Displacement fraction `alpha`, -1 to 1, not 0.
    pub displacement: Ratio,
}

/// Flow balance of one machine (reduced model), prepared for evaluation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReducedModel {
    config: ReducedConfig,
    compression: Compression,
}

/// Flow balance at one operating point: `|r| intake = delivery - Kou leakage`. Shared by forward model and inverse.
#[doc(alias = "volumetric efficiency")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Balance {
    /// Delivery without leakage per pump revolution, cm3.
    delivery_cm3: f32,
    /// Intake of the motor per motor revolution, cm3.
    intake_cm3: f32,
    /// Leakage per pump revolution and unit of Kou, cm3.
    leakage_cm3_per_kou: f32,
    /// Leakage per minute and unit of Kou, L/min.
    leakage_l_min_per_kou: f32,
    /// +1 or -1: direction of the motor.
    sign: f32,
    /// Compressed volume: content of the pump's chambers at change-over to the high line, per pump revolution.
    compressed_cm3: f32,
    /// Compression loss `chi`.
    compression_loss: f32,
}

impl ReducedModel {
    /// Prepares a model from a checked configuration.
    pub(crate) fn from_checked(config: ReducedConfig, compression: Compression) -> Self {
        Self { config, compression }
    }

    /// Fills the table of an [empty](Compression::empty) compression.
    pub(crate) fn tabulate(&mut self, oil: &OilConfig) {
        self.compression.tabulate(oil);
    }

    /// Flow balance at an operating point.
    #[inline(always)]
    #[must_use]
    pub fn balance(&self, at: &OperatingPoint) -> Balance {
        let k = &self.config;
        let chi = self.compression.compression_loss(
            at.low_pressure.to_absolute(),
            at.high_pressure.to_absolute(),
            at.oil_temperature,
        );
        let full_cm3 = k.pump_displacement.get();
        let swept_cm3 = full_cm3 * at.displacement.get().abs();
        // |alpha| D_p + Z_p V_0p', with Z_p V_sp = D_p.
        let compressed_cm3 = k.pump_dead_volume.get() + 0.5 * (full_cm3 + swept_cm3);
        let root = square_root(at.high_pressure.get() - at.low_pressure.get());
        let leaking = k.leaking_chambers
            - k.fewer_leaking_per_rpm * (at.displacement.get().abs() * at.pump_speed.get())
            - k.fewer_leaking_per_root_mpa * root;
        let leakage_l_min_per_kou = leaking * (at.high_pressure.get() - k.case_pressure.get());
        let cm3_per_l_min = CM3_PER_LITRE / at.pump_speed.get();
        Balance {
            delivery_cm3: swept_cm3 - compressed_cm3 * chi - k.groove_flow * root * cm3_per_l_min,
            intake_cm3: k.motor_displacement.get() + k.motor_dead_volume.get() * chi,
            leakage_cm3_per_kou: leakage_l_min_per_kou * cm3_per_l_min,
            leakage_l_min_per_kou,
            sign: 1.0_f32.copysign(at.displacement.get()),
            compressed_cm3,
            compression_loss: chi,
        }
    }

    /// Volumetric efficiency of the drive at a speed ratio: `r D_m/(alpha D_p)`.
    #[inline(always)]
    #[must_use]
    pub fn volumetric_efficiency(&self, at: &OperatingPoint, ratio: Ratio) -> Ratio {
        let k = &self.config;
        Ratio(ratio.get() * k.motor_displacement.get() / (at.displacement.get() * k.pump_displacement.get()))
    }

    /// Speed ratio equivalent to a flow meter's reading: its flow over that of its reference displacement at pump
    /// speed.
    #[inline(always)]
    #[must_use]
    pub fn ratio_of_flow(&self, at: &OperatingPoint, flow: LitrePerMin) -> Ratio {
        Ratio(CM3_PER_LITRE * flow.get() / (at.pump_speed.get() * self.config.motor_displacement.get()))
    }

    /// Compression of the machine's oil.
    #[must_use]
    pub fn compression(&self) -> &Compression {
        &self.compression
    }

    /// Constants of the balance.
    #[must_use]
    pub fn config(&self) -> &ReducedConfig {
        &self.config
    }
}

impl Balance {
    /// Forward model: speed ratio `n_m/n_p` with this leakage coefficient; negative for negative displacement.
    ///
    /// Where leakage exceeds the delivery the result has the sign opposite to the displacement's.
    #[inline(always)]
    #[must_use]
    pub fn ratio(&self, kou: LeakageCoefficient) -> Ratio {
        Ratio(self.sign * (self.delivery_cm3 - kou.get() * self.leakage_cm3_per_kou) / self.intake_cm3)
    }

    /// Inverse model: leakage coefficient that explains a measured speed ratio.
    ///
    /// Negative where the ratio is above the leak-free ratio: no leakage explains it.
    #[inline(always)]
    #[must_use]
    pub fn kou(&self, ratio: Ratio) -> LeakageCoefficient {
        LeakageCoefficient(
            (self.delivery_cm3 - self.sign * ratio.get() * self.intake_cm3) / self.leakage_cm3_per_kou,
        )
    }

    /// Leakage flow of all chambers together, at high pressure.
    #[inline(always)]
    #[must_use]
    pub fn leakage(&self, kou: LeakageCoefficient) -> LitrePerMin {
        LitrePerMin(self.leakage_l_min_per_kou * kou.get())
    }

    /// Sensitivity `|dKou/dr|` at this operating point, in (L/min)/MPa per unit of ratio.
    #[inline(always)]
    #[must_use]
    pub fn kou_per_ratio(&self) -> f32 {
        self.intake_cm3 / self.leakage_cm3_per_kou
    }

    /// Sensitivity `dKou/dchi` at a ratio, in (L/min)/MPa.
    #[inline(always)]
    #[must_use]
    pub(crate) fn kou_per_compression_loss(&self, model: &ReducedModel, ratio: Ratio) -> f32 {
        -(self.compressed_cm3 + self.sign * ratio.get() * model.config.motor_dead_volume.get())
            / self.leakage_cm3_per_kou
    }

    /// Sensitivity `|dKou/dalpha|`, in (L/min)/MPa per unit of displacement fraction.
    #[inline(always)]
    #[must_use]
    pub(crate) fn kou_per_displacement(&self, model: &ReducedModel) -> f32 {
        model.config.pump_displacement.get() * (1.0 - 0.5 * self.compression_loss) / self.leakage_cm3_per_kou
    }

    /// Compression loss `chi`.
    #[inline(always)]
    #[must_use]
    pub fn compression_loss(&self) -> Ratio {
        Ratio(self.compression_loss)
    }
}
