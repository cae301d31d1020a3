//! scratch
use host_sim::full::{hydraulics::*, integrator::*, plant::*, shaft::*, tableau::*};
use host_sim::machine::Machine;
fn main() {
    let m = Machine::load(std::path::Path::new("host-sim/machines/reference.toml")).unwrap();
    let model = Model::new(&m).unwrap();
    let args: Vec<f64> = std::env::args().skip(1).map(|s| s.parse().unwrap()).collect();
    let (step_deg, kou, load, revs, meth) = (args[0], args[1], args[2], args[3], args[4]);
    let plant = model.plant(60.0, kou).unwrap();
    let mut it = Integrator::new(&plant, if meth > 2.5 { Method::Esdirk3 } else { Method::TrBdf2 });
    let w = 2000.0 / 60.0 * std::f64::consts::TAU;
    let inp = Inputs { drive: Drive::SpeedRadS(w), load: Load::ResistiveNm(load), alpha: 1.0 };
    let mut st = it.initial(36.5e6, 1.6e6, &inp, 1.0, 0.1);
    st.omega_m_rad_s = 0.95 * w;
    let h = step_deg.to_radians() / w;
    let n = (revs * 360.0 / step_deg).round() as u64;
    let stored0 = st.stored_kg(&plant);
    let t0 = std::time::Instant::now();
    let mut phi0 = (0.0, 0.0);
    for i in 0..n {
        if i == n / 2 { phi0 = (st.phi_p_rad, st.phi_m_rad); }
        if let Err(e) = it.step(&mut st, &inp, h) { println!("{e}"); break; }
        if i % (n / 20).max(1) == 0 { println!("{:.5} A {:.3} B {:.4} C {:.3} F {:.3} nm {:.2} tm {:.1}", st.time_s, st.p_node_pa[0]*1e-6-0.101325, st.p_node_pa[1]*1e-6-0.101325, st.p_node_pa[2]*1e-6-0.101325,st.p_node_pa[3]*1e-6-0.101325, st.omega_m_rad_s*60.0/std::f64::consts::TAU, st.torque_m_nm); }
    }
    let wall = t0.elapsed().as_secs_f64();
    let f = st.masses.flow;
    let bal = f[CHARGE] - f[RELIEF] - f[LEAK_PUMP] - f[LEAK_MOTOR] - (st.stored_kg(&plant) - stored0);
    println!("ratio {:.7} balance {:.2e} rel {:.2e}", (st.phi_m_rad-phi0.1)/(st.phi_p_rad-phi0.0), bal, bal / f[PUMP_A].abs());
    println!("{:?} flows {:?}", it.counters(), f);
    let c = it.counters();
    println!("wall {wall:.3} s, {:.1} sim s/s, {:.0} ns/step {:.2} it/step {:.0} ns/it", st.time_s / wall, wall/c.0 as f64*1e9, c.1 as f64/c.0 as f64, wall/c.1 as f64*1e9);
}
