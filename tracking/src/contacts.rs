//! Which end effectors bear the robot at a tick: contacts as they are measured, with what the plan says of them.
//!
//! An end effector that touches the ground stands, also before its plan says so; one that should stand and does not touch is let down
//! to the ground. A robot that was pushed far off its plan needs all end effectors: as long as it recovers, those that touch do not
//! lift off, and those in the air land.
//!
//! A switch that stays open where the end effector is on the ground by the measured pose is taken for broken: the robot would lift
//! itself by what it takes for a leg in the air.

/// Height above or below the ground, as a part of that of the centre of mass, at which a switch is to be closed, and how long it may be open
/// there, s: feet that land bounce.
const NEAR: f64 = 0.03;
const OPEN_S: f64 = 0.06;

/// The contact switch of an end effector.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Switch {
    /// How long it has been open on the ground, s.
    open_s: f64,
}

impl Switch {
    /// Whether the end effector touches, from what the switch reports at a tick; whether it is to stand; and its height as a part of that of the centre of mass.
    pub fn touches(&mut self, reports: bool, is_needed: bool, height: f64, tick_s: f64) -> bool {
        if !height.is_finite() {
            return reports;
        }
        let is_suspect = !reports && is_needed && height.abs() < NEAR;
        self.open_s = if is_suspect { self.open_s + tick_s } else { 0.0 };
        reports || self.open_s > OPEN_S
    }
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
    fn a_switch_that_is_open_on_the_ground_is_broken() {
        let mut switch = Switch::default();
        let mut touches = |reports, is_needed, height| -> Vec<bool> {
            (0..5).map(|_| switch.touches(reports, is_needed, height, 0.02)).collect()
        };
        assert_eq!(touches(false, true, 0.01), [false, false, false, true, true]);
        // A pose that is none says nothing.
        assert_eq!(touches(false, true, f64::NAN), [false; 5]);
        assert_eq!(touches(false, true, 0.0), [true; 5]);
        // It may swing, hang over a hole, or be in order.
        assert_eq!(touches(false, false, 0.0), [false; 5]);
        assert_eq!(touches(false, true, -0.05), [false; 5]);
        assert_eq!(touches(true, false, 0.2), [true; 5]);
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
