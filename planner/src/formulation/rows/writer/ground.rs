//! Derivatives that go through the ground: heights change as points move over it, and normals and rolling directions turn.
//!
//! On level ground none of them does, and rows have no entries for it: terms that ask the ground for heights and directions,
//! and write their derivatives here, are the same for every ground.

use super::RowWriter;
use crate::problem::state::{ContactFrame, State};
use nalgebra::Vector3;
use rollwalk_multibody::ground::Elevation;

impl<'a> RowWriter<'a> {
    /// True if the ground is level: heights and directions are then the same everywhere.
    pub fn on_level_ground(&self) -> bool {
        self.problem.ground.is_level()
    }

    /// Adds `factor` times the derivative of the height above the ground of a point, of which three consecutive variables
    /// are the coordinates; `ground` is that below it.
    pub fn d_height(&mut self, k: usize, first: usize, factor: f64, ground: &Elevation) {
        if !self.on_level_ground() {
            self.d(k, first, -factor * ground.slope.x);
            self.d(k, first + 1, -factor * ground.slope.y);
        }
        self.d(k, first + 2, factor);
    }

    /// The same of the centre of mass.
    pub fn d_com_height(&mut self, k: usize, factor: f64, ground: &Elevation) {
        let upward = ground.upward();
        // The base moves it along itself, and on level ground z alone counts.
        let first = if self.on_level_ground() { 2 } else { 0 };
        let states: &'a [State] = self.states;
        let columns = states[self.at[k]].pose.d_com.iter().enumerate().skip(first);
        for (dof, column) in columns {
            self.d(k, dof, factor * upward.dot(column));
        }
    }

    /// Adds derivatives with respect to three consecutive variables, of which the third has none on level ground: those
    /// along the ground.
    pub fn d_along(&mut self, k: usize, first: usize, derivative: &Vector3<f64>) {
        let count = if self.on_level_ground() { 2 } else { 3 };
        (0..count).for_each(|c| self.d(k, first + c, derivative[c]));
    }

    /// Adds derivatives with respect to three consecutive variables, of which the third alone has one on level ground:
    /// those along the normal.
    pub fn d_upward(&mut self, k: usize, first: usize, derivative: &Vector3<f64>) {
        let from = if self.on_level_ground() { 2 } else { 0 };
        (from..3).for_each(|c| self.d(k, first + c, derivative[c]));
    }

    /// Adds what the normal at the contact of end effector `j` contributes, `by_normal` being the derivative by it.
    pub fn d_normal(&mut self, k: usize, j: usize, by_normal: &Vector3<f64>) {
        if !self.on_level_ground() {
            let by_place = self.frame(k, j).ground.d_normal().tr_mul(by_normal);
            let first = self.problem.layout.end_effectors[j].position;
            self.d(k, first, by_place.x);
            self.d(k, first + 1, by_place.y);
        }
    }

    /// Adds what the rolling direction of wheel `j` contributes, `factor` times `by_rolling` being the derivative by it.
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
