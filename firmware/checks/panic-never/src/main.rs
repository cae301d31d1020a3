//! Links the estimator alone, for the firmware's target and in its profile, with a panic handler that does not exist.
//!
//! A panic path that the optimiser cannot remove refers to that handler, so linking fails: a build that succeeds proves
//! that nothing called here can panic. Every value passes through [`black_box`], so that nothing is proven by knowing the
//! inputs. The text forms of errors (`Display`) are left out on purpose: firmware logs with defmt, the host prints.
//!
//! Also the estimator's own flash and stack are read from this binary. It is linked, never run.
#![no_std]
#![no_main]

use core::hint::black_box;

use kou_estimator::model::calibrated_region::RegionConfig;
use kou_estimator::model::flow_balance::{OperatingPoint, ReducedModel};
use kou_estimator::record;
use kou_estimator::units::{LeakageCoefficient, LitrePerMin, MegapascalAbs, Ratio};
use kou_estimator::{Calibration, Channel, Estimate, Fault, Params, Reason, Sample, State};
use panic_never as _;

/// A value that the optimiser knows nothing about.
#[inline(never)]
fn unknown<T>(value: *const T) -> &'static T {
    #[allow(unsafe_code, reason = "this program is linked and never run")]
    // SAFETY: never executed; see the head of this module.
    unsafe {
        &*black_box(value)
    }
}

/// The estimator's public functions, each kept under a name of its own for the analysis of stack depth.
mod entries {
    use super::*;

    #[inline(never)]
    #[allow(unsafe_code, reason = "a name that xtask finds in the ELF")]
    #[unsafe(no_mangle)]
    pub fn kou_step(params: &Params, state: &mut State, sample: &Sample, out: &mut Estimate) {
        *out = kou_estimator::step(params, state, sample);
    }

    #[inline(never)]
    #[allow(unsafe_code, reason = "a name that xtask finds in the ELF")]
    #[unsafe(no_mangle)]
    pub fn kou_params_new(calibration: &Calibration, out: &mut Option<Params>) {
        *out = Params::new(calibration).ok();
    }

    #[inline(never)]
    #[allow(unsafe_code, reason = "a name that xtask finds in the ELF")]
    #[unsafe(no_mangle)]
    pub fn kou_params_replace(calibration: &Calibration, out: &mut Option<Params>) {
        Params::replace(out, calibration).ok();
    }

    #[inline(never)]
    #[allow(unsafe_code, reason = "a name that xtask finds in the ELF")]
    #[unsafe(no_mangle)]
    pub fn kou_record_decode(bytes: &[u8], out: &mut Option<Calibration>) {
        *out = record::calibration::decode(bytes).ok();
    }

    #[inline(never)]
    #[allow(unsafe_code, reason = "a name that xtask finds in the ELF")]
    #[unsafe(no_mangle)]
    pub fn kou_record_encode(calibration: &Calibration, buffer: &mut [u8]) -> Option<usize> {
        record::calibration::encode(calibration, buffer).ok()
    }
}

/// Parts of a step, one by one.
fn pieces(params: &Params, at: &OperatingPoint) {
    let law = params.law();
    let point = law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature);
    black_box((law.evaluate(point), law.standard_error(point)));

    let model = params.reduced();
    let balance = model.balance(at);
    let kou = *unknown(0x20 as *const LeakageCoefficient);
    let ratio = *unknown(0x24 as *const Ratio);
    black_box((balance.ratio(kou), balance.kou(ratio), balance.kou_per_ratio(), balance.compression_loss()));
    black_box((balance.leakage(kou), model.volumetric_efficiency(at, ratio)));
    black_box(model.ratio_of_flow(at, *unknown(0x28 as *const LitrePerMin)));

    let (low, high) = *unknown(0x30 as *const (MegapascalAbs, MegapascalAbs));
    black_box(model.compression().compression_loss(low, high, at.oil_temperature));
}

/// Construction and validation of configurations.
fn configurations(calibration: &Calibration) {
    black_box(ReducedModel::new(&calibration.reduced, &calibration.oil).is_ok());
    let region = RegionConfig::around(unknown(0x40 as *const [[f32; 3]; 45]).iter().copied(), 0.01);
    black_box(region.outside(*unknown(0x50 as *const [f32; 3])));
    black_box(region);
}

fn names(reason: Reason, channel: Channel, fault: Fault) {
    black_box((reason.name(), channel.name(), fault.name()));
}

#[allow(unsafe_code, reason = "the linker's entry point")]
#[unsafe(no_mangle)]
extern "C" fn _start() {
    let calibration = unknown(0x60 as *const Calibration);
    let params = unknown(0x64 as *const Params);
    let bytes = *unknown(0x68 as *const &'static [u8]);
    let mut state = unknown(0x6c as *const State).clone();
    let mut estimate = *unknown(0x70 as *const Estimate);
    let mut decoded = None;
    let mut checked = None;
    let mut buffer = [0; record::calibration::MAX_LEN];

    entries::kou_record_decode(bytes, &mut decoded);
    black_box(&decoded);
    black_box(entries::kou_record_encode(calibration, &mut buffer));
    black_box(record::crc32(&buffer));
    entries::kou_params_new(calibration, &mut checked);
    black_box(&checked);
    entries::kou_params_replace(calibration, &mut checked);
    black_box((&checked, Params::check(calibration).is_ok()));
    entries::kou_step(params, &mut state, unknown(0x74 as *const Sample), &mut estimate);
    black_box(kou_estimator::record::state::encode(&state, 0, &mut buffer).is_ok());
    black_box(kou_estimator::record::state::decode(bytes, 0).is_ok());
    let health = state.health();
    black_box((
        health.severity(params.health()),
        health.remaining_life(params.health()),
        health.last_change(),
    ));
    black_box((&estimate, estimate.wear_ratio().is_ok(), state.samples(), state.valid()));
    pieces(params, unknown(0x78 as *const OperatingPoint));
    configurations(calibration);
    names(*unknown(0x7c as *const Reason), *unknown(0x80 as *const Channel), *unknown(0x84 as *const Fault));
    #[cfg(feature = "deliberate-panic")]
    deliberate_panic(bytes);
}

/// An index that the optimiser cannot bound.
#[cfg(feature = "deliberate-panic")]
#[allow(clippy::indexing_slicing, reason = "it must be able to panic")]
fn deliberate_panic(bytes: &[u8]) {
    black_box(bytes[*unknown(0x88 as *const usize)]);
}
