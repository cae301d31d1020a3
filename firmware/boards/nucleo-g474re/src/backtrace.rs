//! Stack and program memory of this chip for [`kou_app::diagnostics::backtrace`].

use core::ops::Range;

use kou_app::diagnostics::backtrace::CodeMemory;

#[allow(unsafe_code, reason = "symbols of the linker, of which only the addresses are taken")]
// SAFETY: cortex-m-rt's script defines them: beginning of the stack, which grows downwards; begin and end of the code.
unsafe extern "C" {
    static _stack_start: u32;
    static __stext: u32;
    static __etext: u32;
}

/// Code in flash.
pub(crate) struct CodeFlash;

impl CodeMemory for CodeFlash {
    fn code(&self) -> Range<u32> {
        address(&raw const __stext)..address(&raw const __etext)
    }

    fn halfword(&self, at: u32) -> u16 {
        #[allow(unsafe_code, reason = "the program is read as memory")]
        // SAFETY: called for even addresses within the code only, which is flash that nobody writes.
        unsafe {
            core::ptr::with_exposed_provenance::<u16>(at as usize).read_volatile()
        }
    }
}

fn address(of: *const u32) -> u32 {
    of.expose_provenance() as u32
}

/// Words of the stack from the present frame to its beginning.
pub(crate) fn stack() -> impl Iterator<Item = u32> {
    let here = 0_u32;
    let words = address(&raw const here)..address(&raw const _stack_start);
    words.step_by(4).map(|at| {
        #[allow(unsafe_code, reason = "the stack is read as memory")]
        // SAFETY: a whole word of RAM between a variable on the stack and the stack's beginning.
        unsafe {
            core::ptr::with_exposed_provenance::<u32>(at as usize).read_volatile()
        }
    })
}
