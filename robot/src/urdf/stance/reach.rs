//! Inverse kinematics of a leg: the two angles of its plane for hip and knee, then damped least squares with all its joints.

use super::super::bodies::Bodies;
use super::legs::Leg;
use super::{MISS, Turn, at, axes, inside, poses};
use nalgebra::{DMatrix, DVector, Isometry3, Vector3, Vector6};
use std::f64::consts::{PI, TAU};

/// Damping of the least squares, as a fraction of the leg's length.
const DAMPING: f64 = 0.05;
/// Weight of the distance from the leg's plane. A leg without a lateral joint cannot change this distance.
const ASIDE: f64 = 0.1;
/// Weight of the foot's angles, as a fraction of the leg's length. A leg with an ankle keeps its foot level in the plane; a sole
/// also lies flat and points forward.
const LEVEL: f64 = 0.5;
/// Maximum number of iterations of the least squares. About ten suffice.
const STEPS: usize = 100;
/// Change of the angles below which the iteration ends, rad.
const SETTLED_RAD: f64 = 1e-7;
/// Largest change of an angle in an iteration, rad.
const STEP_RAD: f64 = 0.3;

/// Angles of all joints with the foot of a leg at the goal, or as near as it gets, and the remaining distance, m. The knee
/// bends backward, or upward if legs stand out, unless limits forbid it.
pub(super) fn best(
    bodies: &Bodies,
    turns: &[Turn],
    angles_rad: &[f64],
    leg: &Leg,
    goal: &Vector3<f64>,
) -> (Vec<f64>, f64) {
    let usual = if leg.is_radial { 1.0 } else { -1.0 };
    let [first, second] =
        [usual, -usual].map(|side| Solver { bodies, turns, leg, goal }.solve(angles_rad, side));
    let near = MISS * leg.length_m;
    if first.1 <= second.1 + near { first } else { second }
}

struct Solver<'a> {
    bodies: &'a Bodies,
    turns: &'a [Turn],
    leg: &'a Leg,
    goal: &'a Vector3<f64>,
}

