//! Plans that follow each other in closed loop, as a robot on a bus plays them: it stands, goes over into a gait, repeats it,
//! and comes to a stand again.
//!
//! One estimator and one tracker run through all plans, so that the state estimate survives a change of plan. Each plan lies
//! where the one before ended. Times are those of the caller's measurements: samples may be missing.

use crate::closed_loop::Placed;
use crate::follower::{Followed, Follower};
use crate::script::Script;
use crate::tick::{Measured, Timing, Untracked};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rollwalk_multibody::{State, Tree};
use rollwalk_physics::motor::Law;
use rollwalk_physics::world::heading_rad;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_tracking::{Gains, Reference};
use thiserror::Error;

/// Largest difference of a joint between two plans that join, rad: splines of both go through the same state.
const JOINED_RAD: f64 = 0.01;

/// A plan of a sequence, prepared.
pub struct Leg<'p> {
    script: Script<'p>,
    plan: Placed,
    gains: Gains,
    cycles: u32,
    hold_s: f64,
}

/// Plans that do not make a sequence.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SequenceError {
    /// Sequence without plans.
    #[error("a sequence without plans")]
    Empty,
    /// Sequence that begins or ends in motion.
    #[error("a sequence begins and ends at rest, but `{motion}` does not")]
    InMotion {
        /// The motion at its beginning or end.
        motion: String,
    },
    /// Plans of several robots.
    #[error("`{motion}` is planned for another robot than `{first}`")]
    OtherRobot {
        /// The motion.
        motion: String,
        /// The first motion.
        first: String,
    },
    /// A plan begins in another pose than the one before ends in.
    #[error(
        "`{motion}` begins where `{joint}` is {off_rad:.3} rad away from the end of `{before}`"
    )]
    Apart {
        /// The motion.
        motion: String,
        /// The motion before.
        before: String,
        /// The joint.
        joint: String,
        /// Difference of the angles, rad.
        off_rad: f64,
    },
}

/// Progress of a sequence, at the setpoints of its last tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// True if the rest before the first plan is over.
    pub moves: bool,
    /// Index of the plan.
    pub leg: usize,
    /// Completed cycles of a plan that repeats.
    pub cycle: u32,
    /// Time since the plan began, s; its cycles counted on.
    pub time_s: f64,
}

/// A controller of plans that follow each other.
pub struct Sequence<'p> {
    legs: Vec<Leg<'p>>,
    follower: Follower,
    timing: Timing,
    /// True if contacts are those of the plan, not of switches.
    planned_contacts: bool,
    /// Time of the last measurement, s.
    last_s: Option<f64>,
    /// The plan at the last tick, and when it began, in times at which setpoints act, s; `None` at the rest before the first one.
    leg: usize,
    began_s: Option<f64>,
    /// The plan whose setpoints a robot gets that cannot be tracked.
    acts: usize,
    /// True if the sequence is to begin; `ready` is true if the state was known at the last tick.
    goes: bool,
    ready: bool,
    reference: Option<Reference>,
}

impl<'p> Leg<'p> {
    /// A validated plan, once. Gains are computed here, which takes up to some tenths of a second.
    pub fn new(plan: &'p Plan) -> Self {
        let script = Script::new(plan, true);
        let (body, world_from_plan) = (WholeBody::new(plan), Isometry3::identity());
        let mut plan = Placed { body, world_from_plan, from_s: 0.0 };
        let gains = plan.gains(&script);
        Self { script, plan, gains, cycles: 1, hold_s: 0.0 }
    }

    /// The same with so many cycles of a motion that repeats; one that ends is played once all the same.
    #[must_use]
    pub fn times(mut self, cycles: u32) -> Self {
        self.cycles = cycles;
        self
    }

    /// The same, held beyond the end of a motion that comes to rest, s; one that repeats has no such end.
    #[must_use]
    pub fn held(mut self, hold_s: f64) -> Self {
        self.hold_s = hold_s.max(0.0);
        self
    }

