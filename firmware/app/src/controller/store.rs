//! Task `store`: opens what is kept in flash, hands calibration and learned health to the estimator, takes calibration
//! updates, and writes what must outlast a power cut.
//!
//! ```text
//! start: records put right --> calibration: stored, else default, else none (and that is said) --> estimate
//!        --> learned health, when it was learned with this very calibration --> estimate
//!        --> fault memory, hours, why the last run ended
//! then:  update commands as they come; once a second a look at what is due, one record at most
//! ```
//!
//! A write is awaited to its end, whatever else is due. The task is of the lowest priority, so a flash that works beside the
//! processor delays nobody; one that stops the processor shows as missed deadlines, which become a trouble of their own.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer, with_deadline};
use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::units::{Megapascal, Micros};

use super::keep::{Due, KeepParams, Schedule};
use super::note::{self, Note};
use super::{Controller, Pace, STORE_PERIOD, now};
use crate::apart::apart;
use crate::faults::Code;
use crate::j1939::CalibrationState;
use crate::log::{info, warning};
use crate::storage::{HealthRecord, Kind, Life, Live, Record, ResetCause, StopNote, StoreError};
use crate::update::{Handled, KeySource, Service, is_loaded};

/// Pressure difference from which a drive without a calibration counts as loaded.
const UNCALIBRATED_LEAST: Megapascal = Megapascal(2.0);
/// How often it is looked whether the estimator has taken what it was given.
const GLANCE: Duration = Duration::from_millis(2);

/// Why this run began.
#[derive(Debug, Clone)]
pub struct Begin {
    /// As the hardware tells.
    pub cause: ResetCause,
    /// What the run before left.
    pub note: Option<Note>,
}

/// The owner of everything that is kept.
pub struct Keeper<'d, F: NorFlash, K> {
    service: Service<'d, F, K>,
    schedule: Schedule,
    /// Hours and starts as they were at the start of this run.
    life: Life,
    least_difference: Megapascal,
    /// Level, its error and changes of learned health when it was last written.
    written: Option<(u32, u32, u16)>,
    faults_changed: bool,
    missed: u32,
}

impl<'d, F: NorFlash, K: KeySource> Keeper<'d, F, K> {
    /// Puts together what the task needs.
    pub const fn new(service: Service<'d, F, K>, rates: KeepParams) -> Self {
        Self {
            service,
            schedule: Schedule::new(rates),
            life: Life::new(),
            least_difference: UNCALIBRATED_LEAST,
            written: None,
            faults_changed: false,
            missed: 0,
        }
    }

