//! The sensor set: plausibility between sensors, and the resulting sample.

use kou_estimator::units::{Celsius, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Fault, Reading, Sample};

use super::wheel::Wheel;
use crate::sensors::adc::AdcCounts;
use crate::sensors::set::{SensorInputs, SensorsParams, SensorsState};
use crate::sensors::wiring;

/// Simulated drive as its sensors should measure it.
#[derive(Debug, Clone, Copy)]
struct TestDrive {
    n_p: f64,
    n_m: f64,
    p_a: f64,
    p_b: f64,
    t_b: f64,
    alpha: f64,
}

const CRUISE: TestDrive = TestDrive { n_p: 1500.0, n_m: 1400.0, p_a: 25.0, p_b: 1.5, t_b: 60.0, alpha: 1.0 };

struct SetBench {
    params: SensorsParams,
    state: SensorsState,
    pump: Wheel,
    motor: Wheel,
    ms: u64,
    before: TestDrive,
    other_oil: Reading<Celsius>,
}

impl SetBench {
    fn new() -> Self {
        Self {
            params: SensorsParams::new(&wiring::REFERENCE).unwrap(),
            state: SensorsState::new(),
            pump: Wheel::new(60, 0, 0),
            motor: Wheel::new(60, 0, 0),
            ms: 0,
            before: CRUISE,
            other_oil: Reading::not_fitted(),
        }
    }

    /// Runs for a time and returns the last sample; one sample every ten milliseconds, like the tasks.
    fn run(&mut self, ms: u64, drive: TestDrive) -> Sample {
        let mut sample = Sample::empty(Micros(0));
        for _ in 0..ms {
            self.ms += 1;
            let mut inputs = SensorInputs::new();
            let noise = 0.0005 * ((self.ms % 3) as f64 - 1.0);
            let line = |mpa: f64| (4.0 + 16.0 * mpa / 60.0) * 1e-3 * 150.0 / 3.3;
            let ohm = 1000.0 * (1.0 + 3.9083e-3 * drive.t_b - 5.775e-7 * drive.t_b * drive.t_b);
            let shares =
                [line(drive.p_a), line(drive.p_b), ohm / (ohm + 2200.0), 0.5 + 0.8 * drive.alpha / 2.2];
            inputs.analog = shares.map(|share| {
                Ok(AdcCounts::new(((share + noise) * 4096.0).clamp(0.0, 4095.0) as u16).unwrap())
            });
            for time in self.pump.millisecond(self.before.n_p, drive.n_p) {
                inputs.pump.push(self.pump.stamp(time));
            }
            for time in self.motor.millisecond(self.before.n_m, drive.n_m) {
                inputs.motor.push(self.motor.stamp(time));
            }
            inputs.count = self.pump.stamp(self.pump.time_s());
            self.before = drive;
            self.state.observe(&self.params, Micros(self.ms * 1000), &inputs);
            if self.ms.is_multiple_of(10) {
                sample = self.state.sample(&self.params, &self.other_oil);
            }
        }
        sample
    }
}

#[test]
fn healthy_drive_gives_a_complete_sample() {
    let sample = SetBench::new().run(2000, CRUISE);
    assert!((sample.pump_speed.value.unwrap().get() - 1500.0).abs() < 0.02);
    assert!((sample.motor_speed.value.unwrap().get() - 1400.0).abs() < 0.02);
    // One count is 0.02 MPa, 0.3 K and 0.0007; the injected noise averages out.
    assert!((sample.high_pressure.value.unwrap().get() - 25.0).abs() < 0.03);
    assert!((sample.low_pressure.value.unwrap().get() - 1.5).abs() < 0.03);
    assert!((sample.oil_temperature.value.unwrap().get() - 60.0).abs() < 0.4);
    assert!((sample.displacement.value.unwrap().get() - 1.0).abs() < 0.001);
    assert_eq!(sample.flow.value, Err(Fault::NotFitted));
    assert_eq!(sample.time, Micros(2_000_000));
}

