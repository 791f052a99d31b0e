//! Speed that no plan of a robot exceeds: wheel speed times radius, and strokes of the legs.

use rollwalk_multibody::{Standing, Tree};
use rollwalk_pilot::Steering;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::{EndEffector, Robot};

/// Strokes of a leg in units of the height of the standing robot: no leg reaches further forward and back.
const STROKE: f64 = 2.0;

/// Upper bounds of steering.
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    /// Bound of the forward and sideways velocity, m/s.
    pub speed_m_s: f64,
    /// Bound of the turning rate, rad/s.
    pub turn_rad_s: f64,
    /// Derivation of the bound.
    derivation: String,
}

impl Reach {
    /// Returns the bounds of a robot that drives or walks in the gait of a plan; `None` if the robot has wheels without motors
    /// or skates, which roll freely.
    pub fn new(robot: &Robot, gait: Option<&Plan>) -> Option<Self> {
        if robot.end_effectors.iter().any(|end| end.contact.drag().is_some()) {
            return None;
        }
        let standing = Standing::new(&Tree::new(robot))?;
        let rim = |end: &EndEffector| Some(end.contact.actuator()?.speed_max_rad_s * end.radius_m);
        let wheels_m_s = robot.end_effectors.iter().filter_map(rim).fold(0.0, f64::max);
        let mut terms = Vec::new();
        if wheels_m_s > 0.0 {
            terms.push(format!("{wheels_m_s:.2} m/s of the wheels (speed times radius)"));
        }
        let mut speed_m_s = wheels_m_s;
        if let Some(stance_s) = gait.and_then(shortest_stance_s) {
            let stroke_m = STROKE * standing.frames.link_origins[0].z;
            speed_m_s += stroke_m / stance_s;
            terms.push(format!("a stroke of {stroke_m:.2} m in a stance of {stance_s:.2} s"));
        }
        let contacts = standing.contacts.iter().map(|contact| contact.position);
        let nearest_m = contacts.map(|at| at.xy().norm()).fold(f64::INFINITY, f64::min);
        let turn_rad_s = speed_m_s / nearest_m;
        Some(Self { speed_m_s, turn_rad_s, derivation: terms.join(" plus ") })
    }

    /// Checks a steering. `text` is the value as the user typed it.
    ///
    /// # Errors
    /// Returns a message with the bound.
    pub fn check(&self, text: &str, steering: Steering) -> Result<(), String> {
        let Steering { forward_m_s, left_m_s, turn_rad_s } = steering;
        let speed_m_s = forward_m_s.hypot(left_m_s);
        if speed_m_s > self.speed_m_s {
            return Err(format!(
                "{text}: {speed_m_s} m/s is beyond the robot, whose limit is {:.2} m/s: {}",
                self.speed_m_s, self.derivation
            ));
        }
        if turn_rad_s.abs() > self.turn_rad_s {
            return Err(format!(
                "{text}: {turn_rad_s} rad/s is beyond the robot, whose limit is {:.2} rad/s",
                self.turn_rad_s
            ));
        }
        Ok(())
    }
}

/// Time that the foot with the shortest stance is on the ground in a period, s; `None` if a foot never lands.
fn shortest_stance_s(plan: &Plan) -> Option<f64> {
    let feet = plan.robot.end_effectors.len();
    let samples = |foot: usize| plan.motion.stance.iter().filter(|row| row[foot]).count();
    let least = (0..feet).map(samples).min().filter(|&least| least > 0)?;
    Some(least as f64 * plan.sample_interval_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inputs::Source;
    use std::path::Path;

    fn reach(robot: &str) -> Option<Reach> {
        let robot = Source::Shipped.robot(Path::new(robot)).expect("it ships");
        Reach::new(&robot, None)
    }

    /// A velocity in cm/s is refused with the limit of the wheels; the default speed of steering is not.
    #[test]
    fn speeds_beyond_the_wheels_are_refused_with_their_limit() {
        let reach = reach("robots/agilebot.toml").expect("its wheels have motors");
        let steering =
            |forward_m_s, turn_rad_s| Steering { forward_m_s, left_m_s: 0.0, turn_rad_s };
        assert_eq!(reach.check("", steering(0.2, 0.4)), Ok(()));
        let error = reach.check("--steer 1:10,0,0", steering(10.0, 0.0)).unwrap_err();
        assert!(error.starts_with("--steer 1:10,0,0: 10 m/s is beyond the robot"), "{error}");
        assert!(error.contains("of the wheels (speed times radius)"), "{error}");
        let error = reach.check("", steering(0.0, 20.0)).unwrap_err();
        assert!(error.contains("20 rad/s is beyond the robot"), "{error}");
    }

    #[test]
    fn wheels_without_motors_have_no_limit() {
        assert_eq!(reach("robots/swizzlebot.toml"), None);
    }
}
