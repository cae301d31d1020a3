//! Documentation and enforcement of the machine file's field table.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use kou_lumped::Machine;
use kou_lumped::machine::{FIELDS, FieldKind, FieldNeed, MachineField};

const BEGIN: &str = "<!-- fields:begin -->";
const END: &str = "<!-- fields:end -->";
/// With this variable set the test writes the table instead of comparing it.
const BLESS: &str = "KOU_BLESS";

fn page() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/full-model/machine.md")
}

fn unit_and_range(field: &MachineField) -> (String, String) {
    let or_one = |unit: &str| if unit.is_empty() { "1".to_string() } else { unit.to_string() };
    match field.kind {
        FieldKind::Number(range) | FieldKind::Integer(range) if range.min == range.max => {
            (or_one(range.unit), range.min.to_string())
        }
        FieldKind::Number(range) => (or_one(range.unit), format!("{} to {}", range.min, range.max)),
        FieldKind::Integer(range) => ("integer".into(), format!("{} to {}", range.min, range.max)),
        FieldKind::BoundByOther { unit, allowed } => (or_one(unit), allowed.into()),
        FieldKind::Table => ("table".into(), String::new()),
        FieldKind::Text => ("text".into(), String::new()),
    }
}

fn need(field: &MachineField) -> String {
    match field.need {
        FieldNeed::Required => "required".into(),
        FieldNeed::Default(value) => format!("default {value}"),
        FieldNeed::Optional => "optional".into(),
        FieldNeed::LumpedModel => "lumped model".into(),
        FieldNeed::ExactlyOneOf(other) => format!("or {other}"),
    }
}

fn table() -> String {
    let mut text = String::from("| key | unit | range | need | meaning |\n|---|---|---|---|---|\n");
    for field in FIELDS {
        let (unit, range) = unit_and_range(field);
        writeln!(text, "| `{}` | {unit} | {range} | {} | {} |", field.key, need(field), field.meaning)
            .unwrap();
    }
    text
}

#[test]
fn docs_list_every_field_of_the_machine_file() {
    let text = std::fs::read_to_string(page()).unwrap();
    let (before, rest) = text.split_once(BEGIN).unwrap();
    let (_, after) = rest.split_once(END).unwrap();
    let wanted = format!("{before}{BEGIN}\n{}{END}{after}", table());
    if std::env::var_os(BLESS).is_some() {
        std::fs::write(page(), wanted).unwrap();
    } else {
        let command = format!("{BLESS}=1 cargo test -p kou-lumped --test machine_field_table");
        assert!(text == wanted, "docs/full-model/machine.md is not up to date; write it with `{command}`");
    }
}

/// Machine file that has every field: the seven-piston machine with the optional ones added.
fn complete(charge_speed: bool, flow_meter: bool) -> toml_edit::DocumentMut {
    let mut text = include_str!("../../machines/seven-piston.toml").to_string();
    if charge_speed {
        text = text.replace("pump_shaft_ratio = 1.2", "speed_rpm = 1500.0");
    }
    if flow_meter {
        let motor = text.find("[motor]").unwrap();
        text.truncate(motor);
        text += "[flow_meter]\nreference_displacement_cm3_per_rev = 75.0\n";
    }
    text.parse().unwrap()
}

fn item<'a>(document: &'a mut toml_edit::DocumentMut, key: &str) -> Option<&'a mut toml_edit::Item> {
    let mut names = key.split('.');
    let first = document.get_mut(names.next()?)?;
    names.try_fold(first, |item, name| item.as_table_like_mut()?.get_mut(name))
}

/// Machine text in which `key` has another value, from the first variant of the file that has the key.
fn with_value(key: &str, value: toml_edit::Value) -> String {
    for variant in [(false, false), (true, false), (false, true)] {
        let mut document = complete(variant.0, variant.1);
        if let Some(item) = item(&mut document, key) {
            *item = toml_edit::Item::Value(value);
            return document.to_string();
        }
    }
    panic!("no variant of the machine file has `{key}`");
}

#[test]
fn prop_every_number_of_the_table_is_read_and_held_to_its_range() {
    for field in FIELDS {
        let outside: Vec<toml_edit::Value> = match field.kind {
            FieldKind::Number(range) => {
                vec![(range.min - 1.0).into(), (range.max * 1.01 + 1.0).into(), f64::NAN.into()]
            }
            FieldKind::Integer(range) => vec![(range.min as i64 - 1).into(), (range.max as i64 + 1).into()],
            FieldKind::BoundByOther { .. } => vec![(-1.0e9).into(), 1.0e9.into(), f64::INFINITY.into()],
            FieldKind::Table | FieldKind::Text => continue,
        };
        for key in field.keys() {
            for value in &outside {
                let text = with_value(&key, value.clone());
                let error = Machine::from_text(Path::new("m.toml"), &text).expect_err(&key);
                let shown = error.to_string();
                assert!(shown.contains(&format!("`{key}`")), "{key} = {value}: {shown}");
                assert!(error.line().is_some() && error.allowed.is_some(), "{key} = {value}: {shown}");
            }
        }
    }
}

#[test]
fn prop_every_field_is_held_to_its_type_and_no_required_one_may_be_missing() {
    for field in FIELDS {
        for key in field.keys() {
            let wrong = match field.kind {
                FieldKind::Text | FieldKind::Table => toml_edit::Value::from(true),
                _ => toml_edit::Value::from("text"),
            };
            if key.ends_with("valve_plate.table") {
                continue;
            }
            let shown = Machine::from_text(Path::new("m.toml"), &with_value(&key, wrong))
                .expect_err(&key)
                .to_string();
            assert!(shown.contains(&format!("`{key}`")) && shown.contains("must be"), "{key}: {shown}");
            if field.need == FieldNeed::Required {
                let text = without(&key);
                let shown = Machine::from_text(Path::new("m.toml"), &text).expect_err(&key).to_string();
                assert!(shown.contains(&format!("`{key}` is missing")), "{key}: {shown}");
            }
        }
    }
}

/// Machine text without `key`.
fn without(key: &str) -> String {
    for variant in [(false, false), (false, true)] {
        let mut document = complete(variant.0, variant.1);
        let (parent, name) = key.rsplit_once('.').unwrap_or(("", key));
        let removed = if parent.is_empty() {
            document.remove(name)
        } else {
            item(&mut document, parent).and_then(|table| table.as_table_like_mut()?.remove(name))
        };
        if removed.is_some() {
            return document.to_string();
        }
    }
    panic!("no variant of the machine file has `{key}`");
}
