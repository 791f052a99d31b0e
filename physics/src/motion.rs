//! Position and velocity of what moves: rigid bodies and point masses, in world axes.

use crate::rotation::Increment;
use nalgebra::{Matrix3, Vector3};

/// Pose and velocity of a rigid body at an instant; of a point mass with no rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Centre of mass, m.
    pub position: Vector3<f64>,
    /// World from body.
    pub rotation: Matrix3<f64>,
    /// Velocity of the centre of mass, m/s.
    pub velocity: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub spin: Vector3<f64>,
}

impl Motion {
    /// Motion at rest with axes parallel to the world's.
    pub fn at(position: Vector3<f64>) -> Self {
        Self {
            position,
            rotation: Matrix3::identity(),
            velocity: Vector3::zeros(),
            spin: Vector3::zeros(),
        }
    }

    /// A point of the body, given from its centre of mass in body axes: place and velocity.
    pub fn point(&self, in_body: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let arm = self.rotation * in_body;
        (self.position + arm, self.velocity + self.spin.cross(&arm))
    }
}

/// Displacement of a body in a step, the unknowns of the step: `d` of its centre, m, and the rotation increment, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Displacement {
    /// Shift of the centre of mass, m.
    pub shift: Vector3<f64>,
    /// Rotation increment in world axes, rad: the new rotation is Exp(turn) times the old.
    pub turn: Vector3<f64>,
}

/// Order of the integrator.
///
/// Of robots, both settle and converge alike in iterations. BDF2 is much nearer to small steps, also where feet touch down:
/// way of the third period, in % of that at 1/1920 s,
///
/// | plan | BDF1 1/60 s | 1/120 s | 1/240 s | BDF2 1/60 s | 1/120 s | 1/240 s |
/// |---|---|---|---|---|---|---|
/// | walk | +0.8 | +0.6 | +0.5 | −0.5 | +0.1 | +0.1 |
/// | trot | +2.0 | +1.4 | +0.7 | −0.8 | −0.1 | 0.0 |
/// | legbot_walk | −1.0 | +0.1 | +0.4 | +3.5 | −0.3 | −0.2 |
/// | pup_walk | +1.9 | +1.1 | +0.6 | −0.2 | −0.1 | 0.0 |
/// | swizzlebot_forward | −0.6 | −0.3 | −0.1 | 0.0 | 0.0 | 0.0 |
/// | skate | −3.5 | −1.8 | −0.9 | +1.2 | +0.3 | +0.1 |
///
/// An impact lasts about a step, and costs BDF2 its lead at 1/60 s; at 1/120 s it is as good as BDF1 at 1/960 s. Where a
/// robot flies and falls at an edge of stability (flying_trot) no step of either settles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scheme {
    /// Backward Euler: first order, damps; eats impacts and spin.
    #[default]
    Bdf1,
    /// Two-step backward differentiation: second order, damps far less.
    Bdf2,
}

/// Weights of a backward difference of a quantity y: (now·y_n + last·y_{n−1} + before·y_{n−2}) / h.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Step h, s.
    pub step_s: f64,
    now: f64,
    last: f64,
    before: f64,
}

impl Weights {
    /// Weights of a scheme with the step `step_s`.
    pub fn new(scheme: Scheme, step_s: f64) -> Self {
        match scheme {
            Scheme::Bdf1 => Self { step_s, now: 1.0, last: -1.0, before: 0.0 },
            Scheme::Bdf2 => Self { step_s, now: 1.5, last: -2.0, before: 0.5 },
        }
    }

    /// Derivative of the rate by the quantity now, 1/s.
    pub fn gain(&self) -> f64 {
        self.now / self.step_s
    }

    /// Derivatives of the rate by the quantity at the two steps before, 1/s.
    pub(crate) fn earlier_gains(&self) -> [f64; 2] {
        [self.last / self.step_s, self.before / self.step_s]
    }

    /// The rate of a quantity from its value now and at the two steps before.
    pub fn rate<T>(&self, now: T, last: T, before: T) -> T
    where
        T: std::ops::Mul<f64, Output = T> + std::ops::Add<T, Output = T>,
    {
        (now * self.now + last * self.last + before * self.before) * (1.0 / self.step_s)
    }
}

/// A body's motion at the end of a step, with what its derivatives by the unknowns need.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// The motion.
    pub motion: Motion,
    /// dθ/dφ: turn of the body by its rotation increment.
    pub turn_by_phi: Matrix3<f64>,
    /// dω/dφ, 1/s.
    pub spin_by_phi: Matrix3<f64>,
}

impl Trial {
    /// Evaluates `displacement` from `last`. `before` is the displacement of the step before, for BDF2.
    pub fn new(
        weights: &Weights,
        last: &Motion,
        before: &Displacement,
        displacement: &Displacement,
    ) -> Self {
        let &Displacement { shift, turn } = displacement;
        let increment = Increment::new(turn);
        // BDF2 of the position is (1.5 d − 0.5 d1)/h; its rotation increments are carried to the same frame by J_l.
        let share = weights.before / weights.step_s;
        let (carried, carried_by_phi) = increment.left_jacobian_times(&before.turn);
        let motion = Motion {
            position: last.position + shift,
            rotation: increment.rotation() * last.rotation,
            velocity: shift * weights.gain() - before.shift * share,
            spin: turn * weights.gain() - carried * share,
        };
        Self {
            motion,
            turn_by_phi: increment.left_jacobian(),
            spin_by_phi: Matrix3::identity() * weights.gain() - carried_by_phi * share,
        }
    }
}
