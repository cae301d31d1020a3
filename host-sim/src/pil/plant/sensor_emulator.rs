//! Emulated sensors with the reference wiring: transducers, analogue-digital converter, toothed wheels with pickups.
//!
//! The converter answers bytes with bytes, as an MCP3208 does: twelve bits of the ratio to its reference, with noise of
//! half a count. Wheels have sixty teeth and a runout of a fiftieth of a pitch. Failures are electrical, so that their
//! detection is the firmware's.

use heapless::Vec as Few;
use kou_app::sensors::pickup::MAX_EDGES;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

use super::scenario::{FailureMode, Scenario, Sensor, SensorFailure};
use super::vehicle::VehicleTruth;

/// Rate of the capture timer.
const COUNTER_HZ: f64 = 10.0e6;
const TEETH: f64 = 60.0;
/// Amplitude of the runout, pitches.
const RUNOUT: f64 = 0.02;
/// Noise of a conversion, counts.
const NOISE_COUNTS: f64 = 0.5;
const FULL_SCALE: f64 = 4096.0;
/// Shunt over reference voltage, 1/mA.
const SHARE_PER_MA: f64 = 150.0e-3 / 3.3;
const PULL_UP_OHM: f64 = 2200.0;
/// Analogue inputs of the chip.
const INPUTS: usize = 8;

/// Signals at the controller's pins during one millisecond.
#[derive(Debug, Clone)]
pub struct HardwareSignals {
    /// Conversions of the chip's inputs; none where it does not answer.
    counts: [Option<u16>; INPUTS],
    /// Count of the capture timer at the end.
    pub count: u32,
    /// Time stamps of the pump's edges.
    pub pump: Few<u32, MAX_EDGES>,
    /// Time stamps of the motor's edges.
    pub motor: Few<u32, MAX_EDGES>,
}

impl HardwareSignals {
    /// Answer that the converter clocks out while `request` is clocked in: nothing drives the line until the null bit.
    #[must_use]
    pub fn answer(&self, request: [u8; 3]) -> [u8; 3] {
        let [first, second, _] = request;
        let started = first & 0b0000_0110 == 0b0000_0110;
        let input = usize::from((first & 1) << 2 | second >> 6);
        match self.counts.get(input).copied().flatten().filter(|_| started) {
            Some(counts) => {
                let [high, low] = counts.to_be_bytes();
                [0xFF, 0xE0 | high, low]
            }
            None => [0xFF; 3],
        }
    }
}

/// Sensors of one vehicle.
#[derive(Debug)]
pub struct SensorEmulator {
    rng: ChaCha8Rng,
    failures: Vec<SensorFailure>,
    /// Conversions at which inputs are stuck.
    stuck: [Option<u16>; INPUTS],
    last: [u16; INPUTS],
    ms: u64,
}

