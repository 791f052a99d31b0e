//! Joints without a motor: the spring alone balances ground forces, weight and inertia beyond the joint, so that the torque
//! of [`super::joint_torque`] is 0. One equality row per passive joint and sample, N·m.

use super::joint_torque::MotorTorque;
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: springs that hold passive joints.
pub struct PassiveJoint;

impl Term for PassiveJoint {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::PassiveJoint, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        out.set(problem.force_scale_n(), Role::Equality);
        for (j, joint) in problem.model.robot().joints.iter().enumerate() {
            if !joint.is_passive() || out.skips_row() {
                continue;
            }
            let torque = MotorTorque::new(window, j);
            torque.differentiate(1.0, out);
            out.row_of(Subject::Joint(j), torque.value_nm);
        }
    }
}
