//! Encoding of commands and answers, authentication tag.

use kou_app::update::mac;

use super::*;

#[test]
fn every_command_and_answer_survives_encoding_and_decoding() {
    let mut random = SplitMix64(7);
    for _ in 0..100_000 {
        let bytes: [u8; 8] = random.next_u64().to_le_bytes();
        if let Some(command) = UpdateCommand::from_bytes(bytes) {
            assert_eq!(UpdateCommand::from_bytes(command.to_bytes()), Some(command));
        }
        let mut bytes = bytes;
        bytes[0] = [0x81, 0x82, 0x83, 0x84, 0x91, 0x92, 0x7F, bytes[0]][random.below(8)];
        if let Some(answer) = UpdateAnswer::from_bytes(bytes) {
            assert_eq!(UpdateAnswer::from_bytes(answer.to_bytes()), Some(answer));
        }
    }
    for reason in RejectReason::ALL {
        assert_eq!(RejectReason::from_number(reason.number()), Some(reason));
    }
}

#[test]
fn val_the_tag_agrees_with_an_independent_hmac_and_depends_on_all_that_it_covers() {
    let key = Key::new(std::array::from_fn(|i| i as u8));
    let record = [1, 2, 3];
    let tag = mac::tag(&key, 0x0403_0201, &record).unwrap();
    // Python 3.11: hmac.new(bytes(range(32)), b"KOU-CAL-1" + struct.pack("<IH", 0x04030201, 3) + b"\1\2\3", "sha256")
    let hex: String = tag.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(hex, "1c435ad7a64c93132c55850754ad5aeffc7eb7b905f21ba8b42e54e4a272edf3");
    for (counter, changed) in [(0x0403_0202, vec![1, 2, 3]), (0x0403_0201, vec![1, 2, 4])] {
        assert_ne!(mac::tag(&key, counter, &changed), Some(tag));
        assert!(!mac::is_authentic(&key, counter, &changed, &tag));
    }
    assert!(mac::is_authentic(&key, 0x0403_0201, &record, &tag));
    assert!(!mac::is_authentic(&key, 0x0403_0201, &record, &tag[..31]));
    assert!(!mac::is_authentic(TestKey::from_seed(4).key(), 0x0403_0201, &record, &tag));
}
