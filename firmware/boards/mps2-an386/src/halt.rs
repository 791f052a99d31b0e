//! Halt of the board: no further frame is sent, so the actuators' own watchdogs switch torque off.

use core::panic::PanicInfo;

/// Stops until the board is reset, by the operator or by a watchdog that is no longer fed.
pub fn halt() -> ! {
    cortex_m::interrupt::disable();
    loop {
        cortex_m::asm::wfi();
    }
}

/// Halts after a panic. The symbol check proves that a release contains no panic.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    halt()
}
