//! Derivatives through the ground: the height below a point changes as the point moves, and normals and rolling directions
//! turn.
//!
//! On level ground all of these are zero, and rows have no entries for them. Terms that take heights and directions from the
//! ground and write their derivatives here are the same for every ground.

use super::RowWriter;
use crate::problem::state::{ContactFrame, State};
use nalgebra::Vector3;
use rollwalk_multibody::ground::Elevation;

impl<'a> RowWriter<'a> {
    /// Returns true if the ground is level. Heights and directions are then the same everywhere.
    pub fn on_level_ground(&self) -> bool {
        self.problem.ground.is_level()
    }

    /// Adds `factor` times the derivative of a point's height above the ground. The coordinates are three consecutive variables
    /// from `first`; `ground` is the ground below the point.
    pub fn d_height(&mut self, k: usize, first: usize, factor: f64, ground: &Elevation) {
        if !self.on_level_ground() {
            self.d(k, first, -factor * ground.slope.x);
            self.d(k, first + 1, -factor * ground.slope.y);
        }
        self.d(k, first + 2, factor);
    }

    /// Adds `factor` times the derivative of the centre of mass's height above the ground.
    pub fn d_com_height(&mut self, k: usize, factor: f64, ground: &Elevation) {
        let upward = ground.upward();
        // The base moves the point along itself, and on level ground only z counts.
        let first = if self.on_level_ground() { 2 } else { 0 };
        let states: &'a [State] = self.states;
        let columns = states[self.at[k]].pose.d_com.iter().enumerate().skip(first);
        for (dof, column) in columns {
            self.d(k, dof, factor * upward.dot(column));
        }
    }

    /// Adds the derivative with respect to a vector along the ground, stored in three consecutive variables. On level ground
    /// the third has no entry.
    pub fn d_along(&mut self, k: usize, first: usize, derivative: &Vector3<f64>) {
        let count = if self.on_level_ground() { 2 } else { 3 };
        (0..count).for_each(|c| self.d(k, first + c, derivative[c]));
    }

    /// Adds the derivative with respect to a vector along the normal, stored in three consecutive variables. On level ground
    /// only the third has an entry.
    pub fn d_upward(&mut self, k: usize, first: usize, derivative: &Vector3<f64>) {
        let from = if self.on_level_ground() { 2 } else { 0 };
        (from..3).for_each(|c| self.d(k, first + c, derivative[c]));
    }

    /// Adds the derivative through the normal at the contact of end effector `j`. `by_normal` is the derivative with respect to
    /// the normal.
    pub fn d_normal(&mut self, k: usize, j: usize, by_normal: &Vector3<f64>) {
        if !self.on_level_ground() {
            let by_place = self.frame(k, j).ground.d_normal().tr_mul(by_normal);
            let first = self.problem.layout.end_effectors[j].position;
            self.d(k, first, by_place.x);
            self.d(k, first + 1, by_place.y);
        }
    }

    /// Adds the derivative through the rolling direction of wheel `j`. `factor` times `by_rolling` is the derivative with
    /// respect to that direction.
    pub fn d_rolling(&mut self, k: usize, j: usize, factor: f64, by_rolling: &Vector3<f64>) {
        let Some(wheel) = self.problem.layout.end_effectors[j].wheel else { return };
        let ContactFrame { d_rolling: [d_tilt, d_yaw], by_normal, .. } = self.frame(k, j);
        self.d(k, wheel.yaw, factor * by_rolling.dot(d_yaw));
        if let Some(slope) = by_normal {
            self.d(k, wheel.tilt, factor * by_rolling.dot(d_tilt));
            self.d_normal(k, j, &(slope.d_rolling.tr_mul(by_rolling) * factor));
        }
    }

    fn frame(&self, k: usize, j: usize) -> &'a ContactFrame {
        let states: &'a [State] = self.states;
        &states[self.at[k]].frames[j]
    }
}
