//! Objectives on rollouts as sums of squares, with derivatives with respect to motions.
//!
//! The objective is O = ½ Σ e². Each residual e depends on some motions. Its derivatives with respect to the parameters are a
//! row of the Jacobian J ([`Rollout::jacobian`]). Then ∇O = Jᵀe, and JᵀJ is SᵀO_qqS of the thesis's Gauss–Newton method
//! (4.7.1). The adjoint method computes the gradient alone at lower cost ([`Rollout::gradient`]).

use crate::motor::Motor;
use crate::sensitivity::{Rollout, Variation};
use crate::slide::Rows;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation::{log, right_jacobian_inverse};
use std::f64::consts::TAU;

/// Quantity with the target 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    /// Value of the residual.
    pub value: f64,
    /// Derivatives of the value with respect to motions, as step, body, and derivative with respect to the body's motion after
    /// this step.
    pub by: Vec<(usize, usize, Variation)>,
}

impl Residual {
    /// Deviation of a body's position from a target after a step, along the direction of `weight` and multiplied by its length.
    pub fn position(
        rollout: &Rollout,
        step: usize,
        body: usize,
        target: &Vector3<f64>,
        weight: Vector3<f64>,
    ) -> Self {
        let value = weight.dot(&(rollout.motions(step)[body].position - target));
        let by = Variation { shift: weight, ..Variation::default() };
        Self { value, by: vec![(step, body, by)] }
    }

    /// Deviation of a body's velocity from a target after a step, along the direction of `weight` and multiplied by its length.
    pub fn velocity(
        rollout: &Rollout,
        step: usize,
        body: usize,
        target: &Vector3<f64>,
        weight: Vector3<f64>,
    ) -> Self {
        let value = weight.dot(&(rollout.motions(step)[body].velocity - target));
        let by = Variation { velocity: weight, ..Variation::default() };
        Self { value, by: vec![(step, body, by)] }
    }

    /// Rotation vector from a target orientation to a body's orientation after a step, multiplied by `weight`. One residual for
    /// each component.
    pub fn orientation(
        rollout: &Rollout,
        step: usize,
        body: usize,
        target: &Matrix3<f64>,
        weight: f64,
    ) -> [Self; 3] {
        let turned = log(&(rollout.motions(step)[body].rotation * target.transpose()));
        // Exp(δθ) Exp(e) = Exp(e + J_l⁻¹ δθ), and J_l⁻¹ is the transposed J_r⁻¹.
        let by_turn = right_jacobian_inverse(&turned) * weight;
        [0, 1, 2].map(|k| {
            let by = Variation { turn: by_turn.column(k).into(), ..Variation::default() };
            Self { value: weight * turned[k], by: vec![(step, body, by)] }
        })
    }

    /// Deviation of a gyroscope's reading along a body axis from a target after a step, rad/s, multiplied by `weight`.
    pub fn gyroscope(
        rollout: &Rollout,
        step: usize,
        body: usize,
        axis_in_body: &Vector3<f64>,
        target_rad_s: f64,
        weight: f64,
    ) -> Self {
        let motion = &rollout.motions(step)[body];
        let axis = motion.rotation * axis_in_body * weight;
        let value = axis.dot(&motion.spin) - weight * target_rad_s;
        let by = Variation { turn: axis.cross(&motion.spin), spin: axis, ..Variation::default() };
        Self { value, by: vec![(step, body, by)] }
    }

    /// Deviation of a motor's angle from a target after a step, rad, multiplied by `weight`. Whole turns are ignored, as by an
    /// encoder.
    pub fn angle(
        rollout: &Rollout,
        step: usize,
        motor: &Motor,
        target_rad: f64,
        weight: f64,
    ) -> Self {
        let now = motor.bodies.map(|body| rollout.motions(step)[body]);
        let off = motor.angle(&now) - target_rad;
        let value = weight * (off - TAU * (off / TAU).round());
        let [first, second] = motor.bodies;
        if let Some(slide) = &motor.slide {
            let Rows { shift, turn, .. } = slide.rows(&motor.axis, &now);
            let of = |k: usize| Variation {
                shift: shift[k] * weight,
                turn: turn[k] * weight,
                ..Variation::default()
            };
            return Self { value, by: vec![(step, first, of(0)), (step, second, of(1))] };
        }
        let turn = motor.angle_by_turn(&now) * weight;
        let of = |turn| Variation { turn, ..Variation::default() };
        Self { value, by: vec![(step, first, of(-turn)), (step, second, of(turn))] }
    }

    /// Deviation of a motor's speed from a target after a step, rad/s, multiplied by `weight`.
    pub fn speed(
        rollout: &Rollout,
        step: usize,
        motor: &Motor,
        target_rad_s: f64,
        weight: f64,
    ) -> Self {
        let now = motor.bodies.map(|body| rollout.motions(step)[body]);
        let [first, second] = motor.bodies;
        if let Some(slide) = &motor.slide {
            let rows = slide.rows(&motor.axis, &now);
            let of = |k: usize| Variation {
                shift: rows.speed_by_shift[k] * weight,
                turn: rows.speed_by_turn[k] * weight,
                velocity: rows.shift[k] * weight,
                spin: rows.turn[k] * weight,
            };
            return Self {
                value: weight * (motor.speed(&now) - target_rad_s),
                by: vec![(step, first, of(0)), (step, second, of(1))],
            };
        }
        let axis = motor.axis_in_world(&now[0]) * weight;
        let relative = now[1].spin - now[0].spin;
        let none = Variation::default();
        let of_first = Variation { turn: axis.cross(&relative), spin: -axis, ..none };
        Self {
            value: axis.dot(&relative) - weight * target_rad_s,
            by: vec![(step, first, of_first), (step, second, Variation { spin: axis, ..none })],
        }
    }

    /// Deviation of the common centre of mass from a target after a step, along the direction of `weight` and multiplied by its
    /// length.
    pub fn com(
        rollout: &Rollout,
        step: usize,
        target: &Vector3<f64>,
        weight: Vector3<f64>,
    ) -> Self {
        let mass_kg: f64 = rollout.masses_kg().iter().sum();
        let mut residual = Self { value: -weight.dot(target), by: Vec::new() };
        for (body, of_body) in rollout.masses_kg().iter().enumerate() {
            let shift = weight * (of_body / mass_kg);
            residual.value += shift.dot(&rollout.motions(step)[body].position);
            residual.by.push((step, body, Variation { shift, ..Variation::default() }));
        }
        residual
    }

    /// Deviation of the centre of mass's mean velocity between two steps from a target, m/s, along the direction of `weight`
    /// and multiplied by its length.
    pub fn mean_velocity(
        rollout: &Rollout,
        [from, to]: [usize; 2],
        target: &Vector3<f64>,
        weight: Vector3<f64>,
    ) -> Self {
        let per_s = 1.0 / (rollout.time_s(to) - rollout.time_s(from));
        let mut residual = Self::com(rollout, to, &(target / per_s), weight * per_s);
        let before = Self::com(rollout, from, &Vector3::zeros(), weight * -per_s);
        residual.value += before.value;
        residual.by.extend(before.by);
        residual
    }
}

/// Half the sum of squared residuals.
pub fn cost(residuals: &[Residual]) -> f64 {
    0.5 * residuals.iter().map(|residual| residual.value * residual.value).sum::<f64>()
}
