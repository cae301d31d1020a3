//! Clock tree: processor at 170 MHz from the board's 24 MHz crystal, which also meets the tolerance of CAN.

use embassy_stm32::Config;
use embassy_stm32::rcc::{Hse, HseMode, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk, mux};
use embassy_stm32::time::Hertz;

/// Crystal X3 of the board.
const CRYSTAL: Hertz = Hertz(24_000_000);

/// 24 MHz / 6 * 85 / 2 = 170 MHz. CAN uses the crystal's clock directly: 250 kbit/s are 96 of its periods.
pub(crate) fn config() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: CRYSTAL, mode: HseMode::Oscillator });
    config.rcc.pll = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV6,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    config.rcc.sys = Sysclk::PLL1_R;
    config.rcc.boost = true;
    config.rcc.mux.fdcansel = mux::Fdcansel::HSE;
    config
}
