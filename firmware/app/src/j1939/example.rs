//! Example estimate for tests on the host and on the target.

use kou_estimator::health::Health;
use kou_estimator::units::{LeakageCoefficient, LitrePerMin, Micros, Ratio};
use kou_estimator::{Channel, Estimate, Expected, Fault, Reason};

/// Estimate with a valid and an invalid part.
#[must_use]
pub fn example_estimate() -> Estimate {
    Estimate {
        time: Micros(0),
        expected: Ok(Expected {
            kou: LeakageCoefficient(0.08),
            kou_se: LeakageCoefficient(0.002),
            ratio: Ratio(0.95),
            volumetric_efficiency: Ratio(0.95),
            leakage: LitrePerMin(12.5),
        }),
        observed: Err(Reason::Sensor(Channel::MotorSpeed, Fault::Stuck)),
        health: Health::new(),
    }
}
