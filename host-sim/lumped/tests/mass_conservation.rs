//! Conservation of mass, through cavitation and back: inflow minus outflow equals the change of stored mass.
//!
//! Limit: 1e-6 of the pumped mass; a model that clamps pressures creates per cents.

use std::f64::consts::TAU;
use std::path::Path;

use kou_lumped::integrator::Integrator;
use kou_lumped::machine::Machine;
use kou_lumped::mass_balance::MassBalance;
use kou_lumped::plant_state::{PlantInputs, PlantState};
use kou_lumped::shaft::{ShaftDrive, ShaftLoad};
use kou_lumped::stepping::{StepObserver, advance};
use kou_lumped::tableau::Method;
use kou_lumped::{LoadCondition, LumpedModel, SteadyCase, SteadyPoint};

const LIMIT: f64 = 1e-6;
const REFERENCE: &str = include_str!("../../machines/reference.toml");

fn model(text: &str) -> LumpedModel {
    LumpedModel::new(&Machine::from_text(Path::new("m.toml"), text).unwrap()).unwrap()
}

/// Lowest absolute pressure of any chamber or line, and the number of chambers.
struct Lowest(f64, usize);

impl StepObserver for Lowest {
    fn observe(&mut self, state: &PlantState, _h: f64) {
        let chambers = state.p_chamber_pa.iter().flat_map(|group| group.0).take(self.1);
        for p in chambers.chain(state.p_node_pa) {
            self.0 = self.0.min(p);
        }
    }
}

/// Runs stages of (inputs, seconds) and returns the balance error and the lowest pressure.
fn scenario(
    model: &LumpedModel,
    kou: f64,
    alpha: f64,
    n_m_rpm: f64,
    stages: &[(PlantInputs, f64)],
    step_deg: f64,
) -> (f64, f64) {
    let plant = model.plant(60.0, kou).unwrap();
    let mut integrator = Integrator::new(&plant, Method::default());
    let mut state = integrator.initial(1.6e6, 1.6e6, &stages[0].0, alpha, 0.05);
    state.omega_m_rad_s = n_m_rpm / 60.0 * TAU;
    let balance = MassBalance::from(&state, &plant);
    let mut lowest = Lowest(f64::INFINITY, plant.chambers());
    for (inputs, seconds) in stages {
        let h = step_deg.to_radians() / state.omega_p_rad_s.abs();
        let steps = (seconds / h).round() as u64;
        advance(&mut integrator, &mut state, inputs, h, steps, &mut lowest).unwrap();
    }
    assert!(balance.pumped_kg(&state) > 0.1, "the scenario pumps nothing");
    (balance.error(&state, &plant), lowest.0)
}

fn pump(rpm: f64) -> ShaftDrive {
    ShaftDrive::SpeedRadS(rpm / 60.0 * TAU)
}

#[test]
fn prop_mass_balances_at_steady_points_in_both_directions() {
    let model = model(REFERENCE);
    for (alpha, n, p, kou) in [
        (1.0, 1000.0, 50.0, 0.36),
        (1.0, 2800.0, 10.0, 0.0015),
        (-1.0, 2000.0, 30.0, 0.1),
        (0.3, 2000.0, 40.0, 0.05),
    ] {
        let condition = LoadCondition::HighPressureMpa(p);
        let case = SteadyCase { n_p_rpm: n, condition, t_b_c: 60.0, alpha, kou_l_min_mpa: kou };
        let point = SteadyPoint::solve(&model, &case).unwrap();
        assert!(point.mass_balance_error <= LIMIT, "{alpha} {n} {p}: {}", point.mass_balance_error);
        assert!(point.ratio * alpha > 0.0);
    }
}

