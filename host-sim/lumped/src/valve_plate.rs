//! Valve plate (paper fig. 3): flow area between a chamber and either kidney as a function of the chamber's angle.
//!
//! Angle phi of a chamber is 0 at its top dead centre (smallest volume at positive displacement). The kidney of the
//! half turn (0, 180) deg serves expanding chambers, the other one shrinking chambers. With half port arc a, half
//! kidney K = 90 deg - a - land, and u the angle from the kidney's middle, the area is
//!
//! ```text
//! inside  = K + a - |u|
//! overlap = R*w * clamp(inside, 0, 2*min(a, K))
//! reach   = clamp(inside + L, 0, L)                         L: groove's arc at the end on this side
//! area    = overlap + A_groove*(reach/L)^2 * (1 - overlap/overlap_max)
//! ```
//!
//! The last factor removes the groove while the port covers the kidney: the groove then lies beneath the same port. Two
//! chambers on one kidney, and a chamber on both, follow from the geometry. A table of angle against area replaces the
//! formula where the machine file names one.

use std::f64::consts::{PI, TAU};

use crate::machine::{PistonUnit, PlateTable, PortAreas, SilencingGroove, ValvePlate};

use crate::simd::{F64x4, WIDTH};
use crate::valves::conductance;

/// Uniform cells per revolution to which a table is resampled, so that a look-up needs no search.
const TABLE_CELLS: usize = 7200;

/// Valve-plate constants of four chambers; areas as conductances (see [`crate::valves`]).
#[derive(Debug, Clone, Copy, Default)]
pub struct PortConductances {
    /// 1 where line A serves expanding chambers (motor), 0 where it serves shrinking ones (pump).
    a_serves_expansion: F64x4,
    /// K + a.
    open_rad: F64x4,
    /// 2*min(a, K).
    full_rad: F64x4,
    inv_full: F64x4,
    conductance_per_rad: F64x4,
    entry: GrooveConductance,
    exit: GrooveConductance,
}

#[derive(Debug, Clone, Copy, Default)]
struct GrooveConductance {
    arc_rad: F64x4,
    inv_arc: F64x4,
    conductance: F64x4,
}

impl PortConductances {
    /// Fills one lane for a chamber of `plate`; other lanes remain shut.
    pub fn set_lane(&mut self, lane: usize, plate: &ValvePlate, a_serves_expansion: bool, rho_0: f64) {
        let l = lane % WIDTH;
        self.a_serves_expansion.0[l] = f64::from(u8::from(a_serves_expansion));
        let PortAreas::Geometry(geometry) = &plate.areas else { return };
        let per_mm2 = conductance(plate.discharge_coefficient, 1.0, rho_0);
        let a = 0.5 * geometry.port_arc_deg.to_radians();
        let k = 0.5 * PI - a - geometry.seal_land_deg.to_radians();
        let full_rad = 2.0 * a.min(k);
        self.open_rad.0[l] = k + a;
        self.full_rad.0[l] = full_rad;
        self.inv_full.0[l] = 1.0 / full_rad;
        self.conductance_per_rad.0[l] = per_mm2 * geometry.kidney_radius_mm * geometry.kidney_width_mm;
        self.entry.set_lane(l, &geometry.entry_groove, per_mm2);
        self.exit.set_lane(l, &geometry.exit_groove, per_mm2);
    }

    /// Conductance to line A and to line B of four chambers at angles `phi` in [0, 2 pi).
    #[inline(always)]
    #[must_use]
    pub fn conductance(&self, phi: F64x4) -> (F64x4, F64x4) {
        let (pi, tau) = (F64x4::all(PI), F64x4::all(TAU));
        let from_middle = phi - F64x4::all(0.5 * PI);
        let u = from_middle.if_above(pi, from_middle - tau, from_middle);
        let v = u.if_above(F64x4::ZERO, u - pi, u + pi);
        let (expansion, compression) = (self.one_kidney(u), self.one_kidney(v));
        let half = F64x4::all(0.5);
        (
            self.a_serves_expansion.if_above(half, expansion, compression),
            self.a_serves_expansion.if_above(half, compression, expansion),
        )
    }

    #[inline(always)]
    fn one_kidney(&self, u: F64x4) -> F64x4 {
        let inside = self.open_rad - u.abs();
        let overlap = inside.max(F64x4::ZERO).min(self.full_rad);
        let leaving = u.if_above(F64x4::ZERO, F64x4::all(1.0), F64x4::ZERO);
        let half = F64x4::all(0.5);
        let pick = |entry: F64x4, exit: F64x4| leaving.if_above(half, exit, entry);
        let arc = pick(self.entry.arc_rad, self.exit.arc_rad);
        let inv_arc = pick(self.entry.inv_arc, self.exit.inv_arc);
        let groove = pick(self.entry.conductance, self.exit.conductance);
        let reach = (inside + arc).max(F64x4::ZERO).min(arc) * inv_arc;
        overlap * self.conductance_per_rad
            + groove * reach * reach * (F64x4::all(1.0) - overlap * self.inv_full)
    }
}

