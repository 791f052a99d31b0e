//! State estimation, tracking and safe stop of a robot that follows plans, tick by tick.
//!
//! [`crate::closed_loop`] uses a follower for a single plan, [`crate::sequence`] for consecutive plans.

use crate::safe_stop::SafeStop;
use crate::script::{Script, servo};
use crate::tick::{LOST_S, Measurement, Timing, TrackingError, law};
use rollwalk_multibody::Tree;
use rollwalk_physics::motor::Law;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_tracking::absence::Absence;
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Estimator, Gains, Reference, Sensors, Tracker};

/// Follower of plans of one robot.
pub(crate) struct Follower {
    /// Control laws of the motors at rest, in channel order.
    servos: Vec<Law>,
    pub tracker: Tracker,
    pub estimator: Estimator,
    /// True if the robot has stumbled. The rest of its plan is then played in open loop.
    stumbled: bool,
    /// Time since the tracker last returned set-points.
    lost: Absence,
    /// Safe stop that has begun because the tracker returned no set-points for too long.
    stop: Option<SafeStop>,
}

/// Plan that is followed at a tick.
pub(crate) struct FollowedPlan<'a, 'p> {
    pub script: &'a Script<'p>,
    pub body: &'a WholeBody,
    /// Planned stance of the end effectors at the time of the sensor readings; `None` for a robot with contact switches.
    pub contacts: Option<&'a [bool]>,
    /// True if the follower stops a motion that cannot be tracked.
    pub may_stop: bool,
}

impl Follower {
    /// Creates a follower without gains for the robot of `script`. The model `tree` has turning wheels and rotors.
    pub fn new(script: &Script<'_>, tree: &Tree, timing: Timing) -> Self {
        let tracker = Tracker::new(tree.clone(), Weights::default(), timing.tick_s)
            .with_latency(timing.latency_s);
        let servos = script.robot().channels().map(|channel| servo(&channel)).collect();
        let estimator = Estimator::new(tree.clone());
        Self { servos, tracker, estimator, stumbled: false, lost: Absence::default(), stop: None }
    }

    /// Changes to another plan, with its gains.
    pub fn change_plan(&mut self, gains: Gains) {
        self.tracker.change_gains(gains);
        self.stumbled = false;
    }

    /// Control laws of the next tick of a safe stop; `None` if no stop has begun.
    pub fn stopped(&mut self, script: &Script<'_>, tick_s: f64) -> Option<Vec<Law>> {
        self.stop.as_mut().map(|stop| stop.tick(script, tick_s))
    }

    /// True if the robot has come to rest for good.
    pub fn has_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.is_over())
    }

    /// Control laws of the motors until the next tick, and the reason if the robot is not tracked.
    ///
    /// `reference` is the reference at the time at which the set-points act. Set-points that come from the plan itself are
    /// those at `acts_s`, the end of the tick. `tick_s` is the time since the previous tick.
    pub fn tick(
        &mut self,
        followed: &FollowedPlan<'_, '_>,
        reference: &Reference,
        acts_s: f64,
        tick_s: f64,
        measured: Measurement<'_>,
    ) -> (Vec<Law>, Option<TrackingError>) {
        let FollowedPlan { script, body, contacts, may_stop } = followed;
        let known = match measured {
            Measurement::State(state, touches) => Ok((state, touches)),
            Measurement::Sensors(sensors) => {
                let touches = contacts.unwrap_or(sensors.touches);
                let estimate = self.estimator.tick(&Sensors { touches, ..*sensors }, tick_s);
                estimate.map(|state| (state, touches)).map_err(TrackingError::State)
            }
        };
        let solved = known.and_then(|(state, touches)| {
            let touches = if contacts.is_some() { &reference.stands[..] } else { touches };
            self.tracker.tick(reference, state, touches).map(drop).map_err(TrackingError::Setpoints)
        });
        if !may_stop {
            self.lost = Absence::default();
        }
        let is_lost = self.lost.tick(solved.is_ok(), tick_s, LOST_S);
        if *may_stop && is_lost {
            self.stop = Some(SafeStop::after(body, script, acts_s));
        }
        self.stumbled |= solved.is_ok() && script.steps() && self.tracker.stumbles();
        match solved {
            Ok(()) => {
                let is_caught = script.steps() && self.tracker.is_caught_by_steps();
                let why = if self.stumbled {
                    Some(TrackingError::Stumbled)
                } else {
                    is_caught.then_some(TrackingError::CaughtBySteps)
                };
                if why.is_some() {
                    return (script.laws(acts_s), why);
                }
                let laws = self.servos.iter().zip(self.tracker.setpoints());
                (laws.map(|(servo, setpoint)| law(servo, setpoint)).collect(), None)
            }
            Err(why) => (script.laws(acts_s), Some(why)),
        }
    }
}
