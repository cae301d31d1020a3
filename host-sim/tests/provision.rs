//! `host-sim provision`: the provisioning page, read back with the controller's own reader.

mod support;

use std::path::Path;

use kou_app::update::{Key, provision};
use kou_estimator::Calibration;
use kou_estimator::record;
use support::{Folder, calibrated, failure, host_sim};

/// A key as of a random number generator: neither text nor one byte repeated.
fn secret() -> [u8; provision::KEY_LEN] {
    std::array::from_fn(|i| 0xE0 ^ 37_u8.wrapping_mul(i as u8))
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn command(calibration: Option<&Path>, key: Option<&Path>, out: &Path) -> Vec<String> {
    let options = [("--calibration", calibration), ("--key-file", key), ("--out", Some(out))];
    let given = options.into_iter().filter_map(|(name, path)| path.map(|path| (name, path)));
    std::iter::once("provision".to_string())
        .chain(given.flat_map(|(name, path)| [name.to_string(), path.to_str().unwrap().to_string()]))
        .collect()
}

/// The page that the command wrote.
fn page(calibration: Option<&Path>, key: Option<&Path>, out: &Path) -> [u8; provision::LEN] {
    let output = host_sim(command(calibration, key, out));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    std::fs::read(out).unwrap().try_into().expect("exactly one page")
}

/// The calibration that the controller finds in a page.
fn decoded(page: &[u8; provision::LEN]) -> Option<Calibration> {
    provision::calibration(page).map(|bytes| record::calibration::decode(bytes).unwrap())
}

#[test]
fn a_page_gives_the_controller_the_very_calibration_and_key_and_nothing_that_was_not_given() {
    let folder = Folder::new();
    let toml = calibrated(&folder, "A");
    let given = kou_records::calibration::read(&toml).unwrap();
    let binary = folder.path("cal.bin");
    kou_records::calibration::write(&binary, &given).unwrap();
    let raw = folder.write("raw.key", secret());
    let text = folder.write("text.key", format!("{}\n", digits(&secret())));
    let out = folder.path("page.bin");
    for calibration in [&toml, &binary] {
        for key in [&raw, &text] {
            let both = page(Some(calibration), Some(key), &out);
            assert_eq!(decoded(&both), Some(given.clone()));
            assert_eq!(provision::key(&both), Some(Key::new(secret())));
        }
    }
    // The record is the file that the tool itself writes, byte by byte: CRC-32 and what the bus says of it are the same.
    let only_calibration = page(Some(&toml), None, &out);
    assert_eq!(provision::calibration(&only_calibration), Some(&std::fs::read(&binary).unwrap()[..]));
    assert_eq!(provision::key(&only_calibration), None);
    let only_key = page(None, Some(&text), &out);
    assert_eq!(decoded(&only_key), None);
    assert_eq!(provision::key(&only_key), Some(Key::new(secret())));
    assert!(
        only_key[provision::KEY_LEN..].iter().all(|byte| *byte == 0xFF),
        "as erased, to be written later"
    );
}

#[test]
fn a_calibration_that_the_controller_would_reject_is_rejected_with_its_fields_name_and_no_page_is_written() {
    let folder = Folder::new();
    let toml = calibrated(&folder, "A");
    let out = folder.path("page.bin");
    let text = std::fs::read_to_string(&toml).unwrap();
    let line = text.lines().find(|line| line.starts_with("bulk_modulus_mpa = ")).unwrap();
    for (name, content, named) in [
        ("range.toml", text.replace(line, "bulk_modulus_mpa = -1.0"), "bulk_modulus_mpa"),
        ("schema.toml", text.replace("schema = 3", "schema = 2"), "schema"),
        ("unknown.toml", text.replace(line, &format!("{line}\nbulk_modulus_psi = 1.0")), "bulk_modulus_psi"),
        ("missing.toml", text.replace(line, ""), "bulk_modulus_mpa"),
        ("empty.toml", String::new(), "schema"),
    ] {
        let broken = folder.write(name, content);
        let error = failure(2, command(Some(&broken), None, &out));
        assert!(error.contains(named) && error.contains(name), "{error}");
        assert!(!out.exists(), "{name}");
    }
    let binary = folder.path("cal.bin");
    let given = kou_records::calibration::read(&toml).unwrap();
    kou_records::calibration::write(&binary, &given).unwrap();
    let mut bytes = std::fs::read(&binary).unwrap();
    bytes[100] ^= 1;
    let error = failure(2, command(Some(&folder.write("damaged.bin", bytes)), None, &out));
    assert!(error.contains("damaged.bin") && error.contains("CRC"), "{error}");
    let error = failure(2, command(Some(&folder.path("nowhere.toml")), None, &out));
    assert!(error.contains("nowhere.toml"), "{error}");
    assert!(!out.exists());
}

#[test]
fn an_invalid_key_is_rejected_and_never_shown() {
    let folder = Folder::new();
    let out = folder.path("page.bin");
    let text = digits(&secret());
    for (name, content) in [
        ("short.key", secret()[..31].to_vec()),
        ("long.key", [&secret()[..], &[1]].concat()),
        ("odd.key", text.as_bytes()[1..].to_vec()),
        ("no_hex.key", text.replace('e', "x").into_bytes()),
        // A key of 16 bytes in digits is 32 bytes of text.
        ("half.key", text.as_bytes()[..32].to_vec()),
        ("empty.key", Vec::new()),
    ] {
        let error = failure(2, command(None, Some(&folder.write(name, &content)), &out));
        assert!(error.contains(name) && error.contains("32 bytes, or 64 hexadecimal digits"), "{error}");
        assert!(content.is_empty() || !error.contains(&*String::from_utf8_lossy(&content)), "{error}");
    }
    // What an erased or a cleared place holds: the controller would read no key.
    for byte in ["ff", "00", "FF"] {
        let error = failure(2, command(None, Some(&folder.write("blank.key", byte.repeat(32))), &out));
        assert!(error.contains("blank.key") && error.contains("no key"), "{error}");
    }
    let error = failure(2, command(None, Some(&folder.path("nowhere.key")), &out));
    assert!(error.contains("nowhere.key"), "{error}");
    // The two options confused: the complaint about the calibration must not contain the key.
    let error = failure(2, command(Some(&folder.write("swapped.key", &text)), None, &out));
    assert!(error.contains("swapped.key") && !error.contains(&text[..8]), "{error}");
    assert!(!out.exists());
}

#[test]
fn an_empty_page_and_a_page_without_a_path_are_rejected() {
    let folder = Folder::new();
    let key = folder.write("raw.key", secret());
    let error = failure(2, command(None, None, &folder.path("page.bin")));
    assert!(error.contains("--calibration") && error.contains("--key-file"), "{error}");
    let key_text = key.to_str().unwrap();
    let error = failure(2, ["provision", "--key-file", key_text]);
    assert!(error.contains("--out"), "{error}");
    assert!(failure(2, ["provision"]).contains("--out"));
    for out in [folder.path("no/such/folder/page.bin"), folder.path("")] {
        let error = failure(2, command(None, Some(&key), &out));
        assert!(error.contains(out.to_str().unwrap()) && error.contains("cannot be written"), "{error}");
    }
}

#[test]
fn a_page_replaces_an_older_file_entirely_but_never_one_of_its_inputs() {
    let folder = Folder::new();
    let toml = calibrated(&folder, "A");
    let key = folder.write("raw.key", secret());
    // Longer than a page: no byte of it may be left.
    let out = folder.write("page.bin", [0x55; 2 * provision::LEN]);
    let written = page(Some(&toml), Some(&key), &out);
    assert_eq!(provision::key(&written), Some(Key::new(secret())));
    for input in [&toml, &key] {
        let before = std::fs::read(input).unwrap();
        // Also by another name of the same file.
        let other =
            folder.path("../").join(folder.path("").file_name().unwrap()).join(input.file_name().unwrap());
        for out in [input, &other] {
            let error = failure(2, command(Some(&toml), Some(&key), out));
            assert!(error.contains("would be lost"), "{error}");
        }
        assert_eq!(std::fs::read(input).unwrap(), before);
    }
}

#[cfg(unix)]
#[test]
fn a_page_with_its_key_is_for_its_owner_only_even_where_an_older_file_was_for_all() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    let key = folder.write("raw.key", secret());
    let old = folder.write("old.bin", "");
    std::fs::set_permissions(&old, std::fs::Permissions::from_mode(0o666)).unwrap();
    for out in [folder.path("new.bin"), old] {
        page(None, Some(&key), &out);
        assert_eq!(std::fs::metadata(&out).unwrap().permissions().mode() & 0o777, 0o600, "{}", out.display());
    }
}
