//! Scaling, against hand-calculated circuits and the tables of the standards.

use kou_estimator::Fault;
use kou_estimator::units::{Celsius, Megapascal, Ratio};
use proptest::prelude::*;

use crate::sensors::adc::AdcCounts;
use crate::sensors::scale::{LinearConfig, Scale, ThermometerConfig};

fn nearest(share: f64) -> AdcCounts {
    AdcCounts::new((share * 4096.0).round().clamp(0.0, 4095.0) as u16).unwrap()
}

/// Largest change of the value per count in this range: the possible quantisation error.
fn per_count<U: crate::sensors::SensorUnit>(scale: &Scale<U>, counts: AdcCounts) -> f32 {
    let at = |n: u16| scale.value(AdcCounts::new(n).unwrap()).unwrap().bare();
    (at(counts.get() + 1) - at(counts.get() - 1)).abs() / 2.0
}

const LOOP: LinearConfig<Megapascal> = LinearConfig::CurrentLoop {
    shunt_ohm: 150.0,
    reference_v: 3.3,
    at_zero: Megapascal(0.0),
    at_span: Megapascal(60.0),
};

#[test]
fn current_loop_reads_its_span_and_reports_broken_and_shorted_wires() {
    let scale = Scale::pressure(&LOOP).unwrap();
    let at_ma = |ma: f64| scale.value(nearest(ma * 1e-3 * 150.0 / 3.3));
    // Half a count is 0.01 MPa.
    for (ma, mpa) in [(4.0, 0.0), (8.0, 15.0), (12.0, 30.0), (20.0, 60.0), (3.8, -0.75)] {
        let value = at_ma(ma).unwrap().get();
        assert!((value - mpa).abs() < 0.011, "{ma} mA: {value} MPa");
    }
    for ma in [0.0, 2.0, 3.55] {
        assert_eq!(at_ma(ma), Err(Fault::Open), "{ma} mA");
    }
    for ma in [21.1, 21.9, 25.0] {
        assert_eq!(at_ma(ma), Err(Fault::Short), "{ma} mA");
    }
}

#[test]
fn ratiometric_reads_its_span_and_reports_broken_and_shorted_wires() {
    let config = LinearConfig::Ratiometric {
        // 5 V sensor through a divider of 0.6 to a reference of 3.3 V.
        supply_over_reference: 5.0 * 0.6 / 3.3,
        at_zero: Ratio(-1.0),
        at_span: Ratio(1.0),
    };
    let scale = Scale::displacement(&config).unwrap();
    let at_v = |volt: f64| scale.value(nearest(volt * 0.6 / 3.3));
    // Half a count of 2980 per span of 2.
    for (volt, alpha) in [(0.5, -1.0), (2.5, 0.0), (4.5, 1.0), (1.5, -0.5)] {
        let value = at_v(volt).unwrap().get();
        assert!((value - alpha).abs() < 4e-4, "{volt} V: {value}");
    }
    assert_eq!(at_v(0.2), Err(Fault::Open));
    assert_eq!(at_v(4.8), Err(Fault::Short));
}

/// Resistances of IEC 60751:2008, table 1, for 100 Ohm at 0 degC, times ten.
const PT1000: [(f64, f64); 9] = [
    (-50.0, 803.06),
    (-40.0, 842.71),
    (-20.0, 921.60),
    (0.0, 1000.0),
    (30.0, 1116.73),
    (60.0, 1232.42),
    (90.0, 1347.07),
    (120.0, 1460.68),
    (150.0, 1573.25),
];

#[test]
fn platinum_agrees_with_the_table_of_the_standard() {
    let scale = Scale::temperature(&ThermometerConfig::Pt1000 { pull_up_ohm: 2200.0 }).unwrap();
    for (t_c, ohm) in PT1000 {
        let counts = nearest(ohm / (ohm + 2200.0));
        let value = scale.value(counts).unwrap().get();
        // Half a count, and 0.01 K for the arithmetic.
        let allowed = 0.5 * per_count(&scale, counts) + 0.01;
        assert!((f64::from(value) - t_c).abs() < f64::from(allowed), "{t_c}: {value}, {allowed}");
    }
    let at_ohm = |ohm: f64| scale.value(nearest(ohm / (ohm + 2200.0)));
    assert_eq!(at_ohm(10.0), Err(Fault::Short));
    assert_eq!(at_ohm(5000.0), Err(Fault::Open));
    assert_eq!(scale.value(AdcCounts::new(0).unwrap()), Err(Fault::Short));
    assert_eq!(scale.value(AdcCounts::new(4095).unwrap()), Err(Fault::Open));
}

