//! The link to the firmware in QEMU: damaged frames are answered and never executed, rejections name their reason.

use host_sim::pil::{LinkTransport, PilError, PilOptions, PilSession, frame, run, same_bits};
use kou_estimator::record::RecordError;
use kou_estimator::units::CubicCentimetre;
use kou_estimator::{Params, State, step};
use kou_pil::link::{CalibrationRejection, ErrorKind, FieldProblem, FrameError, Request, Response};
use kou_tests::samples::{HostileSamples, SplitMix64};
use kou_tests::{pil_options, record_of, reference_calibration, reference_params, set_up};

/// A copy of `good` that is no frame any more; none of its bytes becomes or stops being the closing zero.
fn damaged(good: &[u8], random: &mut SplitMix64) -> Vec<u8> {
    let mut bad = good.to_vec();
    let inner = bad.len() - 1;
    match random.below(3) {
        0 => {
            let at = random.below(inner);
            let bit = 1 << random.below(8);
            bad[at] = if bad[at] == bit { bad[at] ^ 0xFF } else { bad[at] ^ bit };
            if bad[at] == 0 {
                bad[at] = 0xFF ^ good[at] | 1;
            }
        }
        1 => {
            bad.drain(random.below(inner - 1) + 1..inner);
        }
        _ => {
            let at = random.below(inner);
            bad.insert(at, 1 + random.below(255) as u8);
        }
    }
    bad
}

#[test]
fn qemu_damaged_frames_are_answered_with_errors_and_never_obeyed() {
    let mut session = set_up(PilSession::start(&pil_options()));
    let record = record_of(&reference_calibration());
    let crc = set_up(session.load_calibration(&record));
    let mut random = SplitMix64(7);
    let mut samples = HostileSamples::new(7);
    let mut good_sent: u32 = 0;
    let mut answered_bad: u32 = 0;
    const ROUNDS: u32 = 3_000;
    for round in 0..ROUNDS {
        let sample = samples.next().expect("endless");
        let good = match round % 3 {
            0 => frame(&Request::Sample(sample)),
            1 => frame(&Request::LoadCalibration(&record)),
            _ => frame(&Request::Shutdown),
        }
        .expect("fits");
        let bad = damaged(&good, &mut random);
        // A good frame right behind the bad one must be understood.
        let mut bytes = bad.clone();
        bytes.extend(frame(&Request::Sample(sample)).expect("fits"));
        session.send_raw(bytes).expect("the firmware runs");
        match session.receive().unwrap_or_else(|error| panic!("{error}\nround {round}: {bad:02x?}")) {
            Ok(Response::Error(ErrorKind::Frame(_))) => answered_bad += 1,
            other => panic!("round {round}: {bad:02x?} was answered by {other:?}"),
        }
        match session.receive().unwrap_or_else(|error| panic!("{error}")) {
            Ok(Response::Estimate(_)) => good_sent += 1,
            other => panic!("round {round}: the good frame was answered by {other:?}"),
        }
    }
    let status = set_up(session.status());
    assert_eq!(status.calibration, Some(crc));
    assert_eq!(status.counts.frames_rejected(), answered_bad);
    assert_eq!(status.counts.samples, good_sent);
    assert_eq!(status.counts.calibrations_accepted, 1);
    assert_eq!(set_up(session.shut_down()).code, Some(0));
}

#[test]
fn qemu_each_kind_of_bad_frame_has_its_own_error_and_counter() {
    let mut session = set_up(PilSession::start(&pil_options()));
    // Payloads with a good CRC, and bytes that are no frame; worked out by hand from docs/link.md.
    let with_crc = |payload: &[u8]| {
        let mut body = payload.to_vec();
        body.extend(kou_estimator::record::crc32(payload).to_le_bytes());
        let mut bytes = vec![0; 64];
        let len = kou_pil::link::cobs::encode(&body, &mut bytes).expect("fits");
        bytes.truncate(len);
        bytes.push(0);
        bytes
    };
    let cases: [(Vec<u8>, FrameError); 6] = [
        (std::iter::repeat_n(1, 2_000).chain([0]).collect(), FrameError::TooLong),
        (vec![2, 7, 0], FrameError::TooShort),
        (vec![9, 1, 2, 3, 0], FrameError::Cobs),
        (vec![7, 1, 2, 3, 4, 5, 6, 0], FrameError::Crc),
        (with_crc(&[200, 1]), FrameError::Unknown),
        (with_crc(&[2, 1, 2, 3]), FrameError::Payload),
    ];
    for (bytes, error) in cases {
        session.send_raw(bytes).expect("the firmware runs");
        assert_eq!(set_up(session.receive()), Ok(Response::Error(ErrorKind::Frame(error))));
    }
    // A run of zeros is no frame and has no answer: the next answer belongs to the sample.
    session.send_raw(vec![0; 100]).expect("the firmware runs");
    let sample = HostileSamples::new(1).next().expect("endless");
    assert_eq!(set_up(session.request(&Request::Sample(sample))), Response::Error(ErrorKind::NoCalibration));
    let counts = set_up(session.status()).counts;
    let each = [
        counts.frames_too_long,
        counts.frames_too_short,
        counts.frames_cobs,
        counts.frames_crc,
        counts.frames_unknown,
        counts.frames_payload,
    ];
    assert_eq!(each, [1; 6]);
    assert_eq!(counts.samples_without_calibration, 1);
}

