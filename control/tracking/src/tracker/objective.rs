//! Objective of a tick: desired motion of contacts, centre of mass, body, end effectors and joints, as weighted squares.

use super::Tracker;
use crate::contacts::Phase;
use crate::reference::Reference;
use crate::tasks::{Feedback, SquaredTerms, limited};
use nalgebra::Vector3;
use rollwalk_multibody::{ANGULAR, JOINTS, Kinematics, rotation};
use rollwalk_robot::GRAVITY_M_S2;

/// Depth below the planned ground of the target of a landing end effector, m.
const BELOW_M: f64 = 0.02;

impl Tracker {
    /// Adds the contact task: the material at a rolling or resting contact stays still.
    pub(super) fn add_contact_task(&mut self) {
        let Self { weights, program, row, feet, .. } = self;
        let mut squares = SquaredTerms { program };
        for foot in feet.iter().filter(|foot| foot.stands()) {
            if foot.drag.is_none() {
                squares.add(weights.contact, &foot.jacobian, &foot.still_m_s2);
                continue;
            }
            for direction in [foot.side, foot.normal] {
                row.gemv_tr(1.0, &foot.jacobian, &direction, 0.0);
                let still = direction.dot(&foot.still_m_s2);
                squares.add_row(weights.contact, row.as_view(), still);
            }
        }
    }

    /// Adds the tasks of centre of mass and body, which follow the plan.
    pub(super) fn add_body_tasks(&mut self, reference: &Reference) {
        let Self {
            weights, tree, planned, measured, program, jacobian, correction, recovery, ..
        } = self;
        let mut squares = SquaredTerms { program };
        let (there, here) = (&planned.frames, &measured.frames);
        let place = there.com(tree) - here.com(tree);
        let speed = planned.com_velocity(tree) - measured.com_velocity(tree);
        // Far from the plan, its linear model is inaccurate. There, each task uses its own feedback, which survives larger
        // pushes.
        let correction = correction.as_ref().filter(|_| !recovery.is_active());
        let feedback = match correction {
            Some(correction) => limited(correction.com_m_s2, weights.com_most_m_s2),
            None => weights.com_feedback.limited(&place, &speed, weights.com_most_m_s2),
        };
        let wanted = planned.com_acceleration(tree) + feedback;
        here.com_jacobian(tree, jacobian);
        squares.add(weights.com, jacobian, &(wanted - measured.com_acceleration(tree)));
        let turn = rotation::log(&(there.world_from_link[0] * here.world_from_link[0].transpose()));
        let spin = planned.angular_velocity[0] - measured.angular_velocity[0];
        let feedback = match correction {
            Some(correction) => limited(correction.body_rad_s2, weights.body_most_rad_s2),
            None => weights.body_feedback.limited(&turn, &spin, weights.body_most_rad_s2),
        };
        for k in 0..3 {
            let wanted = reference.acceleration[ANGULAR + k] + feedback[k];
            squares.add_one(weights.body, ANGULAR + k, wanted);
        }
    }

    /// Adds the tasks of the end effectors: feet in the air follow the plan, wheels on the ground have the planned speed.
    pub(super) fn add_foot_tasks(&mut self, reference: &Reference) {
        let Self {
            weights,
            tree,
            planned,
            measured,
            program,
            jacobian,
            row,
            feet,
            correction,
            ahead,
            ..
        } = self;
        for (end_effector, (j, foot)) in
            tree.robot().end_effectors.iter().zip(feet.iter().enumerate())
        {
            let link = end_effector.link;
            let center = |at: &Kinematics| at.frames.point(link, &end_effector.center_in_link_m);
            let (mut there, here) = (center(planned), center(measured));
            let mut speed =
                planned.point_velocity(link, &there) - measured.point_velocity(link, &here);
            let bias = measured.point_acceleration(link, &here);
            let mut wanted_m_s2 = planned.point_acceleration(link, &there);
            if let Some(correction) = correction {
                speed += correction.speed_m_s[j];
                there += correction.foothold_m[j];
            }
            let mut squares = SquaredTerms { program };
            if foot.phase == Phase::Landing {
                // The planned height of the foot and its rate have no effect.
                let normal = foot.normal;
                there -= normal * (BELOW_M + foot.height_m.max(0.0));
                wanted_m_s2 -= normal * wanted_m_s2.dot(&normal);
                speed -= normal * (speed + measured.point_velocity(link, &here)).dot(&normal);
            }
            if !foot.stands() {
                let wanted = wanted_m_s2 + weights.swing_feedback.of(&(there - here), &speed);
                measured.frames.point_jacobian(tree, link, &here, jacobian);
                squares.add(weights.swing, jacobian, &(wanted - bias));
                if let Some(dof) = tree.wheel_dof(j) {
                    let speed = reference.state.velocity[dof] - ahead.velocity[dof];
                    let wanted = reference.acceleration[dof] + weights.spin_per_s * speed;
                    squares.add_one(weights.posture, dof, wanted);
                }
            } else if end_effector.contact.rolls() {
                // With gains, position feedback is part of the gains.
                let place = if correction.is_some() { Vector3::zeros() } else { there - here };
                let wanted = wanted_m_s2 + weights.roll_feedback.of(&place, &speed) - bias;
                measured.frames.point_jacobian(tree, link, &here, jacobian);
                row.gemv_tr(1.0, jacobian, &foot.along, 0.0);
                squares.add_row(weights.roll, row.as_view(), foot.along.dot(&wanted));
            }
        }
    }

    /// Adds the posture task: joints stay near the planned posture where no other task needs them.
    pub(super) fn add_posture_task(&mut self, reference: &Reference) {
        let Self { weights, program, ahead, recovery, .. } = self;
        let Feedback { per_s2, per_s } = weights.posture_feedback;
        let weight =
            if recovery.is_active() { weights.posture_recovering } else { weights.posture };
        let mut squares = SquaredTerms { program };
        for (joint, (there, here)) in
            reference.state.joint_rad.iter().zip(&ahead.joint_rad).enumerate()
        {
            let dof = JOINTS + joint;
            let speed = reference.state.velocity[dof] - ahead.velocity[dof];
            let wanted = reference.acceleration[dof] + per_s2 * (there - here) + per_s * speed;
            squares.add_one(weight, dof, wanted);
        }
    }

    /// Adds the force task: ground forces stay near the planned ones, and are 0 for feet in the air.
    pub(super) fn add_force_task(&mut self, reference: &Reference) {
        let weight_n = self.tree.total_mass_kg() * GRAVITY_M_S2;
        let price = self.weights.force / (weight_n * weight_n);
        let mut squares = SquaredTerms { program: &mut self.program };
        for (j, foot) in self.feet.iter().enumerate() {
            let change = self.correction.as_ref().map_or(Vector3::zeros(), |of| of.force_n[j]);
            let planned =
                if foot.stands() { reference.force_n[j] + change } else { Vector3::zeros() };
            for k in 0..3 {
                squares.add_one(price, self.tree.dofs() + 3 * j + k, planned[k]);
            }
        }
    }
}
