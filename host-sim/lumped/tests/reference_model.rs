//! The lumped model against an independent reference model: the same physics formulated in pressures (paper eq. 1) and
//! integrated by a library (diffsol, variable-order BDF, tight tolerance).
//!
//! The reference model shares the machine file's values and the definitions of the laws with the lumped model, but no
//! line of code: its own valve plate, oil, valves and shaft, volume balances instead of mass balances, another method.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use diffsol::{MatrixCommon, NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod};
use kou_lumped::integrator::Integrator;
use kou_lumped::machine::{ChargeDrive, Machine, PistonUnit, PlateGeometry, PortAreas};
use kou_lumped::plant_state::{PlantInputs, PlantState};
use kou_lumped::shaft::{ShaftDrive, ShaftLoad};
use kou_lumped::simd::WIDTH;
use kou_lumped::stepping::{StepObserver, advance};
use kou_lumped::tableau::Method;
use kou_lumped::{LoadCondition, LumpedModel, SteadyCase, SteadyPoint};

/// Speed, pressure, Kou, displacement: across the envelope, both directions, partial displacement.
const POINTS: [(f64, f64, f64, f64); 10] = [
    (1000.0, 10.0, 0.0015, 1.0),
    (1000.0, 30.0, 0.06, 1.0),
    (1000.0, 50.0, 0.1, 1.0),
    (2000.0, 20.0, 0.0, 1.0),
    (2000.0, 36.5, 0.113, 1.0),
    (2000.0, 40.0, 0.1, -1.0),
    (2800.0, 10.0, 0.01, 1.0),
    (2800.0, 50.0, 0.15, 1.0),
    (2000.0, 30.0, 0.05, 0.4),
    (1500.0, 25.0, 0.05, -0.6),
];
const P_0: f64 = 0.101_325;
/// Recorded samples per revolution.
const SAMPLES: usize = 360;

/// Density over density at p_0 by eq. 2, absolute MPa: ln = ln((1+c)/(1+c x)) + 1/beta_0 * integral dp/(1 + c x).
struct ReferenceOil {
    beta_0: f64,
    c: f64,
    lambda: f64,
    rho_0: f64,
    integral: Vec<f64>,
}

const TABLE_STEP: f64 = 0.002;

impl ReferenceOil {
    fn new(machine: &Machine) -> Self {
        let oil = machine.oil();
        let mut this = Self {
            beta_0: oil.bulk_modulus_mpa,
            c: oil.air_fraction,
            lambda: oil.heat_capacity_ratio,
            rho_0: oil.density_kg_m3,
            integral: vec![0.0],
        };
        // From p_0 upwards, Simpson's rule per cell: 2 kPa cells are 2 % of the lowest pressure.
        for k in 0..60_000 {
            let p = P_0 + TABLE_STEP * k as f64;
            let f = |p: f64| 1.0 / (1.0 + this.c * this.x(p));
            let cell = TABLE_STEP / 6.0 * (f(p) + 4.0 * f(p + 0.5 * TABLE_STEP) + f(p + TABLE_STEP));
            let last = this.integral[k];
            this.integral.push(last + cell);
        }
        this
    }

    fn x(&self, p: f64) -> f64 {
        (P_0 / p).powf(1.0 / self.lambda)
    }

    fn beta(&self, p: f64) -> f64 {
        let cx = self.c * self.x(p);
        self.beta_0 * (1.0 + cx) / (1.0 + cx * self.beta_0 / (self.lambda * p))
    }

    fn rho(&self, p: f64) -> f64 {
        let k = (p - P_0) / TABLE_STEP;
        let i = (k as usize).min(self.integral.len() - 2);
        let integral = self.integral[i] + (k - i as f64) * (self.integral[i + 1] - self.integral[i]);
        self.rho_0 * ((1.0 + self.c) / (1.0 + self.c * self.x(p)) * (integral / self.beta_0).exp())
    }
}

struct ReferenceModel<'a> {
    machine: &'a Machine,
    oil: ReferenceOil,
    kou: f64,
    alpha: f64,
    omega_p: f64,
    phi_p_0: f64,
    load_nm: f64,
}

