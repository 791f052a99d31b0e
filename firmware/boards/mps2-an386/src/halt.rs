//! The halt: no frame leaves the board any more, so the actuators' own watchdogs take the torque away.

use core::panic::PanicInfo;

/// Stops for good. A watchdog that is not fed, or the operator, must reset the board.
pub fn halt() -> ! {
    cortex_m::interrupt::disable();
    loop {
        cortex_m::asm::wfi();
    }
}

/// Halts after a panic. The symbol check keeps a release from having one.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    halt()
}
