//! Frames and messages: valid ones are decoded, invalid ones are named, and no input makes the decoder panic.

use std::format;
use std::vec;
use std::vec::Vec;

use kou_estimator::units::{Megapascal, Micros, RevPerMin};
use kou_estimator::{Estimate, Fault, Reading, Reason, Sample};
use kou_fixture::SplitMix64;
use proptest::prelude::*;

use super::*;

fn request_frame(request: &Request<'_>) -> Vec<u8> {
    let mut out = vec![0; MAX_FRAME];
    let len = encode::<MAX_BODY>(request, &mut out).unwrap();
    out.truncate(len);
    out
}

fn sample(random: &mut SplitMix64) -> Sample {
    let time = Micros(random.next_u64() >> random.below(64));
    let mut sample = Sample::empty(time);
    sample.pump_speed = Reading::new(time, RevPerMin(f32::from_bits(random.next_u64() as u32)));
    sample.motor_speed = Reading::failed(time, Fault::ALL[random.below(Fault::ALL.len())]);
    sample.high_pressure = Reading::new(Micros(random.next_u64()), Megapascal(20.0));
    sample
}

/// Expected result of a stretch of bytes between two zeros, by the `cobs` crate.
fn oracle(stretch: &[u8], capacity: usize) -> Result<Vec<u8>, FrameError> {
    let body = match ::cobs::decode_vec(stretch) {
        Ok(body) if body.len() > capacity => return Err(FrameError::TooLong),
        Ok(body) => body,
        // Truncated: as many bytes as it has, completed, without what completes it.
        Err(_) => {
            let completed = |missing| ::cobs::decode_vec(&[stretch, &vec![1; missing]].concat()).ok();
            let received = || (1..255).find_map(|missing| Some(completed(missing)?.len() - missing)).unwrap();
            let too_long = stretch.len() > capacity && received() > capacity;
            return Err(if too_long { FrameError::TooLong } else { FrameError::Cobs });
        }
    };
    let Some((payload, crc)) = body.split_last_chunk::<4>() else { return Err(FrameError::TooShort) };
    if payload.is_empty() {
        return Err(FrameError::TooShort);
    }
    let mut bitwise: u32 = !0;
    for &byte in payload {
        bitwise ^= u32::from(byte);
        for _ in 0..8 {
            bitwise = if bitwise & 1 == 0 { bitwise >> 1 } else { (bitwise >> 1) ^ 0xEDB8_8320 };
        }
    }
    if !bitwise == u32::from_le_bytes(*crc) { Ok(payload.to_vec()) } else { Err(FrameError::Crc) }
}

#[test]
fn examples_of_the_documentation_hold() {
    assert_eq!(request_frame(&Request::Hello), [0x01, 0x05, 0x8D, 0xEF, 0x02, 0xD2, 0x00]);

    let now = Micros(1_000_000);
    let mut sample = Sample::empty(now);
    sample.pump_speed = Reading::new(now, RevPerMin(1000.0));
    sample.motor_speed = Reading::new(now, RevPerMin(960.0));
    sample.high_pressure = Reading::new(now, Megapascal(20.0));
    sample.oil_temperature = Reading::failed(now, Fault::Open);
    let expected = [
        0x08, 0x02, 0xC0, 0x84, 0x3D, 0xC0, 0x84, 0x3D, 0x01, 0x01, 0x06, 0x7A, 0x44, 0xC0, 0x84, 0x3D, 0x01,
        0x01, 0x06, 0x70, 0x44, 0xC0, 0x84, 0x3D, 0x01, 0x01, 0x03, 0xA0, 0x41, 0x02, 0x01, 0x06, 0xC0, 0x84,
        0x3D, 0x01, 0x02, 0x02, 0x01, 0x01, 0x02, 0x01, 0x05, 0x88, 0x1B, 0x77, 0x3C, 0x00,
    ];
    assert_eq!(request_frame(&Request::Sample(sample)), expected);

    let mut out = [0; MAX_RESPONSE_FRAME];
    let answer = Response::<&str>::Error(ErrorKind::NoCalibration);
    let len = encode::<{ MAX_RESPONSE_PAYLOAD + CRC_LEN }>(&answer, &mut out).unwrap();
    assert_eq!(out[..len], [0x07, 0x05, 0x01, 0x2C, 0xD6, 0xA9, 0x4B, 0x00]);
}

