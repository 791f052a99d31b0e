//! Motion of the robot at one time in the generalised velocities of `rollwalk_multibody`, with its planned contacts.

use super::{PlanSpline, Spline};
use crate::motion::Ends;
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS, Pose};
use rollwalk_multibody::{State, Tree, rotation};
use std::cell::OnceCell;

/// Pose, velocity and acceleration of the robot.
pub(crate) struct Rates {
    pub state: State,
    /// Generalised acceleration ν̇ of the tree.
    pub acceleration: Vec<f64>,
}

/// Planned contact of one end effector at one instant.
#[derive(Clone, Copy)]
pub(crate) struct PlannedContact {
    /// Planned force, N. During lift-off or landing, this is the force at the neighbouring stance sample.
    pub force_n: Vector3<f64>,
    /// Share of the full contact: 1 in stance, 0 in swing, linear in the interval of lift-off or landing.
    pub share: f64,
}

impl PlanSpline {
    /// Motion of `tree` at `plan_time_s`. A periodic motion is in the frame of its first period. A motion at rest has no
    /// acceleration at its ends, because its first and last pose are held.
    pub(crate) fn rates(&self, plan_time_s: f64, tree: &Tree) -> Rates {
        let (time_s, _) = self.within(plan_time_s);
        let xy = self.base_xy.at(time_s);
        let pose: Vec<_> = self.pose.iter().map(|spline| spline.at(time_s)).collect();
        let of = |k: usize| [pose[k].value.re, pose[k].rate.re, pose[k].acceleration.re];
        let [z, dz, ddz] = of(0);
        let [ypr, d_ypr, dd_ypr] = [0, 1, 2].map(|d| Vector3::new(of(1)[d], of(2)[d], of(3)[d]));
        let axes = rotation::yaw_pitch_roll_axes(&ypr);
        // The pitch axis turns with the yaw, the roll axis with both.
        let yaw_turn = axes[0] * d_ypr.x;
        let pitch_turn = yaw_turn + axes[1] * d_ypr.y;
        let turn = pitch_turn + axes[2] * d_ypr.z;
        let d_turn: Vector3<f64> = (0..3).map(|k| axes[k] * dd_ypr[k]).sum::<Vector3<f64>>()
            + yaw_turn.cross(&axes[1]) * d_ypr.y
            + pitch_turn.cross(&axes[2]) * d_ypr.z;

        let mut velocity = vec![xy.rate.re, xy.rate.im, dz];
        let mut acceleration = vec![xy.acceleration.re, xy.acceleration.im, ddz];
        velocity.extend(turn.iter());
        acceleration.extend(d_turn.iter());
        velocity.extend(pose[4..].iter().map(|jet| jet.rate.re));
        acceleration.extend(pose[4..].iter().map(|jet| jet.acceleration.re));
        let carried = CarriedWheels::default();
        for wheel in tree.wheels() {
            let (speed, d_speed) = self.wheel_against_link(wheel.end_effector, time_s, &carried);
            velocity.push(speed);
            acceleration.push(d_speed);
        }
        let held = self.ends == Ends::AtRest && (time_s <= 0.0 || time_s >= self.duration_s);
        if held {
            acceleration.fill(0.0);
        }
        let state = State {
            base_position_m: Vector3::new(xy.value.re, xy.value.im, z),
            world_from_body: rotation::from_yaw_pitch_roll(&ypr),
            joint_rad: pose[4..].iter().map(|jet| jet.value.re).collect(),
            velocity,
        };
        Rates { state, acceleration }
    }

    /// Planned contacts at `plan_time_s`. Those of a periodic motion are in the frame of its first period.
    pub(crate) fn planned_contacts(&self, plan_time_s: f64) -> Vec<PlannedContact> {
        let (i, u) = self.interval(self.within(plan_time_s).0);
        (0..self.stance[i].len())
            .map(|j| {
                let (from, to) = (&self.force_n[i][j], &self.force_n[i + 1][j]);
                let (force_n, share) = match (self.stance[i][j], self.stance[i + 1][j]) {
                    (true, true) => (from.lerp(to, u), 1.0),
                    (true, false) => (*from, 1.0 - u),
                    (false, true) => (*to, u),
                    (false, false) => (Vector3::zeros(), 0.0),
                };
                PlannedContact { force_n, share }
            })
            .collect()
    }

    /// Speed and acceleration of a wheel relative to its link, about the axis in the robot file, rad/s and rad/s².
    fn wheel_against_link(&self, j: usize, time_s: f64, carried: &CarriedWheels) -> (f64, f64) {
        let of = |spline: &Spline| {
            let jet = spline.at(time_s);
            (jet.rate.re, jet.acceleration.re)
        };
        if self.model.robot().end_effectors[j].contact.actuator().is_some() {
            return of(&self.motor_angle[j]);
        }
        // Spin of a free wheel relative to the ground without the rotation of its link. Its derivative is numerical, because no
        // motor drives it, and its gyroscopic moment is small.
        const STEP_S: f64 = 1e-4;
        let at = [time_s, time_s + STEP_S, time_s - STEP_S];
        let moments = carried.0.get_or_init(|| at.map(|time_s| self.pose_and_rates(time_s)));
        let [here, after, before] = moments
            .each_ref()
            .map(|(pose, rates)| self.spin_with_link(j, &pose.end_effectors[j], rates));
        let (spin, d_spin) = of(&self.wheel_angle[j]);
        (spin - here, d_spin - (after - before) / (2.0 * STEP_S))
    }

    /// Pose, and rates of the pose splines.
    fn pose_and_rates(&self, time_s: f64) -> (Pose, Vec<f64>) {
        let jets: Vec<_> = self.pose.iter().map(|spline| spline.at(time_s)).collect();
        let xy = self.base_xy.at(time_s).value;
        let mut q = DVector::zeros(self.model.dofs());
        q[BASE_POSITION] = xy.re;
        q[BASE_POSITION + 1] = xy.im;
        q[BASE_POSITION + 2] = jets[0].value.re;
        (0..3).for_each(|k| q[BASE_YAW + k] = jets[1 + k].value.re);
        jets[4..].iter().enumerate().for_each(|(k, jet)| q[JOINTS + k] = jet.value.re);
        (self.model.pose(&q), jets.iter().map(|jet| jet.rate.re).collect())
    }
}

/// Poses with their rates at a time, shortly after and shortly before it, from which the links of free wheels turn. All free
/// wheels share them.
#[derive(Default)]
struct CarriedWheels(OnceCell<[(Pose, Vec<f64>); 3]>);
