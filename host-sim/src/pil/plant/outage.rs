//! Outages of the supply: when they come, and whether what was kept is all there afterwards.

use kou_app::controller::NoEstimate;
use kou_app::diagnostics::{FaultCode, FaultMemory};
use kou_app::storage::RecordKind;
use kou_estimator::record;
use kou_estimator::units::Micros;
use kou_estimator::{Calibration, Estimate, Params, Sample, State, step};
use serde::Serialize;

use super::flash::{Aim, Flash, Kept};
use super::scenario::{PowerCut, Scenario};

/// Time after a start after which the controller has read and written what it does at a start, s: faults are not written
/// before two.
pub const SETTLED_S: f64 = 3.5;
/// Time after a start within which learned health must be back, s.
const LEARNED_BACK_S: f64 = 0.5;

/// An outage and what was found after it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutageFinding {
    /// When the supply failed, s.
    pub at_s: f64,
    /// Which record was being written.
    pub during: String,
    /// After how many bytes of its write.
    pub byte: usize,
    /// Whether that record was found as it was before, or new; nothing where neither can be told.
    pub found: Option<&'static str>,
    /// Time from the supply's return to the first output, s.
    pub first_output_s: Option<f64>,
    /// Time from the supply's return to the first valid estimate, s.
    pub valid_s: Option<f64>,
    /// Level of leakage that the controller had told last before.
    pub level_before: f64,
    /// Level of leakage that was in flash, and the one told after the start.
    pub level_kept: Option<f64>,
    /// The level told after the start.
    pub level_after: Option<f64>,
    /// Operating time in flash before and after, s.
    pub operating_s: [u32; 2],
    /// Starts in flash before and after.
    pub starts: [u32; 2],
    /// Troubles in flash before and after.
    pub troubles: [usize; 2],
    /// What was lost; empty when nothing was.
    pub lost: Vec<String>,
    /// Whether nothing was lost.
    pub met: bool,
}

/// One outage, from its aim to its audit.
struct Outage {
    cut: PowerCut,
    before: Option<Kept>,
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
    /// Time for which the supply has been there, s.
    powered_s: f64,
}

fn kind_of(name: &str) -> Option<RecordKind> {
    RecordKind::ALL.into_iter().find(|kind| kind.name() == name)
}

impl Outages {
    /// Of a scenario.
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

    /// A millisecond with power: aims the next outage when its time has come.
    pub fn millisecond(&mut self, time_s: f64, flash: &mut Flash) {
        self.powered_s += 1e-3;
        for outage in &mut self.all {
            if !outage.is_audited && outage.finding.is_some() && time_s >= outage.back_s + SETTLED_S {
                outage.audit(flash, self.powered_s);
            }
        }
        let seed = self.seed;
        let next = self.all.iter().enumerate().find(|(_, outage)| outage.finding.is_none());
        if let Some((number, outage)) = next
            && !flash.is_aimed()
            && time_s >= outage.cut.from_s
            && let Some(kind) = kind_of(&outage.cut.during)
        {
            flash.aim(Aim { kind, byte: outage.cut.byte, seed: (seed as u32).wrapping_add(number as u32) });
        }
    }

    /// The supply has failed. Returns how long it is away, s.
    pub fn fails(&mut self, time_s: f64, flash: &mut Flash) -> f64 {
        flash.power_on();
        let level = self.level;
        let Some(outage) = self.all.iter_mut().find(|outage| outage.finding.is_none()) else { return 0.3 };
        let before = flash.before_cut().map(Kept::of);
        let now = Kept::of(flash.cells());
        let mut finding = OutageFinding {
            at_s: time_s,
            during: outage.cut.during.clone(),
            byte: outage.cut.byte,
            found: None,
            first_output_s: None,
            valid_s: None,
            level_before: level,
            level_kept: None,
            level_after: None,
            operating_s: [0; 2],
            starts: [0; 2],
            troubles: [0; 2],
            lost: Vec::new(),
            met: false,
        };
        match (before, now) {
            (Some(Ok(before)), Ok(now)) => {
                finding.found = Some(if before == now { "old" } else { "new" });
                let kept = learned(&self.calibration, &now);
                finding.level_kept = kept.map(f64::from);
                outage.expected_level = kept.map(f32::to_bits);
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

    /// Takes an output of the controller.
    pub fn told(&mut self, time_s: f64, output: &Result<Estimate, NoEstimate>) {
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

    /// What came of each.
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
                level_kept: None,
                level_after: None,
                operating_s: [0; 2],
                starts: [0; 2],
                troubles: [0; 2],
                lost: vec!["the supply never failed: no such write came".into()],
                met: false,
            })
        };
        self.all.iter().map(of).collect()
    }
}

/// The level that a controller tells which restores what is kept; nothing where nothing was learned with the calibration.
fn learned(calibration: &Calibration, kept: &Kept) -> Option<f32> {
    // Health needs parameters only to judge samples; which ones is the same for what is told of an empty one.
    let params = Params::new(calibration).ok()?;
    let health = kept.health.clone()?;
    let mut buffer = [0; record::calibration::MAX_LEN];
    let default =
        record::calibration::encode(calibration, &mut buffer).ok().and_then(|length| buffer.get(..length))?;
    let in_use = kept.calibration.as_ref().map_or(default, |(_, record)| record);
    let crc = in_use.last_chunk::<4>().map(|crc| u32::from_le_bytes(*crc))?;
    if health.calibration_crc != crc {
        return None;
    }
    let mut state = State::with_health(health.state);
    Some(step(&params, &mut state, &Sample::empty(Micros(0))).health.level.get())
}

impl Outage {
    fn audit(&mut self, flash: &Flash, powered_s: f64) {
        self.is_audited = true;
        let (Some(finding), Some(before)) = (&mut self.finding, &self.before) else { return };
        let after = match Kept::of(flash.cells()) {
            Ok(after) => after,
            Err(error) => {
                finding.lost.push(format!("unreadable afterwards: {error}"));
                return;
            }
        };
        let lives = [before.life.unwrap_or_default(), after.life.unwrap_or_default()];
        finding.operating_s = lives.map(|life| life.operating_s);
        finding.starts = lives.map(|life| life.starts);
        finding.troubles = [before, &after].map(|kept| kept.faults.as_ref().map_or(0, |f| f.entries().len()));
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
            let kept = new.entries().iter().find(|kept| kept.dtc == entry.dtc);
            let is_kept = kept.is_some_and(|k| k.occurrences >= entry.occurrences && k.first == entry.first);
            lost(&format!("trouble {:?}", entry.code()), !is_kept);
        }
        lost("the brown-out itself", new.get(FaultCode::BrownOut).is_none());
        lost("calibration", before.calibration.is_some() && after.calibration.is_none());
        lost("update counter", before.counter > after.counter);
        lost("learned health", before.health.is_some() && after.health.is_none());
        let level = self.expected_level.map(f32::from_bits).map(f64::from);
        lost("level", level.is_some() && finding.level_after != level);
        // Whether and when it is valid again depends on the drive too: the scenario's expectations say.
        finding.met = finding.lost.is_empty() && finding.first_output_s.is_some();
    }
}
