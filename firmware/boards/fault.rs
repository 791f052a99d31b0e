//! The end on the real boards: faults and panics.
//!
//! Fail-safe is silence. Nothing is sent any more, so the actuators' own watchdogs take the torque away, as they must when
//! a cable breaks. Then the watchdog resets the chip; the controller starts as emergency stopped and waits for the operator.

use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, exception};

/// Takes the buses off, and waits for the watchdog.
pub fn halt() -> ! {
    cortex_m::interrupt::disable();
    crate::silence();
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
