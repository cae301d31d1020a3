//! Access to 32-bit registers by address: the only place where a number becomes a pointer.

/// Reads the register at `address`.
#[allow(unsafe_code, reason = "a register is reached by its address")]
pub(crate) fn read(address: usize) -> u32 {
    // SAFETY: every caller passes the constant address of a register of this board, aligned to four bytes. Reading one
    // has no effect on memory.
    unsafe { core::ptr::with_exposed_provenance::<u32>(address).read_volatile() }
}

/// Writes the register at `address`.
#[allow(unsafe_code, reason = "a register is reached by its address")]
pub(crate) fn write(address: usize, value: u32) {
    // SAFETY: as for `read`. None of the registers written on this board makes a peripheral touch memory.
    unsafe { core::ptr::with_exposed_provenance_mut::<u32>(address).write_volatile(value) }
}