#[test]
fn thermistor_agrees_with_its_law_and_reports_both_ends() {
    let config = ThermometerConfig::Ntc { pull_up_ohm: 4700.0, ohm_at_25_c: 10_000.0, beta_k: 3435.0 };
    let scale = Scale::temperature(&config).unwrap();
    for t_c in [-20.0, 0.0, 25.0, 60.0, 90.0, 120.0_f64] {
        let ohm = 10_000.0 * (3435.0 * (1.0 / (t_c + 273.15) - 1.0 / 298.15)).exp();
        let counts = nearest(ohm / (ohm + 4700.0));
        let value = scale.value(counts).unwrap().get();
        let allowed = 0.5 * per_count(&scale, counts) + 0.01;
        assert!((f64::from(value) - t_c).abs() < f64::from(allowed), "{t_c}: {value}, {allowed}");
    }
    assert_eq!(scale.value(AdcCounts::new(0).unwrap()), Err(Fault::Short));
    assert_eq!(scale.value(AdcCounts::new(4095).unwrap()), Err(Fault::Open));
}

#[test]
fn impossible_wiring_is_rejected_by_name() {
    let reject = |config| Scale::pressure(&config).unwrap_err().field;
    let current = |shunt_ohm, reference_v, span| LinearConfig::CurrentLoop {
        shunt_ohm,
        reference_v,
        at_zero: Megapascal(0.0),
        at_span: Megapascal(span),
    };
    assert_eq!(reject(current(f32::NAN, 3.3, 60.0)), "shunt_ohm");
    assert_eq!(reject(current(150.0, 33.0, 60.0)), "reference_v");
    assert_eq!(reject(current(150.0, 3.3, 0.0)), "at_span");
    assert_eq!(reject(current(150.0, 3.3, f32::INFINITY)), "at_span");
    // 21 mA through 200 Ohm are 4.2 V: a short would be indistinguishable from a high pressure.
    assert_eq!(reject(current(200.0, 3.3, 60.0)), "reference");
    let ntc = ThermometerConfig::Ntc { pull_up_ohm: 4700.0, ohm_at_25_c: 10_000.0, beta_k: 34.35 };
    assert_eq!(Scale::temperature(&ntc).unwrap_err().field, "beta_k");
    let pt = ThermometerConfig::Pt1000 { pull_up_ohm: 2.2 };
    assert_eq!(Scale::temperature(&pt).unwrap_err().field, "pull_up_ohm");
}

proptest! {
    #[test]
    fn prop_every_count_is_a_finite_value_or_a_named_fault(
        counts in 0..4096_u16,
        pull_up_ohm in 200.0..100_000.0_f32,
        ohm_at_25_c in 100.0..1e6_f32,
        beta_k in 2000.0..6000.0_f32,
    ) {
        let counts = AdcCounts::new(counts).unwrap();
        let ntc = ThermometerConfig::Ntc { pull_up_ohm, ohm_at_25_c, beta_k };
        for config in [ntc, ThermometerConfig::Pt1000 { pull_up_ohm }] {
            let value: Result<Celsius, Fault> = Scale::temperature(&config).unwrap().value(counts);
            match value {
                // The electrical window is that of -60 to 250 degC; a count at its edge may lie a little outside.
                Ok(t) => prop_assert!((-90.0..=300.0).contains(&t.get()), "{t}"),
                Err(fault) => prop_assert!(matches!(fault, Fault::Open | Fault::Short), "{fault:?}"),
            }
        }
    }

    #[test]
    fn prop_linear_scaling_is_monotonic_over_all_counts(
        shunt_ohm in 10.0..150.0_f32,
        span in 0.1..100.0_f32,
    ) {
        let config = LinearConfig::CurrentLoop {
            shunt_ohm, reference_v: 3.3, at_zero: Megapascal(-0.1), at_span: Megapascal(span),
        };
        let scale = Scale::pressure(&config).unwrap();
        let mut last = f32::NEG_INFINITY;
        for counts in 0..4096 {
            if let Ok(value) = scale.value(AdcCounts::new(counts).unwrap()) {
                prop_assert!(value.get() > last);
                last = value.get();
            }
        }
    }
}
