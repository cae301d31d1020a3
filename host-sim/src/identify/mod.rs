//! Identification: from bench points to a calibrated law.

mod law_fit;
mod least_squares;
mod rom;

pub use law_fit::{LawFit, TERMS, physical};
pub use rom::{Identification, PointResult, Refusal, by_reduced_model};