    /// Store and session, for whoever looks at what was kept when the task is over.
    pub fn service(&mut self) -> &mut Service<'d, F, K> {
        &mut self.service
    }

    async fn open<M: RawMutex>(&mut self, controller: &Controller<M>, begin: Begin) {
        let mut crc = None;
        let least = &mut self.least_difference;
        let trouble = self.service.open(|live| crc = Some(adopt(controller, least, live))).await;
        if crc.is_none() {
            warning!("no calibration: nothing is estimated until one comes over the bus");
            controller.set_calibration(CalibrationState::default());
        }
        if let Some(code) = trouble {
            controller.confirmed(code);
        }
        while !controller.exchange.is_free() {
            Timer::after(GLANCE).await;
        }
        let read = self.service.store().read::<HealthRecord>().await;
        restore(controller, crc, read);
        if let Ok(Some(faults)) = self.service.store().read().await {
            controller.faults(|memory| memory.restore(faults));
        }
        if let Ok(Some(life)) = self.service.store().read().await {
            self.life = life;
        }
        self.begin(controller, begin).await;
    }

    async fn begin<M: RawMutex>(&mut self, controller: &Controller<M>, begin: Begin) {
        let Begin { cause, note } = begin;
        let cause = note::cause_of(cause, note.as_ref());
        controller.set_operated_before(self.life.operating_s);
        if let Some(code) = cause.trouble() {
            controller.happened(code);
        }
        self.life.started(cause);
        info!(
            "start {=u32} after {=u32} s of operation, by {}",
            self.life.starts, self.life.operating_s, cause
        );
        self.keep(controller, &self.life.clone()).await;
        if let Some(note) = note {
            self.keep(controller, &StopNote { operating_s: self.life.operating_s, note }).await;
        }
    }

    /// Takes a tool's command and leaves the answer for the bus.
    async fn take<M: RawMutex>(&mut self, controller: &Controller<M>, tool: u8, command: [u8; 8]) {
        let loaded = controller.sample().is_none_or(|sample| is_loaded(&sample, self.least_difference));
        let least = &mut self.least_difference;
        let written = &mut self.written;
        let adopt = |live| {
            adopt(controller, least, live);
            *written = None;
        };
        controller.set_writing(Some(Kind::Calibration));
        let handled = self.service.receive(now(), tool, command, loaded, adopt).await;
        controller.set_writing(None);
        answer(controller, &handled);
    }

    /// What is due once a second.
    async fn turn<M: RawMutex>(&mut self, controller: &Controller<M>) {
        answer(controller, &self.service.poll(now()));
        self.look_for_overruns(controller);
        // Asked for a second ago.
        if let Some(learned) = controller.exchange.take_told() {
            self.keep(controller, &learned).await;
            return;
        }
        self.faults_changed |= controller.faults(|memory| memory.take_changed());
        let health = controller.output(now()).ok().map(|estimate| {
            let health = estimate.health;
            (health.level.get().to_bits(), health.level_se.get().to_bits(), health.changes)
        });
        let health_changed = health.is_some() && health != self.written;
        match self.schedule.due(now(), self.faults_changed, health_changed) {
            Due::Nothing => {}
            Due::Faults => {
                self.faults_changed = false;
                let copy = controller.faults(|memory| memory.clone());
                self.keep(controller, &copy).await;
            }
            Due::Health => {
                self.written = health;
                controller.exchange.ask();
            }
            Due::Life => {
                let life = self.life_at(now());
                self.keep(controller, &life).await;
            }
        }
    }

    fn life_at(&self, now: Micros) -> Life {
        let mut life = self.life;
        life.ran(u32::try_from(now.0 / 1_000_000).unwrap_or(u32::MAX));
        life
    }

    fn look_for_overruns<M: RawMutex>(&mut self, controller: &Controller<M>) {
        let missed =
            controller.vitals.read().iter().fold(0_u32, |sum, vital| sum.saturating_add(vital.missed));
        if missed > self.missed {
            warning!("{=u32} deadlines missed", missed);
            controller.happened(Code::Overrun);
        }
        self.missed = missed;
    }

    async fn keep<'r, M: RawMutex, R: Record<'r>>(&mut self, controller: &Controller<M>, record: &R) {
        controller.set_writing(Some(R::KIND));
        let result = apart!(self.service.keep(record));
        controller.set_writing(None);
        told(controller, result);
    }
}

fn told<M: RawMutex>(controller: &Controller<M>, result: Result<(), StoreError>) {
    match result {
        Ok(()) => controller.healed(Code::StorageFailed),
        Err(error) => {
            warning!("the flash refuses: {}", error);
            controller.confirmed(Code::StorageFailed);
        }
    }
}

/// Hands a calibration to the estimator; its CRC.
fn adopt<M: RawMutex>(controller: &Controller<M>, least: &mut Megapascal, live: Live) -> u32 {
    *least = live.params.limits().min_pressure_difference;
    let crc = live.state.crc;
    controller.exchange.put_calibration(live.params, live.state);
    crc
}

/// Hands learned health to the estimator, when it was learned with the calibration in use and is sound.
fn restore<M: RawMutex>(
    controller: &Controller<M>,
    crc: Option<u32>,
    read: Result<Option<HealthRecord>, StoreError>,
) {
    let (Some(crc), Ok(Some(record))) = (crc, read) else { return };
    match record.for_calibration(crc) {
        Some(state) if state.is_sound() => controller.exchange.put_learned(state),
        _ => warning!("learned health is of another calibration: it is learned anew"),
    }
}

fn answer<M: RawMutex>(controller: &Controller<M>, handled: &Handled) {
    if let Some(code) = handled.trouble {
        controller.happened(code);
    }
    if let Some((tool, answer)) = handled.answer {
        // A tool that asks faster than the bus takes answers loses them, and asks again.
        controller.answers.try_send((tool, answer.to_bytes())).ok();
    }
}

/// Keeps for ever.
pub async fn run_store<M: RawMutex, F: NorFlash, K: KeySource>(
    controller: &Controller<M>,
    start: Instant,
    begin: Begin,
    keeper: &mut Keeper<'_, F, K>,
) -> ! {
    keeper.open(controller, begin).await;
    let mut pace = Pace::new(start, STORE_PERIOD, &controller.vitals.store);
    loop {
        let due = pace.end();
        // Commands in between; not without end, or a tool that floods would keep the task from its turns.
        while Instant::now() < due {
            match with_deadline(due, controller.commands.receive()).await {
                Ok((tool, command)) => keeper.take(controller, tool, command).await,
                Err(_) => break,
            }
        }
        pace.begin();
        keeper.turn(controller).await;
    }
}
