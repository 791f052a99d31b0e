//! Time: timer 0 counts it, and SysTick begins the control periods and wakes the processor for them.

use core::ptr::{read_volatile, write_volatile};
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;
use rollwalk_protocol::time::divided;

/// Clock of the processor and of the board's timers, Hz.
const HZ: u32 = 25_000_000;
const COUNTS_PER_US: u16 = (HZ / 1_000_000) as u16;

/// Control register of timer 0 (Arm CMSDK APB), which counts down.
const CTRL: *mut u32 = 0x4000_0000 as *mut u32;
const VALUE: *mut u32 = 0x4000_0004 as *mut u32;
const RELOAD: *mut u32 = 0x4000_0008 as *mut u32;
const CTRL_ENABLE: u32 = 1 << 0;

/// True if a control period has begun that [`Clock::take_period`] has not reported yet.
static PERIOD_STARTED: AtomicBool = AtomicBool::new(false);

/// Clock. `main` creates the only one.
pub struct Clock {
    counts: u64,
    last: u32,
}

impl Clock {
    /// Starts the clock with `control_hz` control periods a second.
    pub fn start(mut systick: SYST, control_hz: u16) -> Self {
        // SAFETY: registers of this board, which nothing else uses.
        unsafe {
            write_volatile(RELOAD, u32::MAX);
            write_volatile(VALUE, u32::MAX);
            write_volatile(CTRL, CTRL_ENABLE);
        }
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(HZ / u32::from(control_hz.max(1)) - 1);
        systick.clear_current();
        systick.enable_interrupt();
        systick.enable_counter();
        Self { counts: 0, last: u32::MAX }
    }

    /// Time since the start, µs. Call it at least every two minutes, before the counter wraps.
    pub fn now_us(&mut self) -> u64 {
        // SAFETY: as above.
        let value = unsafe { read_volatile(VALUE) };
        self.counts = self.counts.saturating_add(self.last.wrapping_sub(value).into());
        self.last = value;
        divided(self.counts, COUNTS_PER_US)
    }

    /// Returns true if a control period has begun since the previous call that returned true.
    pub fn take_period(&mut self) -> bool {
        PERIOD_STARTED.swap(false, Ordering::AcqRel)
    }

    /// True if the next [`Self::take_period`] will return true.
    pub fn is_due(&self) -> bool {
        PERIOD_STARTED.load(Ordering::Acquire)
    }
}

#[exception]
fn SysTick() {
    PERIOD_STARTED.store(true, Ordering::Release);
}
