//! Detects steps that a board need not make: without an input, and with no free bus for which it may have a frame.

use rollwalk_protocol::tunnel::{Buses, Step, Stepped};

/// Transmit queues of a controller that are known to be empty since its last input.
#[derive(Default)]
pub struct Quiet {
    playing: Option<(u8, u16, f32)>,
    /// Buses with an empty transmit queue, which only an input fills.
    silent: Buses,
}

impl Quiet {
    /// The answer to a step that need not be made; `None` for one that must be.
    pub fn answer(&self, step: &Step) -> Option<Stepped> {
        let nothing = step.input.is_none() && step.free.without(self.silent).is_empty();
        nothing.then(|| Stepped { playing: self.playing, ..Stepped::default() })
    }

    /// Records a step that was made.
    pub fn after(&mut self, step: &Step, stepped: &Stepped) {
        self.playing = stepped.playing;
        if step.input.is_some() {
            self.silent = Buses::default();
        }
        if step.free.link() && stepped.link.is_none() {
            self.silent = self.silent.with_link();
        }
        for (bus, frame) in (0..).zip(&stepped.actuators) {
            if step.free.actuator(bus) && frame.is_none() {
                self.silent = self.silent.with_actuator(bus);
            }
        }
    }
}
