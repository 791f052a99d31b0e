//! Interface of forces on bodies: springs, joints, motors and contacts.
//!
//! A force lists the bodies that it acts on. It computes force and moment on each body, and their derivatives with respect to
//! position, rotation, velocity and spin of all of these bodies. The stepper maps these to unknowns by the chain rule. A force
//! is therefore independent of the integrator, and its derivatives can be tested separately.

use crate::friction::Friction;
use crate::motion::{BodyMotion, TrialMotion, Weights};
use crate::touch::Touch;
use nalgebra::{Matrix3, Matrix6, Matrix6x3, Vector3, Vector6};
use std::any::Any;
use std::fmt::{self, Debug};
use std::ops::{Add, Mul};

pub use crate::friction::StickingFriction;

/// Force and moment about the centre of mass, in world axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force: Vector3<f64>,
    /// Moment, N·m.
    pub moment: Vector3<f64>,
}

impl Wrench {
    /// Vector of the force, then the moment.
    pub fn stacked(&self) -> Vector6<f64> {
        let mut all = Vector6::zeros();
        all.fixed_rows_mut::<3>(0).copy_from(&self.force);
        all.fixed_rows_mut::<3>(3).copy_from(&self.moment);
        all
    }
}

impl Add for Wrench {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { force: self.force + other.force, moment: self.moment + other.moment }
    }
}

impl Mul<f64> for Wrench {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { force: self.force * factor, moment: self.moment * factor }
    }
}

/// Derivatives of a wrench with respect to the motion of a body. Rows are force and moment. Columns of `by_pose` are a shift δc
/// and a turn δθ of the body (`dR = [δθ] R`); columns of `by_rate` are velocity and spin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivative {
    /// Derivative with respect to δc, m, and δθ, rad.
    pub by_pose: Matrix6<f64>,
    /// Derivative with respect to velocity, m/s, and spin, rad/s.
    pub by_rate: Matrix6<f64>,
}

impl Default for Derivative {
    fn default() -> Self {
        Self { by_pose: Matrix6::zeros(), by_rate: Matrix6::zeros() }
    }
}

/// Column block of a [`Derivative`].
#[derive(Clone, Copy, Debug)]
pub enum StateBlock {
    /// Shift of the centre of mass.
    Position,
    /// Turn of the body.
    Rotation,
    /// Velocity of the centre of mass.
    Velocity,
    /// Angular velocity.
    Spin,
}

impl Derivative {
    /// Adds a derivative of the force with respect to one component of the motion.
    pub fn add_force(&mut self, by: StateBlock, block: &Matrix3<f64>) {
        self.add(0, by, block);
    }

    /// Adds a derivative of the moment with respect to one component of the motion.
    pub fn add_moment(&mut self, by: StateBlock, block: &Matrix3<f64>) {
        self.add(3, by, block);
    }

    /// Derivative with respect to the unknowns of a body: its shift and, for rigid bodies, its rotation increment. Includes the
    /// dependence of velocity and spin on these unknowns.
    pub(crate) fn chained(&self, by: &TrialMotion, gain: f64, turns: bool) -> Matrix6<f64> {
        let Self { by_pose, by_rate } = self;
        let mut by_unknowns = Matrix6::zeros();
        let mut shift = by_unknowns.fixed_columns_mut::<3>(0);
        shift.copy_from(&by_pose.fixed_columns::<3>(0));
        shift += by_rate.fixed_columns::<3>(0) * gain;
        if turns {
            let mut turn = by_unknowns.fixed_columns_mut::<3>(3);
            turn.copy_from(&(by_pose.fixed_columns::<3>(3) * by.turn_by_phi));
            turn += by_rate.fixed_columns::<3>(3) * by.spin_by_phi;
        }
        by_unknowns
    }

    fn add(&mut self, row: usize, by: StateBlock, block: &Matrix3<f64>) {
        let (matrix, column) = match by {
            StateBlock::Position => (&mut self.by_pose, 0),
            StateBlock::Rotation => (&mut self.by_pose, 3),
            StateBlock::Velocity => (&mut self.by_rate, 0),
            StateBlock::Spin => (&mut self.by_rate, 3),
        };
        let mut part = matrix.fixed_view_mut::<3, 3>(row, column);
        part += block;
    }
}

