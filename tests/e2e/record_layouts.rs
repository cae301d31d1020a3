//! Every record that is kept or sent has the layout that its schema says: a field that is added, removed, moved or given
//! another type is noticed here, before a controller reads old bytes as new fields.
//!
//! The layouts stand in `tests/data/layouts`, a file for each kind and schema, as the types describe themselves. When this test
//! fails, raise the record's `SCHEMA`, think of `Record::migrate`, and run it with `KOU_NEW_LAYOUTS=1`, which writes the
//! file of the new schema. A file that is there is never written over.

use std::path::{Path, PathBuf};

use kou_app::faults::FaultMemory;
use kou_app::storage::{HealthRecord, Life, Record, StopNote, UpdateCounter};
use kou_estimator::calibration::record;
use kou_estimator::{Calibration, State, state_record};
use serde::de::DeserializeOwned;
use serde_reflection::{Registry, Samples, Tracer, TracerConfig};

fn layout<T: DeserializeOwned>() -> Registry {
    let mut tracer = Tracer::new(TracerConfig::default());
    tracer.trace_type_once::<T>(&Samples::new()).expect("the type describes itself");
    // Of enumerations only the first variant is seen: they are read by position, and append only.
    tracer.registry_unchecked()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/layouts")
}

/// What is wrong, if anything.
fn compare(name: &str, schema: u16, layout: &Registry) -> Option<String> {
    let path = folder().join(format!("{name}-{schema}.txt"));
    let text = format!("{layout:#?}\n");
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
        compare(kind.name(), <$record as Record<'_>>::SCHEMA, &layout::<$record>())
    }};
}

#[test]
fn every_record_has_the_layout_that_its_schema_says() {
    let wrong = [
        of!(HealthRecord),
        of!(FaultMemory),
        of!(Life),
        of!(UpdateCounter),
        of!(StopNote),
        compare("calibration_record", record::SCHEMA, &layout::<Calibration>()),
        compare("state_record", state_record::SCHEMA, &layout::<State>()),
    ];
    let wrong: Vec<String> = wrong.into_iter().flatten().collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_changed_layout_is_noticed() {
    /// Hours, with a field more.
    #[derive(serde::Serialize, serde::Deserialize)]
    struct Longer {
        life: Life,
        more: u8,
    }
    let known = compare("life", <Life as Record<'_>>::SCHEMA, &layout::<Life>());
    let changed = compare("life", <Life as Record<'_>>::SCHEMA, &layout::<Longer>());
    assert!(known.is_none() && changed.is_some_and(|text| text.contains("raise its SCHEMA")));
}