impl GrooveConductance {
    fn set_lane(&mut self, l: usize, groove: &SilencingGroove, per_mm2: f64) {
        let arc = groove.arc_deg.to_radians();
        self.arc_rad.0[l] = arc;
        self.inv_arc.0[l] = 1.0 / arc;
        self.conductance.0[l] = per_mm2 * groove.area_mm2;
    }
}

/// Conductances to line A and line B on uniform cells, where the unit's valve plate has a table.
#[must_use]
pub fn table_of(unit: &PistonUnit, rho_0: f64) -> Option<Vec<[f64; 2]>> {
    let plate = unit.valve_plate.as_ref()?;
    match &plate.areas {
        PortAreas::Geometry(_) => None,
        PortAreas::Table(table) => {
            Some(resample(table, conductance(plate.discharge_coefficient, 1.0, rho_0)))
        }
    }
}

/// Areas from a uniform table at an angle in [0, 2 pi), by linear interpolation.
#[inline]
#[must_use]
pub fn look_up(cells: &[[f64; 2]], phi: f64) -> [f64; 2] {
    let x = phi * (TABLE_CELLS as f64 / TAU);
    let k = (x as usize).min(TABLE_CELLS - 1);
    let t = x - k as f64;
    match (cells.get(k), cells.get(k + 1)) {
        (Some(&[a0, b0]), Some(&[a1, b1])) => [a0 + t * (a1 - a0), b0 + t * (b1 - b0)],
        _ => [0.0, 0.0],
    }
}

/// Linear interpolation of a table onto uniform cells.
fn resample(table: &PlateTable, per_mm2: f64) -> Vec<[f64; 2]> {
    let mut row = 0;
    (0..=TABLE_CELLS)
        .map(|k| {
            let angle = 360.0 * k as f64 / TABLE_CELLS as f64;
            while row + 2 < table.angle_deg.len() && table.angle_deg[row + 1] <= angle {
                row += 1;
            }
            let (a0, a1) = (table.angle_deg[row], table.angle_deg[row + 1]);
            let t = ((angle - a0) / (a1 - a0)).clamp(0.0, 1.0);
            let at = |area: &[f64]| per_mm2 * (area[row] + t * (area[row + 1] - area[row]));
            [at(&table.area_a_mm2), at(&table.area_b_mm2)]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::LumpedModel;
    use crate::machine::Machine;

    fn plant(name: &str) -> crate::Plant {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines").join(name);
        LumpedModel::new(&Machine::load(&path).unwrap()).unwrap().plant(60.0, 0.0).unwrap()
    }

    /// Reference plate: a = 14, K = 72 deg, R*w = 700 mm2/rad, groove 4 deg to 6 mm2, C_d = 0.7.
    #[test]
    fn val_areas_of_the_reference_plate_at_angles_worked_out_by_hand() {
        let plant = plant("reference.toml");
        let mm2_per_deg = 0.7 * 700.0 * std::f64::consts::PI / 180.0;
        for (angle, a, b) in [
            (90.0, 0.0, 28.0 * mm2_per_deg),
            (270.0, 28.0 * mm2_per_deg, 0.0),
            (0.0, 0.0, 0.0),
            (2.0, 0.0, 0.7 * 6.0 * 0.25),
            (4.0, 0.0, 0.7 * 6.0),
            (18.0, 0.0, 14.0 * mm2_per_deg + 0.7 * 6.0 * 0.5),
        ] {
            let (to_a, to_b) = plant.cd_area_mm2(0, f64::to_radians(angle));
            assert!((to_a - a).abs() < 1e-9 && (to_b - b).abs() < 1e-9, "{angle} deg: {to_a} {to_b}");
            // The motor's line A feeds expanding chambers.
            let (to_a, to_b) = plant.cd_area_mm2(9, f64::to_radians(angle));
            assert!((to_a - b).abs() < 1e-9 && (to_b - a).abs() < 1e-9, "motor, {angle} deg");
        }
    }

    #[test]
    fn prop_areas_are_continuous_and_a_groove_longer_than_the_land_bridges_both_kidneys() {
        for name in ["reference.toml", "seven-piston.toml"] {
            let plant = plant(name);
            let mut bridged = false;
            for lane in [0, plant.chambers() - 1] {
                let mut last = plant.cd_area_mm2(lane, 0.0);
                for k in 1..=36_000 {
                    let now = plant.cd_area_mm2(lane, f64::to_radians(0.01 * f64::from(k)));
                    // A hundredth of a degree moves the port's edge over 0.13 mm2 at most.
                    assert!(
                        (now.0 - last.0).abs() < 0.2 && (now.1 - last.1).abs() < 0.2,
                        "{name} {lane} {k}"
                    );
                    bridged |= now.0 > 0.0 && now.1 > 0.0;
                    last = now;
                }
            }
            assert_eq!(bridged, name == "seven-piston.toml");
        }
    }
}
