//! `host-sim pil`: the same samples through the firmware in QEMU, compared with the host bit for bit.
