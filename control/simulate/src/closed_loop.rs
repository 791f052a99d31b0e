//! Tracking of a plan in closed loop, in the simulated world of this project or in another simulator.
//!
//! Each tick receives the measured state or the readings of the sensors, and returns the set-points of all motors until the
//! next tick. [`crate::control`] uses this module in the simulated world, `rollwalk control` in other simulators.

use crate::balance;
use crate::follower::{FollowedPlan, Follower};
use crate::script::Script;
pub use crate::tick::{Measurement, Timing, TrackingError};
use nalgebra::Isometry3;
use rollwalk_multibody::{State, Tree};
use rollwalk_physics::motor::Law;
use rollwalk_planner::whole_body::{Instant, WholeBody};
use rollwalk_tracking::estimator::EstimateError;
use rollwalk_tracking::model::Costs;
use rollwalk_tracking::{Gains, Reference};

/// Method that brings the robot back to the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feedback {
    /// Separate tasks: centre of mass, body and wheels each have their own gains.
    Tasks,
    /// Gains from the linear model of the plan, which couples centre of mass, body and wheels.
    Gains,
}

/// Closed-loop controller of one plan.
pub struct ClosedLoop<'s, 'p> {
    script: &'s Script<'p>,
    plan: PlacedPlan,
    follower: Follower,
    timing: Timing,
}

/// Plan at its pose and start time in the world. In its own frame the ground is the plane z = 0.
pub(crate) struct PlacedPlan {
    pub body: WholeBody,
    pub world_from_plan: Isometry3<f64>,
    pub from_s: f64,
}

impl<'s, 'p> ClosedLoop<'s, 'p> {
    /// Creates a controller for a plan that is placed by `world_from_plan` in a world whose z axis points up.
    ///
    /// The computation of the gains takes up to some tenths of a second.
    pub fn new(
        script: &'s Script<'p>,
        feedback: Feedback,
        world_from_plan: Isometry3<f64>,
        timing: Timing,
    ) -> Self {
        let mut plan =
            PlacedPlan { body: WholeBody::new(script.plan()), world_from_plan, from_s: 0.0 };
        let mut follower = Follower::new(script, plan.body.tree(), timing);
        if feedback == Feedback::Gains {
            follower.change_plan(plan.gains(script));
        }
        Self { script, plan, follower, timing }
    }

    /// Model of the robot with turning wheels and rotors. States and velocities of [`Measurement`] refer to it.
    pub fn tree(&self) -> &Tree {
        self.follower.tracker.tree()
    }

    /// Sets the state of the estimator to a known one ([`rollwalk_tracking::Estimator::align`]).
    ///
    /// # Errors
    /// Returns an error if the state is not finite.
    pub fn align(&mut self, state: &State) -> Result<(), EstimateError> {
        self.follower.estimator.align(state)
    }

    /// Control laws of the motors in a tick that lasts from `from_s` to `to_s` of the motion.
    ///
    /// Times are in s and continue over all periods. `measured` is the measurement at the beginning of the tick. If the robot is
    /// not tracked, the motors get the planned set-points and torques, and the reason is returned too. After 0.1 s without
    /// set-points of the tracker the robot stops: the plan ends at the next time with the largest number of stance feet.
    pub fn tick(
        &mut self,
        [from_s, to_s]: [f64; 2],
        measured: Measurement<'_>,
    ) -> (Vec<Law>, Option<TrackingError>) {
        let Self { script, plan, follower, timing: Timing { tick_s, latency_s } } = self;
        if let Some(laws) = follower.stopped(script, *tick_s) {
            return (laws, Some(TrackingError::Stopped));
        }
        // Before a finite motion the reference stands still. A reference ahead by the latency would make the wheels creep.
        let moves = from_s > 0.0 || script.repeats();
        let ahead_s = if moves { *latency_s } else { 0.0 };
        let reference = plan.reference(from_s + ahead_s);
        // Before the motion, the robot stands still, and the estimator may align.
        let followed =
            FollowedPlan { script, body: &plan.body, contacts: None, may_stop: from_s > 0.0 };
        follower.tick(&followed, &reference, to_s + ahead_s, *tick_s, measured)
    }
}

impl PlacedPlan {
    /// Gains for the script of this plan. They do not depend on the pose of the plan.
    pub fn gains(&mut self, script: &Script<'_>) -> Gains {
        let (costs, tree) = (Costs::default(), self.body.tree().clone());
        let reference = |time_s| self.reference(time_s);
        Gains::new(&tree, &costs, script.duration_s(), script.repeats(), reference)
    }

    pub fn at(&mut self, time_s: f64) -> Instant {
        self.body.at(time_s - self.from_s, &self.world_from_plan)
    }

    pub fn reference(&mut self, time_s: f64) -> Reference {
        let Instant { state, acceleration, stands, force_n, ground_height_m, ground_normal } =
            self.at(time_s);
        let world_from_ground = self.world_from_plan;
        let mut reference = Reference {
            time_s,
            world_from_ground,
            state,
            acceleration,
            stands,
            force_n,
            ground_height_m,
            ground_normal,
        };
        balance::upright(self.body.tree(), &mut reference);
        reference
    }
}
