//! Flash and RAM of a linked binary, from its sections.

use std::path::Path;

use anyhow::{Context, Result};
use object::elf::{SHF_ALLOC, SHF_EXECINSTR, SHF_WRITE};
use object::{Object, ObjectSection, SectionFlags, SectionKind};

/// Bytes by kind of section.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct SectionSizes {
    /// Code, with the constants that the compiler places among it.
    pub text: u64,
    /// Constants and vector table.
    pub rodata: u64,
    /// RAM with initial values, which flash holds as well.
    pub data: u64,
    /// RAM that starts as zero or uninitialised.
    pub bss: u64,
}

impl SectionSizes {
    /// Flash.
    pub fn flash(&self) -> u64 {
        self.text + self.rodata + self.data
    }

    /// Static RAM, without the stack.
    pub fn ram(&self) -> u64 {
        self.data + self.bss
    }
}

/// Reads a binary's sections.
pub fn sizes(path: &Path) -> Result<SectionSizes> {
    let bytes = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    let file = object::File::parse(&*bytes).with_context(|| format!("reading {} as ELF", path.display()))?;
    let mut sizes = SectionSizes::default();
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
        let has = |flag: u32| sh_flags & u64::from(flag) != 0;
        if !has(SHF_ALLOC) {
            continue;
        }
        let without_bits = section.kind() == SectionKind::UninitializedData;
        let kind = match (has(SHF_EXECINSTR), has(SHF_WRITE), without_bits) {
            (true, ..) => &mut sizes.text,
            (_, true, true) => &mut sizes.bss,
            (_, true, false) => &mut sizes.data,
            (_, false, _) => &mut sizes.rodata,
        };
        *kind += section.size();
    }
    Ok(sizes)
}
