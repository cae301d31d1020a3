//! Sensor tests on the host: against independent arithmetic, hostile input, and a mocked bus.

mod adc;
mod analog;
mod pickup;
mod scale;
mod set;
mod wheel;
