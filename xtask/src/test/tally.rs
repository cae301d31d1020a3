//! Counts tests from what `cargo test` prints.
//!
//! libtest knows no skipped test: one that cannot run here (its data is absent, say) prints a line that begins with
//! `SKIPPED:` and returns, and libtest counts it as passed. The [`Reader`] takes it out of the passed ones again.

/// Sums over everything that was run.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Tests and checks that passed.
    pub passed: u64,
    /// Tests and checks that failed.
    pub failed: u64,
    /// Tests that were not run.
    pub skipped: u64,
    /// Tests that cargo executed to an end, skipped ones not among them.
    pub executed_by_cargo: u64,
    /// Why tests were skipped.
    pub skipped_because: Vec<String>,
}

/// Reads the output of `cargo test -- --show-output`, line by line.
#[derive(Debug, Default)]
pub struct Reader {
    tally: Tally,
    /// Inside the output of tests that passed.
    among_successes: bool,
    /// The test whose output follows, until it is known to have been skipped.
    test: Option<String>,
}

impl Reader {
    /// Takes one line in; true when it should be shown.
    ///
    /// The output of tests that passed is not shown, except why one was skipped.
    pub fn line(&mut self, line: &str) -> bool {
        if let Some(result) = line.strip_prefix("test result: ") {
            self.among_successes = false;
            self.test = None;
            self.result(result);
            return true;
        }
        match line {
            "successes:" => self.among_successes = true,
            "failures:" => self.among_successes = false,
            _ => {}
        }
        if !self.among_successes {
            return true;
        }
        if let Some(name) = line.strip_prefix("---- ").and_then(|rest| rest.strip_suffix(" stdout ----")) {
            self.test = Some(name.to_owned());
        }
        let Some(why) = line.trim_start().strip_prefix("SKIPPED:") else { return false };
        // A test that gives two reasons is still one test.
        if let Some(name) = self.test.take() {
            self.tally.skipped += 1;
            self.tally.passed = self.tally.passed.wrapping_sub(1);
            self.tally.skipped_because.push(format!("SKIPPED: {name}: {}", why.trim()));
        }
        true
    }

    /// `ok. 12 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.52s`
    fn result(&mut self, text: &str) {
        let count = |what: &str| {
            let words = text.split([';', '.']).map(str::trim);
            words
                .filter_map(|part| part.strip_suffix(what))
                .find_map(|n| n.trim().parse::<u64>().ok())
                .unwrap_or(0)
        };
        let ignored = count("ignored");
        // Wrapping, because skipped tests were taken off before the sum they belong to was known.
        self.tally.passed = self.tally.passed.wrapping_add(count("passed"));
        self.tally.failed += count("failed");
        self.tally.skipped += ignored;
        if ignored > 0 {
            self.tally.skipped_because.push(format!("SKIPPED: {ignored} marked #[ignore]"));
        }
    }
}

impl Tally {
    /// Adds what a reader has counted.
    pub fn add(&mut self, reader: Reader) {
        let Tally { passed, failed, skipped, skipped_because, .. } = reader.tally;
        // A run that was cut off between a skipped test and its sum must not count below zero.
        let passed = if passed > u64::MAX / 2 { 0 } else { passed };
        self.executed_by_cargo += passed + failed;
        self.passed += passed;
        self.failed += failed;
        self.skipped += skipped;
        self.skipped_because.extend(skipped_because);
    }

    /// The closing line.
    pub fn summary(&self) -> String {
        let mut text = format!("{} passed, {} failed", self.passed, self.failed);
        if self.skipped > 0 {
            text += &format!(", {} skipped", self.skipped);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Tally, String) {
        let mut reader = Reader::default();
        let mut shown = String::new();
        for line in text.lines() {
            if reader.line(line) {
                shown += line;
                shown += "\n";
            }
        }
        let mut tally = Tally::default();
        tally.add(reader);
        (tally, shown)
    }

    #[test]
    fn sums_over_several_binaries() {
        let (tally, _) = read(
            "test result: ok. 12 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.52s\n\
             test result: FAILED. 3 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.00s",
        );
        assert_eq!(tally.summary(), "15 passed, 2 failed");
        assert_eq!(tally.executed_by_cargo, 17);
    }

    #[test]
    fn a_skipped_test_is_not_a_passed_one_and_its_reason_is_shown() {
        let (tally, shown) = read(
            "test a ... ok\ntest b ... ok\n\nsuccesses:\n\n---- a stdout ----\nnoise\n\n---- b stdout ----\n\
             SKIPPED: no rig data\nSKIPPED: really none\n\nsuccesses:\n    a\n    b\n\n\
             test result: ok. 2 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s",
        );
        assert_eq!(tally.summary(), "1 passed, 0 failed, 1 skipped");
        assert_eq!(tally.skipped_because, ["SKIPPED: b: no rig data"]);
        assert!(shown.contains("SKIPPED: no rig data") && !shown.contains("noise"), "{shown}");
    }

    #[test]
    fn ignored_tests_count_as_skipped() {
        let (tally, _) = read(
            "test result: ok. 1 passed; 0 failed; 4 ignored; 0 measured; 0 filtered out; finished in 0.00s",
        );
        assert_eq!(tally.summary(), "1 passed, 0 failed, 4 skipped");
    }

    #[test]
    fn the_output_of_failed_tests_is_shown() {
        let (_, shown) =
            read("successes:\n\n---- a stdout ----\nnoise\n\nfailures:\n\n---- c stdout ----\nwhy");
        assert!(shown.contains("why") && !shown.contains("noise"));
    }
}
