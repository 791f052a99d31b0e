//! Which end effectors bear the robot at a tick: contacts as they are measured, with what the plan says of them.
//!
//! An end effector that touches the ground stands, also before its plan says so; one that should stand and does not touch is let down
//! to the ground. A robot that was pushed far off its plan needs all end effectors: as long as it recovers, those that touch do not
//! lift off, and those in the air land.

use nalgebra::Vector2;
use rollwalk_robot::GRAVITY_M_S2;

/// Height below which an end effector that rises is one that lifts off, whatever it touches, m.
const LIFTS_OFF_M: f64 = 5e-3;
/// Error of the capture point from which on a robot recovers, and until which it does, as parts of the height of its centre of mass.
const RECOVERS: f64 = 0.2;
const RECOVERED: f64 = 0.1;

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
    /// Height of its lowest point above the ground, m, and how fast it rises, m/s.
    pub height_m: f64,
    pub rises_m_s: f64,
}

/// The phase of an end effector that touches the ground or not.
pub(crate) fn phase(planned: Planned, touches: bool, recovers: bool) -> Phase {
    let is_needed = planned.stands || recovers;
    let lifts_off = planned.rises_m_s > 0.0 && planned.height_m < LIFTS_OFF_M;
    match touches {
        true if is_needed || !lifts_off => Phase::Stance,
        false if is_needed => Phase::Landing,
        _ => Phase::Swing,
    }
}

/// Whether the robot recovers from a push.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Recovery {
    pub is_active: bool,
}

impl Recovery {
    /// From errors of the centre of mass, which is this high above the ground, m: of its place, m, and of its velocity, m/s. An upright pendulum comes to rest over its capture point, c + v / sqrt(g / h).
    pub fn update(&mut self, shift: Vector2<f64>, velocity: Vector2<f64>, height_m: f64) {
        let height_m = height_m.max(0.0);
        let error_m = (shift + velocity * (height_m / GRAVITY_M_S2).sqrt()).norm();
        let part = if self.is_active { RECOVERED } else { RECOVERS };
        self.is_active = error_m > part * height_m;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STANDS: Planned = Planned { stands: true, height_m: 0.0, rises_m_s: 0.0 };
    const LIFTS: Planned = Planned { stands: false, height_m: 1e-3, rises_m_s: 0.1 };
    const LANDS: Planned = Planned { stands: false, height_m: 1e-3, rises_m_s: -0.1 };
    const HIGH: Planned = Planned { stands: false, height_m: 0.03, rises_m_s: 0.1 };

    #[test]
    fn contacts_are_as_they_are_measured_but_at_lift_off() {
        for (planned, touching, apart) in [
            (STANDS, Phase::Stance, Phase::Landing),
            (LIFTS, Phase::Swing, Phase::Swing),
            (LANDS, Phase::Stance, Phase::Swing),
            (HIGH, Phase::Stance, Phase::Swing),
        ] {
            assert_eq!(phase(planned, true, false), touching, "{planned:?}");
            assert_eq!(phase(planned, false, false), apart, "{planned:?}");
            assert_eq!(phase(planned, true, true), Phase::Stance);
            assert_eq!(phase(planned, false, true), Phase::Landing);
        }
    }

    #[test]
    fn recovery_begins_late_and_ends_early() {
        let mut recovery = Recovery::default();
        let mut at = |part: f64| {
            let velocity = Vector2::new(0.0, part * (0.5 * GRAVITY_M_S2).sqrt());
            recovery.update(Vector2::zeros(), velocity, 0.5);
            recovery.is_active
        };
        assert_eq!(
            [0.0, 0.15, 0.21, 0.15, 0.11, 0.09, 0.15].map(&mut at),
            [false, false, true, true, true, false, false]
        );
        // A robot that comes back to its plan has no error of its capture point.
        recovery.update(
            Vector2::new(0.1, 0.0),
            Vector2::new(-0.1 * (GRAVITY_M_S2 / 0.5).sqrt(), 0.0),
            0.5,
        );
        assert!(!recovery.is_active);
    }
}
