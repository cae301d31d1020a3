//! Driver of the MCP3208 on a mocked SPI bus.

use embassy_futures::block_on;
use embedded_hal_mock::eh1::spi::{Mock, Transaction};

use crate::sensors::adc::{Adc, AdcCounts, ConversionError, Input, Mcp3208};

/// One transaction: bytes out, bytes in, between select and release.
fn exchange(out: [u8; 3], back: [u8; 3]) -> [Transaction<u8>; 3] {
    [
        Transaction::transaction_start(),
        Transaction::transfer_in_place(out.to_vec(), back.to_vec()),
        Transaction::transaction_end(),
    ]
}

fn convert(out: [u8; 3], back: [u8; 3], input: u8) -> Result<AdcCounts, ConversionError> {
    let mock = Mock::new(&exchange(out, back));
    let mut adc = Mcp3208::new(mock);
    let conversion = block_on(adc.convert(Input::new(input).unwrap()));
    adc.release().done();
    conversion
}

#[test]
fn each_input_is_requested_as_in_the_data_sheet() {
    // Start bit, SGL/DIFF high, D2 D1 D0: figure 6-1 of the data sheet, written out.
    let asked = [
        [0x06, 0x00, 0x00],
        [0x06, 0x40, 0x00],
        [0x06, 0x80, 0x00],
        [0x06, 0xC0, 0x00],
        [0x07, 0x00, 0x00],
        [0x07, 0x40, 0x00],
        [0x07, 0x80, 0x00],
        [0x07, 0xC0, 0x00],
    ];
    for (input, bytes) in (0..).zip(asked) {
        assert_eq!(convert(bytes, [0, 0x0A, 0xBC], input), Ok(AdcCounts::new(0xABC).unwrap()));
    }
    assert_eq!(Input::new(8), None);
}

#[test]
fn every_count_is_read_whatever_precedes_the_null_bit() {
    for counts in 0..4096_u16 {
        let [high, low] = counts.to_be_bytes();
        for noise in [0x00, 0xE0] {
            let conversion = convert([0x06, 0, 0], [0xFF, high | noise, low], 0);
            assert_eq!(conversion.map(AdcCounts::get), Ok(counts));
        }
    }
    assert_eq!(AdcCounts::new(4096), None);
}

#[test]
fn chip_that_does_not_drive_the_line_is_an_error() {
    assert_eq!(convert([0x06, 0, 0], [0xFF; 3], 0), Err(ConversionError::NoAnswer));
}

#[test]
fn bus_failure_is_an_error() {
    #[derive(Debug)]
    struct Broken;
    impl embedded_hal_async::spi::Error for Broken {
        fn kind(&self) -> embedded_hal_async::spi::ErrorKind {
            embedded_hal_async::spi::ErrorKind::Other
        }
    }
    impl embedded_hal_async::spi::ErrorType for Broken {
        type Error = Broken;
    }
    impl embedded_hal_async::spi::SpiDevice for Broken {
        async fn transaction(
            &mut self,
            _: &mut [embedded_hal_async::spi::Operation<'_, u8>],
        ) -> Result<(), Broken> {
            Err(Broken)
        }
    }
    let conversion = block_on(Mcp3208::new(Broken).convert(Input::new(0).unwrap()));
    assert_eq!(conversion, Err(ConversionError::Bus));
}
