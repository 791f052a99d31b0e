//! Which end effectors bear the robot at a tick: contacts as they are measured, with what the plan says of them.
//!
//! An end effector that touches the ground stands, also before its plan says so; one that should stand and does not touch is let down
//! to the ground. A robot that was pushed far off its plan needs all end effectors: as long as it recovers, those that touch do not
//! lift off, and those in the air land.

/// What an end effector does at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// It bears the robot.
    Stance,
    /// It goes where the plan leads it through the air.
    Swing,
    /// It should bear the robot and does not touch the ground yet.
    Landing,
}

/// What the plan says of an end effector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planned {
    pub stands: bool,
    /// Whether it moves away from the ground.
    pub rises: bool,
}

/// The phase of an end effector that touches the ground or not. One that is to rise and touches yet lifts off late: it does not stand.
pub(crate) fn phase(planned: Planned, touches: bool, recovers: bool) -> Phase {
    let is_needed = planned.stands || recovers;
    match touches {
        true if is_needed || !planned.rises => Phase::Stance,
        false if is_needed => Phase::Landing,
        _ => Phase::Swing,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_are_as_they_are_measured_but_at_lift_off() {
        let planned = |stands, rises| Planned { stands, rises };
        for (planned, touching, apart) in [
            (planned(true, false), Phase::Stance, Phase::Landing),
            (planned(false, true), Phase::Swing, Phase::Swing),
            (planned(false, false), Phase::Stance, Phase::Swing),
        ] {
            assert_eq!(phase(planned, true, false), touching, "{planned:?}");
            assert_eq!(phase(planned, false, false), apart, "{planned:?}");
            assert_eq!(phase(planned, true, true), Phase::Stance);
            assert_eq!(phase(planned, false, true), Phase::Landing);
        }
    }
}