/// Area, mm2, to a kidney whose middle is at the angle `middle`.
fn area(g: &PlateGeometry, phi: f64, middle: f64) -> f64 {
    let mut u = (phi - middle).rem_euclid(TAU);
    if u > PI {
        u -= TAU;
    }
    let a = 0.5 * g.port_arc_deg.to_radians();
    let k = PI / 2.0 - a - g.seal_land_deg.to_radians();
    let full = 2.0 * a.min(k);
    let inside = k + a - u.abs();
    let overlap = inside.clamp(0.0, full);
    let groove = if u > 0.0 { &g.exit_groove } else { &g.entry_groove };
    let arc = groove.arc_deg.to_radians();
    let reach = ((inside + arc) / arc).clamp(0.0, 1.0);
    g.kidney_radius_mm * g.kidney_width_mm * overlap
        + groove.area_mm2 * reach.powi(2) * (1.0 - overlap / full)
}

fn geometry(unit: &PistonUnit) -> (&PlateGeometry, f64) {
    let plate = unit.valve_plate.as_ref().unwrap();
    match &plate.areas {
        PortAreas::Geometry(g) => (g, plate.discharge_coefficient),
        PortAreas::Table(_) => panic!("the reference model has no area tables"),
    }
}

impl ReferenceModel<'_> {
    /// Mass flow of an orifice, kg/s; area in mm2, pressures in MPa.
    fn orifice(&self, cd_area: f64, p: f64, q: f64) -> f64 {
        if cd_area == 0.0 {
            return 0.0;
        }
        let dp = (p - q) * 1e6;
        let s = 2500.0 + (2500.0f64.powi(2) + dp * dp).sqrt();
        let up = self.oil.rho(if dp > 0.0 { p } else { q });
        let root = (2.0 * self.oil.rho_0).sqrt() * 0.5 * (1.0 + up / self.oil.rho_0);
        cd_area * 1e-6 * root * dp / s.sqrt()
    }

    fn relief(&self, valve: &kou_lumped::machine::ReliefValve, dp: f64) -> f64 {
        let above = dp - (valve.setting_mpa - valve.override_mpa);
        let round = 0.1 * valve.override_mpa;
        let gain = self.oil.rho_0 * valve.rated_flow_l_min / 60_000.0 / (0.95 * valve.override_mpa);
        if above <= 0.0 {
            0.0
        } else if above < round {
            gain * above * above / (2.0 * round)
        } else {
            gain * (above - round / 2.0)
        }
    }

    fn opening(dp: f64, crack: f64, full: f64) -> f64 {
        let t = ((dp - crack) / (full - crack)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }

    /// State: chambers of pump and motor, lines A and B, charge and flushing gallery (absolute MPa), motor speed and
    /// angle.
    fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        let (pump, motor) = (self.machine.pump(), self.machine.motor().unwrap());
        let dynamics = self.machine.circuit().dynamics.as_ref().unwrap();
        let n = pump.pistons + motor.pistons;
        let case = self.machine.circuit().case_pressure_mpa + P_0;
        let (omega_m, phi_m) = (y[n + 4], y[n + 5]);
        let mut net = [0.0; 4];
        let mut torque = 0.0;
        for i in 0..n {
            let is_pump = i < pump.pistons;
            let (unit, k, alpha) =
                if is_pump { (pump, i, self.alpha) } else { (motor, i - pump.pistons, 1.0) };
            let base = if is_pump { self.phi_p_0 + self.omega_p * t } else { phi_m };
            let omega = if is_pump { self.omega_p } else { omega_m };
            let phi = base + TAU * k as f64 / unit.pistons as f64;
            let half = 0.5 * unit.displacement_cm3_per_rev / unit.pistons as f64;
            let volume = unit.dead_volume_cm3 + half * (1.0 - alpha * phi.cos());
            let v_rate = half * alpha * phi.sin() * omega;
            let (g, cd) = geometry(unit);
            let (expansion, compression) = (area(g, phi, PI / 2.0), area(g, phi, 1.5 * PI));
            let (to_a, to_b) = if is_pump { (compression, expansion) } else { (expansion, compression) };
            let (fa, fb) = (self.orifice(cd * to_a, y[i], y[n]), self.orifice(cd * to_b, y[i], y[n + 1]));
            net[0] += fa;
            net[1] += fb;
            let leak =
                self.oil.rho(if y[i] > case { y[i] } else { case }) * self.kou / 60_000.0 * (y[i] - case);
            // Eq. 1, cm3: volume flows at the chamber's own density.
            let out = (fa + fb + leak) / self.oil.rho(y[i]) * 1e6;
            dy[i] = self.oil.beta(y[i]) / volume * (-v_rate - out);
            if !is_pump {
                torque += (y[i] - case) * half * phi.sin();
            }
        }
        let p = &y[n..n + 4];
        for (line, other) in [(0, 1), (1, 0)] {
            let valve = &dynamics.check_valve;
            let open = Self::opening(p[2] - p[line], valve.crack_mpa, valve.full_open_mpa);
            let f = if open > 0.0 { self.orifice(0.7 * valve.area_mm2 * open, p[2], p[line]) } else { 0.0 };
            net[2] -= f;
            net[line] += f;
            let valve = &dynamics.shuttle;
            let open = Self::opening(p[other] - p[line], valve.crack_mpa, valve.full_open_mpa);
            let f = self.orifice(0.7 * valve.area_mm2 * open, p[line], p[3]);
            net[line] -= f;
            net[3] += f;
        }
        let ChargeDrive::OwnSpeedRpm(rpm) = dynamics.charge_pump.drive else {
            panic!("the reference model has a charge pump with its own drive only")
        };
        net[2] += self.oil.rho_0 * dynamics.charge_pump.displacement_cm3_per_rev * 1e-6 * rpm / 60.0;
        net[2] -= self.relief(&dynamics.charge_relief, p[2] - case);
        net[3] -= self.relief(&dynamics.flushing_relief, p[3] - case);
        let volumes = [
            dynamics.line_a_volume_cm3,
            dynamics.line_b_volume_cm3,
            dynamics.charge_gallery_volume_cm3,
            dynamics.flushing_gallery_volume_cm3,
        ];
        for k in 0..4 {
            dy[n + k] = self.oil.beta(p[k]) / volumes[k] * net[k] / self.oil.rho(p[k]) * 1e6;
        }
        dy[n + 4] = (torque - self.load_nm) / motor.inertia_kg_m2.unwrap();
        dy[n + 5] = omega_m;
    }

    /// Columns of samples over one revolution of the pump.
    fn integrate(&self, start: &[f64], rtol: f64) -> Vec<Vec<f64>> {
        let (n, first) = (start.len(), start.to_vec());
        let mut problem = OdeBuilder::<NalgebraMat<f64>>::new()
            .rtol(rtol)
            .atol(vec![rtol; n])
            .h0(1e-8)
            .rhs_implicit(
                |y, _p, t, dy| self.rhs(t, y, dy),
                |y, _p, t, v, jv| {
                    // Directional difference, central; 1e-6 of the state is far above rounding and below any curvature.
                    let scale = y.iter().fold(1.0f64, |m, x| m.max(x.abs()));
                    let size = v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
                    if size == 0.0 {
                        jv.fill(0.0);
                        return;
                    }
                    let eps = 1e-7 * scale / size;
                    let moved = |sign: f64| -> Vec<f64> {
                        let at: Vec<f64> = y.iter().zip(v).map(|(y, v)| y + sign * eps * v).collect();
                        let mut f = vec![0.0; at.len()];
                        self.rhs(t, &at, &mut f);
                        f
                    };
                    for ((out, plus), minus) in jv.iter_mut().zip(moved(1.0)).zip(moved(-1.0)) {
                        *out = (plus - minus) / (2.0 * eps);
                    }
                },
            )
            .init(move |_p, _t, y| y.copy_from_slice(&first), n)
            .build()
            .unwrap();
        // Ports that open are corners: there the step is cut until the corner is passed, some thousand times per
        // revolution.
        problem.ode_options.max_nonlinear_solver_failures = 1_000_000;
        let times: Vec<f64> = (1..=SAMPLES).map(|k| TAU / self.omega_p * k as f64 / SAMPLES as f64).collect();
        let mut solver = problem.bdf::<NalgebraLU<f64>>().unwrap();
        let (columns, _) = solver.solve_dense(&times).unwrap();
        let columns = columns.inner();
        (0..columns.ncols()).map(|k| columns.column(k).iter().copied().collect()).collect()
    }
}

