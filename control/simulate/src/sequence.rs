//! Sequence of plans in closed loop: the robot stands, makes a transition to a gait, repeats the gait and returns to standing.
//!
//! The estimator and the tracker run through all plans, so that the state estimate survives a change of plan. Each plan is
//! placed at the end of the previous one. Times are those of the caller's measurements, and samples may be missing.

use crate::closed_loop::PlacedPlan;
use crate::follower::{FollowedPlan, Follower};
use crate::script::Script;
use crate::tick::{Measurement, Timing, TrackingError};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rollwalk_multibody::{State, Tree};
use rollwalk_physics::motor::Law;
use rollwalk_physics::world::heading_rad;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_tracking::{Gains, Reference};
use thiserror::Error;

/// Largest difference of a joint angle at the boundary of two plans, rad. The splines of both plans pass through a common
/// state.
const JOINED_RAD: f64 = 0.01;

/// Plan of a sequence, with its gains.
pub struct Leg<'p> {
    script: Script<'p>,
    plan: PlacedPlan,
    gains: Gains,
    cycles: u32,
    hold_s: f64,
}

/// Error of plans that do not form a sequence.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SequenceError {
    /// Empty sequence.
    #[error("the sequence has no plans")]
    Empty,
    /// Sequence that begins or ends in motion.
    #[error("a sequence must begin and end at rest, but `{motion}` does not")]
    InMotion {
        /// Motion that does not begin or end at rest.
        motion: String,
    },
    /// Plans of different robots.
    #[error("`{motion}` is planned for a different robot from `{first}`")]
    OtherRobot {
        /// Motion of another robot.
        motion: String,
        /// First motion of the sequence.
        first: String,
    },
    /// Plan whose start pose differs from the end pose of the previous plan.
    #[error(
        "`{motion}` begins with `{joint}` {off_rad:.3} rad away from its angle at the end of \
         `{before}`"
    )]
    Apart {
        /// Motion with the different start pose.
        motion: String,
        /// Previous motion.
        before: String,
        /// Joint that differs.
        joint: String,
        /// Difference of the angles, rad.
        off_rad: f64,
    },
}

/// Progress of a sequence at the time at which the set-points of the previous tick act.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// True if the rest before the first plan is over.
    pub moves: bool,
    /// Index of the present plan.
    pub leg: usize,
    /// Number of completed cycles of a periodic plan.
    pub cycle: u32,
    /// Time since the start of the plan, s, over all its cycles.
    pub time_s: f64,
}

/// Closed-loop controller of consecutive plans.
pub struct Sequence<'p> {
    legs: Vec<Leg<'p>>,
    follower: Follower,
    timing: Timing,
    /// True if contacts are taken from the plan instead of contact switches.
    planned_contacts: bool,
    /// Time of the previous measurement, s.
    last_s: Option<f64>,
    /// Index of the plan at the previous tick.
    leg: usize,
    /// Time at which the first set-points of this plan act, s; `None` during the rest before the first plan.
    began_s: Option<f64>,
    /// Index of the plan whose set-points the motors get if the robot cannot be tracked.
    acts: usize,
    /// True if the start of the sequence is requested.
    goes: bool,
    /// True if the robot was tracked at the previous tick.
    ready: bool,
    reference: Option<Reference>,
}

impl<'p> Leg<'p> {
    /// Creates a leg that plays a validated plan once.
    ///
    /// The computation of the gains takes up to some tenths of a second.
    pub fn new(plan: &'p Plan) -> Self {
        let script = Script::new(plan, true);
        let (body, world_from_plan) = (WholeBody::new(plan), Isometry3::identity());
        let mut plan = PlacedPlan { body, world_from_plan, from_s: 0.0 };
        let gains = plan.gains(&script);
        Self { script, plan, gains, cycles: 1, hold_s: 0.0 }
    }

    /// Sets the number of cycles of a periodic motion. A finite motion is always played once.
    #[must_use]
    pub fn times(mut self, cycles: u32) -> Self {
        self.cycles = cycles;
        self
    }

