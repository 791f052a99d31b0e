//! Set-points of a steered robot without feedback: each horizon continues the plan of the previous one.
//!
//! Robots whose servos accept angles and speeds play plans without further control. Each horizon begins in the state that the
//! previous horizon predicts, and the set-points continue without a step. Feedback is left to the servos, as with a motion
//! library; `docs/receding-horizon.md` describes when that is enough.

use super::measured::over_ground;
use super::trim::Trim;
use super::{Gait, Horizon, HorizonError, HorizonOptions, MeasuredState, Steering};
use crate::plan::Placement;
use crate::solve::Progress;
use crate::whole_body::WholeBody;
use nalgebra::{Isometry3, Vector3};
use rollwalk_multibody::State;
use rollwalk_multibody::euler::BASE_POSITION;
use rollwalk_protocol::library::RATE_HZ;
use rollwalk_robot::Robot;
use std::collections::HashMap;
use std::fmt;
use std::ops::ControlFlow;

/// Steered course of a robot.
pub struct Course {
    horizon: Horizon,
    /// State at the start of the course.
    begins: State,
    /// Plan in use, with its pose in the world and the index of its first sample.
    plan: Option<(WholeBody, Isometry3<f64>, u64)>,
    /// Corrections of the steering, by name of the gait.
    trims: HashMap<String, Trim>,
    /// Name of the gait in use.
    gait: String,
    /// Number of samples of each horizon that are played ([`Stretch`]).
    stretch_samples: u64,
    /// Number of samples so far.
    samples: u64,
    /// Number of frames so far.
    frames: u64,
}

impl fmt::Debug for Course {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Course").field("samples", &self.samples).finish_non_exhaustive()
    }
}

/// Part of a horizon that is played before the next horizon takes over.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// Set-points, [`RATE_HZ`] per second.
    pub frames: Vec<Frame>,
    /// Iterations of the solve.
    pub iterations: usize,
    /// True if the new horizon was accepted. Otherwise the previous horizon continues.
    pub accepted: bool,
    /// Mean velocity of the body in this part of the horizon: along its heading and to the left, m/s, and yaw rate, rad/s.
    pub velocity: [f64; 3],
    /// Position of the body over the ground and its heading, at the end of this part of the horizon.
    pub place: Placement,
}

/// Set-points of all channels: joints first, then driven wheels.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Angles of joints, rad, and speeds of wheels, rad/s.
    pub values: Vec<f64>,
    /// Torques of the motors, N·m.
    pub torques_nm: Vec<f64>,
}

/// Reason why a course cannot continue at present.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CourseError {
    /// The horizon cannot be planned.
    #[error(transparent)]
    Horizon(#[from] HorizonError),
    /// Solves found no acceptable plan before the last accepted one ended.
    #[error(
        "no plan met the constraints for {for_s:.1} s; the worst residual, of `{constraint}`, is \
         {level:.1} times its tolerance: steer slower"
    )]
    NoPlan {
        /// Time since the last accepted plan began, s.
        for_s: f64,
        /// Most violated constraint of the final attempt.
        constraint: String,
        /// Residual-to-tolerance ratio of that constraint.
        level: f64,
    },
}

impl Course {
    /// Creates a course that begins at rest, with all end effectors on the ground and the given joint angles, rad.
    ///
    /// `interval_s` is the sample spacing, also of the gaits passed to [`change_gait`](Self::change_gait). A stretch is a whole
    /// number of samples, and lasts at least `stretch_s`.
    ///
    /// # Errors
    /// Returns an error if the horizon has too few samples, or if the joints belong to another robot.
    pub fn new(
        robot: &Robot,
        joint_rad: &[f64],
        interval_s: f64,
        stretch_s: f64,
        options: HorizonOptions,
    ) -> Result<Self, HorizonError> {
        let (what, found, expected) = ("joint_rad", joint_rad.len(), robot.joints.len());
        if found != expected {
            return Err(HorizonError::OtherRobot { what, found, expected });
        }
        let stand = Gait::standing_in(robot, interval_s, joint_rad)
            .map_err(|_| HorizonError::NotFinite { what: "interval_s" })?;
        let gait = stand.motion.name.clone();
        let horizon = Horizon::new(robot, stand, options)?;
        let height_m = horizon.model.standing_q(joint_rad)[BASE_POSITION + 2];
        let begins = State {
            base_position_m: Vector3::z() * height_m,
            joint_rad: joint_rad.to_vec(),
            ..State::nominal(&horizon.tree)
        };
        let stretch_samples = (stretch_s / interval_s - 1e-9).ceil().max(1.0) as u64;
        let trims = HashMap::new();
        let (samples, frames) = (0, 0);
        Ok(Self { horizon, begins, plan: None, trims, gait, stretch_samples, samples, frames })
    }

