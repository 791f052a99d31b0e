//! Tasks of a tick as weighted squares of their errors: the objective of its quadratic program.
//!
//! Unknowns are ν̇, and the three force components of each end effector in world axes.

use crate::quadratic::Program;
use nalgebra::{DVectorView, Dim, Matrix, RawStorage, U3, Vector3};

/// Feedback of a task: acceleration per error of position and of velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Acceleration per position error, 1/s².
    pub per_s2: f64,
    /// Acceleration per velocity error, 1/s.
    pub per_s: f64,
}

/// Weights and feedback of the tasks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Weight of the acceleration of the material at a rolling or resting contact, per (m/s²)². Far above all other weights.
    pub contact: f64,
    /// Decay rate of slip at a contact, 1/s.
    pub contact_decay_per_s: f64,
    /// Weight of the acceleration of the centre of mass, per (m/s²)².
    pub com: f64,
    /// Feedback of the centre of mass.
    pub com_feedback: Feedback,
    /// Limit of the feedback acceleration of the centre of mass, m/s².
    pub com_most_m_s2: f64,
    /// Weight of the angular acceleration of the body, per (rad/s²)².
    pub body: f64,
    /// Feedback of the body.
    pub body_feedback: Feedback,
    /// Limit of the feedback acceleration of the body, rad/s².
    pub body_most_rad_s2: f64,
    /// Weight of the acceleration of the centre of an end effector in the air, per (m/s²)².
    pub swing: f64,
    /// Feedback of the centre of an end effector in the air.
    pub swing_feedback: Feedback,
    /// Weight of the acceleration of a standing wheel's centre along its rolling direction, per (m/s²)².
    ///
    /// A wheel carries the inertia of its rotor, many times its mass, so that its speed cannot be chosen freely.
    pub roll: f64,
    /// Value of [`Self::roll`] for a robot that balances on two wheels. Only the wheels can bring its centre of mass forward.
    pub roll_balancing: f64,
    /// Feedback of a wheel that stands.
    ///
    /// Without position feedback the controller would move the body forward by permanently pushing the wheels back, against the
    /// inertia of their rotors.
    pub roll_feedback: Feedback,
    /// Weight of joint accelerations, per (rad/s²)².
    pub posture: f64,
    /// Weight of joint accelerations during recovery from a push, per (rad/s²)². Stiff legs carry the robot over the edge of
    /// its support and back, where soft legs would yield.
    pub posture_recovering: f64,
    /// Feedback of the joints.
    pub posture_feedback: Feedback,
    /// Rate at which the spin of a wheel in the air approaches the planned one, 1/s. Its weight is `posture`.
    pub spin_per_s: f64,
    /// Cost of the squared deviation of ground forces from the planned ones, with forces as fractions of m g.
    pub force: f64,
    /// Fraction of the friction coefficient that is used.
    ///
    /// The friction pyramid lies within the cone of this coefficient; during recovery it encloses the cone.
    pub friction_part: f64,
}

impl Default for Weights {
    /// Default weights for all robots. docs/measured/tracking.md contains their results on the shipped plans.
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
            roll_balancing: 100.0,
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
    /// Feedback acceleration for errors of position and velocity.
    pub(crate) fn of(&self, place: &Vector3<f64>, speed: &Vector3<f64>) -> Vector3<f64> {
        place * self.per_s2 + speed * self.per_s
    }

    /// Feedback acceleration, limited to `most`.
    pub(crate) fn limited(
        &self,
        place: &Vector3<f64>,
        speed: &Vector3<f64>,
        most: f64,
    ) -> Vector3<f64> {
        limited(self.of(place, speed), most)
    }
}

/// Limits the length of a vector.
pub(crate) fn limited(wanted: Vector3<f64>, most: f64) -> Vector3<f64> {
    wanted * (most / wanted.norm().max(most))
}

/// Weighted squares that are added to the objective of a program.
pub(crate) struct SquaredTerms<'p> {
    pub program: &'p mut Program,
}

impl SquaredTerms<'_> {
    /// Adds weight |J ν̇ − target|² for the first unknowns.
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

    /// Adds weight (row ν̇ − target)².
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

    /// Adds weight (x − target)² of one unknown.
    pub fn add_one(&mut self, weight: f64, unknown: usize, target: f64) {
        self.program.hessian[(unknown, unknown)] += weight;
        self.program.gradient[unknown] -= weight * target;
    }
}
