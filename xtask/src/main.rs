//! Set-up, demo, tests, budgets.
fn main() {}
