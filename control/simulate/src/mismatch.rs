//! Mismatch between the simulated robot and the planned one.

use crate::sensors::{Noise, SensorFault};
use rollwalk_physics::world::Parameters;
use rollwalk_robot::Robot;

/// Ratio of the contact stiffness for plans to that of other simulated robots.
///
/// Runs of walks and trots with this ratio or more agree with runs on MuJoCo's hard contacts. A robot that lies on the ground
/// gets up only from softer contacts.
const HARD: f64 = 2.0;

/// Differences between the planned robot and the simulated one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mismatch {
    /// Scale factor of the planned masses and inertias of all links.
    pub mass: f64,
    /// Friction coefficient of all feet, wheels and blades; `None` for the planned coefficients.
    pub friction: Option<f64>,
    /// Scale factor of the usual stiffness of ground contacts. Their damping ratio does not change.
    pub contact_stiffness: f64,
    /// Time in closed loop from a measurement until its set-points act, s.
    pub delay_s: f64,
    /// Noise of the sensors from which a closed-loop controller estimates the state; `None` for a controller with the true
    /// state.
    pub noise: Option<Noise>,
    /// Fault of the sensors from which a closed-loop controller estimates the state.
    pub sensor_fault: Option<SensorFault>,
}

impl Default for Mismatch {
    /// Mismatch without differences.
    fn default() -> Self {
        Self {
            mass: 1.0,
            friction: None,
            contact_stiffness: 1.0,
            delay_s: 0.0,
            noise: None,
            sensor_fault: None,
        }
    }
}

impl Mismatch {
    /// Returns the robot of the simulated world.
    pub fn of(&self, planned: &Robot) -> Robot {
        let mut robot = planned.clone();
        for link in &mut robot.links {
            link.mass_kg *= self.mass;
            link.inertia_in_link_kg_m2 *= self.mass;
        }
        for end_effector in &mut robot.end_effectors {
            end_effector.friction_coefficient =
                self.friction.unwrap_or(end_effector.friction_coefficient);
        }
        robot
    }

    /// Parameters of the world of the simulated robot.
    pub(crate) fn parameters(&self, robot: &Robot) -> Parameters {
        Parameters::new(robot).with_contact_stiffness(HARD * self.contact_stiffness)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn masses_inertias_and_friction_are_those_that_are_asked_for() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped/robots/agilebot.toml");
        let robot = Robot::from_toml("agilebot", &fs::read_to_string(path).unwrap()).unwrap();
        assert_eq!(Mismatch::default().of(&robot), robot);
        let other = Mismatch { mass: 1.5, friction: Some(0.3), ..Mismatch::default() }.of(&robot);
        for (one, other) in robot.links.iter().zip(&other.links) {
            assert_eq!(other.mass_kg, 1.5 * one.mass_kg);
            assert_eq!(other.inertia_in_link_kg_m2, one.inertia_in_link_kg_m2 * 1.5);
        }
        assert!(other.end_effectors.iter().all(|foot| foot.friction_coefficient == 0.3));
    }
}
