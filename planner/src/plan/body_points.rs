//! Plans of motions on feet for a robot that lies in other motions. The points of its body are in the air.

use super::{EndEffectorSample, Plan, Sample};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rollwalk_robot::EndEffector;

impl Plan {
    /// Returns the plan for the robot with the points on which its body lies, off the ground. `None` if the body has no shapes.
    pub(crate) fn with_body_points(&self) -> Option<Self> {
        if self.robot.has_body_points() {
            return Some(self.clone());
        }
        let mut plan = self.clone();
        plan.robot = self.robot.with_body_points()?;
        let points = &plan.robot.end_effectors[self.robot.end_effectors.len()..];
        for sample in plan.samples.iter_mut().chain([&mut plan.before, &mut plan.after]) {
            let added: Vec<_> = points.iter().map(|point| in_the_air(sample, point)).collect();
            sample.end_effectors.extend(added);
        }
        let added = vec![false; points.len()];
        plan.motion.stance.iter_mut().for_each(|flags| flags.extend(&added));
        plan.motion.held_wheels.extend(&added);
        Some(plan)
    }
}

/// Point of the body off the ground.
fn in_the_air(sample: &Sample, point: &EndEffector) -> EndEffectorSample {
    let [w, x, y, z] = sample.base_orientation_wxyz;
    let world_from_body = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let center = Vector3::from(sample.base_position_m) + world_from_body * point.center_in_link_m;
    EndEffectorSample {
        contact: false,
        position_m: (center - Vector3::z() * point.radius_m).into(),
        force_n: [0.0; 3],
        wheel_speed_rad_s: 0.0,
        motor_speed_rad_s: 0.0,
        motor_torque_nm: None,
        tilt_rad: 0.0,
        yaw_rad: 0.0,
    }
}