#[test]
fn prop_mass_balances_with_an_overrunning_load() {
    // A load of 1200 N m drives the motor forward: line B becomes the high one, A the low one.
    let model = model(REFERENCE);
    let inputs = PlantInputs { drive: pump(1500.0), load: ShaftLoad::ConstantNm(-1200.0), alpha: 0.6 };
    let (error, _) = scenario(&model, 0.05, 0.6, 850.0, &[(inputs, 0.5)], 1.0);
    assert!(error <= LIMIT, "{error}");
    let plant = model.plant(60.0, 0.05).unwrap();
    let mut integrator = Integrator::new(&plant, Method::default());
    let mut state = integrator.initial(1.6e6, 1.6e6, &inputs, 0.6, 0.05);
    state.omega_m_rad_s = 850.0 / 60.0 * TAU;
    let h = 1.0f64.to_radians() / state.omega_p_rad_s;
    advance(&mut integrator, &mut state, &inputs, h, 4500, &mut ()).unwrap();
    // 1200 N m on 300 cm3/rev is 25 MPa.
    assert!(state.p_node_pa[1] > state.p_node_pa[0] + 20.0e6, "the lines have not exchanged roles");
}

#[test]
fn prop_mass_balances_through_a_fast_swash_reversal_that_cavitates() {
    // The charge pump is shut off, so the reversal empties one line to vapour.
    let text = REFERENCE.replace(
        "charge_pump = { displacement_cm3_per_rev = 160.0",
        "charge_pump = { displacement_cm3_per_rev = 0.0",
    );
    assert_ne!(text, REFERENCE);
    let model = model(&text);
    let load = ShaftLoad::ResistiveNm(400.0);
    let forward = PlantInputs { drive: pump(2000.0), load, alpha: 0.5 };
    let backward = PlantInputs { alpha: -0.5, ..forward };
    let (error, lowest) =
        scenario(&model, 0.1, 0.0, 0.0, &[(forward, 0.25), (backward, 0.25), (forward, 0.25)], 1.0);
    assert!(error <= LIMIT, "{error}");
    // Cavitation occurred, and no pressure fell below vapour pressure (500 Pa) by more than rounding.
    assert!(lowest < 20_000.0, "lowest pressure {lowest} Pa: the scenario does not cavitate");
    assert!(lowest >= 499.0, "lowest pressure {lowest} Pa is below vapour pressure");
}

#[test]
fn prop_mass_balances_with_the_charge_circuit_shut() {
    let text = REFERENCE.replace(
        "charge_pump = { displacement_cm3_per_rev = 160.0",
        "charge_pump = { displacement_cm3_per_rev = 0.0",
    );
    let model = model(&text);
    let inputs = PlantInputs { drive: pump(1000.0), load: ShaftLoad::ResistiveNm(600.0), alpha: 1.0 };
    for step_deg in [1.0, 0.25] {
        let (error, lowest) = scenario(&model, 0.113, 0.0, 0.0, &[(inputs, 1.0)], step_deg);
        assert!(error <= LIMIT, "{step_deg} deg: {error}");
        assert!((499.0..20_000.0).contains(&lowest), "lowest pressure {lowest} Pa");
    }
}

#[test]
fn prop_mass_balances_with_a_driven_pump_shaft_and_relief_valves() {
    let text = include_str!("../../machines/seven-piston.toml");
    let model = model(text);
    let drive = ShaftDrive::Governed { set_rad_s: 250.0, nm_s: 20.0, limit_nm: 600.0 };
    // A motor held fast: the pump's flow has to leave through the relief valve, and the engine feels it.
    let inputs = PlantInputs { drive, load: ShaftLoad::ResistiveNm(5000.0), alpha: 0.8 };
    let (error, _) = scenario(&model, 0.02, 0.0, 0.0, &[(inputs, 0.4)], 0.5);
    assert!(error <= LIMIT, "{error}");
}

#[test]
fn prop_resistive_load_never_reverses_the_motor() {
    let model = model(REFERENCE);
    let plant = model.plant(60.0, 0.1).unwrap();
    let mut integrator = Integrator::new(&plant, Method::default());
    let inputs = PlantInputs { drive: pump(1000.0), load: ShaftLoad::ResistiveNm(3000.0), alpha: 0.0 };
    let mut state = integrator.initial(1.6e6, 1.6e6, &inputs, 0.0, 0.3);
    let h = 1.0f64.to_radians() / state.omega_p_rad_s;
    advance(&mut integrator, &mut state, &inputs, h, 3600, &mut ()).unwrap();
    assert_eq!(state.omega_m_rad_s, 0.0);
}
