//! Thumb-2 decoder for stack depth: movements of the stack pointer, calls and branches.
//!
//! Only the encodings that move the stack pointer or leave the function are distinguished (Arm v7-M Architecture Reference
//! Manual, chapter A7); everything else is skipped by its length. An instruction that may move the stack pointer by an amount
//! not encoded in it is reported as such, so that a bound is never silently too small.

/// Effect of one instruction on stack and control flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StackEffect {
    /// Nothing of interest.
    None,
    /// Pushes that many bytes.
    Pushes(u32),
    /// Moves the stack pointer by an amount not known here.
    PushesUnknown,
    /// Calls an address in the code.
    Calls(u32),
    /// Branches to an address in the code; out of the function, that is a tail call.
    Branches(u32),
    /// Calls or jumps to an address held in a register.
    BranchesUnknown,
}

/// Length in bytes and effect of the instruction at `address`; nothing at the end of the code.
pub fn decode(code: &[u8], address: u32) -> Option<(usize, StackEffect)> {
    let first = half(code, 0)?;
    if let Some(lost) = aligned(code) {
        return Some((8, StackEffect::Pushes(lost)));
    }
    if releases_stack(code) == Some(true) {
        return Some((2, StackEffect::None));
    }
    // 0b11101, 0b11110 and 0b11111 begin an instruction of two halfwords.
    if first >> 11 < 0b11101 {
        return Some((2, narrow(first, address)));
    }
    Some((4, wide(first, half(code, 2)?, address)))
}

/// Largest loss where a function aligns its stack: MOV Rn, sp; BFC Rn, #0, #width; MOV sp, Rn.
fn aligned(code: &[u8]) -> Option<u32> {
    let (copy, clear, bits, back) = (half(code, 0)?, half(code, 2)?, half(code, 4)?, half(code, 6)?);
    let register = copy & 0x7;
    let is_it = copy & 0xfff8 == 0x4668
        && clear == 0xf36f
        && bits & 0xffe0 == register << 8
        && back == 0x4685 | register << 3;
    is_it.then(|| (2 << (bits & 0x1f)) - 1)
}

/// True where a function releases its stack: MOV sp, Rn right before the saved registers are popped (POP, POP.W or VPOP).
fn releases_stack(code: &[u8]) -> Option<bool> {
    let (back, next) = (half(code, 0)?, half(code, 2)?);
    let is_pop = next & 0xfe00 == 0xbc00 || next == 0xe8bd || next & 0xffbf == 0xecbd;
    Some(back & 0xff87 == 0x4685 && is_pop)
}

fn half(code: &[u8], at: usize) -> Option<u32> {
    let bytes = code.get(at..at + 2)?;
    Some(u32::from(u16::from_le_bytes(bytes.try_into().ok()?)))
}

fn narrow(i: u32, address: u32) -> StackEffect {
    let to = |offset: u32| StackEffect::Branches(address.wrapping_add(4).wrapping_add(offset));
    if i & 0xfe00 == 0xb400 {
        // PUSH {registers, lr}
        StackEffect::Pushes(4 * (i & 0x01ff).count_ones())
    } else if i & 0xff80 == 0xb080 {
        // SUB sp, #imm7*4
        StackEffect::Pushes(4 * (i & 0x7f))
    } else if i & 0xff87 == 0x4485 || (i & 0xff87 == 0x4685 && i & 0x78 != 0x38) {
        // ADD sp, Rm; MOV sp, Rm, except from the frame pointer r7, which releases stack.
        StackEffect::PushesUnknown
    } else if i & 0xff00 == 0x4700 {
        // BLX Rm calls; BX lr returns; BX of another register is a tail call.
        if i & 0x80 == 0 && i & 0x78 == 0x70 { StackEffect::None } else { StackEffect::BranchesUnknown }
    } else if i & 0xff87 == 0x4687 && i & 0x78 != 0x70 {
        // MOV pc, Rm
        StackEffect::BranchesUnknown
    } else if i & 0xf000 == 0xd000 && (i >> 8) & 0xf < 0xe {
        // B<cond>
        to(sign_extend(i & 0xff, 8) << 1)
    } else if i & 0xf800 == 0xe000 {
        // B
        to(sign_extend(i & 0x7ff, 11) << 1)
    } else {
        StackEffect::None
    }
}