    /// Sets the time for which the robot holds the end pose of a finite motion, s. Has no effect on a periodic motion.
    #[must_use]
    pub fn held(mut self, hold_s: f64) -> Self {
        self.hold_s = hold_s.max(0.0);
        self
    }

    /// Plan of the leg.
    pub fn plan(&self) -> &'p Plan {
        self.script.plan()
    }

    /// Number of cycles; 1 for a finite motion.
    pub fn cycles(&self) -> u32 {
        if self.script.repeats() { self.cycles } else { 1 }
    }

    /// Duration including the hold, s.
    pub fn duration_s(&self) -> f64 {
        match self.script.repeats() {
            true => self.moves_s(),
            false => self.moves_s() + self.hold_s,
        }
    }

    /// Duration without the hold, s.
    fn moves_s(&self) -> f64 {
        let cycles = if self.script.repeats() { f64::from(self.cycles) } else { 1.0 };
        cycles * self.script.duration_s()
    }

    /// Position and heading of the body on the ground at `time_s` of the plan.
    fn ground_pose(&self, time_s: f64) -> Isometry3<f64> {
        let (position_m, rotation) = self.script.base(time_s);
        ground_pose(&position_m, &rotation)
    }

    fn name(&self) -> String {
        self.plan().motion.name.clone()
    }

    /// Shortens this part of the sequence to the first moment after `time_s` at which its motion can end. Only the last part
    /// keeps its hold time.
    fn end(&mut self, time_s: f64, is_last: bool) {
        let period_s = self.script.duration_s();
        if self.script.repeats() {
            // A cycle that has begun is completed: transitions leave from its end.
            self.cycles = self.cycles.min((time_s / period_s).ceil().max(0.0) as u32);
        } else if !is_last {
            self.hold_s = self.hold_s.min((time_s - period_s).max(0.0));
        }
    }
}

impl<'p> Sequence<'p> {
    /// Creates a sequence of plans. Each plan begins in the end state of the previous one.
    ///
    /// The sequence waits at the start of the first plan for [`go`](Self::go). [`change_latency`](Self::change_latency) can
    /// change the latency of `timing` until then.
    ///
    /// # Errors
    /// Returns an error if a plan does not begin in the end pose of the previous one, the plans are for different robots, or the
    /// sequence does not begin and end at rest.
    pub fn new(mut legs: Vec<Leg<'p>>, timing: Timing) -> Result<Self, SequenceError> {
        let (Some(first), Some(last)) = (legs.first(), legs.last()) else {
            return Err(SequenceError::Empty);
        };
        if let Some(moves) =
            [first, last].into_iter().find(|leg| leg.plan().motion.ends != Ends::AtRest)
        {
            return Err(SequenceError::InMotion { motion: moves.name() });
        }
        let robot = first.script.robot();
        if let Some(other) = legs.iter().find(|leg| leg.script.robot() != robot) {
            let (motion, first) = (other.name(), first.name());
            return Err(SequenceError::OtherRobot { motion, first });
        }
        for pair in legs.windows(2) {
            joined(&pair[0], &pair[1])?;
        }
        let mut follower = Follower::new(&first.script, first.plan.body.tree(), timing);
        follower.change_plan(first.gains.clone());
        // Pose in which an estimator that aligns at rest places the robot.
        let start = legs[0].ground_pose(0.0).inverse();
        legs[0].plan.world_from_plan = start;
        Ok(Self {
            legs,
            follower,
            timing,
            planned_contacts: false,
            last_s: None,
            leg: 0,
            began_s: None,
            acts: 0,
            goes: false,
            ready: false,
            reference: None,
        })
    }

    /// Selects, from the next tick on, whether planned stance feet count as touching the ground regardless of measurements.
    ///
    /// Use it for a robot without contact switches, or if their readings are not received.
    pub fn use_planned_contacts(&mut self, planned: bool) {
        self.planned_contacts = planned;
    }

    /// Model of the robot with turning wheels and rotors. States and velocities of [`Measurement`] refer to it.
    pub fn tree(&self) -> &Tree {
        self.follower.tracker.tree()
    }

    /// Legs of the sequence.
    pub fn legs(&self) -> &[Leg<'p>] {
        &self.legs
    }

