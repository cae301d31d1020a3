//! Leakage estimator.
#![no_std]
