//! Which end effectors bear the robot at a tick: contacts as they are measured, with what the plan says of them.
//!
//! An end effector that touches the ground stands, also before its plan says so; one that should stand and does not touch is let down
//! to the ground. A robot that was pushed far off its plan needs all end effectors: as long as it recovers, those that touch do not
//! lift off, and those in the air land.
//!
//! One that is to stand, and is on the ground by the measured pose, stands whatever its switch says. Light feet chatter: at each tick without
//! force the robot would take the leg for one in the air, and lift itself. A switch that stays open is one more case of this.

/// Height above or below the ground, as a part of that of the centre of mass, at which an end effector is on it.
const NEAR: f64 = 0.03;

/// Whether an end effector touches the ground, from what its switch reports at a tick; whether it is to stand; and its height as a part of that of
/// the centre of mass. A height that is not finite says nothing.
pub(crate) fn touches(reports: bool, is_needed: bool, height: f64) -> bool {
    reports || (is_needed && height.abs() < NEAR)
}

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
    fn what_is_to_stand_and_is_on_the_ground_stands() {
        assert!(touches(false, true, 0.01));
        assert!(touches(false, true, -0.01));
        // A pose that is none says nothing.
        assert!(!touches(false, true, f64::NAN));
        // It may hang over a hole, or swing.
        assert!(!touches(false, true, -0.05));
        assert!(!touches(false, false, 0.0));
        assert!(touches(true, false, 0.2));
        assert!(touches(true, false, f64::NAN));
    }

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
