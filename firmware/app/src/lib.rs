//! Firmware application.
#![no_std]
