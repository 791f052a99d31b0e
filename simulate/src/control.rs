//! What turns a plan into what motors do: its setpoints to the servos, or a controller that sees the robot.

use crate::run::Options;
use crate::script::{Script, servo};
use crate::sensors::{Noise, SimulatedSensors, touches};
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion};
use rollwalk_multibody::Tree;
use rollwalk_physics::World;
use rollwalk_physics::motor::Law;
use rollwalk_planner::whole_body::{Instant, WholeBody};
use rollwalk_robot::Robot;
use rollwalk_tracking::model::Costs;
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Estimator, Gains, Reference, Setpoint, Tracker};
use std::collections::VecDeque;

/// How a plan is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Setpoints go to the servos, open loop.
    Servos,
    /// With the planned torques on top.
    FeedForward,
    /// A controller of the whole body sees the state of the robot at each step ([`rollwalk_tracking`]).
    Tracking(Feedback),
}

/// How [`Control::Tracking`] brings the robot back to the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feedback {
    /// Each task by itself: centre of mass, body and wheels have their own gains.
    Tasks,
    /// Gains of the plan's linear model, for all of them together.
    Gains,
}

/// What the motors do, step by step.
pub(crate) struct Controller<'s, 'p> {
    script: &'s Script<'p>,
    /// The motors at rest, in channel order.
    servos: Vec<Law>,
    tracking: Option<Tracking>,
    /// Setpoints that do not act yet, and for how many steps.
    on_their_way: VecDeque<Vec<Law>>,
    delay: usize,
    /// Steps in which the tracker had no solution, and the servos got the setpoints of the plan.
    pub untracked: u32,
}

struct Tracking {
    body: WholeBody,
    tracker: Tracker,
    world_from_plan: Isometry3<f64>,
    estimation: Option<Estimation>,
    touches: Vec<bool>,
    step_s: f64,
}

/// The state as a robot knows it.
struct Estimation {
    sensors: SimulatedSensors,
    estimator: Estimator,
}

impl<'s, 'p> Controller<'s, 'p> {
    /// For a world that stands where the plan begins. A controller that sees the state does so at the beginning of each step, and its
    /// setpoints act after a delay, s.
    pub fn new(
        script: &'s Script<'p>,
        options: &Options,
        world: &World,
        world_from_plan: &Rotation3<f64>,
        step_s: f64,
    ) -> Self {
        let robot: &Robot = script.robot();
        let feedback = match options.control {
            Control::Tracking(feedback) => Some(feedback),
            Control::Servos | Control::FeedForward => None,
        };
        let tracking = feedback.map(|feedback| {
            let mut body = WholeBody::new(script.plan());
            let tracker = Tracker::new(body.tree().clone(), Weights::default(), step_s);
            let turn = UnitQuaternion::from_rotation_matrix(world_from_plan);
            let turned = Isometry3::from_parts(Translation3::identity(), turn);
            let start = body.at(0.0, &turned).state.base_position_m;
            let shift = Translation3::from(world.base().0 - start);
            let world_from_plan = Isometry3::from_parts(shift, turn);
            let noise = options.mismatch.noise;
            let estimation = noise.map(|noise| Estimation::new(body.tree(), noise, world));
            let touches = vec![false; robot.end_effectors.len()];
            let mut tracking =
                Tracking { body, tracker, world_from_plan, estimation, touches, step_s };
            if feedback == Feedback::Gains {
                let tree = tracking.body.tree().clone();
                let gains = Gains::new(
                    &tree,
                    &Costs::default(),
                    script.duration_s(),
                    script.repeats(),
                    |time_s| tracking.reference(time_s),
                );
                tracking.tracker = tracking.tracker.with_gains(gains);
            }
            tracking
        });
        Self {
            script,
            on_their_way: VecDeque::new(),
            delay: (options.mismatch.delay_s / step_s).round() as usize,
            servos: robot.channels().map(|channel| servo(&channel)).collect(),
            tracking,
            untracked: 0,
        }
    }

    /// What the motors do in a step between two times of the motion, periods counted on; the world is where it begins.
    pub fn laws(&mut self, [from_s, to_s]: [f64; 2], world: &World) -> Vec<Law> {
        // The law at the end of the step is the one that acts in it.
        let Some(tracking) = &mut self.tracking else { return self.script.laws(to_s) };
        let laws = match tracking.tick(from_s, world) {
            Some(setpoints) => self
                .servos
                .iter()
                .zip(setpoints)
                .map(|(servo, setpoint)| law(servo, setpoint))
                .collect(),
            None => {
                self.untracked += 1;
                self.script.laws(to_s)
            }
        };
        self.on_their_way.push_back(laws);
        match self.on_their_way.len() > self.delay {
            true => self.on_their_way.pop_front().expect("there is one"),
            false => self.script.laws(to_s),
        }
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

impl Tracking {
    /// Setpoints at a time of the motion; `None` if there are none, or the state is not known well enough.
    fn tick(&mut self, time_s: f64, world: &World) -> Option<&[Setpoint]> {
        let reference = self.reference(time_s);
        let exact;
        let state = match &mut self.estimation {
            None => {
                exact = world.state(self.tracker.tree());
                self.touches.clear();
                self.touches.extend(touches(world, self.tracker.tree()));
                &exact
            }
            Some(Estimation { sensors, estimator }) => {
                let sensed = sensors.sample(world, self.step_s);
                self.touches.copy_from_slice(sensed.touches);
                estimator.tick(&sensed, self.step_s).ok()?
            }
        };
        self.tracker.tick(&reference, state, &self.touches).ok()
    }

    fn reference(&mut self, time_s: f64) -> Reference {
        let Instant { state, acceleration, stands, force_n } =
            self.body.at(time_s, &self.world_from_plan);
        let world_from_ground = self.world_from_plan;
        Reference { time_s, world_from_ground, state, acceleration, stands, force_n }
    }
}

/// Seed of the noise.
const SEED: u64 = 1;

impl Estimation {
    /// The robot knows where it begins.
    fn new(tree: &Tree, noise: Noise, world: &World) -> Self {
        let mut estimator = Estimator::new(tree.clone());
        estimator.align(&world.state(tree)).expect("the state of a world is finite");
        Self { sensors: SimulatedSensors::new(tree.clone(), noise, SEED), estimator }
    }
}
