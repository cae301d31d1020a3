//! Joint identification: law, displacement ratio, bulk modulus and partial displacement settings from all points at once.
//!
//! Weighted least squares in the ratio domain with prior knowledge of what the points may not separate, by Gauss and
//! Newton with a singular value decomposition of every step's whitened Jacobian (never normal equations), and robust
//! weights against outliers. Derivatives are the reduced model's; where a better model is at hand its ratio is what is
//! fitted: it enters as a correction to the reduced model's ratio, made again at every new solution until it no longer
//! changes. What no quadratic can follow is an unknown function beside the law ([`super::discrepancy`]); its size is what makes
//! the points likeliest. `docs/identification.md` derives it and says what can be separated.
//!
//! Limits: unknowns are few (tens) and points some thousands; each displacement setting below full is one unknown.
//!
//! | file | duty |
//! |---|---|
//! | `linear` | the model and its derivatives about the present unknowns, each row over its standard error |
//! | `stacked` | those rows and what is known beforehand as one least-squares problem, and its solution |
//! | `search` | iterations to the solution, robust weights, choice of the function beside the law |
//! | `solution` | what follows: errors, ratios from a fit without the point, sensitivities of hypothetical points |

mod linear;
mod search;
mod solution;
mod stacked;

use super::discrepancy::{Basis, Shape};
use super::ratio_model::{OperatingPoint, ReducedRatio};
use kou_records::InputError;
use linear::{Problem, settings_of};
use search::Fitted;

pub use solution::{Solution, sensitivities};

/// What is known beforehand, all standard errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Relative, of the displacement ratio: tolerance of the machine file and systematic error of both speed sensors.
    pub displacement: f64,
    /// Relative, of the bulk modulus in the machine file.
    pub bulk: f64,
    /// Relative, of each displacement setting below full.
    pub setting: f64,
    /// Random error of a measured ratio, relative.
    pub ratio: f64,
    /// Random error of a measured pressure.
    pub pressure_mpa: f64,
    /// What neither the law nor a smooth function beside it follows of a real machine's leakage, relative: keeps no point
    /// from being believed without limit.
    pub misfit: f64,
}

impl Default for Prior {
    fn default() -> Self {
        Self { displacement: 0.02, bulk: 0.1, setting: 0.05, ratio: 3e-4, pressure_mpa: 0.03, misfit: 0.003 }
    }
}

/// One measured point, with its row of the law's terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Where.
    pub at: OperatingPoint,
    /// Measured ratio.
    pub ratio: f64,
    /// Normalised speed, pressure and temperature.
    pub x: [f64; 3],
    /// The law's kept terms here.
    pub phi: Vec<f64>,
}

/// Relative misfit in the first fit, which has no function beside the law: what a quadratic misses of a physical leakage.
const FIRST_MISFIT: f64 = 0.018;
/// Choices of the function's shape at most; they agree after one or two.
const CHOICES: usize = 3;

/// Fits; `correction` is what a better model's ratio is above the reduced model's, per row. An earlier solution for the same
/// rows is a start, and its shape is kept.
///
/// # Errors
/// A change of the machine that the estimator refuses.
pub fn fit(
    rows: &[Row],
    reduced: &ReducedRatio,
    correction: &[f64],
    prior: &Prior,
    start: Option<&Solution>,
) -> Result<Solution, InputError> {
    let settings = settings_of(rows);
    let kept = rows.first().map_or(0, |r| r.phi.len());
    let named = kept + 2 + settings.len();
    let problem = Problem { rows, reduced, correction, prior: *prior, settings: &settings, kept };
    let points: Vec<[f64; 3]> = rows.iter().map(|r| r.x).collect();
    let mut fitted = Fitted { unknowns: vec![0.0; named], weight: vec![1.0; rows.len()] };
    let mut shape = Shape { size: 0.0, length: 1.0 };
    let mut found;
    if let Some(start) = start {
        fitted.unknowns.clone_from(&start.unknowns);
        shape = start.shape;
        found = problem.converge(&mut fitted, &Basis::over(&points, shape.length), shape)?;
    } else {
        let first = Prior { misfit: prior.misfit.max(FIRST_MISFIT), ..*prior };
        found = Problem { prior: first, ..problem }.converge(&mut fitted, &Basis::over(&[], 1.0), shape)?;
        for _ in 0..CHOICES {
            let chosen = problem.likeliest(&fitted, &points)?;
            if chosen == shape {
                break;
            }
            shape = chosen;
            found = problem.converge(&mut fitted, &Basis::over(&points, shape.length), shape)?;
        }
    }
    Ok(solution::of(&problem, fitted, found, shape))
}
