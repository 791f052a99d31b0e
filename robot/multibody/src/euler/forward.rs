//! Forward kinematics in the optimiser's coordinates, with derivatives.
//!
//! A point x on a link moves by w_k × (x − o_k) per radian of a degree of freedom k above the link; a vector a moves by w_k ×
//! a. Here w_k is the axis of k, and o_k its origin, in world axes. The base's yaw, pitch and roll are three such axes through
//! the base origin. The position of the base, and a prismatic joint, translate all points equally.

use super::{BASE_YAW, EndEffectorPose, Model, Pose};
use crate::rotation;
use nalgebra::{DVector, Vector3};

impl Pose {
    /// Computes the derivatives unless they exist.
    pub fn differentiate(&mut self, model: &Model) {
        if !self.d_com.is_empty() {
            return;
        }
        let Self { frames, base_axes, com, d_com, end_effectors } = self;
        let (robot, tree) = (model.robot(), model.tree());
        let base_origin = frames.link_origins[0];
        let translations = [Vector3::x(), Vector3::y(), Vector3::z()];
        d_com.reserve_exact(model.dofs());
        d_com.extend(translations);
        d_com.extend(base_axes.iter().map(|w| w.cross(&(*com - base_origin))));
        let joints = robot.joints.iter().enumerate();
        d_com.extend(joints.map(|(j, joint)| frames.com_column(tree, j, joint.child)));
        for (at, ee) in end_effectors.iter_mut().zip(&robot.end_effectors) {
            at.d_center.extend(translations);
            at.d_rotation.extend([Vector3::zeros(); 3]);
            let turns = base_axes.iter().map(|w| (w, base_origin));
            for (w, origin) in turns {
                at.d_center.push(w.cross(&(at.center - origin)));
                at.d_rotation.push(*w);
            }
            for &j in tree.joints_to_link(ee.link) {
                let arm = at.center - frames.link_origins[robot.joints[j].child];
                at.d_center.push(frames.joint_displacement(j, &arm));
                at.d_rotation.push(frames.joint_axes[j]);
            }
            at.d_axis.extend(at.d_rotation.iter().map(|w| w.cross(&at.axis)));
        }
    }
}

impl Model {
    /// Computes the forward kinematics with derivatives at `q`.
    pub fn pose(&self, q: &DVector<f64>) -> Pose {
        let mut pose = self.pose_values(q);
        pose.differentiate(self);
        pose
    }

    /// Computes the forward kinematics at `q`. The vectors of derivatives stay empty until [`Pose::differentiate`].
    pub fn pose_values(&self, q: &DVector<f64>) -> Pose {
        let mut pose = Pose {
            frames: self.frames(q),
            base_axes: Default::default(),
            com: Vector3::zeros(),
            d_com: Vec::new(),
            end_effectors: vec![EndEffectorPose::default(); self.robot().end_effectors.len()],
        };
        self.follow_frames(q.as_slice(), &mut pose);
        pose
    }

    /// Updates a pose of this robot for `q`, of which at least the first [`dofs`](Model::dofs) entries are given. Its vectors of
    /// derivatives become empty and keep their memory.
    pub fn update_pose(&self, q: &[f64], pose: &mut Pose) {
        pose.frames.update(self.tree(), &super::model::configuration(q));
        self.follow_frames(q, pose);
    }

    /// Sets everything in a pose that follows from its frames.
    fn follow_frames(&self, q: &[f64], pose: &mut Pose) {
        let Pose { frames, base_axes, com, d_com, end_effectors } = pose;
        *base_axes =
            rotation::yaw_pitch_roll_axes(&Vector3::from_column_slice(&q[BASE_YAW..][..3]));
        *com = frames.com(self.tree());
        d_com.clear();
        let end_effectors = end_effectors.iter_mut().zip(&self.robot().end_effectors);
        for (index, (at, ee)) in end_effectors.enumerate() {
            let axis_in_link = self.wheel_axis_in_link(index).unwrap_or_else(Vector3::zeros);
            at.world_from_link = frames.world_from_link[ee.link];
            at.center = frames.point(ee.link, &ee.center_in_link_m);
            at.axis = at.world_from_link * axis_in_link;
            at.d_center.clear();
            at.d_axis.clear();
            at.d_rotation.clear();
        }
    }
}
