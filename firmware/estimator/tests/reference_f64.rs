//! The f32 kernels against an independent f64 reference model: compression table, forward model, leakage law.

mod common;

use common::reference::{Oil, OracleMachine};
use kou_estimator::Params;
use kou_estimator::model::flow_balance::{OperatingPoint, ReducedModel};
use kou_estimator::model::oil_compression::OilConfig;
use kou_estimator::units::*;

/// Oils from stiff and air-free to soft and foamy: corners of the admissible calibrations.
const OILS: [Oil; 5] = [
    Oil { beta_mpa: 1314.0, air: 0.002, lambda: 1.4 },
    Oil { beta_mpa: 1800.0, air: 0.0, lambda: 1.4 },
    Oil { beta_mpa: 1000.0, air: 0.01, lambda: 1.2 },
    Oil { beta_mpa: 800.0, air: 0.05, lambda: 1.0 },
    Oil { beta_mpa: 3000.0, air: 0.1, lambda: 1.67 },
];

fn config(oil: Oil) -> OilConfig {
    OilConfig {
        bulk_modulus_mpa: oil.beta_mpa as f32,
        air_fraction: oil.air as f32,
        heat_capacity_ratio: oil.lambda as f32,
        bulk_modulus_per_k: 0.0,
        reference: Celsius(60.0),
    }
}

#[test]
fn compression_loss_agrees_with_quadrature_of_the_published_bulk_modulus() {
    let mut worst = 0.0_f64;
    for oil in OILS {
        let model = ReducedModel::new(&common::calibration().reduced, &config(oil)).unwrap();
        for low in [0.0, 0.2, 0.9, 1.5, 3.0, 5.0] {
            for i in 0..200 {
                let high = low + 1.0 + 55.0 * f64::from(i) / 199.0;
                // The f64 reference is evaluated at the pressures as f32 represents them.
                let (low, high) = (low as f32, high as f32);
                let exact = oil.compression_loss(f64::from(low), f64::from(high));
                let got = model.compression().compression_loss(
                    Megapascal(low).to_absolute(),
                    Megapascal(high).to_absolute(),
                    Celsius(60.0),
                );
                let error = (f64::from(got) - exact).abs();
                // Interpolation with six Chebyshev nodes over an octave: (3 - sqrt 8)^6 = 2.5e-5 of the air's share,
                // with a factor of 2 for the constant; rounding: some ulp of 0.1. Below 1e-5 of volume even for a
                // foam at atmospheric pressure, where the flow balance itself may err by 1e-4.
                let bound = 2e-7 + 5e-5 * oil.air;
                assert!(error < bound, "{oil:?} {low} {high}: {got} against {exact}");
                worst = worst.max(error);
            }
        }
    }
    println!("worst error of the compression loss {worst:.2e}");
}

#[test]
fn ratio_agrees_with_f64_to_1e6_over_the_envelope() {
    let calibration = common::calibration();
    let model = ReducedModel::new(&calibration.reduced, &calibration.oil).unwrap();
    let machine = OracleMachine {
        d_p: f64::from(301.2_f32),
        d_m: 300.0,
        dead_p: f64::from(0.3 * 301.2_f32),
        dead_m: 90.0,
        chambers: f64::from(8.7_f32),
        fewer_per_rpm: 6e-5,
        fewer_per_root: 0.02,
        groove: 0.01,
        p_low: 1.5,
    };
    let mut worst = 0.0_f64;
    for n in [1000.0_f32, 1500.0, 2000.0, 2800.0] {
        for p in [10.0_f32, 17.3, 30.0, 41.0, 50.0] {
            let chi = OILS[0].compression_loss(1.5, f64::from(p));
            for alpha in [-1.0_f32, -0.6, -0.3, 0.3, 0.47, 0.8, 1.0] {
                for kou in [0.0015_f32, 0.01, 0.058, 0.113, 0.36] {
                    let at = OperatingPoint {
                        pump_speed: RevPerMin(n),
                        high_pressure: Megapascal(p),
                        low_pressure: Megapascal(1.5),
                        oil_temperature: Celsius(60.0),
                        displacement: Ratio(alpha),
                    };
                    let got = model.balance(&at).ratio(LeakageCoefficient(kou));
                    let exact = machine.ratio(chi, n.into(), p.into(), alpha.into(), kou.into());
                    worst = worst.max((f64::from(got.get()) - exact).abs());
                }
            }
        }
    }
    println!("worst error of the ratio {worst:.2e}");
    // Eight roundings of quantities near 1 (6e-8 each): 5e-7. The stated bound is twice that.
    assert!(worst < 1e-6, "{worst:.2e}");
}

#[test]
fn law_agrees_with_f64_to_ten_roundings() {
    let calibration = common::calibration();
    let params = Params::new(&calibration).unwrap();
    let k = &calibration.law;
    let mut worst = 0.0_f64;
    for n in [1000.0_f32, 1777.0, 2800.0] {
        for p in [10.0_f32, 33.3, 50.0] {
            for t in [30.0_f32, 58.24, 90.0] {
                let point = params.law().normalised(RevPerMin(n), Megapascal(p), Celsius(t));
                let got = f64::from(params.law().evaluate(point).get());
                let [x, y, z] = [f64::from(n) / 2800.0, f64::from(p) / 50.0, f64::from(t) / 90.0];
                // Written term by term, as published, not nested as in the kernel.
                let f = f64::from;
                let terms = [
                    f(k.a11) * x * x,
                    f(k.a22) * y * y,
                    f(k.a33) * z * z,
                    f(k.a12) * x * y,
                    f(k.a13) * x * z,
                    f(k.a23) * y * z,
                    f(k.b1) * x,
                    f(k.b2) * y,
                    f(k.b3) * z,
                    f(k.c),
                ];
                let size: f64 = terms.iter().map(|t| t.abs()).sum();
                worst = worst.max((got - terms.iter().sum::<f64>()).abs() / size);
            }
        }
    }
    println!("worst error of the law, relative to the sum of its terms' magnitudes: {worst:.2e}");
    // Each of ten terms undergoes at most six roundings of 6e-8, most fewer.
    assert!(worst < 6.0 * 6e-8, "{worst:.2e}");
}

#[test]
fn softening_with_temperature_scales_the_contribution_of_the_oil_only() {
    let mut oil = config(OILS[0]);
    oil.bulk_modulus_per_k = -0.005;
    let soft = ReducedModel::new(&common::calibration().reduced, &oil).unwrap();
    let (low, high) = (Megapascal(1.5).to_absolute(), Megapascal(50.0).to_absolute());
    let got = f64::from(soft.compression().compression_loss(low, high, Celsius(90.0)).to_owned());
    // The contribution of the air, ln((1+u_L)/(1+u_H)), is unchanged; that of the oil is divided by 1 - 0.005*30 =
    // 0.85.
    let u = |p: f64| 0.002 * (0.101_325 / (p + 0.101_325)).powf(1.0 / 1.4);
    let air = ((1.0 + u(1.5)) / (1.0 + u(50.0))).ln();
    let total = -(1.0 - OILS[0].compression_loss(1.5, 50.0)).ln();
    let wanted = 1.0 - (-(air + (total - air) / 0.85)).exp();
    assert!((got - wanted).abs() < 2e-7, "{got} {wanted}");
}
