//! The independent watchdog, which runs from its own oscillator (RM0440, chapter 35).

use embassy_stm32::pac::IWDG;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};

/// 32 kHz divided by 16: half a millisecond. The longest that the control loop may stop for is a
/// library being checked, while disarmed: about half a second for a slot that is full (320
/// instructions a byte, counted on a host). The actuators' own watchdogs are the fast ones.
const TIMEOUT_HALF_MS: u16 = 2000;

/// A watchdog that runs: a second without [`feed`](Self::feed) resets the chip.
pub struct Watchdog(());

impl Watchdog {
    /// Starts it; nothing but a reset stops it.
    pub fn start() -> Self {
        // The order of 35.3.2.
        IWDG.kr().write(|w| w.set_key(Key::START));
        IWDG.kr().write(|w| w.set_key(Key::ENABLE));
        IWDG.pr().write(|w| w.set_pr(Pr::DIVIDE_BY16));
        IWDG.rlr().write(|w| w.set_rl(TIMEOUT_HALF_MS));
        while IWDG.sr().read().0 != 0 {}
        let watchdog = Self(());
        watchdog.feed();
        watchdog
    }

    /// A control period is complete.
    pub fn feed(&self) {
        IWDG.kr().write(|w| w.set_key(Key::RESET));
    }
}
