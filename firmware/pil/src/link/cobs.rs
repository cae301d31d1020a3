//! Consistent overhead byte stuffing (COBS; Cheshire and Baker, 1999): encodes a frame without zero bytes.
//!
//! Each block is a code byte `n` and `n - 1` bytes without zero; a zero follows it in the original unless `n` is 255
//! or the frame ends there. [`encode`] writes a whole frame at once; [`CobsDecoder`] decodes byte by byte.
//!
//! Own code, because the `cobs` crate omits the empty block behind a final block of 254 bytes that this link's frames
//! have.

/// Largest number of bytes in one block without its code byte.
const BLOCK: usize = 254;

/// Sufficient length for `len` encoded bytes, without the delimiter.
#[must_use]
pub const fn max_encoded_len(len: usize) -> usize {
    len + len / BLOCK + 1
}

/// Encodes `plain` into `out` without a delimiter and returns the length; `None` when it does not fit.
#[must_use]
pub fn encode(plain: &[u8], out: &mut [u8]) -> Option<usize> {
    let mut used: usize = 0;
    for mut run in plain.split(|&byte| byte == 0) {
        while let Some((block, rest)) = run.split_at_checked(BLOCK) {
            used = used.checked_add(put_block(block, out.get_mut(used..)?)?)?;
            run = rest;
        }
        used = used.checked_add(put_block(run, out.get_mut(used..)?)?)?;
    }
    Some(used)
}

/// Writes code byte and data of one block; at most [`BLOCK`] bytes, none of them zero.
fn put_block(block: &[u8], out: &mut [u8]) -> Option<usize> {
    let (code, rest) = out.split_first_mut()?;
    *code = u8::try_from(block.len()).ok()?.checked_add(1)?;
    let space = rest.get_mut(..block.len())?;
    for (slot, byte) in space.iter_mut().zip(block) {
        *slot = *byte;
    }
    block.len().checked_add(1)
}

/// Result of decoding one byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CobsEvent {
    /// No output: the code byte of a block without a preceding zero.
    Nothing,
    /// One byte of the frame.
    Byte(u8),
    /// End of a frame of at least one byte.
    End,
    /// End of a frame whose last block is truncated.
    Cut,
    /// Delimiter without a frame.
    Empty,
}

/// COBS decoder of a byte stream.
#[doc(alias = "byte stuffing")]
#[derive(Debug, Clone, Copy, Default)]
pub struct CobsDecoder {
    /// Bytes that remain in the present block.
    in_block: u8,
    /// Whether a zero separates the present block from the next.
    zero_due: bool,
    /// Whether a byte of the present frame has been received.
    begun: bool,
}

impl CobsDecoder {
    /// Decoder at the start of a frame.
    #[must_use]
    pub const fn new() -> Self {
        Self { in_block: 0, zero_due: false, begun: false }
    }

    /// Decodes the next byte.
    #[inline]
    pub fn push(&mut self, byte: u8) -> CobsEvent {
        if byte == 0 {
            let end = match (self.begun, self.in_block) {
                (false, _) => CobsEvent::Empty,
                (true, 0) => CobsEvent::End,
                (true, _) => CobsEvent::Cut,
            };
            *self = Self::new();
            return end;
        }
        self.begun = true;
        if let Some(left) = self.in_block.checked_sub(1) {
            self.in_block = left;
            return CobsEvent::Byte(byte);
        }
        let zero_before = self.zero_due;
        self.in_block = byte.wrapping_sub(1);
        self.zero_due = byte != u8::MAX;
        if zero_before { CobsEvent::Byte(0) } else { CobsEvent::Nothing }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    fn encoded(plain: &[u8]) -> Vec<u8> {
        let mut out = vec![0; max_encoded_len(plain.len())];
        let len = encode(plain, &mut out).unwrap();
        out.truncate(len);
        out
    }

    fn decoded(code: &[u8]) -> (Vec<u8>, CobsEvent) {
        let mut decoder = CobsDecoder::new();
        let mut plain = Vec::new();
        for &byte in code.iter().chain(&[0]) {
            match decoder.push(byte) {
                CobsEvent::Nothing => {}
                CobsEvent::Byte(byte) => plain.push(byte),
                end => return (plain, end),
            }
        }
        unreachable!("a zero ends every frame")
    }

    #[test]
    fn blocks_of_254_bytes_are_split_as_specified() {
        assert_eq!(encoded(&[0]), [1, 1]);
        assert_eq!(encoded(&[1, 2, 0, 3]), [3, 1, 2, 2, 3]);
        let long = [7; 255];
        let code = encoded(&long);
        assert_eq!((code[0], code[255], code[256]), (255, 2, 7));
    }

    #[test]
    fn buffer_one_byte_short_is_rejected() {
        for len in [0, 1, 253, 254, 255, 508] {
            let plain = vec![1; len];
            let needed = encoded(&plain).len();
            assert_eq!(encode(&plain, &mut vec![0; needed - 1]), None, "{len}");
        }
    }

    proptest! {
        /// Runs are generated so that lengths around 254 and many zeros both occur.
        #[test]
        fn encoded_bytes_have_no_zero_and_agree_with_the_cobs_crate(
            runs in prop::collection::vec((any::<u8>(), 0usize..520), 0..4),
        ) {
            let plain: Vec<u8> = runs.iter().flat_map(|&(byte, len)| vec![byte % 3; len]).collect();
            let code = encoded(&plain);
            prop_assert!(!code.contains(&0));
            prop_assert_eq!(decoded(&code), (plain.clone(), CobsEvent::End));
            prop_assert_eq!(&::cobs::decode_vec(&code).unwrap(), &plain);
            prop_assert_eq!(decoded(&::cobs::encode_vec(&plain)).0, plain);
        }
    }
}
