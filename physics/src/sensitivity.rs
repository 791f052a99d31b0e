//! Sensitivities of whole rollouts, from the same derivatives as the Newton step (thesis 4.3.2).
//!
//! A [`Recorder`] keeps of every step that it takes with a system the derivatives of its residual; the [`Rollout`] that it
//! ends with gives derivatives of everything that the bodies did, by numbers that each are a [`Parameter`]. The direct
//! method carries derivatives by all parameters forward ([`Rollout::direct`]), the adjoint method those of one number
//! backward ([`Rollout::adjoint`]). [`objective`] has what rollouts are to do; [`gauss_newton`] and [`lbfgs`] find parameters
//! with which they do, [`adam`] the weights of a controller that is trained on many.
//!
//! # Equations
//!
//! Step i has a root x_i, the displacements d and rotation increments φ of its bodies, of the residual
//! r(z_i, z_{i−1}, z_{i−2}; p), where z are motions: position, rotation, velocity and spin. Rotations vary by a turn δθ
//! on the left, dR = \[δθ\]R, so that nothing depends on where angles are counted from. With g = w_0/h and s = w_2/h from the
//! weights of the backward difference, the motions follow from x as
//!
//! δc_i = δc_{i−1} + δd_i, δθ_i = J_l(φ_i) δφ_i + Exp(φ_i) δθ_{i−1},
//! δv_i = g δd_i − s δd_{i−1}, δω_i = (∂ω/∂φ) δφ_i − s J_l(φ_i) δφ_{i−1},
//!
//! which is exact: increments begin anew at every step and are carried on by these two formulas alone. With them the
//! residual's variation is B δx_i + P δz_{i−1} + Q δz_{i−2} + N δx_{i−1} + (∂r/∂p) δp = 0, where B is Newton's matrix. A
//! record has B, P, Q, N and the columns of ∂r/∂p; with backward Euler Q and N are 0.
//!
//! * direct: B δx_i = −(P δz_{i−1} + Q δz_{i−2} + N δx_{i−1} + ∂r/∂p), with all parameters as right sides;
//! * adjoint: Bᵀ μ_i = (∂x of all that follows), dO/dp = −Σ (∂r/∂p)ᵀ μ_i + what the initial state gives.
//!
//! A step that was halved is several such steps, and the first of BDF2 is one of backward Euler: both are in the record as they
//! were taken.
//!
//! # Example
//!
//! How far a mass comes in a second by how fast it is thrown, forward and backward:
//!
//! ```
//! use nalgebra::Vector3;
//! use rollwalk_physics::sensitivity::parameter::{Freedom, Initial};
//! use rollwalk_physics::sensitivity::{Recorder, Residual};
//! use rollwalk_physics::{Assembly, Body, Motion, Settings, System};
//!
//! let mut assembly = Assembly::default();
//! let ball = assembly.add_body(Body::Particle { mass_kg: 0.1 }, Motion::at(Vector3::z()));
//! let mut system = System::new(Settings::default(), assembly);
//! let faster = Initial { bodies: vec![ball], freedom: Freedom::Velocity, axis: Vector3::x() };
//!
//! let mut recorder = Recorder::new(&system, vec![Box::new(faster)]);
//! for _ in 0..100 {
//!     system.step_recorded(0.01, &mut recorder)?;
//! }
//! let rollout = recorder.finish();
//!
//! let target = Vector3::x() * 2.0;
//! let miss = [Residual::position(&rollout, 100, ball, &target, Vector3::x())];
//! assert!((rollout.jacobian(&miss)[(0, 0)] - 1.0).abs() < 1e-12);
//! assert!((rollout.gradient(&miss)[0] + 2.0).abs() < 1e-12);
//! # Ok::<(), rollwalk_physics::StepError>(())
//! ```
//!
//! # Where the motion has kinks
//!
//! Contacts open and close, friction begins to slide and motors come to their limits at single instants. Between them the
//! derivatives are exact. A rollout in which such an instant coincides with the end of a step has different derivatives
//! to its two sides; [`Rollout`] has that of the side on which the solution lies: every contact stays open or closed, sticking
//! or sliding, as the solver found it. So the coefficient of friction of a contact that never slides has a derivative of exactly
//! 0, which is right and which [`Health`] lists. What hybrid friction held is held in the derivatives, too: a particle's
//! velocity across the normal stays exactly 0 whatever the parameters do. That of a rigid body's contacts does to about 1e-3:
//! they hold it more often than it can move, and the solver finds their friction as far only as the motion depends on it.

pub mod adam;
mod adjoint;
mod direct;
pub mod gauss_newton;
mod health;
pub mod lbfgs;
pub mod objective;
pub mod parameter;
mod record;
mod rows;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;

pub use direct::Tangents;
pub use health::Health;
pub use objective::Residual;
pub use parameter::{Column, Constant, Parameter, Solved, Start};
pub use record::{Recorder, Rollout};

/// A variation of a body's motion; or what a number changes by each part of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Variation {
    /// δc of the centre of mass, m.
    pub shift: Vector3<f64>,
    /// δθ, rad: dR = \[δθ\]R.
    pub turn: Vector3<f64>,
    /// δv of the centre of mass, m/s.
    pub velocity: Vector3<f64>,
    /// δω, rad/s.
    pub spin: Vector3<f64>,
}

impl Variation {
    /// Returns the variation times a factor.
    pub fn scaled(&self, by: f64) -> Self {
        let [shift, turn, velocity, spin] = self.parts().map(|part| part * by);
        Self { shift, turn, velocity, spin }
    }

    /// Change of a number whose derivatives are `by`.
    pub fn dot(&self, by: &Self) -> f64 {
        self.parts().iter().zip(by.parts()).map(|(part, by)| part.dot(&by)).sum()
    }

    fn parts(&self) -> [Vector3<f64>; 4] {
        [self.shift, self.turn, self.velocity, self.spin]
    }
}
