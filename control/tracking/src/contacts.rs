//! Stance of the end effectors at a tick, from measured contacts and the plan.
//!
//! An end effector that touches the ground counts as standing, even before its planned touch-down. A planned stance foot that
//! does not touch is lowered to the ground. A robot that was pushed far off its plan needs all end effectors. While it recovers,
//! those that touch do not lift off, and those in the air land.
//!
//! A planned stance foot whose measured pose is on the ground counts as standing regardless of its switch, because light feet
//! chatter. At each tick without contact the leg would otherwise count as a swing leg, and the robot would lift itself. A
//! switch that is stuck open has the same effect.

/// Largest distance from the ground at which an end effector counts as touching, as a fraction of the height of the centre of
/// mass.
const NEAR: f64 = 0.03;

/// True if an end effector touches the ground.
///
/// Either its switch `reports` contact, or the end effector `is_needed` for stance and its `height` is near 0. `height` is a
/// fraction of the height of the centre of mass; NaN has no effect.
pub(crate) fn touches(reports: bool, is_needed: bool, height: f64) -> bool {
    reports || (is_needed && height.abs() < NEAR)
}

/// Phase of an end effector at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// Carries the robot.
    Stance,
    /// Follows its planned path through the air.
    Swing,
    /// Is needed for stance but does not touch the ground yet.
    Landing,
}

/// Plan of an end effector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlannedContact {
    pub stands: bool,
    /// True if the end effector moves away from the ground.
    pub rises: bool,
}

/// Phase of an end effector. An end effector that should rise but still touches the ground lifts off late and does not stand.
pub(crate) fn phase(planned: PlannedContact, touches: bool, recovers: bool) -> Phase {
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
        // A height of NaN is ignored.
        assert!(!touches(false, true, f64::NAN));
        // The foot may be over a hole, or in swing.
        assert!(!touches(false, true, -0.05));
        assert!(!touches(false, false, 0.0));
        assert!(touches(true, false, 0.2));
        assert!(touches(true, false, f64::NAN));
    }

    #[test]
    fn contacts_are_as_they_are_measured_but_at_lift_off() {
        let planned = |stands, rises| PlannedContact { stands, rises };
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