    /// Changes the time from a measurement until set-points act, s, and returns true if it was changed.
    ///
    /// A bus measures this latency while the robot stands. Once the robot moves, the latency cannot be changed.
    pub fn change_latency(&mut self, latency_s: f64) -> bool {
        let is_taken = self.began_s.is_none();
        if is_taken {
            self.timing.latency_s = latency_s;
            self.follower.tracker.change_latency(latency_s);
        }
        is_taken
    }

    /// True if the robot was tracked at the previous tick. Its state is known, so that [`go`](Self::go) starts the motion at
    /// the next tick.
    pub fn is_ready(&self) -> bool {
        self.ready
    }

    /// Starts the motion as soon as the robot has been tracked for a tick. The plan is then placed at the robot.
    pub fn go(&mut self) {
        self.goes = true;
    }

    /// Ends the sequence early.
    ///
    /// A robot that still stands remains standing. A moving robot completes its present cycle and plays the remaining plans
    /// once, without holds except the final one.
    pub fn stop(&mut self) {
        self.goes = false;
        if self.began_s.is_none() {
            return;
        }
        let Progress { leg: present, time_s, .. } = self.progress();
        let last = self.legs.len() - 1;
        for (index, leg) in self.legs.iter_mut().enumerate().skip(present) {
            leg.end(if index == present { time_s } else { 0.0 }, index == last);
        }
    }

    /// Progress at the previous tick.
    pub fn progress(&self) -> Progress {
        let leg = &self.legs[self.leg];
        let time_s = self.began_s.zip(self.last_s);
        let time_s = time_s.map_or(0.0, |(began_s, last_s)| self.acts_s(last_s) - began_s);
        let cycles = (time_s / leg.script.duration_s()).floor().max(0.0) as u32;
        let cycle = if leg.script.repeats() { cycles } else { 0 };
        Progress { moves: self.began_s.is_some(), leg: self.leg, cycle, time_s }
    }

    /// True if all plans and holds have been played. Further ticks track the robot at the end of the final plan.
    pub fn is_over(&self) -> bool {
        let Progress { leg, time_s, .. } = self.progress();
        leg + 1 == self.legs.len() && time_s >= self.legs[leg].duration_s()
    }

    /// True if the robot could not be tracked, was stopped, and now stands ([`TrackingError::Stopped`]).
    pub fn has_stopped(&self) -> bool {
        self.follower.has_stopped()
    }

    /// Reference at the time at which the set-points of the previous tick act.
    pub fn reference(&self) -> Option<&Reference> {
        self.reference.as_ref()
    }

    /// State estimate at the previous tick with sensors, trusted or not.
    pub fn estimate(&self) -> &State {
        self.follower.estimator.state()
    }

    /// Control laws of the motors from a measurement until the next one.
    ///
    /// `time_s` is the time of the measurement, s, from any origin; ticks may be skipped. If the robot is not tracked, the motors
    /// get the set-points of the plan, and the reason is returned too. With sensors, a robot is not tracked if `time_s` is not
    /// later than the previous time. After 0.1 s without set-points in motion the robot stops for good
    /// ([`TrackingError::Stopped`]).
    pub fn tick(
        &mut self,
        time_s: f64,
        measured: Measurement<'_>,
    ) -> (Vec<Law>, Option<TrackingError>) {
        let time_s = if time_s.is_finite() { time_s } else { self.last_s.unwrap_or(0.0) };
        let now_s = self.last_s.map_or(time_s, |last_s| time_s.max(last_s));
        let since_s = self.last_s.map_or(self.timing.tick_s, |last_s| now_s - last_s);
        self.last_s = Some(now_s);
        if let Some(laws) = self.follower.stopped(&self.legs[self.acts].script, since_s) {
            self.ready = false;
            return (laws, Some(TrackingError::Stopped));
        }
        if self.began_s.is_none() {
            self.rest(now_s, measured);
        }
        let leg_s = self.change_leg(self.acts_s(now_s));
        let latency_s = self.timing.latency_s;
        let Leg { plan, .. } = &mut self.legs[self.leg];
        let reference = plan.reference(leg_s);
        let planned = self.planned_contacts.then(|| plan.body.stands((leg_s - latency_s).max(0.0)));
        let moves = self.began_s.is_some();
        let ends_s = self.acts_s(now_s) + self.timing.tick_s;
        let (acts, _, acts_s) = self.at(ends_s);
        self.acts = acts;
        let Leg { script, plan, .. } = &self.legs[acts];
        let followed = FollowedPlan {
            script,
            body: &plan.body,
            contacts: planned.as_deref(),
            may_stop: moves,
        };
        let (laws, untracked) =
            self.follower.tick(&followed, &reference, acts_s, since_s, measured);
        self.ready = untracked.is_none();
        self.reference = Some(reference);
        (laws, untracked)
    }

