//! How a robot comes to rest that cannot be tracked any more: open loop it plays its plan on to the next moment at which it can stand, stays in
//! that pose, and its driven wheels come to rest.
//!
//! [`crate::closed_loop`] begins it; only another start ends it.

use crate::script::Script;
use rollwalk_physics::motor::Law;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_robot::Channel;

/// Interval between the moments that are looked at, s.
const STEP_S: f64 = 0.01;
/// Time in which driven wheels come to rest, s.
const WHEELS_S: f64 = 0.5;

/// The stop of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SafeStop {
    /// When the plan ends, s; of one that repeats, periods counted on.
    at_s: f64,
    /// Time of the plan at the last tick, s: it goes on where that of a motion stays at its end.
    now_s: f64,
}

impl SafeStop {
    /// The stop of a robot whose motors are at a time of its plan, s: at the first moment within a period, or before the end of a motion
    /// that ends, at which as many end effectors stand as at any.
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

    /// What the motors do a tick later.
    pub fn tick(&mut self, script: &Script<'_>, tick_s: f64) -> Vec<Law> {
        self.now_s += tick_s;
        let since_s = self.now_s - self.at_s;
        let mut laws = script.laws(self.now_s.min(self.at_s));
        if since_s > 0.0 {
            let rolls = (1.0 - since_s / WHEELS_S).max(0.0);
            for (channel, law) in script.robot().channels().zip(&mut laws) {
                match channel {
                    // The planned torque bears the robot.
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
