//! Joint fit: law, displacement ratio, bulk modulus and partial displacement settings from all points at once.
//!
//! Weighted nonlinear least squares in the speed ratio, with Gaussian priors on the machine parameters (maximum a posteriori),
//! by Gauss-Newton iteration; every step is solved by a singular value decomposition of the whitened Jacobian, never by normal
//! equations (Bjorck 1996). Outliers are downweighted by a Huber function with a redescending tail (Huber 1964, Hampel 1974).
//! Derivatives are those of the reduced model; a plant model enters as an additive correction of the reduced model's ratio,
//! updated at every new solution until it converges. The model discrepancy of the quadratic law is a Gaussian process
//! ([`crate::discrepancy`]); its hyperparameters maximise the restricted likelihood (Patterson and Thompson 1971).
//! Derivation and identifiability: `docs/identification.md`.
//!
//! Limits: tens of unknowns and thousands of points; each displacement setting below full is one unknown.
//!
//! | file | content |
//! |---|---|
//! | `prior`, `observation` | prior standard errors; measured point with its regressor |
//! | `linear` | linearised model, each row divided by its standard error |
//! | `least_squares` | least-squares problem of a Gauss-Newton step, its solution and its restricted likelihood |
//! | `gauss_newton` | iteration with robust weights |
//! | `hyperparameters` | selection of the discrepancy's kernel |
//! | `solution` | covariance, leave-one-out ratios, sensitivities of hypothetical points |
//! | `fit` | the whole fit |

mod fit;
mod gauss_newton;
mod hyperparameters;
pub mod least_squares;
mod linear;
mod observation;
mod prior;
mod solution;

pub use fit::fit;
pub use observation::Observation;
pub use prior::Prior;
pub use solution::{JointSolution, sensitivities};
