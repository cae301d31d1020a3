//! Outages of the supply: their schedule, and the audit of the stored records afterwards.

use kou_app::controller::NoEstimate;
use kou_app::diagnostics::{FaultCode, FaultMemory};
use kou_app::storage::RecordKind;
use kou_estimator::record;
use kou_estimator::units::Micros;
use kou_estimator::{Calibration, Estimate, Params, Sample, State, step};
use serde::Serialize;

use super::emulated_flash::{CutPoint, EmulatedFlash, StoredRecords};
use super::scenario::{PowerCut, Scenario};

/// Time after a start at which the controller has finished its reads and writes of a start, s; faults are written after 2 s.
pub const SETTLED_S: f64 = 3.5;
/// Time after a start within which learned health must be restored, s.
const LEARNED_BACK_S: f64 = 0.5;

/// An outage and the state found after it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutageFinding {
    /// Time of the failure, s.
    pub at_s: f64,
    /// Record that was being written.
    pub during: String,
    /// Bytes written before the failure.
    pub byte: usize,
    /// Whether the record was found `old` or `new`; none where it was unreadable.
    pub found: Option<&'static str>,
    /// Time from the supply's return to the first output, s.
    pub first_output_s: Option<f64>,
    /// Time from the supply's return to the first valid estimate, s.
    pub valid_s: Option<f64>,
    /// Level of leakage in the last output before the failure.
    pub level_before: f64,
    /// Level of leakage in flash.
    #[serde(rename = "level_kept")]
    pub level_stored: Option<f64>,
    /// Level of leakage in the outputs after the restart.
    pub level_after: Option<f64>,
    /// Operating time in flash before and after, s.
    pub operating_s: [u32; 2],
    /// Starts in flash before and after.
    pub starts: [u32; 2],
    /// Trouble codes in flash before and after.
    #[serde(rename = "troubles")]
    pub faults: [usize; 2],
    /// Lost data.
    pub lost: Vec<String>,
    /// Whether nothing was lost.
    pub met: bool,
}

/// One outage, from its schedule to its audit.
struct Outage {
    cut: PowerCut,
    before: Option<StoredRecords>,
    back_s: f64,
    expected_level: Option<u32>,
    finding: Option<OutageFinding>,
    is_audited: bool,
}

/// The outages of a scenario.
pub struct Outages {
    all: Vec<Outage>,
    seed: u64,
    calibration: Calibration,
    level: f64,
    /// Time with supply, s.
    powered_s: f64,
}

fn kind_of(name: &str) -> Option<RecordKind> {
    RecordKind::ALL.into_iter().find(|kind| kind.name() == name)
}

impl Outages {
    /// The outages of a scenario.
    #[must_use]
    pub fn new(scenario: &Scenario, calibration: &Calibration) -> Self {
        let outage = |cut: &PowerCut| Outage {
            cut: cut.clone(),
            before: None,
            back_s: 0.0,
            expected_level: None,
            finding: None,
            is_audited: false,
        };
        Self {
            all: scenario.power_cuts.iter().map(outage).collect(),
            seed: scenario.seed,
            calibration: calibration.clone(),
            level: 1.0,
            powered_s: 0.0,
        }
    }

    /// A millisecond with power: audits a past outage and schedules the next one when due.
    pub fn millisecond(&mut self, time_s: f64, flash: &mut EmulatedFlash) {
        self.powered_s += 1e-3;
        for outage in &mut self.all {
            if !outage.is_audited && outage.finding.is_some() && time_s >= outage.back_s + SETTLED_S {
                outage.audit(flash, self.powered_s);
            }
        }
        let seed = self.seed;
        let next = self.all.iter().enumerate().find(|(_, outage)| outage.finding.is_none());
        if let Some((number, outage)) = next
            && !flash.is_cut_pending()
            && time_s >= outage.cut.from_s
            && let Some(kind) = kind_of(&outage.cut.during)
        {
            flash.schedule_cut(CutPoint {
                kind,
                byte: outage.cut.byte,
                seed: (seed as u32).wrapping_add(number as u32),
            });
        }
    }

    /// Records a failure of the supply. Returns the duration of the outage, s.
    pub fn power_lost(&mut self, time_s: f64, flash: &mut EmulatedFlash) -> f64 {
        flash.power_on();
        let level = self.level;
        let Some(outage) = self.all.iter_mut().find(|outage| outage.finding.is_none()) else { return 0.3 };
        let before = flash.before_cut().map(StoredRecords::read);
        let now = StoredRecords::read(flash.cells());
        let mut finding = OutageFinding {
            at_s: time_s,
            during: outage.cut.during.clone(),
            byte: outage.cut.byte,
            found: None,
            first_output_s: None,
            valid_s: None,
            level_before: level,
            level_stored: None,
            level_after: None,
            operating_s: [0; 2],
            starts: [0; 2],
            faults: [0; 2],
            lost: Vec::new(),
            met: false,
        };
        match (before, now) {
            (Some(Ok(before)), Ok(now)) => {
                finding.found = Some(if before == now { "old" } else { "new" });
                let stored = restored_level(&self.calibration, &now);
                finding.level_stored = stored.map(f64::from);
                outage.expected_level = stored.map(f32::to_bits);
                outage.before = Some(before);
            }
            (before, now) => {
                finding.lost.push(format!("unreadable: {:?}, {:?}", before.map(|b| b.err()), now.err()))
            }
        }
        outage.back_s = time_s + outage.cut.off_s;
        outage.finding = Some(finding);
        outage.cut.off_s
    }

