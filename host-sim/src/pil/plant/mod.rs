//! Closed loop: a simulated vehicle around the controller's firmware in QEMU.
//!
//! ```text
//! scenario --> vehicle --> sensor emulator --> controller: firmware in QEMU
//!     |           `--- true state ---> check <--- estimates ---'
//!     `--------- expectations -----------^
//! ```
//!
//! | module | duty |
//! |---|---|
//! | `scenario` | scenario files: driver commands, sensor failures, power cuts, updates, expectations |
//! | `vehicle` | pump, motor and circuit: the lumped model, or a fast surrogate |
//! | `sensor_emulator` | transducers, analogue-digital converter and toothed wheels, with electrical failures |
//! | `can_bus`, `service_tool` | the other nodes: random traffic, and a tool that sends calibration updates |
//! | `emulated_flash`, `outage` | flash whose supply fails within a write, and the audit of the stored records afterwards |
//! | `controller` | the firmware in QEMU, in lockstep with the host |
//! | `scenario_check`, `calibration_in_use` | observers of the outputs |
//! | `closed_loop`, `report` | the loop over all of them, and its results |
//!
//! Time advances by milliseconds, in lockstep: the firmware's millisecond ends when the host has answered it. All random
//! numbers come from the scenario's seed, so the same scenario gives the same bits.

mod calibration_in_use;
mod can_bus;
mod closed_loop;
mod controller;
mod emulated_flash;
mod error;
mod outage;
mod report;
mod scenario;
mod scenario_check;
mod sensor_emulator;
mod service_tool;
mod vehicle;

pub use calibration_in_use::{CalibrationTracker, LawFinding};
pub use can_bus::{BusTraffic, SimulatedCanBus};
pub use closed_loop::run;
pub use controller::{ControllerEvent, EmulatedController};
pub use emulated_flash::{EmulatedFlash, StoredRecords};
pub use error::LoopError;
pub use outage::{OutageFinding, Outages, SETTLED_S};
pub use report::LoopReport;
pub use scenario::{DriverCommand, FailureMode, Scenario, Sensor};
pub use scenario_check::{ExpectationFinding, ScenarioCheck};
pub use sensor_emulator::SensorEmulator;
pub use service_tool::{ServiceTool, UpdateFinding, key_of};
pub use vehicle::{Vehicle, VehicleTruth};

/// Name of the firmware's binary that the closed loop runs.
pub const CONTROLLER: &str = "kou-qemu-controller";
