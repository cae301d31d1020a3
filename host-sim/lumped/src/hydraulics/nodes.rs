//! Nodes of the circuit (lines and galleries): the valves between them, and their 4 x 4 linear system.

use crate::layout::{CHARGE_GALLERY, FLUSHING_GALLERY, LINE_A, LINE_B, NODES};
use crate::plant::Plant;
use crate::valves::MassFlow;

/// Adds the circuit's valves (paper fig. 1) to the nodes' inflows and their slopes with respect to the nodes' masses.
/// Returns the flows to the case of relief valves 4 and 10.
#[inline(always)]
pub(super) fn circuit(
    plant: &Plant,
    p: &[f64; NODES],
    relative_rho: &[f64; NODES],
    slope: &[f64; NODES],
    charge: f64,
    inflow: &mut [f64; NODES],
    matrix: &mut [[f64; NODES]; NODES],
) -> [MassFlow; 2] {
    let mut edge = |from: usize, to: usize, flow: MassFlow| {
        inflow[from] -= flow.kg_s;
        inflow[to] += flow.kg_s;
        matrix[from][from] -= flow.d_from * slope[from];
        matrix[from][to] -= flow.d_to * slope[to];
        matrix[to][from] += flow.d_from * slope[from];
        matrix[to][to] += flow.d_to * slope[to];
    };
    for line in [LINE_A, LINE_B] {
        // Check valves 5 and 6; high-pressure relief valves, when fitted.
        edge(
            CHARGE_GALLERY,
            line,
            plant.check_valve.flow(p[CHARGE_GALLERY], p[line], relative_rho[CHARGE_GALLERY]),
        );
        if let Some(relief) = &plant.high_relief {
            edge(line, CHARGE_GALLERY, relief.flow(p[line], p[CHARGE_GALLERY]));
        }
    }
    // Shuttle valve 9: the side of the lower line, moved by the other line's pressure as well.
    for (line, other) in [(LINE_A, LINE_B), (LINE_B, LINE_A)] {
        let (flow, by_other) = plant.shuttle.flow(
            p[line],
            p[other],
            p[FLUSHING_GALLERY],
            (relative_rho[line], relative_rho[FLUSHING_GALLERY]),
        );
        if flow != MassFlow::default() {
            edge(line, FLUSHING_GALLERY, flow);
            matrix_add(matrix, line, FLUSHING_GALLERY, other, by_other * slope[other]);
            break;
        }
    }
    // Relief valves 4 and 10 to the case; charge pump 3.
    let drains = [
        plant.charge_relief.flow(p[CHARGE_GALLERY], plant.case_pa),
        plant.flushing_relief.flow(p[FLUSHING_GALLERY], plant.case_pa),
    ];
    for (node, drain) in [(CHARGE_GALLERY, drains[0]), (FLUSHING_GALLERY, drains[1])] {
        inflow[node] -= drain.kg_s;
        matrix[node][node] -= drain.d_from * slope[node];
    }
    inflow[CHARGE_GALLERY] += charge;
    drains
}

/// Derivative of a flow `from` -> `to` with respect to a third node.
#[inline(always)]
fn matrix_add(matrix: &mut [[f64; NODES]; NODES], from: usize, to: usize, third: usize, slope: f64) {
    matrix[from][third] -= slope;
    matrix[to][third] += slope;
}

/// Gaussian elimination with partial pivoting; `None` when the matrix is singular or not finite.
#[inline(always)]
pub(super) fn solve_nodes(
    matrix: &mut [[f64; NODES]; NODES],
    rhs: &mut [f64; NODES],
) -> Option<[f64; NODES]> {
    for k in 0..NODES {
        let mut pivot = k;
        for row in k + 1..NODES {
            if matrix[row][k].abs() > matrix[pivot][k].abs() {
                pivot = row;
            }
        }
        if pivot != k {
            matrix.swap(k, pivot);
            rhs.swap(k, pivot);
        }
        let diagonal = matrix[k][k];
        if !(diagonal.abs() > 0.0 && diagonal.is_finite()) {
            return None;
        }
        let inv = 1.0 / diagonal;
        for row in k + 1..NODES {
            let factor = matrix[row][k] * inv;
            let pivot_row = matrix[k];
            for (entry, above) in matrix[row].iter_mut().zip(pivot_row).skip(k + 1) {
                *entry -= factor * above;
            }
            rhs[row] -= factor * rhs[k];
        }
    }
    let mut x = [0.0; NODES];
    for k in (0..NODES).rev() {
        let mut sum = rhs[k];
        for column in k + 1..NODES {
            sum -= matrix[k][column] * x[column];
        }
        x[k] = sum / matrix[k][k];
    }
    Some(x)
}