    /// Adds an output of the controller.
    pub fn push(&mut self, time_s: f64, output: &Result<Estimate, NoEstimate>) {
        let Ok(estimate) = output else { return };
        self.level = f64::from(estimate.health.level.get());
        let last = self.all.iter_mut().rev().find(|outage| outage.finding.is_some());
        let Some(outage) = last else { return };
        let since_s = time_s - outage.back_s;
        let Some(finding) = &mut outage.finding else { return };
        finding.first_output_s.get_or_insert(since_s);
        if estimate.observed.is_ok() {
            finding.valid_s.get_or_insert(since_s);
        }
        let level = estimate.health.level.get();
        let is_back = outage.expected_level == Some(level.to_bits());
        if since_s <= LEARNED_BACK_S && (is_back || finding.level_after.is_none()) {
            finding.level_after = Some(f64::from(level));
        }
    }

    /// Results of all outages.
    #[must_use]
    pub fn findings(&self) -> Vec<OutageFinding> {
        let of = |outage: &Outage| {
            outage.finding.clone().unwrap_or_else(|| OutageFinding {
                at_s: outage.cut.from_s,
                during: outage.cut.during.clone(),
                byte: outage.cut.byte,
                found: None,
                first_output_s: None,
                valid_s: None,
                level_before: 0.0,
                level_stored: None,
                level_after: None,
                operating_s: [0; 2],
                starts: [0; 2],
                faults: [0; 2],
                lost: vec!["the supply never failed: no such write came".into()],
                met: false,
            })
        };
        self.all.iter().map(of).collect()
    }
}

/// Level that a controller reports after restoring the stored records; none where nothing was learned with the calibration.
fn restored_level(calibration: &Calibration, stored: &StoredRecords) -> Option<f32> {
    // The parameters do not matter for the level that an empty sample gives.
    let params = Params::new(calibration).ok()?;
    let health = stored.health.clone()?;
    let mut buffer = [0; record::calibration::MAX_LEN];
    let default =
        record::calibration::encode(calibration, &mut buffer).ok().and_then(|length| buffer.get(..length))?;
    let in_use = stored.calibration.as_ref().map_or(default, |(_, record)| record);
    let crc = in_use.last_chunk::<4>().map(|crc| u32::from_le_bytes(*crc))?;
    if health.calibration_crc != crc {
        return None;
    }
    let mut state = State::with_health(health.state);
    Some(step(&params, &mut state, &Sample::empty(Micros(0))).health.level.get())
}

impl Outage {
    fn audit(&mut self, flash: &EmulatedFlash, powered_s: f64) {
        self.is_audited = true;
        let (Some(finding), Some(before)) = (&mut self.finding, &self.before) else { return };
        let after = match StoredRecords::read(flash.cells()) {
            Ok(after) => after,
            Err(error) => {
                finding.lost.push(format!("unreadable afterwards: {error}"));
                return;
            }
        };
        let lives = [before.life.unwrap_or_default(), after.life.unwrap_or_default()];
        finding.operating_s = lives.map(|life| life.operating_s);
        finding.starts = lives.map(|life| life.starts);
        finding.faults =
            [before, &after].map(|stored| stored.faults.as_ref().map_or(0, |f| f.entries().len()));
        let mut lost = |what: &str, is_lost: bool| {
            if is_lost {
                finding.lost.push(what.to_owned());
            }
        };
        lost("hours", lives[1].operating_s < lives[0].operating_s);
        lost("hours invented", f64::from(lives[1].operating_s) > powered_s);
        lost(
            "a start not counted",
            lives[1].starts != lives[0].starts + 1
                || lives[1].unplanned_resets != lives[0].unplanned_resets + 1,
        );
        let none = FaultMemory::new();
        let (old, new) = (before.faults.as_ref().unwrap_or(&none), after.faults.as_ref().unwrap_or(&none));
        for entry in old.entries() {
            let stored = new.entries().iter().find(|stored| stored.dtc == entry.dtc);
            let is_stored =
                stored.is_some_and(|k| k.occurrences >= entry.occurrences && k.first == entry.first);
            lost(&format!("trouble {:?}", entry.code()), !is_stored);
        }
        lost("the brown-out itself", new.get(FaultCode::BrownOut).is_none());
        lost("calibration", before.calibration.is_some() && after.calibration.is_none());
        lost("update counter", before.counter > after.counter);
        lost("learned health", before.health.is_some() && after.health.is_none());
        let level = self.expected_level.map(f32::from_bits).map(f64::from);
        lost("level", level.is_some() && finding.level_after != level);
        // Whether and when it is valid again depends on the drive too: that is the scenario's to expect.
        finding.met = finding.lost.is_empty() && finding.first_output_s.is_some();
    }
}
