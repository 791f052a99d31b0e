//! What turns a plan into what motors do: its setpoints to the servos, or a controller that sees the robot.

use crate::script::{Script, servo};
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion};
use rollwalk_physics::World;
use rollwalk_physics::motor::Law;
use rollwalk_planner::whole_body::{Instant, WholeBody};
use rollwalk_robot::{GRAVITY_M_S2, Robot};
use rollwalk_tracking::model::Costs;
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Gains, Reference, Tracker};
use std::collections::VecDeque;

/// How a plan is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Setpoints go to the servos, open loop.
    Servos,
    /// With the planned torques on top.
    FeedForward,
    /// A controller of the whole body sees the state of the robot at each step ([`rollwalk_tracking`]); it knows the state exactly.
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

/// Part of the robot's weight on an end effector from which on it touches the ground.
const TOUCHES: f64 = 0.005;

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
    weight_n: f64,
    world_from_plan: Isometry3<f64>,
}

impl<'s, 'p> Controller<'s, 'p> {
    /// For a world that stands where the plan begins. A controller that sees the state does so at the beginning of each step, and its
    /// setpoints act after a delay, s.
    pub fn new(
        script: &'s Script<'p>,
        control: Control,
        world: &World,
        world_from_plan: &Rotation3<f64>,
        [step_s, delay_s]: [f64; 2],
    ) -> Self {
        let robot: &Robot = script.robot();
        let feedback = match control {
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
            let weight_n = body.tree().total_mass_kg() * GRAVITY_M_S2;
            let world_from_plan = Isometry3::from_parts(shift, turn);
            let mut tracking = Tracking { body, tracker, weight_n, world_from_plan };
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
            delay: (delay_s / step_s).round() as usize,
            servos: robot.channels().map(|channel| servo(&channel)).collect(),
            tracking,
            untracked: 0,
        }
    }

    /// What the motors do in a step between two times of the motion, periods counted on; the world is where it begins.
    pub fn laws(&mut self, [from_s, to_s]: [f64; 2], world: &World) -> Vec<Law> {
        // The law at the end of the step is the one that acts in it.
        let Some(tracking) = &mut self.tracking else { return self.script.laws(to_s) };
        let reference = tracking.reference(from_s);
        let state = world.state(tracking.tracker.tree());
        let touches: Vec<bool> =
            world.touches().map(|touch| touch.normal_n > TOUCHES * tracking.weight_n).collect();
        let laws = match tracking.tracker.tick(&reference, &state, &touches) {
            Ok(setpoints) => self
                .servos
                .iter()
                .zip(setpoints)
                .map(|(servo, setpoint)| Law {
                    kp_nm_rad: setpoint.kp_nm_rad,
                    kd_nm_s_rad: setpoint.kd_nm_s_rad,
                    position_rad: setpoint.position_rad,
                    speed_rad_s: setpoint.speed_rad_s,
                    torque_nm: setpoint.torque_nm,
                    ..*servo
                })
                .collect(),
            Err(_) => {
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

impl Tracking {
    fn reference(&mut self, time_s: f64) -> Reference {
        let Instant { state, acceleration, stands, force_n } =
            self.body.at(time_s, &self.world_from_plan);
        let world_from_ground = self.world_from_plan;
        Reference { time_s, world_from_ground, state, acceleration, stands, force_n }
    }
}
