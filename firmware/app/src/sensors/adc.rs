//! Analogue-to-digital conversion, and a driver of the MCP3208 (8 channels, 12 bits, SPI).
//!
//! The driver is the project's own: published ones for embedded-hal 1.0 ignore the null bit that the chip sends
//! before its data, so an absent or unpowered chip reads as a value; here it is an error. The chip has no register
//! and no state: one transaction of 24 clocks is one conversion (Microchip DS21298E, figure 6-1; SPI mode 0 or 3, at
//! most 1 MHz from a 2.7 V supply and 2 MHz from 5 V).

use embedded_hal_async::spi::SpiDevice;

/// Full scale: conversions are below it; the value itself would be the reference voltage.
pub const FULL_SCALE: u16 = 4096;

/// One conversion, in 1/4096 of the reference voltage: 0 to 4095.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdcCounts(u16);

impl AdcCounts {
    /// Counts of a converter; `None` above 4095.
    #[must_use]
    pub const fn new(counts: u16) -> Option<Self> {
        if counts < FULL_SCALE { Some(Self(counts)) } else { None }
    }

    /// Number of counts.
    #[must_use]
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Ratio to the reference voltage, 0 to 1.
    #[must_use]
    pub fn share(self) -> f32 {
        f32::from(self.0) / f32::from(FULL_SCALE)
    }
}

/// Reason why a conversion failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ConversionError {
    /// Bus error.
    Bus,
    /// No response on the data line: the chip is absent, unpowered, or not selected.
    NoAnswer,
}

/// Input of a converter, 0 to 7.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Input(u8);

impl Input {
    /// Number of inputs of the chip.
    pub const COUNT: u8 = 8;

    /// Input `number`, 0 to 7.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        if number < Self::COUNT { Some(Self(number)) } else { None }
    }

    /// Input number.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }
}

/// Converter of 12 bits. A board with an own converter implements this trait.
#[allow(async_fn_in_trait, reason = "called by tasks that are not sent between threads")]
pub trait Adc {
    /// Converts one input relative to ground.
    ///
    /// # Errors
    /// The reason why the conversion failed.
    async fn convert(&mut self, input: Input) -> Result<AdcCounts, ConversionError>;
}

/// MCP3208 with its own chip select.
#[derive(Debug)]
pub struct Mcp3208<S> {
    spi: S,
}

impl<S: SpiDevice> Mcp3208<S> {
    /// Driver of the chip behind an SPI device; needs no set-up.
    pub const fn new(spi: S) -> Self {
        Self { spi }
    }

    /// Releases the SPI device.
    pub fn release(self) -> S {
        self.spi
    }
}

impl<S: SpiDevice> Adc for Mcp3208<S> {
    async fn convert(&mut self, input: Input) -> Result<AdcCounts, ConversionError> {
        let mut bytes = request(input);
        if self.spi.transfer_in_place(&mut bytes).await.is_err() {
            return Err(ConversionError::Bus);
        }
        counts_of(bytes)
    }
}

/// Bytes to send: start bit, single-ended mode, three bits of the channel, padding.
#[must_use]
pub const fn request(input: Input) -> [u8; 3] {
    let channel = input.number();
    [0b0000_0110 | channel >> 2, (channel & 0b11) << 6, 0]
}

/// Conversion in the bytes received simultaneously: a null bit, then twelve bits.
const fn counts_of([_, high, low]: [u8; 3]) -> Result<AdcCounts, ConversionError> {
    const NULL_BIT: u8 = 1 << 4;
    if high & NULL_BIT != 0 {
        return Err(ConversionError::NoAnswer);
    }
    Ok(AdcCounts(u16::from_be_bytes([high & 0x0F, low])))
}