    /// Time at which the set-points from a measurement act, s.
    fn acts_s(&self, measured_s: f64) -> f64 {
        measured_s + self.timing.latency_s
    }

    /// Places the first plan at the robot's position during the rest before the plan: when the robot's state becomes known, and
    /// again when the motion begins.
    fn rest(&mut self, now_s: f64, measured: Measurement<'_>) {
        let begins = self.goes && self.ready;
        if self.ready && !begins {
            return;
        }
        let state = match measured {
            Measurement::State(state, _) => state,
            // An alignment keeps the origin of the estimator.
            Measurement::Sensors(_) => self.follower.estimator.state(),
        };
        let there = ground_pose(&state.base_position_m, &state.world_from_body);
        if !there.to_homogeneous().iter().all(|value| value.is_finite()) {
            return;
        }
        let anchor_m = self.follower.tracker.anchor_m();
        let back = Translation3::new(-anchor_m.x, -anchor_m.y, 0.0);
        self.legs[0].plan.world_from_plan = back * there * self.legs[0].ground_pose(0.0).inverse();
        if begins {
            self.began_s = Some(self.acts_s(now_s));
        }
    }

    /// Index of the plan at the time `acts_s`, start time of this plan, and time since its start, s.
    fn at(&self, acts_s: f64) -> (usize, Option<f64>, f64) {
        let Some(mut began_s) = self.began_s else { return (self.leg, None, 0.0) };
        let mut leg = self.leg;
        while leg + 1 < self.legs.len() && acts_s - began_s >= self.legs[leg].duration_s() {
            began_s += self.legs[leg].duration_s();
            leg += 1;
        }
        (leg, Some(began_s), acts_s - began_s)
    }

    /// Changes to the plan at the time `acts_s`, and returns the time since its start, s.
    fn change_leg(&mut self, acts_s: f64) -> f64 {
        let (leg, began_s, leg_s) = self.at(acts_s);
        for next in self.leg + 1..=leg {
            let before = &self.legs[next - 1];
            let end = before.plan.world_from_plan * before.ground_pose(before.moves_s());
            let begins = self.legs[next].ground_pose(0.0);
            self.legs[next].plan.world_from_plan = end * begins.inverse();
        }
        if leg != self.leg {
            self.follower.change_plan(self.legs[leg].gains.clone());
        }
        (self.leg, self.began_s) = (leg, began_s);
        leg_s
    }
}

/// Position on the ground and heading of a body.
fn ground_pose(position_m: &Vector3<f64>, rotation: &Matrix3<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading_rad(rotation));
    Isometry3::from_parts(Translation3::new(position_m.x, position_m.y, 0.0), turn)
}

/// Checks that a plan begins in the end pose of the previous one.
fn joined(before: &Leg<'_>, leg: &Leg<'_>) -> Result<(), SequenceError> {
    let end = before.script.joint_rad(before.moves_s());
    let joints = end.iter().zip(leg.script.joint_rad(0.0)).zip(&leg.script.robot().joints);
    for ((there, here), joint) in joints {
        let off_rad = here - there;
        if off_rad.abs() > JOINED_RAD {
            return Err(SequenceError::Apart {
                motion: leg.name(),
                before: before.name(),
                joint: joint.name.clone(),
                off_rad,
            });
        }
    }
    Ok(())
}
