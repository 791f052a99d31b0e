//! Cost of control periods in counts of SysTick: instructions, under QEMU's `-icount`.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use rollwalk_protocol::tunnel::Figures;

/// Reload value of SysTick, which counts down. Every measured span must be shorter.
const RELOAD: u32 = 0x00FF_FFFF;

/// Counter, and the figures so far.
pub struct Cost {
    /// SysTick, which runs only during a measurement, so that an emulated processor that sleeps has no running timer.
    timer: SYST,
    figures: Figures,
    /// Counts of the current period.
    period: u32,
}

impl Cost {
    /// Sets up the counter.
    pub fn new(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(RELOAD);
        timer.clear_current();
        Self { timer, figures: Figures::default(), period: 0 }
    }

    /// Runs a part of a control period, and counts its cost.
    pub fn of<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (done, counts) = self.counted(work);
        self.period = self.period.saturating_add(counts);
        done
    }

    /// Runs the tick that begins a control period, and completes the figures of the previous period.
    pub fn of_tick(&mut self, tick: impl FnOnce()) {
        let ((), counts) = self.counted(tick);
        let figures = &mut self.figures;
        if figures.periods > 0 {
            figures.worst_period = figures.worst_period.max(self.period);
            figures.all_periods = figures.all_periods.saturating_add(self.period.into());
        }
        figures.periods = figures.periods.saturating_add(1);
        figures.worst_tick = figures.worst_tick.max(counts);
        figures.all_ticks = figures.all_ticks.saturating_add(counts.into());
        self.period = counts;
    }

    /// Figures so far, without the stack.
    pub fn figures(&self) -> Figures {
        self.figures
    }

    /// Runs `work`; returns its result, and the counts that it took.
    pub fn counted<T>(&mut self, work: impl FnOnce() -> T) -> (T, u32) {
        self.timer.enable_counter();
        let before = SYST::get_current();
        let done = work();
        let counts = before.wrapping_sub(SYST::get_current()) & RELOAD;
        self.timer.disable_counter();
        (done, counts)
    }
}
