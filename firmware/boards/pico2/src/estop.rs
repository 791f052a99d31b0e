//! Emergency-stop contact: normally closed, from GP22 to ground.
//!
//! Only a closed contact allows torque. A pressed button, a broken wire and an unplugged connector all give the high level. The
//! firmware reads the level in every control period. It also reads the edge that the pin has latched, which catches shorter
//! pulses.

use crate::chip;
use embassy_rp::pac::{IO_BANK0, SIO};

/// Pin GP22, at pin 29 of the board, next to ground at 28.
const PIN: usize = 22;

pub struct EstopContact(());

impl EstopContact {
    /// Contact with the pin's own pull-up.
    pub fn new() -> Self {
        chip::input::<PIN>();
        let contact = Self(());
        // The pull-up charges the wire, which causes a rising edge.
        contact.take_opened();
        contact
    }

    /// True if the contact is open.
    pub fn is_open(&self) -> bool {
        SIO.gpio_in(0).read() & 1 << PIN != 0
    }

    /// Returns true if the contact opened since the previous call, however briefly. Reads a latched edge, without an interrupt
    /// (9.5).
    pub fn take_opened(&self) -> bool {
        let edges = IO_BANK0.intr(PIN / 8);
        let opened = edges.read().edge_high(PIN % 8);
        if opened {
            // Cleared by writing 1.
            edges.write(|w| w.set_edge_high(PIN % 8, true));
        }
        opened
    }
}
