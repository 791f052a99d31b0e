//! The end: faults and panics.
//!
//! Fail-safe is silence. Nothing is sent any more, so the actuators' own watchdogs take the
//! torque away, as they must when a cable breaks. Then the independent watchdog resets the chip; the
//! controller starts as emergency stopped and waits for the operator.

use crate::{can, flash, line};
use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, exception};

/// Takes the buses off, and waits for the watchdog.
pub fn halt() -> ! {
    cortex_m::interrupt::disable();
    can::silence();
    line::silence();
    loop {
        cortex_m::asm::nop();
    }
}

/// Stops after a panic. The symbol check keeps a release from having one.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    halt()
}

// SAFETY: does not return.
#[exception]
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    halt()
}

// SAFETY: does not return.
#[exception]
unsafe fn DefaultHandler(_: i16) {
    halt()
}

/// A word of the library's flash that cannot be corrected is noted. Every other cause is the end: the
/// crystal has stopped, or the program's own flash is broken.
// SAFETY: touches an atomic and the flash's error register.
#[exception]
unsafe fn NonMaskableInt() {
    if !flash::note_broken_word() {
        halt()
    }
}