struct StateSamples {
    every: u64,
    steps: u64,
    rows: Vec<Vec<f64>>,
    chambers: usize,
}

impl StepObserver for StateSamples {
    fn observe(&mut self, state: &PlantState, _h: f64) {
        self.steps += 1;
        if self.steps.is_multiple_of(self.every) {
            self.rows.push(columns(state, self.chambers));
        }
    }
}

fn columns(state: &PlantState, chambers: usize) -> Vec<f64> {
    let mut row: Vec<f64> =
        (0..chambers).map(|i| 1e-6 * state.p_chamber_pa[i / WIDTH].0[i % WIDTH]).collect();
    row.extend(state.p_node_pa.map(|p| 1e-6 * p));
    row.extend([state.omega_m_rad_s, state.phi_m_rad]);
    row
}

/// Ratio difference and worst waveform difference (fraction of peak to peak) of one point at a step.
fn compare(model: &LumpedModel, point: (f64, f64, f64, f64), step_deg: f64, rtol: f64) -> (f64, f64) {
    let (n_p_rpm, p, kou, alpha) = point;
    let condition = LoadCondition::HighPressureMpa(p);
    let case = SteadyCase { n_p_rpm, condition, t_b_c: 60.0, alpha, kou_l_min_mpa: kou };
    let steady = SteadyPoint::solve(model, &case).unwrap();
    let plant = model.plant(60.0, kou).unwrap();
    let omega_p = n_p_rpm / 60.0 * TAU;
    let mut inputs = PlantInputs {
        drive: ShaftDrive::SpeedRadS(omega_p),
        load: ShaftLoad::SpeedRadS(steady.ratio * omega_p),
        alpha,
    };
    let (high, low) = (p * 1e6 + 101_325.0, 1.6e6);
    let (p_a, p_b) = if alpha > 0.0 { (high, low) } else { (low, high) };
    let mut integrator = Integrator::new(&plant, Method::default());
    let mut state = integrator.initial(p_a, p_b, &inputs, alpha, 0.1);
    let h = step_deg.to_radians() / omega_p;
    // Half a revolution with a fine step, then one revolution to compare, the motor free under its load.
    advance(&mut integrator, &mut state, &inputs, 0.02f64.to_radians() / omega_p, 9000, &mut ()).unwrap();
    let load_nm = alpha.signum() * steady.torque_nm;
    inputs.load = ShaftLoad::ConstantNm(load_nm);
    let start = columns(&state, plant.chambers());
    let reference = ReferenceModel {
        machine: model.machine(),
        oil: ReferenceOil::new(model.machine()),
        kou,
        alpha,
        omega_p,
        phi_p_0: state.phi_p_rad,
        load_nm,
    };
    let truth = reference.integrate(&start, rtol);
    let every = (1.0 / step_deg).round() as u64;
    let mut samples = StateSamples { every, steps: 0, rows: Vec::new(), chambers: plant.chambers() };
    advance(&mut integrator, &mut state, &inputs, h, every * SAMPLES as u64, &mut samples).unwrap();
    let n = plant.chambers();
    let revolutions = |rows: &[Vec<f64>]| (rows[SAMPLES - 1][n + 5] - start[n + 5]) / TAU;
    let mut worst: f64 = 0.0;
    for chamber in 0..n {
        let of = |rows: &[Vec<f64>]| -> Vec<f64> { rows.iter().map(|row| row[chamber]).collect() };
        let (model, reference) = (of(&samples.rows), of(&truth));
        let (lowest, highest) =
            reference.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
        for (m, t) in model.iter().zip(&reference) {
            worst = worst.max((m - t).abs() / (highest - lowest));
        }
    }
    ((revolutions(&samples.rows) - revolutions(&truth)).abs(), worst)
}

/// The step of recorded waveforms, 0.1 deg: ratio to 2e-5, every sample of every chamber to 0.2 % of peak to peak.
#[test]
fn val_diffsol_agrees_on_ratio_and_waveforms_at_ten_points() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines/reference.toml");
    let model = LumpedModel::new(&Machine::load(&path).unwrap()).unwrap();
    for point in POINTS {
        let (ratio, waveform) = compare(&model, point, 0.1, 1e-7);
        println!("{point:?}: ratio {ratio:.1e}, waveform {:.3} %", 100.0 * waveform);
        assert!(ratio <= 2e-5, "{point:?}: ratio differs by {ratio:.1e}");
        assert!(waveform <= 2e-3, "{point:?}: waveform differs by {:.3} %", 100.0 * waveform);
    }
}
