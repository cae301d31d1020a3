//! Plots: one stack for every picture of the tool.

pub mod decimator;