    /// Duration of the played part of a horizon, s.
    pub fn stretch_s(&self) -> f64 {
        self.stretch_samples as f64 * self.horizon.interval_s()
    }

    /// Changes to another gait with the next horizon. End effectors in the air finish their swing first.
    ///
    /// # Errors
    /// Returns an error if the gait belongs to another robot or has another sample spacing.
    pub fn change_gait(&mut self, gait: Gait) -> Result<(), HorizonError> {
        let name = gait.motion.name.clone();
        self.horizon.change_gait(gait, self.samples)?;
        self.trims.entry(name.clone()).or_default().restart();
        self.gait = name;
        Ok(())
    }

    /// Plans the next horizon and returns the part that is played. `progress` is called after every iteration and may stop the
    /// solve.
    ///
    /// # Errors
    /// Returns an error if the horizon cannot be planned, or if no plan covers the stretch. The call may be repeated with
    /// another steering.
    pub fn go_on(
        &mut self,
        steering: Steering,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Stretch, CourseError> {
        let (interval_s, stretch_s) = (self.horizon.interval_s(), self.stretch_s());
        let time_s = |sample: u64| sample as f64 * interval_s;
        let count = self.horizon.tree.robot().end_effectors.len();
        let (state, stands) = match &mut self.plan {
            None => (self.begins.clone(), vec![true; count]),
            Some((body, world_from_plan, from)) => {
                let instant = body.at(time_s(self.samples - *from), world_from_plan);
                (instant.state, instant.stands)
            }
        };
        let measured = MeasuredState { state: &state, touches: &stands };
        let trim = self.trims.entry(self.gait.clone()).or_default();
        let asked = trim.apply(steering);
        let found = self.horizon.plan(measured, self.samples, asked, progress)?;
        let accepted = found.is_accepted();
        if accepted {
            self.plan = Some((WholeBody::new(&found.plan), found.world_from_plan, self.samples));
        } else {
            trim.reject();
        }
        let end = self.samples + self.stretch_samples;
        let last = |from: u64| from + (found.plan.samples.len() - 1) as u64;
        let Some((body, world_from_plan, from)) =
            self.plan.as_mut().filter(|(_, _, from)| end <= last(*from))
        else {
            let begun = self.plan.as_ref().map_or(self.samples, |(_, _, from)| *from);
            return Err(CourseError::NoPlan {
                for_s: time_s(self.samples - begun),
                constraint: found.plan.solve.worst_constraint.to_string(),
                level: found.plan.solve.worst_level,
            });
        };
        let rate_hz = f64::from(RATE_HZ);
        let mut frames = Vec::new();
        while (self.frames as f64 / rate_hz) < time_s(end) - 1e-9 {
            let plan_time_s = self.frames as f64 / rate_hz - time_s(*from);
            let (setpoints, torques_nm) = body.setpoints(plan_time_s);
            let values = setpoints.channels(body.tree().robot()).collect();
            frames.push(Frame { values, torques_nm });
            self.frames += 1;
        }
        let then = body.at(time_s(end - *from), world_from_plan).state;
        self.samples = end;
        let [before, place] = [&state, &then].map(over_ground);
        let [dx, dy] = [0, 1].map(|k| place.offset_m[k] - before.offset_m[k]);
        let turned = place.yaw_rad - before.yaw_rad;
        let turned = turned.sin().atan2(turned.cos());
        let (sin, cos) = (before.yaw_rad + 0.5 * turned).sin_cos();
        let velocity =
            [cos * dx + sin * dy, cos * dy - sin * dx, turned].map(|change| change / stretch_s);
        if accepted {
            let sway = self.horizon.mean_sway(end - self.stretch_samples, self.stretch_samples);
            trim.update(steering, [0, 1, 2].map(|c| velocity[c] - sway[c]), stretch_s);
        }
        let iterations = found.plan.solve.iterations;
        Ok(Stretch { frames, iterations, accepted, velocity, place })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Motion;
    use crate::plan::Plan;
    use crate::{Options, optimise};

    fn on() -> impl FnMut(&Progress) -> ControlFlow<()> {
        |_| ControlFlow::Continue(())
    }

    fn agilebot() -> Robot {
        let text = include_str!("../../../shipped/robots/agilebot.toml");
        Robot::from_toml("agilebot.toml", text).expect("it ships")
    }

    /// AgileBot's shipped walk, without refinement of its samples.
    fn walk(robot: &Robot) -> Gait {
        let text = include_str!("../../../shipped/motions/walk.toml");
        let motion = Motion::from_toml("walk.toml", text, robot).expect("it ships");
        Gait::of(&planned(robot, &motion)).expect("it repeats")
    }

    fn planned(robot: &Robot, motion: &Motion) -> Plan {
        let options = Options { refine: false, ..Options::default() };
        optimise(robot, motion, &options, &mut on())
    }

    /// Course that replans every 0.2 s, from the nominal posture.
    fn from_nominal(robot: &Robot, interval_s: f64, duration_s: f64) -> Course {
        let horizon = HorizonOptions { duration_s, ..HorizonOptions::default() };
        Course::new(robot, &nominal(robot), interval_s, 0.2, horizon).expect("it is long enough")
    }

    fn nominal(robot: &Robot) -> Vec<f64> {
        robot.joints.iter().map(|joint| joint.nominal_rad).collect()
    }

    /// Steers a course by one command after the other, each for a number of horizons.
    fn steered(course: &mut Course, commands: &[(Steering, usize)]) -> Vec<Stretch> {
        let mut stretches = Vec::new();
        for &(steering, count) in commands {
            for _ in 0..count {
                stretches.push(course.go_on(steering, &mut on()).expect("it goes on"));
            }
        }
        stretches
    }

    /// Checks that successive frames respect the limits of the actuators, also from one horizon to the next.
    fn check_frames(robot: &Robot, stretches: &[Stretch]) {
        let config = robot.controller_config().expect("channels");
        let frames: Vec<&Frame> = stretches.iter().flat_map(|stretch| &stretch.frames).collect();
        for (k, pair) in frames.windows(2).enumerate() {
            for (c, channel) in config.channels.iter().enumerate() {
                let rate = (pair[1].values[c] - pair[0].values[c]).abs() * f64::from(RATE_HZ);
                // The tolerance of joint speeds, and a step of acceleration at seams.
                let most = 1.05 * f64::from(channel.max_rate);
                assert!(rate <= most, "frame {k}, channel {c}: {rate} of {most}");
                let value = pair[1].values[c];
                let limits = f64::from(channel.min) - 0.01..=f64::from(channel.max) + 0.01;
                assert!(limits.contains(&value), "frame {k}, channel {c}: {value}");
            }
        }
    }

    #[test]
    fn a_course_begins_at_its_posture_walks_as_it_is_steered_and_comes_to_rest() {
        let robot = agilebot();
        let walk = walk(&robot);
        let interval_s = walk.interval_s();
        let posture = nominal(&robot);
        let mut course = from_nominal(&robot, interval_s, 1.6);
        let mut all = steered(&mut course, &[(Steering::default(), 2)]);
        for (angle, nominal) in all[0].frames[0].values.iter().zip(&posture) {
            assert!((angle - nominal).abs() < 1e-6, "{angle} {nominal}"); // on its contacts
        }
        course.change_gait(walk).expect("of the same robot");
        let forward = Steering { forward_m_s: 0.15, ..Steering::default() };
        let turning = Steering { turn_rad_s: 0.3, ..forward };
        let walked = steered(&mut course, &[(forward, 20), (turning, 20)]);
        let mean = |part: &[Stretch], c: usize| {
            part.iter().map(|stretch| stretch.velocity[c]).sum::<f64>() / part.len() as f64
        };
        // Whole periods of 1.6 s.
        assert!((mean(&walked[4..20], 0) - 0.15).abs() < 0.01, "{}", mean(&walked[4..20], 0));
        assert!((mean(&walked[24..40], 2) - 0.3).abs() < 0.02, "{}", mean(&walked[24..40], 2));
        let stand = Gait::standing(&robot, interval_s).expect("a spacing");
        course.change_gait(stand).expect("of the same robot");
        let stopped = steered(&mut course, &[(Steering::default(), 12)]);
        let last = stopped.last().expect("some");
        for (angle, nominal) in last.frames.last().expect("some").values.iter().zip(&posture) {
            // Well within the range of ramps to SAFE.
            assert!((angle - nominal).abs() < 0.1, "{angle} {nominal}");
        }
        assert!(last.velocity.iter().all(|v| v.abs() < 0.01), "{:?}", last.velocity);
        all.extend(walked);
        all.extend(stopped);
        assert!(all.iter().all(|stretch| stretch.accepted));
        // Frames are 1/60 s apart, independent of the samples.
        let frames: usize = all.iter().map(|stretch| stretch.frames.len()).sum();
        assert_eq!(frames, (all.len() as f64 * course.stretch_s() * 60.0).round() as usize);
        check_frames(&robot, &all);
    }

    /// Alternates between the walk and a stand with zero command, as when a stick is tapped.
    #[test]
    fn a_stick_that_is_tapped_does_not_wind_up_the_correction_of_the_walk() {
        let robot = agilebot();
        let walk = walk(&robot);
        let stand = Gait::standing(&robot, walk.interval_s()).expect("a spacing");
        let mut course = from_nominal(&robot, walk.interval_s(), 1.6);
        let forward = Steering { forward_m_s: 0.1, ..Steering::default() };
        for _ in 0..4 {
            course.change_gait(walk.clone()).expect("of the same robot");
            steered(&mut course, &[(forward, 6)]);
            course.change_gait(stand.clone()).expect("of the same robot");
            steered(&mut course, &[(Steering::default(), 6)]);
        }
        assert_eq!(course.trims[&walk.motion.name].apply(forward), forward);
    }

    /// Walks with Legbot, whose legs leave their posture in each step.
    #[test]
    #[ignore = "ten seconds and more: cargo xtask nightly --only long"]
    fn a_robot_that_cannot_roll_walks_as_fast_as_it_is_steered() {
        let text = include_str!("../../../shipped/robots/legbot.toml");
        let robot = Robot::from_toml("legbot.toml", text).expect("it ships");
        let text = include_str!("../../../shipped/motions/legbot_walk.toml");
        let motion = Motion::from_toml("legbot_walk.toml", text, &robot).expect("it ships");
        let plan = planned(&robot, &motion);
        let speed_m_s = plan.end_placement.offset_m[0] / motion.duration_s;
        let walk = Gait::of(&plan).expect("it repeats");
        let horizon =
            HorizonOptions { duration_s: motion.duration_s.max(1.0), ..HorizonOptions::default() };
        let mut course = Course::new(&robot, &nominal(&robot), walk.interval_s(), 0.15, horizon)
            .expect("it is long enough");
        course.change_gait(walk).expect("of the same robot");
        let forward = Steering { forward_m_s: speed_m_s, ..Steering::default() };
        let walked = steered(&mut course, &[(forward, 100)]);
        assert!(walked.iter().all(|stretch| stretch.accepted));
        // Mean of three periods, after the correction has adapted.
        let mean_m_s = walked[68..].iter().map(|of| of.velocity[0]).sum::<f64>() / 32.0;
        assert!((0.95..1.05).contains(&(mean_m_s / speed_m_s)), "{mean_m_s} of {speed_m_s}");
    }

    #[test]
    fn without_plans_the_last_one_goes_on_to_its_end() {
        let robot = agilebot();
        let mut course = from_nominal(&robot, 0.1, 1.0);
        let forward = Steering { forward_m_s: 0.15, ..Steering::default() };
        steered(&mut course, &[(forward, 3)]);
        // Stopped during the first iteration, from a state far from the command.
        let wild = Steering { forward_m_s: 40.0, left_m_s: 30.0, turn_rad_s: 50.0 };
        let mut outcomes = Vec::new();
        for _ in 0..6 {
            outcomes.push(course.go_on(wild, &mut |_| ControlFlow::Break(())));
        }
        let rejected: Vec<_> = outcomes.iter().flatten().filter(|s| !s.accepted).collect();
        // 1.0 s of the last plan, of which 0.2 s were played.
        assert_eq!(rejected.len(), 4, "{outcomes:?}");
        assert!(matches!(outcomes[4], Err(CourseError::NoPlan { .. })));
        check_frames(&robot, &outcomes.into_iter().flatten().collect::<Vec<_>>());
        let wrong = Course::new(&robot, &[0.0], 0.1, 0.2, HorizonOptions::default());
        assert!(matches!(wrong, Err(HorizonError::OtherRobot { what: "joint_rad", .. })));
    }
}
