//! Tracks a plan in closed loop: each tick takes the measured state or the readings of the sensors, and returns the setpoints of all motors until the next
//! tick. The world may be ours or another's.
//!
//! [`crate::control`] asks it about the simulated world, `rollwalk control` for the simulators of others.

use crate::follower::{Followed, Follower, LOST_S};
use crate::script::Script;
use nalgebra::Isometry3;
use rollwalk_multibody::{State, Tree};
use rollwalk_physics::motor::Law;
use rollwalk_planner::whole_body::{Instant, WholeBody};
use rollwalk_tracking::estimator::Untrusted;
use rollwalk_tracking::model::Costs;
use rollwalk_tracking::{Gains, NoSetpoints, Reference, Sensors, Setpoint};
use thiserror::Error;

/// How the robot is brought back to the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feedback {
    /// Each task by itself: centre of mass, body and wheels have their own gains.
    Tasks,
    /// Gains of the plan's linear model, for all of them together.
    Gains,
}

/// What is known of the robot at a tick.
#[derive(Clone, Copy, Debug)]
pub enum Measured<'a> {
    /// Its state, in the world of the plan's placement, and whether each end effector touches the ground.
    State(&'a State, &'a [bool]),
    /// What its sensors measured since the last tick.
    Sensors(&'a Sensors<'a>),
}

/// Why the motors got the plan as in open loop, or its stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Untracked {
    /// The state is not known well enough.
    #[error("{0}")]
    State(Untrusted),
    /// The tracker found no setpoints.
    #[error("{0}")]
    Setpoints(NoSetpoints),
    /// It was pushed beyond the edge of its support: the steps of its plan go on under it.
    #[error(
        "it was pushed beyond the edge of its support, and the steps of its plan are to catch it"
    )]
    CaughtBySteps,
    /// It had to recover twice as soon as it had resumed its plan, which goes on in open loop until it ends.
    #[error("it stumbled from one recovery into the next, and its plan goes on in open loop")]
    Stumbled,
    /// It was not tracked for 0.1 s: it comes to rest, and stays so.
    #[error(
        "it was not tracked for {LOST_S} s, and is brought to a stop for good: begin the motion anew"
    )]
    Stopped,
}

/// When a controller acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Interval between ticks, s.
    pub tick_s: f64,
    /// Time from a measurement until the motors act on the setpoints computed from it, s, beyond the tick itself.
    pub latency_s: f64,
}

/// A controller of one plan.
pub struct ClosedLoop<'s, 'p> {
    script: &'s Script<'p>,
    plan: Placed,
    follower: Follower,
    timing: Timing,
}

/// A plan where it lies in the world, on its plane z = 0, from a time on, s.
pub(crate) struct Placed {
    pub body: WholeBody,
    pub world_from_plan: Isometry3<f64>,
    pub from_s: f64,
}

impl<'s, 'p> ClosedLoop<'s, 'p> {
    /// `world_from_plan` says where the plan lies, in a world whose z is up. Gains are computed here, which takes up to
    /// some tenths of a second.
    pub fn new(
        script: &'s Script<'p>,
        feedback: Feedback,
        world_from_plan: Isometry3<f64>,
        timing: Timing,
    ) -> Self {
        let mut plan = Placed { body: WholeBody::new(script.plan()), world_from_plan, from_s: 0.0 };
        let mut follower = Follower::new(script, plan.body.tree(), timing);
        if feedback == Feedback::Gains {
            follower.change_plan(plan.gains(script));
        }
        Self { script, plan, follower, timing }
    }

    /// The robot with turning wheels and rotors, whose states and velocities those of [`Measured`] are.
    pub fn tree(&self) -> &Tree {
        self.follower.tracker.tree()
    }

    /// Tells the estimator a state that is known by other means ([`rollwalk_tracking::Estimator::align`]).
    ///
    /// # Errors
    /// The state is not finite.
    pub fn align(&mut self, state: &State) -> Result<(), Untrusted> {
        self.follower.estimator.align(state)
    }

    /// What the motors do in a tick between two times of the motion, periods counted on, s; `measured` is
    /// its beginning. If the tracker has no setpoints, they get those of the plan with its torques; the reason comes beside them. After 0.1 s of
    /// that in a motion the robot is brought to a stop: the plan goes on to the next moment at which all of its end effectors stand, or most, and ends there.
    pub fn tick(
        &mut self,
        [from_s, to_s]: [f64; 2],
        measured: Measured<'_>,
    ) -> (Vec<Law>, Option<Untracked>) {
        let Self { script, plan, follower, timing: Timing { tick_s, latency_s } } = self;
        if let Some(laws) = follower.stopped(script, *tick_s) {
            return (laws, Some(Untracked::Stopped));
        }
        // A motion that ends has a rest before it, in which its reference does not move: wheels would creep ahead.
        let moves = from_s > 0.0 || script.repeats();
        let ahead_s = if moves { *latency_s } else { 0.0 };
        let reference = plan.reference(from_s + ahead_s);
        // Before it moves it stands still, and the estimator may align itself.
        let followed =
            Followed { script, body: &plan.body, contacts: None, may_stop: from_s > 0.0 };
        follower.tick(&followed, &reference, to_s + ahead_s, *tick_s, measured)
    }
}

/// A servo with what it is to do until the next tick.
pub(crate) fn law(servo: &Law, setpoint: &Setpoint) -> Law {
    Law {
        kp_nm_rad: setpoint.kp_nm_rad,
        kd_nm_s_rad: setpoint.kd_nm_s_rad,
        position_rad: setpoint.position_rad,
        speed_rad_s: setpoint.speed_rad_s,
        torque_nm: setpoint.torque_nm,
        ..*servo
    }
}

impl Placed {
    /// Gains for its script, wherever it lies.
    pub fn gains(&mut self, script: &Script<'_>) -> Gains {
        let (costs, tree) = (Costs::default(), self.body.tree().clone());
        let reference = |time_s| self.reference(time_s);
        Gains::new(&tree, &costs, script.duration_s(), script.repeats(), reference)
    }

    pub fn at(&mut self, time_s: f64) -> Instant {
        self.body.at(time_s - self.from_s, &self.world_from_plan)
    }

    pub fn reference(&mut self, time_s: f64) -> Reference {
        let Instant { state, acceleration, stands, force_n } = self.at(time_s);
        let world_from_ground = self.world_from_plan;
        Reference { time_s, world_from_ground, state, acceleration, stands, force_n }
    }
}
