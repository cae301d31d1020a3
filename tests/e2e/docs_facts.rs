//! Numbers of the documents that the code states as constants. Links, paths, commands and names: `cargo xtask docs`.

use std::fmt::Display;
use std::path::Path;

use kou_app::diagnostics::FaultMemory;

use kou_app::storage::{
    CrashReport, HealthRecord, OperatingCounters, Record, StoredCalibration, UpdateCounter,
};
use kou_estimator::record::calibration;
use kou_lumped::machine;
use kou_pil::link;

/// A document's text, each run of white space as one blank.
fn prose(path: &str) -> String {
    text(path).split_whitespace().collect::<Vec<_>>().join(" ")
}

fn text(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Cells of a row of a table; the outer bars are no cells.
fn cells(line: &str) -> Vec<&str> {
    line.trim().trim_matches('|').split('|').map(str::trim).collect()
}

/// The cell of a table in the column of this heading, in the row that begins with this text.
fn cell(path: &str, row: &str, column: &str) -> Option<String> {
    let text = text(path);
    let mut at = None;
    for line in text.lines() {
        if !line.trim_start().starts_with('|') {
            at = None;
            continue;
        }
        let cells = cells(line);
        at = at.or_else(|| cells.iter().position(|cell| *cell == column));
        if let Some(cell) = at.filter(|_| cells.first() == Some(&row)).and_then(|at| cells.get(at)) {
            return Some((*cell).to_owned());
        }
    }
    None
}

/// `{}` of the sentence stands for the value.
fn states(path: &str, sentence: &str, value: impl Display) -> Result<(), String> {
    let expected = sentence.replace("{}", &value.to_string());
    let found = prose(path).contains(&expected);
    found
        .then_some(())
        .ok_or_else(|| format!("{path} does not say `{expected}`, which is what the code does"))
}

fn lists<'a, R: Record<'a>>(row: &str) -> Result<(), String> {
    const PATH: &str = "docs/storage.md";
    let copies = 2 * R::KIND as usize;
    let facts = [("schema", R::SCHEMA.to_string()), ("key", format!("{copies}, {}", copies + 1))];
    for (column, expected) in facts {
        let found = cell(PATH, row, column);
        if found.as_ref() != Some(&expected) {
            return Err(format!(
                "{PATH}, row `{row}`, column `{column}`: {found:?}, but the code has `{expected}`"
            ));
        }
    }
    Ok(())
}

#[test]
fn numbers_in_the_documents_are_those_of_the_code() {
    let facts = [
        states("docs/link.md", "at most {} bytes", link::MAX_PAYLOAD),
        states("docs/link.md", "more bytes than the largest message and its CRC have ({})", link::MAX_BODY),
        states("docs/link.md", "protocol version ({})", link::PROTOCOL),
        states("docs/calibration-record.md", "this version writes and reads {} ", calibration::SCHEMA),
        states("docs/full-model/machine.md", "`schema = {}`", machine::SCHEMA),
        lists::<StoredCalibration<'_>>("calibration"),
        lists::<HealthRecord>("health"),
        lists::<FaultMemory>("faults"),
        lists::<OperatingCounters>("life"),
        lists::<UpdateCounter>("update counter"),
        lists::<CrashReport>("stop"),
    ];
    let wrong: Vec<String> = facts.into_iter().filter_map(Result::err).collect();
    assert!(wrong.is_empty(), "\n  {}", wrong.join("\n  "));
}
