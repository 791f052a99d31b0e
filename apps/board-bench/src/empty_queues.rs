//! Detection of steps that a board can skip: they have no input, and no free bus has a frame to send.

use rollwalk_protocol::tunnel::{Buses, Step, StepResult};

/// Transmit queues of a controller that are known to be empty since its previous input.
#[derive(Default)]
pub struct EmptyQueues {
    playing: Option<(u8, u16, f32)>,
    /// Buses with an empty transmit queue. Only an input can fill such a queue.
    silent: Buses,
}

impl EmptyQueues {
    /// Answer to a step that can be skipped; `None` if the step must be made.
    pub fn answer(&self, step: &Step) -> Option<StepResult> {
        let nothing = step.input.is_none() && step.free.without(self.silent).is_empty();
        nothing.then(|| StepResult { playing: self.playing, ..StepResult::default() })
    }

    /// Records an executed step.
    pub fn after(&mut self, step: &Step, stepped: &StepResult) {
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
