//! Identification: from bench points to a calibrated law, a corrected machine and a fitted surrogate.
//!
//! | module | duty |
//! |---|---|
//! | [`ratio_model`] | what is asked of a model; reduced and full model behind it |
//! | [`memory`] | remembers what a model was asked, so that an interrupted run resumes |
//! | [`secant`], [`two_step`] | the paper's scheme |
//! | [`joint`], [`joint_scheme`] | the default: everything fitted together |
//! | [`discrepancy`] | what no quadratic law can follow, fitted beside it |
//! | [`surrogate`], [`envelope`] | the reduced model's constants fitted to the full model |
//! | [`advice`] | which points to measure next |

pub mod advice;
pub mod calibration;
pub mod discrepancy;
pub mod envelope;
pub mod joint;
pub mod joint_scheme;
mod law_fit;
mod least_squares;
pub mod memory;
mod outcome;
pub mod ratio_model;
pub mod secant;
pub mod surrogate;
pub mod two_step;

pub use law_fit::{LawFit, TERMS, coefficients, normalised, phi, physical};
pub use outcome::{Identification, PointResult, Refusal, Unknown, evaluate};
