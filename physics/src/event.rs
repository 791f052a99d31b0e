//! Contact events: touch-down, lift-off, beginning and end of slip.

use crate::force::Force;
use crate::motion::BodyMotion;
use crate::touch::Touch;

/// Change of a contact between the beginning and the end of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactEvent {
    /// Index of the force that is the contact.
    pub force: usize,
    /// Kind of change.
    pub change: ContactChange,
}

/// Kind of change at a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ContactChange {
    /// Touch-down.
    TouchDown {
        /// Approach speed along the normal before the step, m/s, positive towards the ground.
        approach_m_s: f64,
    },
    /// Lift-off.
    LiftOff,
    /// Beginning of slip: friction has reached its limit.
    SlipBegins,
    /// End of slip: friction is below its limit again.
    SlipEnds,
}

/// States of all contacts after the previous step.
#[derive(Clone, Debug)]
pub(crate) struct Contacts {
    of_force: Vec<(usize, Touch)>,
}

impl Contacts {
    pub fn new(forces: &[Box<dyn Force>], motions: &[BodyMotion]) -> Self {
        let numbered = |number: usize| Some((number, touch(forces[number].as_ref(), motions)?));
        Self { of_force: (0..forces.len()).filter_map(numbered).collect() }
    }

    /// Stores the contacts at the end of a step, and returns the events since the previous step.
    pub fn update(
        &mut self,
        forces: &[Box<dyn Force>],
        motions: &[BodyMotion],
    ) -> Vec<ContactEvent> {
        let mut events = Vec::new();
        for (number, before) in &mut self.of_force {
            let Some(now) = touch(forces[*number].as_ref(), motions) else { continue };
            let [touched, touches] = [before.gap_m < 0.0, now.gap_m < 0.0];
            let change = match (touched, touches) {
                (false, true) => {
                    Some(ContactChange::TouchDown { approach_m_s: before.approach_m_s })
                }
                (true, false) => Some(ContactChange::LiftOff),
                (true, true) if now.slips && !before.slips => Some(ContactChange::SlipBegins),
                (true, true) if before.slips && !now.slips => Some(ContactChange::SlipEnds),
                _ => None,
            };
            events.extend(change.map(|change| ContactEvent { force: *number, change }));
            *before = now;
        }
        events
    }
}

fn touch(force: &dyn Force, motions: &[BodyMotion]) -> Option<Touch> {
    let now: Vec<_> = force.bodies().iter().map(|&body| motions[body]).collect();
    force.touch(&now)
}
