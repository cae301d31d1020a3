//! Synthetic records: bench tables and drive logs with a leakage truth that is physical and not quadratic.
//!
//! What is made here says so in its heading. The speed ratio comes from the reduced model; noise is random only, of the
//! stated standard deviations. Columns `kou_true` hold the truth and are ignored by every reader.

mod bench;
mod drive;
mod noise;
mod truth;

pub use bench::write_bench;
pub use drive::write_drive;
pub use truth::kou_truth;

use kou_estimator::reduced::{OperatingPoint, ReducedModel};
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, Ratio, RevPerMin};

use crate::machine::Machine;

/// Speed ratio by the reduced model, for a leakage coefficient.
#[allow(clippy::cast_possible_truncation, reason = "the reduced model works in f32")]
fn ratio(model: &ReducedModel, machine: &Machine, [n, p, t, alpha]: [f64; 4], kou: f64) -> f64 {
    let at = OperatingPoint {
        pump_speed: RevPerMin(n as f32),
        high_pressure: Megapascal(p as f32),
        low_pressure: Megapascal(machine.circuit().low_pressure_mpa as f32),
        oil_temperature: Celsius(t as f32),
        displacement: Ratio(alpha as f32),
    };
    f64::from(model.balance(&at).ratio(LeakageCoefficient(kou as f32)).get())
}
