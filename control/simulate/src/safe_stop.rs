//! Safe stop of a robot that can no longer be tracked.
//!
//! The robot plays its plan in open loop to the next time at which it can stand, and stays in that pose. Its driven wheels come
//! to rest. [`crate::follower`] begins the stop, which is final: only a new controller starts the motion again.

use crate::script::Script;
use rollwalk_physics::motor::Law;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_robot::Channel;

/// Interval between the times at which the planned stance is evaluated, s.
const STEP_S: f64 = 0.01;
/// Time in which driven wheels come to rest, s.
const WHEELS_S: f64 = 0.5;

/// Safe stop of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SafeStop {
    /// Time of the plan at which it is stopped, s. Times of a periodic plan continue over all periods.
    at_s: f64,
    /// Time of the plan at the previous tick, s. It continues after `at_s`.
    now_s: f64,
}

impl SafeStop {
    /// Creates the safe stop of a robot whose motors are at `now_s` of its plan, s.
    ///
    /// The stop is at the first time with the largest number of stance feet. The search covers one period, or the rest of a
    /// finite motion.
    pub fn after(plan: &WholeBody, script: &Script<'_>, now_s: f64) -> Self {
        let end_s = match script.repeats() {
            true => now_s + script.duration_s(),
            false => script.duration_s().max(now_s),
        };
        let all = script.robot().end_effectors.len();
        let steps = ((end_s - now_s) / STEP_S).ceil() as usize;
        let mut best = (0, end_s);
        for step in 0..=steps {
            let time_s = (now_s + STEP_S * step as f64).min(end_s);
            let count = plan.stands(time_s).into_iter().filter(|&stands| stands).count();
            if count > best.0 {
                best = (count, time_s);
            }
            if count == all {
                break;
            }
        }
        Self { at_s: best.1, now_s }
    }

    /// True if the plan is stopped, and the wheels have come to rest.
    pub fn is_over(&self) -> bool {
        self.now_s - self.at_s >= WHEELS_S
    }

    /// Advances by a tick, and returns the control laws of the motors.
    pub fn tick(&mut self, script: &Script<'_>, tick_s: f64) -> Vec<Law> {
        self.now_s += tick_s;
        let since_s = self.now_s - self.at_s;
        let mut laws = script.laws(self.now_s.min(self.at_s));
        if since_s > 0.0 {
            let rolls = (1.0 - since_s / WHEELS_S).max(0.0);
            for (channel, law) in script.robot().channels().zip(&mut laws) {
                match channel {
                    // The planned torque supports the robot.
                    Channel::Joint(_) => law.speed_rad_s = 0.0,
                    Channel::Wheel(..) => {
                        law.speed_rad_s *= rolls;
                        law.torque_nm *= rolls;
                    }
                }
            }
        }
        laws
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_planner::motion::Motion;
    use rollwalk_planner::plan::Plan;
    use rollwalk_planner::{Options, optimise};
    use rollwalk_robot::Robot;
    use std::fs;
    use std::ops::ControlFlow;

    const TICK_S: f64 = 0.002;

    fn plan(motion: &str) -> Plan {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped");
        let read = |name: &str| fs::read_to_string(format!("{root}/{name}.toml")).unwrap();
        let robot = Robot::from_toml("agilebot", &read("robots/agilebot")).unwrap();
        let text = read(&format!("motions/{motion}"));
        let motion = Motion::from_toml(motion, &text, &robot).unwrap();
        optimise(&robot, &motion, &Options::default(), &mut |_: &_| ControlFlow::Continue(()))
    }

    fn count(body: &WholeBody, time_s: f64) -> usize {
        body.stands(time_s).into_iter().filter(|&stands| stands).count()
    }

    /// A flying trot has at most two feet on the ground.
    #[test]
    #[ignore = "minutes: cargo xtask nightly --only long"]
    fn a_stop_is_where_most_end_effectors_stand() {
        let plan = plan("flying_trot");
        let (body, script) = (WholeBody::new(&plan), Script::new(&plan, true));
        let period_s = script.duration_s();
        for part in [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 7.35] {
            let now_s = part * period_s;
            let SafeStop { at_s, .. } = SafeStop::after(&body, &script, now_s);
            assert!((now_s..=now_s + period_s).contains(&at_s), "{now_s}: {at_s}");
            assert_eq!(count(&body, at_s), 2, "{now_s}: {at_s}");
        }
    }

    /// Tests a stop during and after a motion of a robot that drives, and hence stands at both times.
    #[test]
    fn motors_go_on_until_the_stop_and_wheels_roll_out() {
        let plan = plan("drive_1m");
        let (body, script) = (WholeBody::new(&plan), Script::new(&plan, true));
        for now_s in [2.0, 9.0] {
            let mut stop = SafeStop::after(&body, &script, now_s);
            assert_eq!(stop.at_s, now_s);
            let planned = script.laws(now_s);
            let mut last: Vec<f64> = planned.iter().map(|law| law.speed_rad_s.abs()).collect();
            for _ in 0..300 {
                let laws = stop.tick(&script, TICK_S);
                for ((law, planned), last) in laws.iter().zip(&planned).zip(&mut last) {
                    assert_eq!(law.position_rad, planned.position_rad);
                    assert!(law.speed_rad_s.abs() <= *last);
                    *last = law.speed_rad_s.abs();
                }
            }
            assert!(last.iter().all(|speed| *speed == 0.0), "{now_s}: {last:?}");
        }
        // The wheels rolled.
        assert!(script.laws(2.0).iter().any(|law| law.speed_rad_s.abs() > 1.0));
    }
}
