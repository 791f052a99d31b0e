//! Time: TIM5 counts microseconds.

use crate::chip::CORE_HZ;
use embassy_stm32::pac;

/// Counter of microseconds since its start.
pub struct Clock {
    high: u64,
    last: u32,
}

impl Clock {
    /// Starts the timer: a 32-bit counter, clocked by APB1 undivided.
    pub fn start() -> Self {
        let timer = pac::TIM5;
        timer.psc().write_value((CORE_HZ / 1_000_000 - 1) as u16);
        timer.arr().write_value(u32::MAX);
        // The prescaler acts from the next update on, so an update is forced.
        timer.egr().write(|w| w.set_ug(true));
        timer.cnt().write_value(0);
        timer.cr1().modify(|w| w.set_cen(true));
        Self { high: 0, last: 0 }
    }

    /// Current time, µs. Call it at least every 71 minutes, before 32 bits wrap.
    pub fn now_us(&mut self) -> u64 {
        let low = pac::TIM5.cnt().read();
        if low < self.last {
            self.high = self.high.wrapping_add(1 << 32);
        }
        self.last = low;
        self.high | u64::from(low)
    }
}
