//! Follower of plans, tick by tick: state estimation, tracking, and the stop that ends both.
//!
//! [`crate::closed_loop`] has one for one plan, [`crate::sequence`] one for plans that follow each other.

use crate::safe_stop::SafeStop;
use crate::script::{Script, servo};
use crate::tick::{LOST_S, Measured, Timing, Untracked, law};
use rollwalk_multibody::Tree;
use rollwalk_physics::motor::Law;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_tracking::absence::Absence;
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Estimator, Gains, Reference, Sensors, Tracker};

/// Follows plans of one robot.
pub(crate) struct Follower {
    /// The motors at rest, in channel order.
    servos: Vec<Law>,
    pub tracker: Tracker,
    pub estimator: Estimator,
    /// True if the robot has stumbled: its plan is played in open loop to the end.
    stumbled: bool,
    /// Time without setpoints of the tracker, and the stop that ends it.
    lost: Absence,
    stop: Option<SafeStop>,
}

/// The plan that is followed at a tick.
pub(crate) struct Followed<'a, 'p> {
    pub script: &'a Script<'p>,
    pub body: &'a WholeBody,
    /// Planned stance of the end effectors when the other sensors were read, for a robot without contact switches.
    pub contacts: Option<&'a [bool]>,
    /// True if a motion that cannot be tracked is to be stopped.
    pub may_stop: bool,
}

impl Follower {
    /// Creates a follower for the robot of a script, with turning wheels and rotors, without gains.
    pub fn new(script: &Script<'_>, tree: &Tree, timing: Timing) -> Self {
        let tracker = Tracker::new(tree.clone(), Weights::default(), timing.tick_s)
            .with_latency(timing.latency_s);
        let servos = script.robot().channels().map(|channel| servo(&channel)).collect();
        let estimator = Estimator::new(tree.clone());
        Self { servos, tracker, estimator, stumbled: false, lost: Absence::default(), stop: None }
    }

    /// Goes over to a plan with these gains.
    pub fn change_plan(&mut self, gains: Gains) {
        self.tracker.change_gains(gains);
        self.stumbled = false;
    }

    /// Control laws of the motors, a tick after the last one, for a robot that is coming to rest for good; otherwise `None`.
    pub fn stopped(&mut self, script: &Script<'_>, tick_s: f64) -> Option<Vec<Law>> {
        self.stop.as_mut().map(|stop| stop.tick(script, tick_s))
    }

    /// True if the robot has come to rest for good.
    pub fn has_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.is_over())
    }

    /// Control laws of the motors until the next tick. `reference` is that of the moment at which setpoints act; setpoints of the
    /// plan are those at `acts_s`, the end of the tick. `tick_s` is the time since the last tick.
    pub fn tick(
        &mut self,
        followed: &Followed<'_, '_>,
        reference: &Reference,
        acts_s: f64,
        tick_s: f64,
        measured: Measured<'_>,
    ) -> (Vec<Law>, Option<Untracked>) {
        let Followed { script, body, contacts, may_stop } = followed;
        let known = match measured {
            Measured::State(state, touches) => Ok((state, touches)),
            Measured::Sensors(sensors) => {
                let touches = contacts.unwrap_or(sensors.touches);
                let estimate = self.estimator.tick(&Sensors { touches, ..*sensors }, tick_s);
                estimate.map(|state| (state, touches)).map_err(Untracked::State)
            }
        };
        let solved = known.and_then(|(state, touches)| {
            let touches = if contacts.is_some() { &reference.stands[..] } else { touches };
            self.tracker.tick(reference, state, touches).map(drop).map_err(Untracked::Setpoints)
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
                    Some(Untracked::Stumbled)
                } else {
                    is_caught.then_some(Untracked::CaughtBySteps)
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
