//! Interface of forces on bodies: springs, joints, motors and contacts.
//!
//! A force names the bodies that it acts on and computes force and moment on each, with derivatives by position, rotation,
//! velocity and spin of all of them. Unknowns, steps and matrices are not part of it: the stepper applies the chain rule. One
//! element therefore serves all integrators, and its derivatives can be tested separately.

use crate::friction::Friction;
use crate::motion::{Motion, Trial, Weights};
use crate::touch::Touch;
use nalgebra::{Matrix3, Matrix6, Matrix6x3, Vector3, Vector6};
use std::any::Any;
use std::fmt::{self, Debug};

pub use crate::friction::Held;

/// Force, N, and moment about the centre of mass, N·m, in world axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force: Vector3<f64>,
    /// Moment, N·m.
    pub moment: Vector3<f64>,
}

impl Wrench {
    /// Force, then moment.
    pub fn stacked(&self) -> Vector6<f64> {
        let mut all = Vector6::zeros();
        all.fixed_rows_mut::<3>(0).copy_from(&self.force);
        all.fixed_rows_mut::<3>(3).copy_from(&self.moment);
        all
    }
}

/// Derivatives of a wrench by the motion of a body: rows force and moment, columns a shift δc and a turn δθ of the body
/// (`dR = [δθ] R`) in `by_pose`, of its velocity and spin in `by_rate`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivative {
    /// Derivative by δc, m, and δθ, rad.
    pub by_pose: Matrix6<f64>,
    /// Derivative by velocity, m/s, and spin, rad/s.
    pub by_rate: Matrix6<f64>,
}

impl Default for Derivative {
    fn default() -> Self {
        Self { by_pose: Matrix6::zeros(), by_rate: Matrix6::zeros() }
    }
}

/// Part of the motion that a block of a [`Derivative`] belongs to.
#[derive(Clone, Copy, Debug)]
pub enum By {
    /// Shift of the centre of mass.
    Position,
    /// Turn.
    Rotation,
    /// Velocity of the centre of mass.
    Velocity,
    /// Angular velocity.
    Spin,
}

impl Derivative {
    /// Adds the derivative of the force by a part of the motion.
    pub fn add_force(&mut self, by: By, block: &Matrix3<f64>) {
        self.add(0, by, block);
    }

    /// Adds the derivative of the moment by a part of the motion.
    pub fn add_moment(&mut self, by: By, block: &Matrix3<f64>) {
        self.add(3, by, block);
    }

    /// Derivative by the unknowns of a body: by its shift and, if it turns, by its rotation increment; through velocity and
    /// spin as well.
    pub(crate) fn chained(&self, by: &Trial, gain: f64, turns: bool) -> Matrix6<f64> {
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

    fn add(&mut self, row: usize, by: By, block: &Matrix3<f64>) {
        let (matrix, column) = match by {
            By::Position => (&mut self.by_pose, 0),
            By::Rotation => (&mut self.by_pose, 3),
            By::Velocity => (&mut self.by_rate, 0),
            By::Spin => (&mut self.by_rate, 3),
        };
        let mut part = matrix.fixed_view_mut::<3, 3>(row, column);
        part += block;
    }
}

/// Motions of the bodies of a force: now, and at the ends of the two steps before.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Motions at the end of the step.
    pub now: &'a [Motion],
    /// Motions at the beginning of the step.
    pub last: &'a [Motion],
    /// Motions one step before `last`.
    pub before: &'a [Motion],
    /// Weights of the step's backward differences.
    pub weights: &'a Weights,
    /// True if derivatives may be those of a tamer force with the same value: the secant of friction, and joint forces that keep
    /// their moments as they turn. Used where exact derivatives make Newton's method oscillate across a kink or lead down from a
    /// saddle.
    pub tame: bool,
    /// Friction found so far, if hybrid friction holds the contact.
    pub held: Option<Held>,
}

/// A force that may have a kink, near a motion of its bodies: a law of the displacement of one point, or of one angle.
pub struct Kink<'a> {
    /// Jᵀ of each body: maps the force of the law to a wrench; its transpose maps body motion to displacement.
    pub(crate) levers: [Matrix6x3<f64>; 2],
    /// Directions in which the law acts.
    pub(crate) directions: usize,
    /// True if the kink is always solved with the others; otherwise only if it leaves its tangent.
    pub(crate) always: bool,
    /// Force after a displacement whose rate changes by `gain` times as much, and its derivative by the displacement.
    #[allow(clippy::type_complexity, reason = "it is named nowhere else")]
    pub(crate) law: Box<dyn Fn(f64, &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) + 'a>,
}

impl Debug for Kink<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Kink").field("levers", &self.levers).finish_non_exhaustive()
    }
}

/// Something that acts on bodies. Results are functions of the motions alone, so that a step can be tried again.
pub trait Force: Any + Debug + Send + Sync {
    /// The bodies, by index in the system. A force that acts between a body and the world names the body alone.
    fn bodies(&self) -> &[usize];

    /// Adds the wrenches on its bodies, in their order.
    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]);

    /// Adds the wrenches and their derivatives: that of the wrench on body `i` by the motion of body `j` is in
    /// `derivatives[i * bodies + j]`.
    fn derivatives(&self, view: &View<'_>, wrenches: &mut [Wrench], derivatives: &mut [Derivative]);

    /// Adds the derivatives of the wrenches by the motions at the beginning of the step and one step earlier; false of a force
    /// that does not look at them.
    fn history(
        &self,
        _view: &View<'_>,
        _last: &mut [Derivative],
        _before: &mut [Derivative],
    ) -> bool {
        false
    }

    /// Called when a step ends with these motions of all bodies, to update state that motions do not contain. A call with the
    /// motions at the beginning of the step must undo the update.
    fn end_step(&mut self, _motions: &[Motion]) {}

    /// True if the force can have a [`Kink`].
    fn has_kink(&self) -> bool {
        false
    }

    /// Law near motions of the bodies, for a force with kinks that its derivatives do not contain.
    fn kink(&self, _now: &[Motion], _held: Option<Held>) -> Option<Kink<'_>> {
        None
    }

    /// True if the force has no effect in a step of this length, s, unless its bodies move in ways that their motions do not
    /// show. The solver checks again at the solution of the step.
    fn is_far(&self, _now: &[Motion], _step_s: f64) -> bool {
        false
    }

    /// Friction of the contact; `None` for other forces.
    fn friction(&self) -> Option<&Friction> {
        None
    }

    /// State of the contact; `None` for other forces.
    fn touch(&self, _now: &[Motion]) -> Option<Touch> {
        None
    }

    /// Stored energy, J.
    fn energy(&self, _now: &[Motion]) -> f64 {
        0.0
    }
}
