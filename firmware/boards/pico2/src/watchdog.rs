//! The watchdog, which counts microseconds of the crystal (RP2350 datasheet, 12.9).

use embassy_rp::pac::{PSM, WATCHDOG};

/// The longest that the control loop may stop for is a library being checked or a sector of flash erased, while disarmed:
/// at most about half a second each. The servos' own watchdogs are the fast ones.
const TIMEOUT_US: u32 = 1_000_000;
/// Everything but the oscillators, bits 2 and 3 (7.4.5).
const ALL_BUT_OSCILLATORS: u32 = 0x01FF_FFF3;

/// Mark in a register that a watchdog reset preserves: the boot ROM's own restarts, as after a copied UF2 file, use the watchdog,
/// too.
const RUNNING: u32 = 0x526F_6C6C;

/// True if the last reset was caused by a stopped control loop; clears the cause.
pub fn take_expired() -> bool {
    let was_running = WATCHDOG.scratch0().read() == RUNNING;
    WATCHDOG.scratch0().write_value(0);
    was_running && WATCHDOG.reason().read().timer()
}

/// A watchdog that runs: a second without [`feed`](Self::feed) resets the chip.
pub struct Watchdog(());

impl Watchdog {
    /// Starts it; it goes on while a debugger halts the processor.
    pub fn start() -> Self {
        WATCHDOG.ctrl().write(|w| w.set_enable(false));
        PSM.wdsel().write(|w| w.0 = ALL_BUT_OSCILLATORS);
        let watchdog = Self(());
        watchdog.feed();
        WATCHDOG.scratch0().write_value(RUNNING);
        WATCHDOG.ctrl().write(|w| w.set_enable(true));
        watchdog
    }

    /// A control period is complete.
    pub fn feed(&self) {
        WATCHDOG.load().write(|w| w.set_load(TIMEOUT_US));
    }
}
