//! Service tool on the bus: sends the scenario's calibration updates, valid or not, and records the controller's answers.

use kou_app::j1939::catalogue::UPDATE_COMMAND;
use kou_app::j1939::{Frame, Id};
use kou_app::update::wire::UpdateAnswer;
use kou_app::update::{Key, UpdateTransfer};
use kou_emulation::CanFrame;
use kou_estimator::record;
use kou_estimator::{Calibration, Params};
use serde::Serialize;

use super::scenario::{Scenario, ScheduledUpdate};
use kou_records::InputError;

/// Source address of a service tool (SAE J1939-81).
const TOOL: u8 = 0xF9;
/// Silence of the controller after which the tool aborts an update, ms.
const TIMEOUT_MS: u64 = 500;

/// An update and its result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UpdateFinding {
    /// Begin, s.
    pub from_s: f64,
    /// Update counter.
    pub counter: u32,
    /// Expected result: `committed`, the name of a reject reason, or `silence`.
    pub expect: String,
    /// Result, unless the scenario ended before.
    pub came: Option<String>,
    /// Time of the result after the begin, s.
    pub after_s: Option<f64>,
    /// Whether the expected result came in time.
    pub met: bool,
}

struct UpdateTransaction {
    update: ScheduledUpdate,
    transfer: UpdateTransfer,
    params: Option<Params>,
    sent: usize,
    sent_ms: u64,
    begun_ms: Option<u64>,
    came: Option<(String, u64)>,
}

/// The service tool.
pub struct ServiceTool {
    transactions: Vec<UpdateTransaction>,
    controller: Option<u8>,
    ms: u64,
}

/// The controller's key in a scenario, derived from its seed.
#[must_use]
pub fn key_of(scenario: &Scenario) -> [u8; 32] {
    core::array::from_fn(|i| {
        (scenario.seed.rotate_left(8 * (i as u32 % 8)) as u8).wrapping_mul(167) ^ i as u8
    })
}

impl ServiceTool {
    /// The tool of a scenario.
    ///
    /// # Errors
    /// A calibration that fits no record.
    pub fn new(scenario: &Scenario, calibration: &Calibration) -> Result<Self, InputError> {
        let transactions = scenario.updates.iter().map(|update| {
            let error = |e: String| InputError::new(format!("update at {} s: {e}", update.from_s));
            let mut candidate = calibration.clone();
            candidate.law.c += update.law_c as f32;
            if update.other_machine {
                candidate.machine.name = heapless::String::try_from("another machine").unwrap_or_default();
            }
            let mut buffer = [0; record::calibration::MAX_LEN];
            let length =
                record::calibration::encode(&candidate, &mut buffer).map_err(|e| error(e.to_string()))?;
            let mut key = key_of(scenario);
            if update.wrong_key {
                key.reverse();
            }
            let bytes = buffer.get(..length).unwrap_or_default();
            let transfer = UpdateTransfer::new(bytes, update.counter, &Key::new(key))
                .map_err(|e| error(e.to_string()))?;
            Ok(UpdateTransaction {
                update: update.clone(),
                transfer,
                params: Params::new(&candidate).ok(),
                sent: 0,
                sent_ms: 0,
                begun_ms: None,
                came: None,
            })
        });
        Ok(Self { transactions: transactions.collect::<Result<_, InputError>>()?, controller: None, ms: 0 })
    }

    /// One millisecond: receives the controller's frames, and returns the next frame to send.
    pub fn millisecond(&mut self, time_s: f64, received: &[CanFrame]) -> Option<CanFrame> {
        self.ms += 1;
        let mut answer = None;
        for (id, data) in received {
            let id = Id::from_raw(*id);
            self.controller = Some(id.source());
            if id.pgn() == UPDATE_COMMAND.pgn && id.destination() == TOOL {
                answer = data.as_slice().try_into().ok().and_then(UpdateAnswer::from_bytes);
            }
        }
        let (ms, controller) = (self.ms, self.controller?);
        let under_way = self.transactions.iter_mut().find(|one| one.came.is_none())?;
        if time_s < under_way.update.from_s {
            return None;
        }
        let begun_ms = *under_way.begun_ms.get_or_insert(ms);
        let ended = match answer {
            Some(UpdateAnswer::Committed { .. }) => Some("committed".to_owned()),
            Some(UpdateAnswer::Rejected { reason: why, .. }) => Some(why.name().to_owned()),
            None if under_way.sent > 0 && ms - under_way.sent_ms > TIMEOUT_MS => Some("silence".to_owned()),
            None if under_way.sent > 0 => return None,
            _ => None,
        };
        if let Some(ended) = ended {
            under_way.came = Some((ended, ms - begun_ms));
            return None;
        }
        let command = under_way.transfer.command(under_way.sent)?;
        under_way.sent += 1;
        under_way.sent_ms = ms;
        let id = Id::new(UPDATE_COMMAND.priority, UPDATE_COMMAND.pgn, controller, TOOL);
        let frame = Frame::new(id, command.to_bytes());
        Some((frame.id().raw(), heapless::Vec::from_slice(frame.data()).ok()?))
    }

    /// Parameters of the updates, in their order, and whether the controller may already use them.
    pub fn candidates(&self) -> impl Iterator<Item = (&Params, bool)> {
        self.transactions.iter().filter_map(|one| {
            // Without an answer it may or may not have been stored.
            let may = one.sent > 0
                && one.came.as_ref().is_none_or(|(came, _)| came == "committed" || came == "silence");
            one.params.as_ref().map(|params| (params, may))
        })
    }

    /// Results of all updates.
    #[must_use]
    pub fn findings(&self) -> Vec<UpdateFinding> {
        let of = |one: &UpdateTransaction| {
            let came = one.came.as_ref().map(|(came, _)| came.clone());
            let after_s = one.came.as_ref().map(|(_, ms)| *ms as f64 * 1e-3);
            UpdateFinding {
                from_s: one.update.from_s,
                counter: one.update.counter,
                expect: one.update.expect.clone(),
                met: came.as_deref() == Some(one.update.expect.as_str())
                    && after_s.is_some_and(|after_s| after_s <= one.update.within_s),
                came,
                after_s,
            }
        };
        self.transactions.iter().map(of).collect()
    }
}
