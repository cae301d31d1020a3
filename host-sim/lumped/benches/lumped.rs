//! Cost of the lumped model, with the error of the ratio where it depends on the step.
//!
//! `closed_loop`: one simulated second of two nine-piston machines in closed loop at 2000 r/min and 36.5 MPa, one core;
//! the target of 40 simulated seconds per second is 25 ms. The error printed before each run is that of the ratio
//! against a step of 0.02 deg. `steady_point`: one case point by the direct search; target 20 ms.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::path::Path;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use kou_lumped::integrator::Integrator;
use kou_lumped::machine::Machine;
use kou_lumped::plant_state::{PlantInputs, PlantState};
use kou_lumped::shaft::{ShaftDrive, ShaftLoad};
use kou_lumped::stepping::advance;
use kou_lumped::tableau::Method;
use kou_lumped::{LoadCondition, LumpedModel, Plant, SteadyCase, SteadyPoint};

const RPM: f64 = 2000.0;

fn model() -> LumpedModel {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines/reference.toml");
    let machine = Machine::load(&path).unwrap_or_else(|e| panic!("{e}"));
    LumpedModel::new(&machine).unwrap_or_else(|e| panic!("{e}"))
}

fn inputs() -> PlantInputs {
    PlantInputs {
        drive: ShaftDrive::SpeedRadS(RPM / 60.0 * TAU),
        load: ShaftLoad::ResistiveNm(1659.0),
        alpha: 1.0,
    }
}

fn begin<'a>(plant: &'a Plant, method: Method) -> (Integrator<'a>, PlantState) {
    let mut integrator = Integrator::new(plant, method);
    let mut state = integrator.initial(36.5e6, 1.6e6, &inputs(), 1.0, 0.1);
    state.omega_m_rad_s = 0.909 * RPM / 60.0 * TAU;
    (integrator, state)
}

fn turn_pump(integrator: &mut Integrator<'_>, state: &mut PlantState, step_deg: f64, revolutions: f64) {
    let h = step_deg / 6.0 / RPM;
    let steps = (revolutions * 360.0 / step_deg).round() as u64;
    advance(integrator, state, &inputs(), h, steps, &mut ()).unwrap_or_else(|e| panic!("{e}"));
}

fn ratio(plant: &Plant, method: Method, step_deg: f64) -> f64 {
    let (mut integrator, mut state) = begin(plant, method);
    turn_pump(&mut integrator, &mut state, step_deg, 40.0);
    state.phi_m_rad / state.phi_p_rad
}

fn closed_loop(c: &mut Criterion) {
    let model = model();
    let plant = model.plant(60.0, 0.1).unwrap_or_else(|e| panic!("{e}"));
    let reference = ratio(&plant, Method::Esdirk3, 0.02);
    let mut group = c.benchmark_group("closed_loop_one_simulated_second");
    group.sample_size(10);
    for method in [Method::TrBdf2, Method::Esdirk3] {
        for step_deg in [0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0] {
            let error = (ratio(&plant, method, step_deg) - reference).abs();
            eprintln!("{method:?}, {step_deg} deg: ratio error {error:.1e}");
            let (mut integrator, mut state) = begin(&plant, method);
            turn_pump(&mut integrator, &mut state, step_deg, 4.0);
            group.bench_function(BenchmarkId::new(format!("{method:?}"), step_deg), |b| {
                b.iter(|| turn_pump(&mut integrator, black_box(&mut state), step_deg, RPM / 60.0));
            });
        }
    }
    group.finish();
}

fn steady_point(c: &mut Criterion) {
    let model = model();
    let mut group = c.benchmark_group("steady_point");
    for (name, condition, kou) in [
        ("36.5 MPa, Kou 0.1", LoadCondition::HighPressureMpa(36.5), 0.1),
        ("25 MPa, no leakage", LoadCondition::HighPressureMpa(25.0), 0.0),
        ("10 MPa, slow beat", LoadCondition::HighPressureMpa(10.0), 0.01),
        ("1671 N m, Kou 0.113", LoadCondition::LoadNm(1671.0), 0.113),
    ] {
        let case = SteadyCase { n_p_rpm: RPM, condition, t_b_c: 60.0, alpha: 1.0, kou_l_min_mpa: kou };
        group.bench_function(name, |b| b.iter(|| SteadyPoint::solve(&model, black_box(&case))));
    }
    group.finish();
}

criterion_group!(benches, closed_loop, steady_point);
criterion_main!(benches);
