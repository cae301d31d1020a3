//! Fault signatures of health monitoring against finite differences of the estimator's own expectation at displaced readings.
//!
//! At one operating point the regression of the ratio residual on a signature has the same residual for every cause, so that the
//! quotient of two of its results is the quotient of two signatures, whatever was learned. The saved state holds both sums.

mod support;

use kou_estimator::health::Cause;
use kou_estimator::model::flow_balance::OperatingPoint;
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Params, Reading, Sample, State, step};
use kou_records::calibration::read_checked;
use support::{Folder, calibrated};

/// An oil whose bulk modulus falls with temperature as mineral oils' does, so that both parts of the temperature's signature
/// matter.
const BULK_MODULUS_PER_K: f32 = -0.005;

fn params() -> Params {
    let folder = Folder::new();
    let out = calibrated(&folder, "A");
    let (mut calibration, _) = read_checked(&out).unwrap();
    calibration.oil.bulk_modulus_per_k = BULK_MODULUS_PER_K;
    Params::new(&calibration).unwrap()
}

/// Values of the sensors: both speeds (pump first), pressure, oil temperature, displacement.
type ReadingValues = [f32; 5];

/// A cause that is an offset of one reading.
struct Offset {
    cause: Cause,
    /// Half of the finite difference: wide enough for f32, whose rounding is 1e-7 of a ratio, and narrow enough for a straight
    /// line.
    half: f32,
    /// Relative. Signatures are of first order, good to 0.7 % here; the temperature's also uses the relative change of the bulk
    /// modulus at 60 degC, which is 15 % off at 30 degC and there contributes 4 %.
    tolerance: f64,
}

/// In the order of [`ReadingValues`].
const OFFSETS: [Offset; 5] = [
    Offset { cause: Cause::PumpSpeedOffset, half: 10.0, tolerance: 0.01 },
    Offset { cause: Cause::MotorSpeedOffset, half: 10.0, tolerance: 0.01 },
    Offset { cause: Cause::Pressure, half: 0.2, tolerance: 0.01 },
    Offset { cause: Cause::Temperature, half: 1.0, tolerance: 0.05 },
    Offset { cause: Cause::Displacement, half: 0.005, tolerance: 0.01 },
];

fn point(params: &Params, [n_p, _, p_h, t_b, alpha]: ReadingValues) -> OperatingPoint {
    OperatingPoint {
        pump_speed: RevPerMin(n_p),
        high_pressure: Megapascal(p_h),
        low_pressure: params.low_pressure(),
        oil_temperature: Celsius(t_b),
        displacement: Ratio(alpha),
    }
}

fn kou(params: &Params, [n_p, _, p_h, t_b, _]: ReadingValues) -> f32 {
    let law = params.law();
    law.evaluate(law.normalised(RevPerMin(n_p), Megapascal(p_h), Celsius(t_b))).get()
}

fn ratio(params: &Params, read: ReadingValues, kou: f32) -> f64 {
    f64::from(params.reduced().balance(&point(params, read)).ratio(LeakageCoefficient(kou)).get())
}

/// Ratio by the law less the measured one.
fn ratio_residual(params: &Params, read: ReadingValues) -> f64 {
    ratio(params, read, kou(params, read)) - f64::from(read[1]) / f64::from(read[0])
}

/// Ratio residual per unit of wear (a level more) and of each offset, by differences.
fn expected(params: &Params, read: ReadingValues) -> (f64, [f64; 5]) {
    let by_law = kou(params, read);
    let wear = (ratio(params, read, 0.8 * by_law) - ratio(params, read, 1.2 * by_law)) / 0.4;
    let slopes = std::array::from_fn(|i| {
        let by = |half: f32| {
            let mut read = read;
            read[i] += half;
            ratio_residual(params, read)
        };
        let half = OFFSETS[i].half;
        (by(half) - by(-half)) / f64::from(2.0 * half)
    });
    (wear, slopes)
}

/// Drives at one operating point until the leakage has doubled and its causes are isolated. Returns the ratio residual over
/// each signature, in the order of [`Cause::ALL`].
fn regressed(params: &Params, at: ReadingValues) -> Vec<f64> {
    let mut state = State::new();
    let by_law = kou(params, at);
    for i in 1..8000_u64 {
        let time = Micros(50_000 * i);
        let level = if i < 4000 { 1.0 } else { 2.0 };
        let mut sample = Sample::empty(time);
        let motor_rpm = f64::from(at[0]) * ratio(params, at, level * by_law);
        sample.pump_speed = Reading::new(time, RevPerMin(at[0]));
        sample.motor_speed = Reading::new(time, RevPerMin(motor_rpm as f32));
        sample.high_pressure = Reading::new(time, Megapascal(at[2]));
        sample.oil_temperature = Reading::new(time, Celsius(at[3]));
        sample.displacement = Reading::new(time, Ratio(at[4]));
        let estimate = step(params, &mut state, &sample);
        assert!(estimate.observed.is_ok(), "{at:?}: {estimate:?}");
    }
    assert_eq!(state.health().last_change().map(|change| change.step), Some(true), "the leak must be found");
    let saved = serde_json::to_value(state.health()).unwrap();
    let sums = |name: &str| -> Vec<f64> {
        let list = saved["diagnosis"]["regression"][name].as_array().unwrap();
        list.iter().map(|value| value.as_f64().unwrap()).collect()
    };
    sums("residual_products")
        .iter()
        .zip(sums("signature_products"))
        .map(|(residual, itself)| residual / itself)
        .collect()
}

#[test]
fn val_signatures_of_offsets_are_the_slopes_of_the_expected_ratio_over_operating_points() {
    let params = params();
    for (n_p, p_h, t_b, alpha) in [
        (1200.0, 15.0, 40.0, 1.0),
        (2000.0, 30.0, 60.0, 1.0),
        (2500.0, 40.0, 80.0, 0.6),
        (1600.0, 35.0, 30.0, 0.8),
    ] {
        let mut at = [n_p, 0.0, p_h, t_b, alpha];
        // Measured as with the leak, which is where signatures are looked at.
        at[1] = n_p * ratio(&params, at, 2.0 * kou(&params, at)) as f32;
        let (wear, slopes) = expected(&params, at);
        let regressed = regressed(&params, at);
        let of_wear = regressed[Cause::Wear as usize];
        for (Offset { cause, tolerance, .. }, slope) in OFFSETS.into_iter().zip(slopes) {
            // The signature over that of wear, both ways.
            let (got, wanted) = (of_wear / regressed[cause as usize], slope / wear);
            println!("{cause:?} at {at:?}: {got:.6} per unit, by differences {wanted:.6}");
            assert!((got / wanted - 1.0).abs() < tolerance, "{cause:?} at {at:?}: {got} for {wanted}");
        }
    }
}