#[test]
fn a_million_random_damaged_and_truncated_frames_are_each_decoded_as_by_the_oracle() {
    let mut random = SplitMix64(1);
    let mut decoder = FrameDecoder::<{ MAX_BODY }>::new();
    let record = [0x5A; 500];
    let mut decoded: u32 = 0;
    let mut by_error = [0_u32; 7];
    while decoded < 1_000_000 {
        // One to three pieces run together where their delimiters are cut off.
        let mut stretch = Vec::new();
        for _ in 0..=random.below(3) / 2 {
            let mut bytes = match random.below(12) {
                0 => {
                    let len = random.below(12);
                    (0..len).map(|_| random.next_u64() as u8).collect()
                }
                1 if random.below(50) == 0 => vec![random.next_u64() as u8; MAX_BODY + 1 + random.below(200)],
                2 if random.below(50) == 0 => request_frame(&Request::LoadCalibration(&record)),
                3..=6 => request_frame(&Request::Sample(sample(&mut random))),
                7 => request_frame(&Request::Status),
                // An invalid message in a valid frame.
                _ => {
                    let len = random.below(4) + 1;
                    let payload: Vec<u8> = (0..len).map(|_| random.below(8) as u8).collect();
                    let mut body = payload.clone();
                    body.extend(kou_estimator::record::crc32(&payload).to_le_bytes());
                    ::cobs::encode_vec(&body)
                }
            };
            match random.below(6) {
                0 => bytes.truncate(random.below(bytes.len() + 1)),
                1 if !bytes.is_empty() => {
                    let at = random.below(bytes.len());
                    bytes[at] ^= 1 << random.below(8);
                }
                _ => {}
            }
            stretch.extend(bytes.into_iter().filter(|&byte| byte != 0));
        }
        let mut outcomes: u32 = 0;
        for &byte in stretch.iter().chain(&[0, 0]) {
            let Some(outcome) = decoder.push(byte) else { continue };
            outcomes += 1;
            let expected = oracle(&stretch, MAX_BODY);
            assert_eq!(outcome.map(<[u8]>::to_vec), expected, "{stretch:02x?}");
            let class = match outcome.and_then(decode_request) {
                Ok(_) => 6,
                Err(error) => error as usize,
            };
            by_error[class] += 1;
        }
        assert_eq!(outcomes, u32::from(!stretch.is_empty()), "{stretch:02x?}");
        decoded += outcomes;
    }
    assert!(by_error.iter().all(|&count| count > 50), "too few of some kind: {by_error:?}");
}

#[test]
fn every_valid_frame_behind_garbage_is_decoded() {
    let mut random = SplitMix64(2);
    let mut decoder = FrameDecoder::<{ MAX_BODY }>::new();
    for _ in 0..20_000 {
        let garbage = random.below(40);
        for _ in 0..garbage {
            let _ = decoder.push(random.next_u64() as u8);
        }
        let _ = decoder.push(0);
        let sample = sample(&mut random);
        let frame = request_frame(&Request::Sample(sample));
        let (last, before) = frame.split_last().unwrap();
        for &byte in before {
            assert_eq!(decoder.push(byte), None);
        }
        let payload = decoder.push(*last).unwrap().unwrap();
        let Request::Sample(received) = decode_request(payload).unwrap() else { panic!("not a sample") };
        // Compared as text: readings may be NaN, which is unequal to itself.
        assert_eq!(format!("{received:?}"), format!("{sample:?}"));
    }
}

