//! Plan for a whole-body controller: at any time, the generalised motion, the ground forces that balance it, and the stance end
//! effectors.

use crate::plan::{EndEffectorSample, Plan};
use crate::sample::{PlannedContact, Setpoints};
use crate::torque::InverseDynamics;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rollwalk_multibody::{State, Tree, turn_base};

/// Contact share from which an end effector counts as in stance. With this value, at least one of two feet is in stance while one
/// lands and the other lifts off in the same interval.
const STANDS: f64 = 0.5;

/// Plan prepared for evaluation at any time.
pub struct WholeBody {
    inverse: InverseDynamics,
}

/// State of the robot in the world at one time of its plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Instant {
    /// Pose and velocity.
    pub state: State,
    /// Generalised acceleration ν̇ of [`WholeBody::tree`].
    pub acceleration: Vec<f64>,
    /// Stance flag of each end effector.
    pub stands: Vec<bool>,
    /// Force of the ground on each end effector, N. With these forces, motor torques alone produce the acceleration, except for
    /// the part that the ground cannot supply.
    pub force_n: Vec<Vector3<f64>>,
    /// Height of the ground at each end effector above the plane z = 0 of the plan, m; zeros for a plan without a terrain.
    pub ground_height_m: Vec<f64>,
    /// Unit normal of the ground at each end effector, in axes of the plan.
    pub ground_normal: Vec<Vector3<f64>>,
}

impl WholeBody {
    /// Prepares a validated plan.
    pub fn new(plan: &Plan) -> Self {
        Self { inverse: InverseDynamics::new(plan) }
    }

    /// Returns the robot with its wheels and rotors as bodies. [`Instant`] has the generalised velocities of this tree.
    pub fn tree(&self) -> &Tree {
        self.inverse.tree()
    }

    /// Set-points of joints and driven wheels at `plan_time_s`, and torques in channel order, N·m.
    pub fn setpoints(&mut self, plan_time_s: f64) -> (Setpoints, Vec<f64>) {
        let actuation = self.inverse.at(plan_time_s);
        let torques_nm = actuation.channels_nm(self.tree().robot()).collect();
        (self.inverse.spline().setpoints(plan_time_s), torques_nm)
    }

    /// Stance flag of each end effector at `plan_time_s`, as in [`Instant`].
    pub fn stands(&self, plan_time_s: f64) -> Vec<bool> {
        stand(&self.inverse.spline().planned_contacts(plan_time_s))
    }

    /// Height and unit normal of the ground at each end effector.
    fn ground(&self, plan_time_s: f64) -> Vec<(f64, Vector3<f64>)> {
        let spline = self.inverse.spline();
        let ground = spline.ground();
        let feet = &self.tree().robot().end_effectors;
        if ground.is_level() {
            return vec![(0.0, Vector3::z()); feet.len()];
        }
        let sample = spline.sample(plan_time_s);
        let below = |(j, end): (usize, &EndEffectorSample)| {
            let contact = Vector3::from(end.position_m);
            let center = contact + Vector3::z() * feet[j].radius_m;
            let here = ground.contact(j, end.contact, &center).at(&contact);
            (here.height_m, here.normal())
        };
        sample.end_effectors.iter().enumerate().map(below).collect()
    }

    /// State of the robot at `plan_time_s`. `world_from_plan` is the pose of the plan in the world. A periodic motion continues
    /// in later periods; other motions stay at their ends.
    pub fn at(&mut self, plan_time_s: f64, world_from_plan: &Isometry3<f64>) -> Instant {
        let (rates, contacts, actuation) = self.inverse.moving(plan_time_s);
        let placement = self.inverse.spline().placement(plan_time_s);
        let [x, y] = placement.offset_m;
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), placement.yaw_rad);
        let there = world_from_plan * Isometry3::from_parts(Translation3::new(x, y, 0.0), yaw);
        let mut acceleration = rates.acceleration;
        turn_base(&mut acceleration, there.rotation.to_rotation_matrix().matrix());
        let (ground_height_m, ground_normal) = self.ground(plan_time_s).into_iter().unzip();
        Instant {
            ground_height_m,
            ground_normal,
            state: rates.state.moved(&there),
            acceleration,
            stands: stand(&contacts),
            force_n: actuation.force_n.iter().map(|force| there.rotation * force).collect(),
        }
    }
}

fn stand(contacts: &[PlannedContact]) -> Vec<bool> {
    contacts.iter().map(|contact| contact.share >= STANDS).collect()
}
