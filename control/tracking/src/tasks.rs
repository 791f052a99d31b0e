//! Tasks of a tick as weighted squares of their errors: the objective of its quadratic program.
//!
//! Unknowns are ν̇ and the forces f of the end effectors that stand, three each in world axes.

use crate::quadratic::Program;
use nalgebra::{DVectorView, Dim, Matrix, RawStorage, U3, Vector3};

/// Feedback of a task on a place: acceleration per error of place, and of speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// 1/s².
    pub per_s2: f64,
    /// 1/s.
    pub per_s: f64,
}

/// Weights of tasks, and how errors are fed back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Contacts that roll or rest: acceleration of the material at the contact, per (m/s²)². Far above all others.
    pub contact: f64,
    /// Decay rate of slip at a contact, 1/s.
    pub contact_decay_per_s: f64,
    /// Acceleration of the centre of mass, per (m/s²)².
    pub com: f64,
    /// Feedback of the centre of mass.
    pub com_feedback: Feedback,
    /// Most acceleration that it may ask for, m/s².
    pub com_most_m_s2: f64,
    /// Angular acceleration of the body, per (rad/s²)².
    pub body: f64,
    /// Feedback of the body.
    pub body_feedback: Feedback,
    /// Most angular acceleration that it may ask for, rad/s².
    pub body_most_rad_s2: f64,
    /// Acceleration of the centre of an end effector in the air, per (m/s²)².
    pub swing: f64,
    /// Feedback of the centre of an end effector in the air.
    pub swing_feedback: Feedback,
    /// Acceleration along its way of the centre of a wheel that stands, per (m/s²)². A wheel carries the inertia of its rotor,
    /// many times its mass: it is no free choice how fast it goes.
    pub roll: f64,
    /// Feedback of a wheel that stands. Without feedback of its place, the body would be brought ahead by pushing the wheels back
    /// for good, against the inertia of their rotors.
    pub roll_feedback: Feedback,
    /// Accelerations of joints, per (rad/s²)².
    pub posture: f64,
    /// The same of a robot that recovers from a push: stiff legs carry it over the edge of its support and back, where soft
    /// ones give way.
    pub posture_recovering: f64,
    /// Feedback of the joints.
    pub posture_feedback: Feedback,
    /// Rate at which the spin of a wheel in the air approaches the planned one, 1/s; its weight is `posture`.
    pub spin_per_s: f64,
    /// Forces of the ground against the planned ones, per square of the robot's weight.
    pub force: f64,
    /// Part of the friction coefficient that forces keep to: the cone around their pyramid, or, of a robot that recovers,
    /// within it.
    pub friction_part: f64,
}

impl Default for Weights {
    /// The same for all robots; docs/measured/tracking.md has their results on the shipped plans.
    fn default() -> Self {
        Self {
            contact: 1e3,
            contact_decay_per_s: 30.0,
            com: 10.0,
            com_feedback: Feedback { per_s2: 80.0, per_s: 18.0 },
            com_most_m_s2: 10.0,
            body: 5.0,
            body_feedback: Feedback { per_s2: 150.0, per_s: 24.0 },
            body_most_rad_s2: 80.0,
            swing: 10.0,
            swing_feedback: Feedback { per_s2: 400.0, per_s: 40.0 },
            roll: 1.0,
            roll_feedback: Feedback { per_s2: 50.0, per_s: 15.0 },
            posture: 0.3,
            posture_recovering: 3.0,
            posture_feedback: Feedback { per_s2: 200.0, per_s: 28.0 },
            spin_per_s: 20.0,
            force: 160.0,
            friction_part: 0.8,
        }
    }
}

impl Feedback {
    /// Acceleration that it asks for.
    pub(crate) fn of(&self, place: &Vector3<f64>, speed: &Vector3<f64>) -> Vector3<f64> {
        place * self.per_s2 + speed * self.per_s
    }

    /// Acceleration that it asks for, up to a limit.
    pub(crate) fn limited(
        &self,
        place: &Vector3<f64>,
        speed: &Vector3<f64>,
        most: f64,
    ) -> Vector3<f64> {
        limited(self.of(place, speed), most)
    }
}

/// Shortens a vector to a limit.
pub(crate) fn limited(wanted: Vector3<f64>, most: f64) -> Vector3<f64> {
    wanted * (most / wanted.norm().max(most))
}

/// Squares to be added up in a program's objective.
pub(crate) struct Squares<'p> {
    pub program: &'p mut Program,
}

impl Squares<'_> {
    /// weight |J ν̇ − target|², for the first unknowns.
    pub fn add<C: Dim, S: RawStorage<f64, U3, C>>(
        &mut self,
        weight: f64,
        jacobian: &Matrix<f64, U3, C, S>,
        target: &Vector3<f64>,
    ) {
        let columns = jacobian.ncols();
        for i in 0..columns {
            let one = jacobian.column(i);
            for j in 0..=i {
                self.program.hessian[(i, j)] += weight * one.dot(&jacobian.column(j));
            }
            self.program.gradient[i] -= weight * one.dot(target);
        }
    }

    /// weight (row ν̇ − target)².
    pub fn add_row(&mut self, weight: f64, row: DVectorView<'_, f64>, target: f64) {
        for i in 0..row.len() {
            if row[i] == 0.0 {
                continue;
            }
            for j in 0..=i {
                self.program.hessian[(i, j)] += weight * row[i] * row[j];
            }
            self.program.gradient[i] -= weight * row[i] * target;
        }
    }

    /// weight (x − target)² of one unknown.
    pub fn add_one(&mut self, weight: f64, unknown: usize, target: f64) {
        self.program.hessian[(unknown, unknown)] += weight;
        self.program.gradient[unknown] -= weight * target;
    }
}
