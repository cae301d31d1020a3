//! The committed limits: `xtask/limits.toml`.

use anyhow::{Context, Result, bail};
use toml::Table;

use super::figure::Figure;

/// Path below the workspace's root.
const FILE: &str = "xtask/limits.toml";
const TEXT: &str = include_str!("../../limits.toml");

/// Limits of the budgets and of the number of tests.
#[derive(Debug)]
pub struct BudgetLimits {
    budgets: Vec<(String, u64)>,
    /// Fewest host and QEMU tests that a full run must execute.
    pub min_tests: u64,
}

impl BudgetLimits {
    /// Reads the committed limits.
    pub fn load() -> Result<Self> {
        Self::parse(TEXT).with_context(|| format!("reading {FILE}"))
    }

    fn parse(text: &str) -> Result<Self> {
        let table: Table = text.parse()?;
        let unsigned = |name: &str, value: &toml::Value| {
            let number = value.as_integer().and_then(|value| u64::try_from(value).ok());
            number.with_context(|| format!("`{name}` must be a whole number, 0 or more"))
        };
        let Some(budgets) = table.get("budgets").and_then(toml::Value::as_table) else {
            bail!("there is no table [budgets]")
        };
        let min_tests = table.get("tests").and_then(|tests| tests.get("min_executed"));
        Ok(Self {
            budgets: budgets
                .iter()
                .map(|(name, value)| Ok((name.clone(), unsigned(name, value)?)))
                .collect::<Result<_>>()?,
            min_tests: unsigned("tests.min_executed", min_tests.context("there is no tests.min_executed")?)?,
        })
    }

    /// The limit of one figure.
    pub fn of(&self, key: &str) -> Option<u64> {
        self.budgets.iter().find(|(name, _)| name == key).map(|(_, limit)| *limit)
    }

    /// Every figure above its limit or without one, and every limit without a figure.
    pub fn compare(&self, figures: &[Figure]) -> Vec<String> {
        let mut complaints = Vec::new();
        for f in figures {
            match self.of(f.key) {
                None => complaints.push(format!("`{}` is {} and has no limit in {FILE}", f.key, f.value)),
                Some(limit) if f.value > limit => complaints.push(format!(
                    "`{}` is {} {}, above its limit of {limit}. If the cost is worth it, raise the limit in {FILE} \
                     and say why in the commit",
                    f.key, f.value, f.unit
                )),
                Some(_) => {}
            }
        }
        for (name, _) in &self.budgets {
            if !figures.iter().any(|f| f.key == name) {
                complaints.push(format!("{FILE} has a limit for `{name}`, which is no longer measured"));
            }
        }
        complaints
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budgets::figure::figure;

    #[test]
    fn committed_limits_are_no_larger_than_the_project_promises() {
        let limits = BudgetLimits::load().unwrap();
        for (key, promised) in [
            ("law_instructions", 40),
            ("law_forward_inverse_instructions", 300),
            ("step_worst_instructions", 1500),
            ("state_bytes", 1024),
            ("g474_flash_bytes", 128 * 1024),
            ("g474_ram_and_stack_bytes", 24 * 1024),
        ] {
            let limit = limits.of(key).unwrap_or(u64::MAX);
            assert!(limit <= promised, "`{key}` may be {limit}, but {promised} is promised");
        }
    }

    #[test]
    fn above_without_and_unused_limits_are_complaints() {
        let limits =
            BudgetLimits::parse("[budgets]\na = 10\nb = 5\nold = 1\n[tests]\nmin_executed = 3").unwrap();
        let figures = [figure("a", "", "", 10), figure("b", "", "", 6), figure("new", "", "", 0)];
        let complaints = limits.compare(&figures);
        assert_eq!(complaints.len(), 3, "{complaints:?}");
        assert!(complaints[0].contains("`b` is 6"));
        assert!(complaints[1].contains("`new`"));
        assert!(complaints[2].contains("`old`"));
    }

    #[test]
    fn a_negative_limit_is_rejected() {
        let error = BudgetLimits::parse("[budgets]\na = -1\n[tests]\nmin_executed = 3").unwrap_err();
        assert!(error.to_string().contains("`a` must be"), "{error}");
    }
}