#[test]
fn reversed_lines_swap_and_the_motor_has_the_sign_of_the_displacement() {
    let reversed = TestDrive { p_a: 1.5, p_b: 20.0, alpha: -0.6, n_m: 850.0, ..CRUISE };
    let mut bench = SetBench::new();
    bench.run(1000, CRUISE);
    let sample = bench.run(2000, reversed);
    assert!((sample.high_pressure.value.unwrap().get() - 20.0).abs() < 0.03);
    assert!((sample.low_pressure.value.unwrap().get() - 1.5).abs() < 0.03);
    assert!((sample.motor_speed.value.unwrap().get() + 850.0).abs() < 0.02);
}

#[test]
fn implausible_sensors_are_found_within_a_second_and_heal() {
    type Blame = fn(&Sample) -> Option<Fault>;
    const NEUTRAL: TestDrive = TestDrive { alpha: 0.0, n_m: 0.0, p_a: 2.4, p_b: 2.4, ..CRUISE };
    let cases: [(&str, TestDrive, Blame); 10] = [
        // Sensor of the low line 5 MPa too high.
        ("low line", TestDrive { p_b: 6.5, ..CRUISE }, |s| s.low_pressure.value.err()),
        // Idle, with line A reading 10 MPa.
        ("idle", TestDrive { alpha: 0.0, p_a: 10.0, n_m: 0.0, ..CRUISE }, |s| s.high_pressure.value.err()),
        ("dead motor pickup", TestDrive { n_m: 0.0, ..CRUISE }, |s| s.motor_speed.value.err()),
        ("dead pump pickup", TestDrive { n_p: 0.0, ..CRUISE }, |s| s.pump_speed.value.err()),
        // In neutral, half a megapascal from the other line or a hundredth of displacement is an offset.
        ("neutral, A high", TestDrive { p_a: 2.95, ..NEUTRAL }, |s| s.high_pressure.value.err()),
        ("neutral, A low", TestDrive { p_a: 1.85, ..NEUTRAL }, |s| s.low_pressure.value.err()),
        ("neutral, B high", TestDrive { p_b: 2.95, ..NEUTRAL }, |s| s.high_pressure.value.err()),
        ("neutral, swash", TestDrive { alpha: 0.013, ..NEUTRAL }, |s| s.displacement.value.err()),
        ("neutral, swash far off", TestDrive { alpha: -0.5, ..NEUTRAL }, |s| s.displacement.value.err()),
        ("motor too fast", TestDrive { n_m: 1900.0, ..CRUISE }, |s| s.motor_speed.value.err()),
    ];
    for (what, wrong, blame) in cases {
        let mut bench = SetBench::new();
        let sample = bench.run(2000, CRUISE);
        assert_eq!(blame(&sample), None, "{what}: {sample:?}");
        let sample = bench.run(1200, wrong);
        assert_eq!(blame(&sample), Some(Fault::Implausible), "{what}: {sample:?}");
        // A line's sensor can only recover where its rule applies: idle, where both lines do.
        bench.run(2000, TestDrive { alpha: 0.0, p_a: 1.6, n_m: 0.0, ..CRUISE });
        let sample = bench.run(2000, CRUISE);
        assert_eq!(blame(&sample), None, "{what}: {sample:?}");
    }
}

#[test]
fn in_neutral_one_line_outside_charge_pressure_is_implausible_alone_and_stays_so_while_driving() {
    let mut bench = SetBench::new();
    let neutral = TestDrive { alpha: 0.0, n_m: 0.0, p_a: 2.4, p_b: 2.4, ..CRUISE };
    bench.run(2000, TestDrive { p_a: 4.4, ..neutral });
    let sample = bench.run(3000, TestDrive { p_a: 27.0, ..CRUISE });
    assert_eq!(sample.high_pressure.value, Err(Fault::Implausible));
    assert!(sample.low_pressure.value.is_ok(), "{sample:?}");
    bench.run(2000, neutral);
    let sample = bench.run(2000, CRUISE);
    assert!(sample.high_pressure.value.is_ok(), "{sample:?}");
}