impl Solver<'_> {
    /// Angles from a start with the knee on one side, and the remaining distance, m.
    fn solve(&self, angles_rad: &[f64], side: f64) -> (Vec<f64>, f64) {
        let Self { turns, leg, .. } = *self;
        let straight = self.poses(angles_rad);
        let mut angles = self.start(angles_rad, side);
        let level = |is_kept: bool| if is_kept { LEVEL * leg.length_m } else { 0.0 };
        let (pitch, flat) =
            (level(leg.bending.len() > 2), level(leg.tip.body_from_level.is_some()));
        let weights = Vector6::new(1.0, ASIDE, 1.0, pitch, flat, flat);
        for _ in 0..STEPS {
            let now = self.poses(&angles);
            let error = self.error(&straight, &now).component_mul(&weights);
            if error.norm() < 1e-9 {
                break;
            }
            let tip_m = at(&now, &leg.tip);
            let mut jacobian = DMatrix::zeros(6, leg.own.len());
            for (column, &joint) in leg.own.iter().enumerate() {
                let pose = now[self.bodies.moving[joint].child];
                let axis: Vector3<f64> = pose.rotation * *turns[joint].axis;
                let moved = self.in_leg(&axis.cross(&(tip_m - pose.translation.vector)));
                let [pitch, roll, yaw] = self.turns_in_leg(&axis);
                let row = Vector6::new(moved.x, moved.y, moved.z, pitch, roll, yaw);
                jacobian.set_column(column, &row.component_mul(&weights));
            }
            let damping = (DAMPING * leg.length_m).powi(2);
            let normal = &jacobian * jacobian.transpose() + DMatrix::identity(6, 6) * damping;
            let Some(solved) = normal.cholesky() else { break };
            let pull = DVector::from_column_slice(error.as_slice());
            let step = jacobian.transpose() * solved.solve(&pull);
            if step.norm() < SETTLED_RAD {
                break;
            }
            for (column, &joint) in leg.own.iter().enumerate() {
                let change = step[column].clamp(-STEP_RAD, STEP_RAD);
                angles[joint] = inside(&turns[joint], angles[joint] + change);
            }
        }
        let error = self.error(&straight, &self.poses(&angles)).component_mul(&weights);
        (angles, error.xyz().norm() + MISS * error.fixed_rows::<3>(3).norm())
    }

    fn poses(&self, angles_rad: &[f64]) -> Vec<Isometry3<f64>> {
        poses(self.bodies, axes(self.turns), angles_rad)
    }

    /// Components outward, across and up.
    fn in_leg(&self, of: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(of.dot(&self.leg.out), of.dot(&self.leg.across), of.z)
    }

    /// Components of a rotation about the normal of the plane, about the direction outward, and about the vertical.
    fn turns_in_leg(&self, of: &Vector3<f64>) -> [f64; 3] {
        [of.dot(&self.leg.across), of.dot(&self.leg.out), of.z]
    }

    /// Distance to the goal outward, across and up, m, and the rotation that turns the foot back to level, rad.
    fn error(&self, straight: &[Isometry3<f64>], now: &[Isometry3<f64>]) -> Vector6<f64> {
        let to_goal = self.in_leg(&(self.goal - at(now, &self.leg.tip)));
        let body_from_level = self.leg.tip.body_from_level;
        let body_from_level =
            body_from_level.unwrap_or_else(|| straight[self.leg.body].rotation.inverse());
        let turned = now[self.leg.body].rotation * body_from_level;
        let [pitch, roll, yaw] = self.turns_in_leg(&-turned.scaled_axis());
        Vector6::new(to_goal.x, to_goal.y, to_goal.z, pitch, roll, yaw)
    }

    /// Angles of hip and knee that put the foot at the goal if both turn in the plane.
    fn start(&self, angles_rad: &[f64], side: f64) -> Vec<f64> {
        let Self { turns, leg, .. } = *self;
        let mut angles = angles_rad.to_vec();
        let now = self.poses(angles_rad);
        let &[hip, knee, ..] = &leg.bending[..] else { return angles };
        let at_joint = |joint: usize| now[self.bodies.moving[joint].child];
        let [hip_m, knee_m] = [hip, knee].map(|joint| at_joint(joint).translation.vector);
        // A rotation about `across` turns z towards `out`.
        let polar = |of: Vector3<f64>| {
            let of = self.in_leg(&of);
            (of.x.hypot(of.z), of.x.atan2(of.z))
        };
        let (thigh_m, thigh_rad) = polar(knee_m - hip_m);
        let (shank_m, shank_rad) = polar(at(&now, &leg.tip) - knee_m);
        let (goal_m, goal_rad) = polar(self.goal - hip_m);
        let corner = |near: f64, side: f64, far: f64| {
            let cosine = (near.powi(2) + side.powi(2) - far.powi(2)) / (2.0 * near * side);
            cosine.clamp(-1.0, 1.0).acos()
        };
        // With z up and `out` to the right, angles grow clockwise: an angle smaller than the goal's is outward below the hip.
        let new_thigh_rad = goal_rad - side * corner(thigh_m, goal_m, shank_m);
        let new_shank_rad = goal_rad + side * corner(shank_m, goal_m, thigh_m);
        let turned = [new_thigh_rad - thigh_rad, new_shank_rad - shank_rad];
        let turned = [turned[0], turned[1] - turned[0]];
        for (joint, turned_rad) in [hip, knee].into_iter().zip(turned) {
            let axis: Vector3<f64> = at_joint(joint).rotation * *turns[joint].axis;
            let change = wrapped(turned_rad) * axis.dot(&leg.across).signum();
            let turn = &turns[joint];
            let candidates = [0.0, TAU, -TAU].map(|whole| angles[joint] + change + whole);
            let fits = |angle: &&f64| (turn.min_rad..=turn.max_rad).contains(*angle);
            let chosen = candidates.iter().find(fits).unwrap_or(&candidates[0]);
            angles[joint] = inside(turn, *chosen);
        }
        angles
    }
}

/// Equivalent angle between −π and π.
fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}