    /// The plan.
    pub fn plan(&self) -> &'p Plan {
        self.script.plan()
    }

    /// Number of cycles; 1 for a motion that ends.
    pub fn cycles(&self) -> u32 {
        if self.script.repeats() { self.cycles } else { 1 }
    }

    /// Duration, s, including the hold.
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

    /// Place and heading of the body at a time, on the ground of the plan.
    fn place(&self, time_s: f64) -> Isometry3<f64> {
        let (position_m, rotation) = self.script.base(time_s);
        place(&position_m, &rotation)
    }

    fn name(&self) -> String {
        self.plan().motion.name.clone()
    }

    /// Ends it as soon as it can be left, from a time of it on, s; the last one of a sequence stays.
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
    /// A sequence of plans, each of which begins in the state in which the one before ends. It waits at the beginning of the
    /// first one for [`go`](Self::go). `latency_s` of the timing may still change.
    ///
    /// # Errors
    /// The plans do not follow each other, or they do not begin and end at rest.
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
        // Where an estimator that aligns itself at rest puts the robot.
        let start = legs[0].place(0.0).inverse();
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

    /// Sets from the next tick on if planned stance feet count as touching the ground, whatever is measured: the robot has no
    /// contact switches, or their readings are not received.
    pub fn use_planned_contacts(&mut self, planned: bool) {
        self.planned_contacts = planned;
    }

    /// The robot with turning wheels and rotors, whose states and velocities those of [`Measured`] are.
    pub fn tree(&self) -> &Tree {
        self.follower.tracker.tree()
    }

    /// The plans.
    pub fn legs(&self) -> &[Leg<'p>] {
        &self.legs
    }

    /// Changes the time from a measurement until setpoints act, s, which a bus measures while the robot stands. Returns whether
    /// it did: once the robot moves its latency stays.
    pub fn change_latency(&mut self, latency_s: f64) -> bool {
        let is_taken = self.began_s.is_none();
        if is_taken {
            self.timing.latency_s = latency_s;
            self.follower.tracker.change_latency(latency_s);
        }
        is_taken
    }

    /// True if the robot was tracked at the last tick: its state is known, and [`go`](Self::go) will act at the next one.
    pub fn is_ready(&self) -> bool {
        self.ready
    }

    /// Begins at the next tick before which the robot was tracked; the plan then lies where the robot stands.
    pub fn go(&mut self) {
        self.goes = true;
    }

    /// Ends early. A robot that still stands stays; one that moves completes its present cycle, and plays the plans that come
    /// after it without repeating or holding them, but for the hold of the last one.
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

    /// Progress at the last tick.
    pub fn progress(&self) -> Progress {
        let leg = &self.legs[self.leg];
        let time_s = self.began_s.zip(self.last_s);
        let time_s = time_s.map_or(0.0, |(began_s, last_s)| self.acts_s(last_s) - began_s);
        let cycles = (time_s / leg.script.duration_s()).floor().max(0.0) as u32;
        let cycle = if leg.script.repeats() { cycles } else { 0 };
        Progress { moves: self.began_s.is_some(), leg: self.leg, cycle, time_s }
    }

    /// True if all plans have been played and held. The robot is tracked at the end of the last one as long as there are ticks.
    pub fn is_over(&self) -> bool {
        let Progress { leg, time_s, .. } = self.progress();
        leg + 1 == self.legs.len() && time_s >= self.legs[leg].duration_s()
    }

    /// True if a robot that could not be tracked has been brought to a stop, and stands ([`Untracked::Stopped`]).
    pub fn has_stopped(&self) -> bool {
        self.follower.has_stopped()
    }

    /// Reference for the moment at which the setpoints of the last tick act.
    pub fn reference(&self) -> Option<&Reference> {
        self.reference.as_ref()
    }

    /// The estimate of the last tick with sensors, whether or not it may be trusted.
    pub fn estimate(&self) -> &State {
        self.follower.estimator.state()
    }

    /// Control laws of the motors from a measurement until the next one. `time_s` is the time of the measurement, s, from any
    /// origin; ticks may be skipped. If the time is not later than the last one, or there are no setpoints for another reason,
    /// the motors get the setpoints of the plan, and the reason is returned beside them. After 0.1 s of that in motion the robot
    /// is brought to a stop, and stays so ([`Untracked::Stopped`]).
    pub fn tick(&mut self, time_s: f64, measured: Measured<'_>) -> (Vec<Law>, Option<Untracked>) {
        let time_s = if time_s.is_finite() { time_s } else { self.last_s.unwrap_or(0.0) };
        let now_s = self.last_s.map_or(time_s, |last_s| time_s.max(last_s));
        let since_s = self.last_s.map_or(self.timing.tick_s, |last_s| now_s - last_s);
        self.last_s = Some(now_s);
        if let Some(laws) = self.follower.stopped(&self.legs[self.acts].script, since_s) {
            self.ready = false;
            return (laws, Some(Untracked::Stopped));
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
        let followed =
            Followed { script, body: &plan.body, contacts: planned.as_deref(), may_stop: moves };
        let (laws, untracked) =
            self.follower.tick(&followed, &reference, acts_s, since_s, measured);
        self.ready = untracked.is_none();
        self.reference = Some(reference);
        (laws, untracked)
    }

    /// Time at which setpoints from a measurement act, s.
    fn acts_s(&self, measured_s: f64) -> f64 {
        measured_s + self.timing.latency_s
    }

    /// Places the plan at rest: at the robot when its state becomes known, and again when it begins.
    fn rest(&mut self, now_s: f64, measured: Measured<'_>) {
        let begins = self.goes && self.ready;
        if self.ready && !begins {
            return;
        }
        let state = match measured {
            Measured::State(state, _) => state,
            // An alignment keeps them.
            Measured::Sensors(_) => self.follower.estimator.state(),
        };
        let there = place(&state.base_position_m, &state.world_from_body);
        if !there.to_homogeneous().iter().all(|value| value.is_finite()) {
            return;
        }
        let anchor_m = self.follower.tracker.anchor_m();
        let back = Translation3::new(-anchor_m.x, -anchor_m.y, 0.0);
        self.legs[0].plan.world_from_plan = back * there * self.legs[0].place(0.0).inverse();
        if begins {
            self.began_s = Some(self.acts_s(now_s));
        }
    }

    /// The plan of a moment at which setpoints act, when it begins and the time of it, s.
    fn at(&self, acts_s: f64) -> (usize, Option<f64>, f64) {
        let Some(mut began_s) = self.began_s else { return (self.leg, None, 0.0) };
        let mut leg = self.leg;
        while leg + 1 < self.legs.len() && acts_s - began_s >= self.legs[leg].duration_s() {
            began_s += self.legs[leg].duration_s();
            leg += 1;
        }
        (leg, Some(began_s), acts_s - began_s)
    }

    /// Goes over to the plan of a moment at which setpoints act, and returns the time of it, s.
    fn change_leg(&mut self, acts_s: f64) -> f64 {
        let (leg, began_s, leg_s) = self.at(acts_s);
        for next in self.leg + 1..=leg {
            let before = &self.legs[next - 1];
            let end = before.plan.world_from_plan * before.place(before.moves_s());
            let begins = self.legs[next].place(0.0);
            self.legs[next].plan.world_from_plan = end * begins.inverse();
        }
        if leg != self.leg {
            self.follower.change_plan(self.legs[leg].gains.clone());
        }
        (self.leg, self.began_s) = (leg, began_s);
        leg_s
    }
}

/// Place and heading of a body.
fn place(position_m: &Vector3<f64>, rotation: &Matrix3<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading_rad(rotation));
    Isometry3::from_parts(Translation3::new(position_m.x, position_m.y, 0.0), turn)
}

/// Checks that a plan begins in the pose in which the one before ends.
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
