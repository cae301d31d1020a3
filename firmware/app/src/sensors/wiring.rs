//! Reference wiring: used by the boards' documentation, the tests and the emulated controller.
//!
//! A vehicle with other sensors supplies its own [`SensorsConfig`]; no other part of the firmware contains these
//! numbers.

use kou_estimator::units::{Celsius, Megapascal, Ratio, RevPerMin};

use super::adc::Input;
use super::analog::AnalogConfig;
use super::debounce::DebounceConfig;
use super::pickup::PickupConfig;
use super::plausibility::PlausibilityConfig;
use super::scale::{LinearConfig, ThermometerConfig};
use super::set::SensorsConfig;

/// Period of the sample task, us.
pub const SAMPLE_PERIOD_US: u32 = 1000;
/// Reference voltage and supply of the converter.
const REFERENCE_V: f32 = 3.3;

const fn input(number: u8) -> Input {
    match Input::new(number) {
        Some(input) => input,
        // Unreachable: the numbers below are valid.
        None => input(0),
    }
}

/// 50 ms to confirm a failure, half a second to heal it.
const ANALOG_DEBOUNCE: DebounceConfig = DebounceConfig { confirm: 50, heal: 500 };

/// 4 to 20 mA for 0 to 60 MPa through 150 Ohm: 0.02 MPa per count.
const PRESSURE: LinearConfig<Megapascal> = LinearConfig::CurrentLoop {
    shunt_ohm: 150.0,
    reference_v: REFERENCE_V,
    at_zero: Megapascal(0.0),
    at_span: Megapascal(60.0),
};

/// A line rises from charge pressure to the relief valve's setting in about 20 ms; piston ripple is up to 3 MPa.
const LINE: AnalogConfig<Megapascal> = AnalogConfig {
    period_us: SAMPLE_PERIOD_US,
    filter_s: 0.05,
    lowest: Megapascal(-0.5),
    highest: Megapascal(60.0),
    max_rate_per_s: 2000.0,
    return_rate_per_s: None,
    noise_band: 3.0,
    stuck_ms: Some(1000),
    debounce: ANALOG_DEBOUNCE,
};

/// Oil warms by some kelvin a minute; cold oil may reach the sensor faster, but the whole tank changes by at most
/// half a kelvin per second: 20 kW into 20 L. One count is 0.34 K, the noise of a conversion half of that.
const OIL: AnalogConfig<Celsius> = AnalogConfig {
    period_us: SAMPLE_PERIOD_US,
    filter_s: 1.0,
    lowest: Celsius(-40.0),
    highest: Celsius(150.0),
    max_rate_per_s: 5.0,
    return_rate_per_s: Some(0.5),
    noise_band: 2.0,
    stuck_ms: Some(60_000),
    debounce: ANALOG_DEBOUNCE,
};

/// The swash plate moves from stop to stop in 100 ms at the fastest.
const SWASH: AnalogConfig<Ratio> = AnalogConfig {
    period_us: SAMPLE_PERIOD_US,
    filter_s: 0.02,
    lowest: Ratio(-1.05),
    highest: Ratio(1.05),
    max_rate_per_s: 25.0,
    return_rate_per_s: None,
    noise_band: 0.05,
    stuck_ms: Some(5000),
    debounce: ANALOG_DEBOUNCE,
};

/// Sixty teeth, stamped at 10 MHz; standstill below 2 r/min.
const PICKUP: PickupConfig = PickupConfig {
    teeth: 60,
    gap_teeth: 0,
    max_rpm: 3500.0,
    counter_hz: 10_000_000,
    window_ms: 50,
    zero_ms: 500,
    debounce: DebounceConfig { confirm: 60, heal: 600 },
};

/// Reference wiring.
pub const REFERENCE: SensorsConfig = SensorsConfig {
    line_a: (input(0), PRESSURE, LINE),
    line_b: Some((input(1), PRESSURE, LINE)),
    oil: (input(2), ThermometerConfig::Pt1000 { pull_up_ohm: 2200.0 }, OIL),
    displacement: Some((
        input(3),
        // Supplied from the converter's reference, so that its error cancels.
        LinearConfig::Ratiometric { supply_over_reference: 1.0, at_zero: Ratio(-1.1), at_span: Ratio(1.1) },
        SWASH,
    )),
    pump: PICKUP,
    motor: PICKUP,
    plausibility: PlausibilityConfig {
        working_speed: RevPerMin(400.0),
        // The flushing valve holds the low line at 1.5 MPa, the charge relief valve both lines at 2.4 MPa in neutral;
        // cold oil raises both, a burst of flow lowers the former.
        charge_lowest: Megapascal(0.8),
        charge_highest: Megapascal(3.5),
        // Half a per cent of 60 MPa twice, plus noise.
        neutral_difference: Megapascal(0.4),
        // Leakage at charge pressure needs 0.002; the sensor's zero adjustment is 0.5 % of its span.
        zero_displacement: Ratio(0.01),
        // The thermometers of a vehicle are at different places.
        oil_difference: Celsius(10.0),
        idle_displacement: Ratio(0.03),
        driving_displacement: Ratio(0.2),
        stall_pressure: Megapascal(45.0),
        largest_ratio: Ratio(1.05),
        debounce: DebounceConfig { confirm: 50, heal: 100 },
    },
};
