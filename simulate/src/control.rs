//! What turns a plan into what motors do: its setpoints to the servos, or a controller that sees the robot.

use crate::script::{Script, servo};
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion};
use rollwalk_physics::World;
use rollwalk_physics::motor::Law;
use rollwalk_planner::whole_body::{Instant, WholeBody};
use rollwalk_robot::Robot;
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Reference, Tracker};

/// How a plan is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Setpoints go to the servos, open loop.
    Servos,
    /// With the planned torques on top.
    FeedForward,
    /// A controller of the whole body sees the state of the robot at each step ([`rollwalk_tracking`]); it knows the state exactly.
    Tracking,
}

/// What the motors do, step by step.
pub(crate) struct Controller<'s, 'p> {
    script: &'s Script<'p>,
    /// The motors at rest, in channel order.
    servos: Vec<Law>,
    tracking: Option<Tracking>,
    /// Steps in which the tracker had no solution, and the servos got the setpoints of the plan.
    pub untracked: u32,
}

struct Tracking {
    body: WholeBody,
    tracker: Tracker,
    world_from_plan: Isometry3<f64>,
}

impl<'s, 'p> Controller<'s, 'p> {
    /// For a world that stands where the plan begins. The state is seen at the beginning of each step of `step_s`.
    pub fn new(
        script: &'s Script<'p>,
        control: Control,
        world: &World,
        world_from_plan: &Rotation3<f64>,
        step_s: f64,
    ) -> Self {
        let robot: &Robot = script.robot();
        let tracking = (control == Control::Tracking).then(|| {
            let mut body = WholeBody::new(script.plan());
            let tracker = Tracker::new(body.tree().clone(), Weights::default(), step_s);
            let turn = UnitQuaternion::from_rotation_matrix(world_from_plan);
            let turned = Isometry3::from_parts(Translation3::identity(), turn);
            let start = body.at(0.0, &turned).state.base_position_m;
            let shift = Translation3::from(world.base().0 - start);
            Tracking { body, tracker, world_from_plan: Isometry3::from_parts(shift, turn) }
        });
        Self {
            script,
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
        match tracking.tracker.tick(&reference, &state) {
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
        }
    }
}

impl Tracking {
    fn reference(&mut self, time_s: f64) -> Reference {
        let Instant { state, acceleration, stands, force_n } =
            self.body.at(time_s, &self.world_from_plan);
        Reference { state, acceleration, stands, force_n }
    }
}