impl SensorEmulator {
    /// The sensors of a scenario.
    #[must_use]
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(scenario.seed),
            failures: scenario.failures.clone(),
            stuck: [None; INPUTS],
            last: [0; INPUTS],
            ms: 0,
        }
    }

    fn normal(&mut self, sigma: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.rng);
        sigma * unit
    }

    fn chance(&mut self, probability: f64) -> bool {
        f64::from(self.rng.next_u32()) < probability * (f64::from(u32::MAX) + 1.0)
    }

    fn failure(&self, sensor: Sensor, time_s: f64) -> Option<SensorFailure> {
        let now = |f: &&SensorFailure| f.sensor == sensor && time_s >= f.from_s && time_s < f.until_s;
        self.failures.iter().find(now).copied()
    }

    /// Signals of the millisecond that ends at `time_s`.
    pub fn millisecond(&mut self, time_s: f64, truth: &VehicleTruth) -> HardwareSignals {
        let begin_s = self.ms as f64 * 1e-3;
        self.ms += 1;
        let mut counts = [None; INPUTS];
        let values = [truth.lines_mpa[0], truth.lines_mpa[1], truth.t_b_c, truth.alpha];
        let sensors = [Sensor::LineA, Sensor::LineB, Sensor::Oil, Sensor::Displacement];
        for (input, (sensor, value)) in sensors.into_iter().zip(values).enumerate() {
            let conversion = self.conversion(input, sensor, value, time_s);
            if let Some(slot) = counts.get_mut(input) {
                *slot = conversion;
            }
        }
        let pump = self.edges(Sensor::Pump, 1, begin_s, time_s, truth);
        let motor = self.edges(Sensor::Motor, 2, begin_s, time_s, truth);
        HardwareSignals { counts, count: stamp(self.ms as f64 * 1e-3), pump, motor }
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to twelve bits")]
    fn conversion(&mut self, input: usize, sensor: Sensor, mut value: f64, time_s: f64) -> Option<u16> {
        let failure = self.failure(sensor, time_s);
        let noise = self.normal(NOISE_COUNTS);
        let mut wire = None;
        let mut held = false;
        if let Some(SensorFailure { kind, size, from_s, .. }) = failure {
            match kind {
                FailureMode::Open => wire = Some(if sensor == Sensor::Oil { 1.0 } else { 0.0 }),
                FailureMode::Short => wire = Some(if sensor == Sensor::Oil { 0.0 } else { 1.0 }),
                FailureMode::Stuck => held = true,
                FailureMode::Offset => value += size,
                FailureMode::Drift => value += size * (time_s - from_s),
                FailureMode::Noise => value += self.normal(size),
                FailureMode::DropOut => {
                    if self.chance(size) {
                        return None;
                    }
                }
            }
        }
        let share = wire.unwrap_or_else(|| share_of(sensor, value));
        let fresh = (share * FULL_SCALE + noise).round().clamp(0.0, FULL_SCALE - 1.0) as u16;
        let (Some(stuck), Some(last)) = (self.stuck.get_mut(input), self.last.get_mut(input)) else {
            return Some(fresh);
        };
        if held {
            return Some(*stuck.get_or_insert(*last));
        }
        *stuck = None;
        *last = fresh;
        Some(fresh)
    }

    /// Time stamps of a wheel's edges; `shaft` is its column in [`VehicleTruth::turns`].
    fn edges(
        &mut self,
        sensor: Sensor,
        shaft: usize,
        begin_s: f64,
        time_s: f64,
        truth: &VehicleTruth,
    ) -> Few<u32, MAX_EDGES> {
        let failure = self.failure(sensor, time_s).map(|failure| match failure.kind {
            FailureMode::Drift => (FailureMode::Drift, failure.size * (time_s - failure.from_s)),
            kind => (kind, failure.size),
        });
        let mut times: Vec<f64> = Vec::new();
        for pair in truth.turns.windows(2) {
            let [from, to] = pair else { continue };
            let (t0, t1) = (from[0], to[0]);
            let (a, b) = (pitches(from[shaft]), pitches(to[shaft]));
            // A wheel that turns back passes the same edges from the other side.
            let (low, high) = if a <= b { (a, b) } else { (b, a) };
            let mut tooth = low.floor() + 1.0;
            while tooth <= high {
                times.push(begin_s + t0 + (t1 - t0) * (tooth - a) / (b - a));
                tooth += 1.0;
            }
        }
        match failure {
            Some((FailureMode::Open | FailureMode::Short | FailureMode::Stuck, _)) => times.clear(),
            Some((FailureMode::Offset | FailureMode::Drift | FailureMode::DropOut, share)) => {
                times.retain(|_| !self.chance(share));
            }
            Some((FailureMode::Noise, per_ms)) => {
                let mut left = per_ms;
                while left > 0.0 {
                    if self.chance(left.min(1.0)) {
                        let share = f64::from(self.rng.next_u32()) / (f64::from(u32::MAX) + 1.0);
                        times.push(begin_s + 1e-3 * share);
                    }
                    left -= 1.0;
                }
            }
            None => {}
        }
        times.sort_by(f64::total_cmp);
        // More edges than the controller's buffer holds are lost there, as on hardware.
        times.into_iter().take(MAX_EDGES).map(stamp).collect()
    }
}

/// Pitches that a wheel has turned, with its runout.
fn pitches(turns: f64) -> f64 {
    let angle = turns * TEETH;
    angle + RUNOUT * (std::f64::consts::TAU * turns).sin()
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the counter wraps by design")]
fn stamp(time_s: f64) -> u32 {
    (time_s * COUNTER_HZ).round() as u64 as u32
}

/// Output of a sensor for a value, as a fraction of the converter's reference.
fn share_of(sensor: Sensor, value: f64) -> f64 {
    match sensor {
        Sensor::LineA | Sensor::LineB => {
            // A transmitter holds its output within 3.8 to 20.5 mA.
            (4.0 + 16.0 * value / 60.0).clamp(3.8, 20.5) * SHARE_PER_MA
        }
        Sensor::Oil => {
            let cubic = if value < 0.0 { -4.183e-12 * (value - 100.0) * value.powi(3) } else { 0.0 };
            let ohm = 1000.0 * (1.0 + 3.9083e-3 * value - 5.775e-7 * value * value + cubic);
            ohm / (ohm + PULL_UP_OHM)
        }
        Sensor::Displacement => 0.5 + 0.8 * value / 2.2,
        Sensor::Pump | Sensor::Motor => 0.0,
    }
}
