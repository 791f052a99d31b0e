//! Halt of the real boards after a fault or a panic.
//!
//! The halted board is silent, which is fail-safe: the actuators' own watchdogs switch torque off, as they must when a cable
//! breaks. Then the watchdog resets the chip. The controller starts in the emergency-stopped state and waits for the operator.

use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, exception};

/// Disconnects from the buses, and waits for the watchdog.
pub fn halt() -> ! {
    cortex_m::interrupt::disable();
    crate::silence();
    loop {
        cortex_m::asm::nop();
    }
}

/// Halts after a panic. The symbol check proves that a release contains no panic.
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
