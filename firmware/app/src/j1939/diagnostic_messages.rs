//! Diagnostic messages DM1 and DM2 (SAE J1939-73): lamp status followed by four bytes per trouble code.

use heapless::Vec;

use super::catalogue::{AMBER_LAMP, DTC_COUNT, DTC_FMI, DTC_METHOD, DTC_SPN_HIGH, DTC_SPN_LOW};
use super::catalogue::{MALFUNCTION_LAMP, PROTECT_LAMP, RED_LAMP};
use super::transport::MAX_LEN;
use crate::diagnostics::{DtcList, DtcReport, Lamp};

/// List of trouble codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DtcListKind {
    /// Active trouble codes: DM1.
    Active,
    /// Previously active trouble codes: DM2.
    Previous,
}

/// Padding behind a trouble code in a single frame.
const PADDING: usize = 2;

/// Writes one trouble code into bytes 2 to 5 of a frame; zeros for none.
fn with_dtc(mut data: [u8; 8], dtc: Option<&DtcReport>) -> [u8; 8] {
    let (spn, fmi, count) =
        dtc.map_or((0, 0, 0), |report| (report.dtc.spn, report.dtc.fmi, report.occurrences));
    DTC_SPN_LOW.put_bits(&mut data, spn);
    DTC_SPN_HIGH.put_bits(&mut data, spn >> 16);
    DTC_FMI.put_bits(&mut data, u32::from(fmi));
    DTC_COUNT.put_bits(&mut data, u32::from(count));
    DTC_METHOD.put_bits(&mut data, 0);
    data
}

/// Bytes of a list: eight for at most one trouble code, sent in one frame; more otherwise.
#[must_use]
pub fn list(dtcs: &DtcList, which: DtcListKind) -> Vec<u8, MAX_LEN> {
    let mut head = [0xFF; 8];
    for lamp in [&PROTECT_LAMP, &RED_LAMP, &MALFUNCTION_LAMP] {
        lamp.put_raw(&mut head, 0);
    }
    AMBER_LAMP.put_raw(&mut head, u32::from(dtcs.lamp() == Lamp::Amber));
    let is_active = which == DtcListKind::Active;
    let mut entries = dtcs.all().iter().filter(|report| report.active == is_active);
    let first = with_dtc(head, entries.next());
    let mut rest = entries.peekable();
    // A list in a single frame is padded to eight bytes; a longer one is not.
    let length = if rest.peek().is_none() { first.len() } else { first.len() - PADDING };
    let rest = rest.flat_map(|report| {
        let [_, _, dtc @ .., _, _] = with_dtc(head, Some(report));
        dtc
    });
    let mut bytes = Vec::new();
    // The list has room for a full fault memory, so nothing is omitted.
    first.into_iter().take(length).chain(rest).map_while(|byte| bytes.push(byte).ok()).for_each(|()| ());
    bytes
}

#[cfg(test)]
mod tests {
    use kou_estimator::{Channel, Fault};

    use super::*;
    use crate::diagnostics::{FaultCode, FaultMemory, FreezeFrame};

    #[test]
    fn lists_agree_with_the_standard_layout() {
        let mut memory = FaultMemory::new();
        // No trouble code: zeros in its place.
        assert_eq!(list(&memory.reports(), DtcListKind::Active)[..], [0, 0xFF, 0, 0, 0, 0, 0xFF, 0xFF]);
        memory.confirm(FaultCode::Sensor(Channel::HighPressure, Fault::Open), FreezeFrame::at(1));
        // SPN 1762 = 0x006E2, FMI 5, once.
        assert_eq!(
            list(&memory.reports(), DtcListKind::Active)[..],
            [4, 0xFF, 0xE2, 0x06, 0x05, 1, 0xFF, 0xFF]
        );
        memory.confirm(FaultCode::Wear, FreezeFrame::at(1));
        // SPN 520192 = 0x7F000: 7 in the three high bits of the FMI's byte.
        assert_eq!(
            list(&memory.reports(), DtcListKind::Active)[..],
            [4, 0xFF, 0xE2, 0x06, 0x05, 1, 0x00, 0xF0, 0xF0, 1]
        );
        memory.heal(FaultCode::Wear);
        assert_eq!(
            list(&memory.reports(), DtcListKind::Previous)[..],
            [4, 0xFF, 0x00, 0xF0, 0xF0, 1, 0xFF, 0xFF]
        );
        for code in FaultCode::all() {
            memory.confirm(code, FreezeFrame::at(2));
        }
        assert_eq!(list(&memory.reports(), DtcListKind::Active).len(), MAX_LEN);
    }
}