#[test]
fn message_counts_match_the_enums() {
    let tag = |frame: &[u8]| {
        let mut decoder = FrameDecoder::<{ MAX_BODY }>::new();
        frame
            .iter()
            .find_map(|&byte| decoder.push(byte).map(|payload| u32::from(payload.unwrap()[0])))
            .unwrap()
    };
    assert_eq!(tag(&request_frame(&Request::Shutdown)) + 1, Request::COUNT);
    let mut out = [0; MAX_RESPONSE_FRAME];
    let len =
        encode::<{ MAX_RESPONSE_PAYLOAD + CRC_LEN }>(&Response::<&str>::ShuttingDown, &mut out).unwrap();
    assert_eq!(tag(&out[..len]) + 1, Response::<&str>::COUNT);
}

#[test]
fn largest_messages_fit_their_frames() {
    let record = [0xA5; kou_estimator::record::calibration::MAX_LEN];
    assert!(request_frame(&Request::LoadCalibration(&record)).len() <= MAX_FRAME);
    let mut out = [0; MAX_RESPONSE_FRAME];
    let text = |len| core::str::from_utf8(&[b'x'; 128][..len]).map(std::string::String::from).unwrap();
    let rejection =
        CalibrationRejection::Field { field: text(48), problem: FieldProblem::Inconsistent(text(128)) };
    let full = u32::MAX;
    let counts = LinkCounts {
        frames_ok: full,
        frames_too_long: full,
        frames_too_short: full,
        frames_cobs: full,
        frames_crc: full,
        frames_unknown: full,
        frames_payload: full,
        samples: full,
        samples_without_calibration: full,
        estimates_valid: full,
        estimates_rejected: full,
        calibrations_accepted: full,
        calibrations_rejected: full,
        heartbeats: full,
    };
    let status =
        Status { uptime_us: u64::MAX, stack_high_water_bytes: full, calibration: Some(full), counts };
    for response in [Response::CalibrationRejected(rejection), Response::Status(status)] {
        encode::<{ MAX_RESPONSE_PAYLOAD + CRC_LEN }>(&response, &mut out).unwrap();
    }
    assert_eq!(counts.frames_rejected(), full, "the sum does not wrap");
}

#[test]
fn message_with_trailing_bytes_is_rejected() {
    assert_eq!(decode_request(&[0]), Ok(Request::Hello));
    assert_eq!(decode_request(&[0, 0]), Err(FrameError::Payload));
    assert_eq!(decode_request(&[]), Err(FrameError::Payload));
    assert_eq!(decode_request(&[5]), Err(FrameError::Unknown));
    assert_eq!(decode_request(&[0xFF, 0xFF, 0xFF, 0xFF, 0x0F]), Err(FrameError::Unknown));
}

proptest! {
    #[test]
    fn an_answer_given_is_the_answer_received(time in any::<u64>(), channel in 0usize..7, fault in 0usize..10) {
        let reason = Reason::Sensor(kou_estimator::Channel::ALL[channel], Fault::ALL[fault]);
        let response = Response::<&str>::Estimate(Estimate::invalid(Micros(time), reason));
        let mut out = [0; MAX_RESPONSE_FRAME];
        let len = encode::<{ MAX_RESPONSE_PAYLOAD + CRC_LEN }>(&response, &mut out).unwrap();
        let mut decoder = FrameDecoder::<64>::new();
        for &byte in &out[..len - 1] {
            prop_assert!(decoder.push(byte).is_none());
        }
        let payload = decoder.push(0).unwrap().unwrap();
        prop_assert_eq!(decode_response::<&str>(payload), Ok(response));
    }

    #[test]
    fn any_payload_is_a_message_or_an_error(payload in prop::collection::vec(any::<u8>(), 0..200)) {
        match decode_request(&payload) {
            Ok(_) | Err(FrameError::Unknown | FrameError::Payload) => {}
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}
