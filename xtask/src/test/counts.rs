//! Counts of tests, from the output of `cargo test`.
//!
//! libtest has no skipped tests: a test that cannot run here (its data is absent, say) prints a line that begins with
//! `SKIPPED:` and returns, and libtest counts it as passed. [`LibtestReader`] subtracts it from the passed ones.

/// Sums over all test binaries and checks.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct TestCounts {
    /// Tests and checks that passed.
    pub passed: u64,
    /// Tests and checks that failed.
    pub failed: u64,
    /// Tests that did not run.
    pub skipped: u64,
    /// Tests that cargo executed to their end, without the skipped ones.
    pub executed_by_cargo: u64,
    /// Reasons of skipped tests.
    pub skipped_because: Vec<String>,
}

/// Reads the output of `cargo test -- --show-output`, line by line.
#[derive(Debug, Default)]
pub struct LibtestReader {
    counts: TestCounts,
    /// Inside the output of tests that passed.
    among_successes: bool,
    /// The test whose output follows, until it is known to have been skipped.
    test: Option<String>,
}

impl LibtestReader {
    /// Reads one line; true when it should be shown.
    ///
    /// The output of tests that passed is not shown, except why one was skipped.
    pub fn push(&mut self, line: &str) -> bool {
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
        // A test that prints two reasons is still one test.
        if let Some(name) = self.test.take() {
            self.counts.skipped += 1;
            self.counts.passed = self.counts.passed.wrapping_sub(1);
            self.counts.skipped_because.push(format!("SKIPPED: {name}: {}", why.trim()));
        }
        true
    }

    /// `ok. 12 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.52s`
    fn result(&mut self, text: &str) {
        let count = |what: &str| {
            let parts = text.split([';', '.']).map(str::trim);
            parts
                .filter_map(|part| part.strip_suffix(what))
                .find_map(|n| n.trim().parse::<u64>().ok())
                .unwrap_or(0)
        };
        let ignored = count("ignored");
        // Wrapping: skipped tests were subtracted before the sum that they belong to was known.
        self.counts.passed = self.counts.passed.wrapping_add(count("passed"));
        self.counts.failed += count("failed");
        self.counts.skipped += ignored;
        if ignored > 0 {
            self.counts.skipped_because.push(format!("SKIPPED: {ignored} marked #[ignore]"));
        }
    }
}

impl TestCounts {
    /// Adds the counts of a reader.
    pub fn add(&mut self, reader: LibtestReader) {
        let TestCounts { passed, failed, skipped, skipped_because, .. } = reader.counts;
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

    fn read(text: &str) -> (TestCounts, String) {
        let mut reader = LibtestReader::default();
        let mut shown = String::new();
        for line in text.lines() {
            if reader.push(line) {
                shown += line;
                shown += "\n";
            }
        }
        let mut counts = TestCounts::default();
        counts.add(reader);
        (counts, shown)
    }

    #[test]
    fn sums_over_several_binaries() {
        let (counts, _) = read(
            "test result: ok. 12 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.52s\n\
             test result: FAILED. 3 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.00s",
        );
        assert_eq!(counts.summary(), "15 passed, 2 failed");
        assert_eq!(counts.executed_by_cargo, 17);
    }

    #[test]
    fn a_skipped_test_is_not_a_passed_one_and_its_reason_is_shown() {
        let (counts, shown) = read(
            "test a ... ok\ntest b ... ok\n\nsuccesses:\n\n---- a stdout ----\nnoise\n\n---- b stdout ----\n\
             SKIPPED: no rig data\nSKIPPED: really none\n\nsuccesses:\n    a\n    b\n\n\
             test result: ok. 2 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s",
        );
        assert_eq!(counts.summary(), "1 passed, 0 failed, 1 skipped");
        assert_eq!(counts.skipped_because, ["SKIPPED: b: no rig data"]);
        assert!(shown.contains("SKIPPED: no rig data") && !shown.contains("noise"), "{shown}");
    }

    #[test]
    fn ignored_tests_count_as_skipped() {
        let (counts, _) = read(
            "test result: ok. 1 passed; 0 failed; 4 ignored; 0 measured; 0 filtered out; finished in 0.00s",
        );
        assert_eq!(counts.summary(), "1 passed, 0 failed, 4 skipped");
    }

    #[test]
    fn the_output_of_failed_tests_is_shown() {
        let (_, shown) =
            read("successes:\n\n---- a stdout ----\nnoise\n\nfailures:\n\n---- c stdout ----\nwhy");
        assert!(shown.contains("why") && !shown.contains("noise"));
    }
}
