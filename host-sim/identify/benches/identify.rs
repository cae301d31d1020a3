//! The whole identification of the shipped 45 points with the full model: joint scheme with surrogate, and the paper's.
//!
//! Target: 3 s on two cores for either.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use kou_identify::calibration::{SensorClass, Settings};
use kou_identify::joint::Prior;
use kou_identify::ratio_model::FullRatio;
use kou_identify::secant::Secant;
use kou_identify::{joint_scheme, two_step};
use kou_lumped::machine::Machine;
use kou_records::Mapping;
use kou_records::read_bench;

fn identify(c: &mut Criterion) {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let machine = Machine::load(&here.join("../machines/reference.toml")).unwrap_or_else(|e| panic!("{e}"));
    let points = read_bench(
        &here.join("../../tests/data/bench_45.csv"),
        &Mapping::default(),
        machine.reference_displacement_cm3_per_rev(),
    )
    .unwrap_or_else(|e| panic!("{e}"));
    let full = FullRatio::new(&machine).unwrap_or_else(|e| panic!("{e}"));
    let settings = Settings {
        serial: String::new(),
        date: String::new(),
        class: SensorClass::A,
        bench_crc32: 0,
        machine_crc32: 0,
    };
    let mut group = c.benchmark_group("identify_45_points");
    group.sample_size(10);
    group.bench_function("joint", |b| {
        b.iter(|| {
            let result = joint_scheme::identify(
                &machine,
                black_box(&points),
                &settings,
                Some(&full),
                &Prior::default(),
            );
            result.unwrap_or_else(|e| panic!("{e}"))
        });
    });
    group.bench_function("paper", |b| {
        b.iter(|| {
            let result =
                two_step::identify(&machine, black_box(&points), &settings, Some(&full), &Secant::default());
            result.unwrap_or_else(|e| panic!("{e}"))
        });
    });
    group.finish();
}

criterion_group!(benches, identify);
criterion_main!(benches);