#[test]
fn thermometer_that_another_one_contradicts_is_implausible_until_both_agree() {
    let mut bench = SetBench::new();
    for (other, ms, fault) in [(51.0, 2000, None), (49.0, 700, Some(Fault::Implausible)), (55.0, 1500, None)]
    {
        bench.other_oil = Reading::new(Micros(0), Celsius(other));
        let sample = bench.run(ms, CRUISE);
        assert_eq!(sample.oil_temperature.value.err(), fault, "{other}");
    }
    bench.other_oil = Reading::failed(Micros(0), Fault::Stale);
    assert!(bench.run(2000, CRUISE).oil_temperature.value.is_ok());
}

#[test]
fn permitted_behaviour_of_a_drive_is_plausible() {
    let cases = [
        ("at rest", TestDrive { n_p: 0.0, n_m: 0.0, p_a: 0.0, p_b: 0.0, alpha: 0.0, ..CRUISE }),
        ("idle", TestDrive { n_m: 0.0, p_a: 1.6, p_b: 1.5, alpha: 0.0, ..CRUISE }),
        ("stalled at the relief valve", TestDrive { n_m: 0.0, p_a: 48.0, ..CRUISE }),
        ("overrunning", TestDrive { p_a: 1.5, p_b: 12.0, n_m: 1530.0, ..CRUISE }),
        ("neutral, tolerances used up", TestDrive { n_m: 0.0, alpha: 0.008, p_a: 2.55, p_b: 2.25, ..CRUISE }),
        ("standing against a load", TestDrive { n_m: 0.0, alpha: 0.05, p_a: 12.0, ..CRUISE }),
        ("creeping", TestDrive { n_m: 20.0, alpha: 0.05, p_a: 8.0, ..CRUISE }),
    ];
    for (what, drive) in cases {
        let mut bench = SetBench::new();
        bench.run(500, CRUISE);
        let sample = bench.run(5000, drive);
        let implausible = [
            sample.pump_speed.value.err(),
            sample.motor_speed.value.err(),
            sample.high_pressure.value.err(),
            sample.low_pressure.value.err(),
            sample.displacement.value.err(),
        ]
        .contains(&Some(Fault::Implausible));
        assert!(!implausible, "{what}: {sample:?}");
    }
}

#[test]
fn broken_line_sensor_is_attributed_to_its_own_line() {
    let mut bench = SetBench::new();
    bench.run(1000, CRUISE);
    // -10 MPa are 1.3 mA: a broken loop.
    let sample = bench.run(200, TestDrive { p_b: -10.0, ..CRUISE });
    assert!(sample.high_pressure.value.is_ok());
    assert_eq!(sample.low_pressure.value, Err(Fault::Open));
    let mut bench = SetBench::new();
    let sample = bench.run(200, TestDrive { p_a: -10.0, ..CRUISE });
    assert_eq!(sample.high_pressure.value, Err(Fault::Open));
    assert!(sample.low_pressure.value.is_ok());
    let sample = bench.run(200, TestDrive { p_a: -10.0, p_b: -10.0, ..CRUISE });
    assert_eq!(sample.high_pressure.value, Err(Fault::Open));
    assert_eq!(sample.low_pressure.value, Err(Fault::Open));
}

#[test]
fn optional_sensors_that_are_absent_are_not_fitted() {
    let mut config = wiring::REFERENCE;
    config.line_b = None;
    config.displacement = None;
    let mut bench = SetBench { params: SensorsParams::new(&config).unwrap(), ..SetBench::new() };
    let sample = bench.run(1000, CRUISE);
    assert!(sample.high_pressure.value.is_ok());
    assert_eq!(sample.low_pressure.value, Err::<Megapascal, _>(Fault::NotFitted));
    assert_eq!(sample.displacement.value, Err::<Ratio, _>(Fault::NotFitted));
    assert!(sample.motor_speed.value.is_ok_and(|n| n > RevPerMin(0.0)));
    assert!(sample.oil_temperature.value.is_ok_and(|t| t > Celsius(0.0)));
}
