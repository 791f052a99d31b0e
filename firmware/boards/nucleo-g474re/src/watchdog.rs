//! Independent watchdog, which runs from its own oscillator (RM0440, chapter 35).

use embassy_stm32::pac::IWDG;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};

/// Timeout in units of 0.5 ms (32 kHz divided by 16).
///
/// The longest stop of the control loop is the check of a library while disarmed. A full slot takes about half a second, by 320
/// instructions a byte, counted on a host. The actuators' own watchdogs react faster.
const TIMEOUT_HALF_MS: u16 = 2000;

/// Running watchdog: a second without [`feed`](Self::feed) resets the chip.
pub struct Watchdog(());

impl Watchdog {
    /// Starts the watchdog. Only a reset stops it.
    pub fn start() -> Self {
        // Order of 35.3.2.
        IWDG.kr().write(|w| w.set_key(Key::START));
        IWDG.kr().write(|w| w.set_key(Key::ENABLE));
        IWDG.pr().write(|w| w.set_pr(Pr::DIVIDE_BY16));
        IWDG.rlr().write(|w| w.set_rl(TIMEOUT_HALF_MS));
        while IWDG.sr().read().0 != 0 {}
        let watchdog = Self(());
        watchdog.feed();
        watchdog
    }

    /// Restarts the timeout. Call it when a control period is complete.
    pub fn feed(&self) {
        IWDG.kr().write(|w| w.set_key(Key::RESET));
    }
}