#[test]
fn qemu_calibration_refused_names_the_field() {
    let mut session = set_up(PilSession::start(&pil_options()));
    let good = reference_calibration();
    let crc = set_up(session.load_calibration(&record_of(&good)));

    let mut nan = good.clone();
    nan.law.a13 = f32::NAN;
    let mut bar = good.clone();
    bar.limits.min_pressure_difference.0 = 60.0;
    let mut meter = good.clone();
    meter.reduced.motor_displacement.0 = 200.0;
    let mut volume = good.clone();
    volume.reduced.pump_dead_volume = CubicCentimetre(-1.0);
    let rejections = [
        (nan, "law.a13", FieldProblem::NotFinite),
        (
            bar,
            "limits.min_pressure_difference_mpa",
            FieldProblem::OutOfRange { value: 60.0, min: 0.1, max: 50.0 },
        ),
        (
            meter,
            "reduced.motor_displacement_cm3_per_rev",
            FieldProblem::Inconsistent("differs from the data sheet's by more than 20 %".to_string()),
        ),
        (
            volume,
            "reduced.pump_dead_volume_cm3",
            FieldProblem::OutOfRange { value: -1.0, min: 0.0, max: 1506.0 },
        ),
    ];
    for (calibration, field, problem) in rejections {
        match session.load_calibration(&record_of(&calibration)) {
            Err(PilError::CalibrationRejected(rejection)) => {
                assert_eq!(rejection, CalibrationRejection::Field { field: field.to_string(), problem });
            }
            other => panic!("{field}: {other:?}"),
        }
    }
    let mut record = record_of(&good);
    record[20] ^= 1;
    match session.load_calibration(&record) {
        Err(PilError::CalibrationRejected(rejection)) => {
            assert_eq!(rejection, CalibrationRejection::Record(RecordError::Crc))
        }
        other => panic!("{other:?}"),
    }
    // The calibration before them is still in use.
    let status = set_up(session.status());
    assert_eq!((status.calibration, status.counts.calibrations_rejected), (Some(crc), 5));
}

#[test]
fn qemu_a_new_calibration_takes_effect_between_two_samples_and_starts_the_state_anew() {
    let mut session = set_up(PilSession::start(&pil_options()));
    let first = reference_calibration();
    let mut second = first.clone();
    second.law.c += 0.01;
    let late = HostileSamples::new(5).nth(100).expect("endless");
    // Earlier than the sample before it: time reversed, unless the state is new.
    let early = HostileSamples::new(5).next().expect("endless");
    let sequence = [
        Request::LoadCalibration(&record_of(&first)),
        Request::Sample(late),
        Request::LoadCalibration(&record_of(&second)),
        Request::Sample(early),
    ]
    .map(|request| frame(&request).expect("fits"))
    .concat();
    session.send_raw(sequence).expect("the firmware runs");
    for (calibration, sample) in [(first, late), (second, early)] {
        assert!(matches!(set_up(session.receive()), Ok(Response::CalibrationAccepted { .. })));
        let params = Params::new(&calibration).expect("both are sound");
        let host = step(&params, &mut State::new(), &sample);
        match set_up(session.receive()) {
            Ok(Response::Estimate(target)) => assert!(same_bits(&host, &target), "{host:?}\n{target:?}"),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn qemu_over_its_uart_gives_the_same_bits() {
    let options = PilOptions { transport: LinkTransport::Uart, ..pil_options() };
    let params = reference_params();
    let mut state = State::new();
    let mut mismatches = 0;
    let record = record_of(&reference_calibration());
    let report = set_up(run(&options, &record, HostileSamples::new(9).take(300), |_, sample, target| {
        mismatches += u32::from(!same_bits(&step(&params, &mut state, sample), target));
    }));
    println!("{:.0} samples/s over the UART", report.samples_per_s);
    assert_eq!((report.samples, mismatches, report.status.counts.frames_rejected()), (300, 0, 0));
}
