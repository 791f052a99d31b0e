//! Emergency-stop contact: normally closed, from the pin to ground.
//!
//! Only a closed contact allows torque. A pressed button, a broken wire and an unplugged connector all give the high level. The
//! firmware reads the level in every control period, and an interrupt catches shorter pulses.

use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::peripheral::NVIC;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::pac::{EXTI, SYSCFG, interrupt};
use embassy_stm32::{Peri, peripherals};

/// Number of the pin, and of its EXTI line.
const LINE: usize = 10;

static OPENED: AtomicBool = AtomicBool::new(false);

pub struct EstopContact {
    pin: Input<'static>,
}

impl EstopContact {
    /// Contact on PA10, with the pin's own pull-up.
    pub fn new(pin: Peri<'static, peripherals::PA10>) -> Self {
        let pin = Input::new(pin, Pull::Up);
        // Port A is 0 in SYSCFG_EXTICR3. Rising edges, unmasked.
        SYSCFG.exticr(LINE / 4).modify(|w| w.set_exti(LINE % 4, 0));
        EXTI.rtsr(0).modify(|w| w.set_line(LINE, true));
        EXTI.imr(0).modify(|w| w.set_line(LINE, true));
        // SAFETY: the handler below touches nothing but its flag.
        unsafe { NVIC::unmask(interrupt::EXTI15_10) };
        Self { pin }
    }

    /// True if the contact is open.
    pub fn is_open(&self) -> bool {
        self.pin.is_high()
    }

    /// Returns true if the contact opened since the previous call, however briefly.
    pub fn take_opened(&self) -> bool {
        // The load comes first, because a swap in every iteration of the main loop would be slower.
        OPENED.load(Ordering::Relaxed) && OPENED.swap(false, Ordering::Relaxed)
    }
}

#[interrupt]
fn EXTI15_10() {
    // Cleared by writing 1.
    EXTI.pr(0).write(|w| w.set_line(LINE, true));
    OPENED.store(true, Ordering::Relaxed);
}
