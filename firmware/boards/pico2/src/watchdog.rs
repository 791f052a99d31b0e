//! Watchdog, which counts microseconds of the crystal (RP2350 datasheet, 12.9).

use embassy_rp::pac::{PSM, WATCHDOG};

/// Timeout of the watchdog, µs.
///
/// The longest stops of the control loop are the check of a library and the erasure of a flash sector, while disarmed. Each takes
/// at most about half a second. The servos' own watchdogs react faster.
const TIMEOUT_US: u32 = 1_000_000;
/// Reset mask of everything except the oscillators, bits 2 and 3 (7.4.5).
const ALL_BUT_OSCILLATORS: u32 = 0x01FF_FFF3;

/// Mark of a running control loop, in a register that a watchdog reset preserves. The boot ROM also restarts through the
/// watchdog, for example after a UF2 file was copied.
const RUNNING: u32 = 0x526F_6C6C;

/// Returns true if a stopped control loop caused the most recent reset. Clears the cause.
pub fn take_expired() -> bool {
    let was_running = WATCHDOG.scratch0().read() == RUNNING;
    WATCHDOG.scratch0().write_value(0);
    was_running && WATCHDOG.reason().read().timer()
}

/// Running watchdog: a second without [`feed`](Self::feed) resets the chip.
pub struct Watchdog(());

impl Watchdog {
    /// Starts the watchdog, which also runs while a debugger halts the processor.
    pub fn start() -> Self {
        WATCHDOG.ctrl().write(|w| w.set_enable(false));
        PSM.wdsel().write(|w| w.0 = ALL_BUT_OSCILLATORS);
        let watchdog = Self(());
        watchdog.feed();
        WATCHDOG.scratch0().write_value(RUNNING);
        WATCHDOG.ctrl().write(|w| w.set_enable(true));
        watchdog
    }

    /// Restarts the timeout. Call it when a control period is complete.
    pub fn feed(&self) {
        WATCHDOG.load().write(|w| w.set_load(TIMEOUT_US));
    }
}