fn wide(i: u32, j: u32, address: u32) -> StackEffect {
    let to = |offset: u32| StackEffect::Branches(address.wrapping_add(4).wrapping_add(offset));
    if i & 0xf800 == 0xf000 && j & 0x9000 == 0x9000 {
        // BL and B.W: the same offset.
        let s = (i >> 10) & 1;
        let i1 = !((j >> 13) ^ s) & 1;
        let i2 = !((j >> 11) ^ s) & 1;
        let offset = (s << 24) | (i1 << 23) | (i2 << 22) | ((i & 0x3ff) << 12) | ((j & 0x7ff) << 1);
        let target = sign_extend(offset, 25);
        if j & 0x4000 == 0 {
            to(target)
        } else {
            StackEffect::Calls(address.wrapping_add(4).wrapping_add(target))
        }
    } else if i & 0xf800 == 0xf000 && j & 0xd000 == 0x8000 && (i >> 6) & 0xf < 0xe {
        // B<cond>.W
        let s = (i >> 10) & 1;
        let (j1, j2) = ((j >> 13) & 1, (j >> 11) & 1);
        let offset = (s << 20) | (j2 << 19) | (j1 << 18) | ((i & 0x3f) << 12) | ((j & 0x7ff) << 1);
        to(sign_extend(offset, 21))
    } else if i == 0xe92d {
        // PUSH.W
        StackEffect::Pushes(4 * j.count_ones())
    } else if i == 0xf84d && j & 0x0f00 == 0x0d00 {
        // STR Rt, [sp, #-imm8]!
        StackEffect::Pushes(j & 0xff)
    } else if i == 0xe96d {
        // STRD Rt, Rt2, [sp, #-imm8*4]!
        StackEffect::Pushes(4 * (j & 0xff))
    } else if i & 0xffbf == 0xed2d {
        // VPUSH
        StackEffect::Pushes(4 * (j & 0xff))
    } else if i & 0xfbef == 0xf1ad && j & 0x8f00 == 0x0d00 {
        // SUB.W sp, sp, #const
        StackEffect::Pushes(expand_constant(((i & 0x0400) << 1) | ((j & 0x7000) >> 4) | (j & 0xff)))
    } else if i & 0xfbff == 0xf2ad && j & 0x8f00 == 0x0d00 {
        // SUBW sp, sp, #imm12
        StackEffect::Pushes(((i & 0x0400) << 1) | ((j & 0x7000) >> 4) | (j & 0xff))
    } else if (i & 0xffef == 0xebad || i & 0xffef == 0xeb0d) && j & 0x0f00 == 0x0d00 {
        // SUB.W, ADD.W sp, sp, Rm
        StackEffect::PushesUnknown
    } else if (i & 0xff70 == 0xf850 && j & 0xf000 == 0xf000) && i & 0xf != 0xd {
        // LDR pc, [Rn]; from the stack it is a return.
        StackEffect::BranchesUnknown
    } else {
        StackEffect::None
    }
}

fn sign_extend(value: u32, bits: u32) -> u32 {
    (((value << (32 - bits)) as i32) >> (32 - bits)) as u32
}

/// ThumbExpandImm of the 12 bits `i:imm3:imm8`.
fn expand_constant(bits: u32) -> u32 {
    let byte = bits & 0xff;
    match bits >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (0x80 | (bits & 0x7f)).rotate_right(bits >> 7),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Halfwords as a disassembler shows them.
    fn effect(halves: &[u16], address: u32) -> StackEffect {
        let code: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
        let (length, effect) = decode(&code, address).unwrap();
        assert_eq!(length, code.len());
        effect
    }

    #[test]
    fn every_encoding_that_pushes_is_counted() {
        // The halfwords are those of LLVM's assembler for the instruction in the comment.
        for (halves, bytes) in [
            (&[0xb5f0][..], 20),                     // push {r4, r5, r6, r7, lr}
            (&[0xb082], 8),                          // sub sp, #8
            (&[0xe92d, 0x4ff0], 36),                 // push.w {r4-r11, lr}
            (&[0xf84d, 0xbd04], 4),                  // str r11, [sp, #-4]!
            (&[0xed2d, 0x8b10], 64),                 // vpush {d8-d15}
            (&[0xed2d, 0x8a02], 8),                  // vpush {s16, s17}
            (&[0xf5ad, 0x7d00], 512),                // sub.w sp, sp, #512
            (&[0xf6ad, 0x5d24], 0xd24),              // subw sp, sp, #3364
            (&[0xf1ad, 0x0d0c], 12),                 // sub.w sp, sp, #12
            (&[0x466c, 0xf36f, 0x0403, 0x46a5], 15), // mov r4, sp; bfc r4, #0, #4; mov sp, r4
        ] {
            assert_eq!(effect(halves, 0), StackEffect::Pushes(bytes), "{halves:x?}");
        }
    }

    #[test]
    fn releasing_stack_pushes_nothing() {
        // pop {r7, pc}; add sp, #8; mov sp, r7; sub.w sp, r7, #8; vpop {d8}; bx lr
        for halves in [&[0xbd80][..], &[0xb002], &[0x46bd], &[0xf1a7, 0x0d08], &[0xecbd, 0x8b02], &[0x4770]] {
            assert_eq!(effect(halves, 0), StackEffect::None, "{halves:x?}");
        }
    }

    #[test]
    fn stack_pointer_from_a_register_is_known_only_right_before_a_pop() {
        let code = |halves: &[u16]| halves.iter().flat_map(|half| half.to_le_bytes()).collect::<Vec<u8>>();
        // mov sp, r4; pop.w {r8-r11}
        assert_eq!(decode(&code(&[0x46a5, 0xe8bd, 0x0f00]), 0), Some((2, StackEffect::None)));
        // mov sp, r4; nop
        assert_eq!(decode(&code(&[0x46a5, 0xbf00]), 0), Some((2, StackEffect::PushesUnknown)));
    }

    #[test]
    fn calls_and_branches_go_where_a_disassembler_says() {
        assert_eq!(effect(&[0xf000, 0xf801], 0x100), StackEffect::Calls(0x106)); // bl +2
        assert_eq!(effect(&[0xf7ff, 0xfffe], 0x4), StackEffect::Calls(0x4)); // bl to itself
        assert_eq!(effect(&[0xf7ff, 0xbffe], 0x40), StackEffect::Branches(0x40)); // b.w to itself
        assert_eq!(effect(&[0xe7fe], 0x40), StackEffect::Branches(0x40)); // b to itself
        assert_eq!(effect(&[0xd83a], 0x1baa), StackEffect::Branches(0x1c22)); // bhi
    }

    #[test]
    fn what_has_no_bound_is_reported() {
        assert_eq!(effect(&[0x4798], 0), StackEffect::BranchesUnknown); // blx r3
        assert_eq!(effect(&[0x4718], 0), StackEffect::BranchesUnknown); // bx r3
        assert_eq!(effect(&[0xebad, 0x0d03], 0), StackEffect::PushesUnknown); // sub.w sp, sp, r3
        assert_eq!(effect(&[0x44ad], 0), StackEffect::PushesUnknown); // add sp, r5
    }
}