/// Motions of a force's bodies at the end of the step, at its beginning, and one step earlier.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Motions at the end of the step.
    pub now: &'a [BodyMotion],
    /// Motions at the beginning of the step.
    pub last: &'a [BodyMotion],
    /// Motions one step before `last`.
    pub before: &'a [BodyMotion],
    /// Weights of the step's backward differences.
    pub weights: &'a Weights,
    /// True if derivatives may be those of a smoother force with the same value: the secant of friction, and joint forces
    /// without the change of their moment arms. The solver sets it if exact derivatives oscillate across a kink or lead away
    /// from a minimum.
    pub tame: bool,
    /// Current estimate of the friction force, if hybrid friction holds the contact; otherwise `None`.
    pub held: Option<StickingFriction>,
}

/// Force law with a kink, near given motions of its bodies. The law depends on the displacement of one point, or on one angle.
pub struct Kink<'a> {
    /// Jᵀ of each body: maps the force of the law to a wrench; its transpose maps body motion to displacement.
    pub(crate) levers: [Matrix6x3<f64>; 2],
    /// Number of directions in which the law acts.
    pub(crate) directions: usize,
    /// True if the combined solve always includes the kink; false if it includes the kink only where the law deviates from its
    /// tangent.
    pub(crate) always: bool,
    /// Force after a displacement, and its derivative with respect to this displacement. The arguments are a gain and the
    /// displacement. The rate of the displacement changes by the gain times the displacement.
    #[allow(clippy::type_complexity, reason = "the type has no other use")]
    pub(crate) law: Box<dyn Fn(f64, &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) + 'a>,
}

impl Debug for Kink<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Kink").field("levers", &self.levers).finish_non_exhaustive()
    }
}

/// Force on bodies. Results depend on the motions alone, so that a step can be repeated.
pub trait Force: Any + Debug + Send + Sync {
    /// Indices of the bodies in the system. A force between a body and the world lists that body only.
    fn bodies(&self) -> &[usize];

    /// Adds the wrenches on the bodies, in the order of [`bodies`](Self::bodies).
    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]);

    /// Adds the wrenches and their derivatives. The derivative of the wrench on body `i` with respect to the motion of body `j`
    /// is `derivatives[i * bodies + j]`.
    fn derivatives(&self, view: &View<'_>, wrenches: &mut [Wrench], derivatives: &mut [Derivative]);

    /// Adds the derivatives of the wrenches with respect to the motions at the beginning of the step and one step earlier.
    /// Returns false if the force does not depend on these motions.
    fn history(
        &self,
        _view: &View<'_>,
        _last: &mut [Derivative],
        _before: &mut [Derivative],
    ) -> bool {
        false
    }

    /// Updates internal state at the end of a step, given the motions of all bodies. A call with the motions at the beginning
    /// of the step must undo the update.
    fn end_step(&mut self, _motions: &[BodyMotion]) {}

    /// Returns true if the force can have a [`Kink`].
    fn has_kink(&self) -> bool {
        false
    }

    /// Returns the law near the given motions, for a force whose derivatives omit a kink.
    fn kink(&self, _now: &[BodyMotion], _held: Option<StickingFriction>) -> Option<Kink<'_>> {
        None
    }

    /// Returns true if the force has no effect in a step of `step_s` seconds, given the present velocities. The solver checks
    /// again at the solution of the step.
    fn is_far(&self, _now: &[BodyMotion], _step_s: f64) -> bool {
        false
    }

    /// Friction of the contact; `None` for other forces.
    fn friction(&self) -> Option<&Friction> {
        None
    }

    /// State of the contact; `None` for other forces.
    fn touch(&self, _now: &[BodyMotion]) -> Option<Touch> {
        None
    }

    /// Stored energy, J.
    fn energy(&self, _now: &[BodyMotion]) -> f64 {
        0.0
    }
}
