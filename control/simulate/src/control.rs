//! Control of a robot along a plan: set-points for the servos in open loop, or a controller with feedback.

use crate::closed_loop::{ClosedLoop, Feedback, Measurement, Timing, TrackingError};
use crate::mismatch::Mismatch;
use crate::script::Script;
use crate::sensors::SimulatedSensors;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion};
use rollwalk_physics::World;
use rollwalk_physics::motor::Law;
use std::collections::VecDeque;

/// Method of playing a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Set-points for the servos, open loop.
    Servos,
    /// Set-points for the servos, open loop, with the planned torques as feed-forward.
    FeedForward,
    /// Whole-body controller that reads the state of the robot at each step ([`rollwalk_tracking`]).
    Tracking(Feedback),
}

impl Control {
    /// Default number of simulation steps per second.
    ///
    /// Twice as many steps do not change which motions pass. A controller with feedback runs at every step.
    pub const fn usual_rate_hz(self) -> u32 {
        match self {
            Self::Servos | Self::FeedForward => 480,
            Self::Tracking(_) => 500,
        }
    }
}

/// Controller that computes control laws of the motors, step by step.
pub(crate) struct Controller<'s, 'p> {
    script: &'s Script<'p>,
    tracking: Option<Tracking<'s, 'p>>,
    /// Control laws that wait for the end of the delay, oldest first.
    on_their_way: VecDeque<Vec<Law>>,
    /// Delay of control laws, steps.
    delay: usize,
    /// Number of steps without tracking, in which the servos got the set-points of the plan or of its stop.
    pub untracked: u32,
    /// Time at which the stop began, s.
    pub stopped_at_s: Option<f64>,
}

struct Tracking<'s, 'p> {
    closed_loop: ClosedLoop<'s, 'p>,
    /// Sensors from which the state is estimated; `None` if the controller reads the true state.
    sensors: Option<SimulatedSensors>,
    step_s: f64,
}

/// Control rate of a controller that plays a library, Hz: the firmware's default.
const CONTROL_HZ: f64 = 120.0;
/// Seed of the noise.
const SEED: u64 = 1;

impl<'s, 'p> Controller<'s, 'p> {
    /// Creates a controller for a world in which the robot stands at the beginning of the plan.
    ///
    /// A controller with feedback reads the state at the beginning of each step. Its set-points act after the delay of
    /// `mismatch`, which the controller compensates.
    pub fn new(
        script: &'s Script<'p>,
        control: Control,
        mismatch: &Mismatch,
        world: &World,
        world_from_plan: &Rotation3<f64>,
        step_s: f64,
    ) -> Self {
        let delay = (mismatch.delay_s / step_s).round() as usize;
        let tracking = match control {
            Control::Servos | Control::FeedForward => None,
            Control::Tracking(feedback) => {
                let start_m = script.start(world_from_plan).base_position_m;
                let shift = Translation3::from(world.base().0 - start_m);
                let turn = UnitQuaternion::from_rotation_matrix(world_from_plan);
                let world_from_plan = Isometry3::from_parts(shift, turn);
                let timing = Timing { tick_s: step_s, latency_s: delay as f64 * step_s };
                let mut closed_loop = ClosedLoop::new(script, feedback, world_from_plan, timing);
                // The simulated robot knows its initial pose.
                let start = world.state(closed_loop.tree());
                closed_loop.align(&start).expect("the state of a world is finite");
                let tree = closed_loop.tree();
                let noise = mismatch.noise;
                let fault = mismatch.sensor_fault;
                let sensors = noise.map(|noise| {
                    SimulatedSensors::new(tree.clone(), noise, SEED).with_fault(fault)
                });
                Some(Tracking { closed_loop, sensors, step_s })
            }
        };
        let on_their_way = VecDeque::new();
        Self { script, on_their_way, delay, tracking, untracked: 0, stopped_at_s: None }
    }

    /// Control laws of the motors in a step that lasts from `from_s` to `to_s` of the motion.
    ///
    /// Times continue over all periods. `world` is at the beginning of the step.
    pub fn laws(&mut self, [from_s, to_s]: [f64; 2], world: &World) -> Vec<Law> {
        let Some(tracking) = &mut self.tracking else {
            // A controller sends the set-points of a tick at its beginning, and drives hold them until the next tick. Times are
            // multiples of a step except for rounding.
            let tick = ((from_s + 0.5 * (to_s - from_s).abs()) * CONTROL_HZ).floor();
            return self.script.laws(tick / CONTROL_HZ);
        };
        let Tracking { closed_loop, sensors, step_s } = tracking;
        let (laws, untracked) = match sensors {
            None => {
                let state = world.state(closed_loop.tree());
                let touches: Vec<bool> = world.switches().collect();
                closed_loop.tick([from_s, to_s], Measurement::State(&state, &touches))
            }
            Some(sensors) => {
                let sensed = sensors.sample(world, *step_s);
                closed_loop.tick([from_s, to_s], Measurement::Sensors(&sensed))
            }
        };
        self.untracked += u32::from(untracked.is_some());
        if untracked == Some(TrackingError::Stopped) {
            self.stopped_at_s.get_or_insert(world.system().time_s());
        }
        self.on_their_way.push_back(laws);
        match self.on_their_way.len() > self.delay {
            true => self.on_their_way.pop_front().expect("there is one"),
            false => self.script.laws(to_s),
        }
    }
}
