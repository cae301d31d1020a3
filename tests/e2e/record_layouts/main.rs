//! Every record that is stored or sent has the layout that its schema says: a field that is added, removed, moved or given
//! another type is noticed here, before a controller reads old bytes as new fields. So is a variant of an enumeration, which is
//! kept by its number: one in the middle makes others of all behind it.
//!
//! The layouts stand in `tests/data/layouts`, a file for each kind and schema, as the types describe themselves. When this test
//! fails, raise the record's `SCHEMA`, think of `Record::migrate`, and run it with `KOU_NEW_LAYOUTS=1`, which writes the
//! file of the new schema. A file that is there is never written over.

mod layout;

use std::path::{Path, PathBuf};

use kou_app::diagnostics::FaultMemory;
use kou_app::storage::{CrashReport, HealthRecord, OperatingCounters, Record, UpdateCounter};
use kou_estimator::{Calibration, State, record};
use layout::RecordLayout;
use serde::Deserialize;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/layouts")
}

/// Compares a layout with the committed one; returns the difference, if any.
fn compare(name: &str, schema: u16, layout: &RecordLayout) -> Option<String> {
    let path = folder().join(format!("{name}-{schema}.txt"));
    let text = layout.to_string();
    match std::fs::read_to_string(&path) {
        Ok(known) if known == text => None,
        Ok(_) => {
            Some(format!("{name}: the layout is not that of schema {schema} any more: raise its SCHEMA"))
        }
        Err(_) if std::env::var_os("KOU_NEW_LAYOUTS").is_some() => {
            std::fs::create_dir_all(folder()).expect("a folder for layouts");
            std::fs::write(&path, text).expect("a layout can be written");
            None
        }
        Err(_) => Some(format!(
            "{name}: schema {schema} is new: run this with KOU_NEW_LAYOUTS=1 and commit the file"
        )),
    }
}

macro_rules! of {
    ($record:ty) => {{
        let kind = <$record as Record<'_>>::KIND;
        compare(kind.name(), <$record as Record<'_>>::SCHEMA, &layout::of::<$record>())
    }};
}

#[test]
fn every_record_has_the_layout_that_its_schema_says() {
    let wrong = [
        of!(HealthRecord),
        of!(FaultMemory),
        of!(OperatingCounters),
        of!(UpdateCounter),
        of!(CrashReport),
        compare("calibration_record", record::calibration::SCHEMA, &layout::of::<Calibration>()),
        compare("state_record", record::state::SCHEMA, &layout::of::<State>()),
    ];
    let wrong: Vec<String> = wrong.into_iter().flatten().collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_changed_layout_is_detected() {
    /// The record with one more field.
    #[derive(serde::Serialize, serde::Deserialize)]
    struct WithMoreFields {
        life: OperatingCounters,
        more: u8,
    }
    let known =
        compare("life", <OperatingCounters as Record<'_>>::SCHEMA, &layout::of::<OperatingCounters>());
    let changed = compare("life", <OperatingCounters as Record<'_>>::SCHEMA, &layout::of::<WithMoreFields>());
    assert!(known.is_none() && changed.is_some_and(|text| text.contains("raise its SCHEMA")));
}

#[test]
#[expect(dead_code, reason = "types of which only the layout is used")]
fn an_inserted_variant_and_a_changed_variant_field_are_detected() {
    #[derive(Deserialize)]
    enum Known {
        _One,
        _Two(u8),
        _Three { _at: u32 },
    }
    #[derive(Deserialize)]
    #[serde(rename = "Known")]
    enum WithVariantBetween {
        _One,
        _Between,
        _Two(u8),
        _Three { _at: u32 },
    }
    #[derive(Deserialize)]
    #[serde(rename = "Known")]
    enum WithWiderField {
        _One,
        _Two(u8),
        _Three { _at: u64 },
    }
    #[derive(Deserialize)]
    struct Holder<T> {
        _first: T,
        _list: Vec<Option<T>>,
    }
    let known = layout::of::<Holder<Known>>();
    assert_ne!(known, layout::of::<Holder<WithVariantBetween>>());
    assert_ne!(known, layout::of::<Holder<WithWiderField>>());
    let enumeration = |place: &str| {
        format!(
            "  {place}: one of Known\n    0 _One: nothing\n    1 _Two: u8\n    2 _Three: fields\n      _at: u32\n"
        )
    };
    let text = format!("record: Holder\n{}{}", enumeration("_first"), enumeration("_list list of optional"));
    assert_eq!(known.to_string(), text);
}
