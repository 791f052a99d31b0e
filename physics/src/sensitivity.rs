//! Sensitivities of whole rollouts, from the derivatives of the Newton steps (thesis 4.3.2).
//!
//! A [`Recorder`] stores the derivatives of the residual of each step that a system takes through it. Its [`Rollout`] gives
//! derivatives of the motion of all bodies with respect to [`Parameter`]s. The direct method propagates derivatives with
//! respect to all parameters forward ([`Rollout::direct`]). The adjoint method propagates the derivatives of one scalar
//! backward ([`Rollout::adjoint`]).
//!
//! [`objective`] has objectives of rollouts. [`gauss_newton`] and [`lbfgs`] optimise parameters; [`adam`] trains the weights of
//! a controller on many rollouts.
//!
//! # Equations
//!
//! In step i, the displacements d and rotation increments φ of the bodies form the unknowns x_i. They are a root of the
//! residual r(z_i, z_{i−1}, z_{i−2}; p), where z are motions: position, rotation, velocity and spin. Rotations vary by a turn
//! δθ on the left, dR = \[δθ\]R, so that nothing depends on the zero of the angles. With g = w_0/h and s = w_2/h from the
//! weights of the backward difference, the variations of the motions follow from those of x:
//!
//! δc_i = δc_{i−1} + δd_i, δθ_i = J_l(φ_i) δφ_i + Exp(φ_i) δθ_{i−1},
//! δv_i = g δd_i − s δd_{i−1}, δω_i = (∂ω/∂φ) δφ_i − s J_l(φ_i) δφ_{i−1}.
//!
//! These are exact, because increments start at 0 in every step and only these formulas carry them on. The variation of the
//! residual is B δx_i + P δz_{i−1} + Q δz_{i−2} + N δx_{i−1} + (∂r/∂p) δp = 0, where B is the Newton matrix. A record has B, P,
//! Q, N and the columns of ∂r/∂p; with backward Euler, Q and N are 0.
//!
//! * direct: B δx_i = −(P δz_{i−1} + Q δz_{i−2} + N δx_{i−1} + ∂r/∂p), with all parameters as right-hand sides;
//! * adjoint: Bᵀ μ_i = derivative of all later terms with respect to x_i, dO/dp = −Σ (∂r/∂p)ᵀ μ_i + contribution of the initial
//!   state.
//!
//! A halved step is recorded as several steps. The first step of BDF2 is recorded as backward Euler.
//!
//! # Example
//!
//! Distance of a thrown mass after one second, and its derivative with respect to the initial speed, forward and backward:
//!
//! ```
//! use nalgebra::Vector3;
//! use rollwalk_physics::sensitivity::parameter::{Freedom, Initial};
//! use rollwalk_physics::sensitivity::{Recorder, Residual};
//! use rollwalk_physics::{Assembly, Body, BodyMotion, Settings, System};
//!
//! let mut assembly = Assembly::default();
//! let ball = assembly.add_body(Body::Particle { mass_kg: 0.1 }, BodyMotion::at(Vector3::z()));
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
//! # Kinks
//!
//! Contacts open and close, friction begins to slide, and motors reach their limits at isolated times. Between these times the
//! derivatives are exact. If such a time coincides with the end of a step, the rollout has two one-sided derivatives.
//! [`Rollout`] returns the one of the branch that the solver found: each contact stays open or closed, and sticking or sliding.
//! The friction coefficient of a contact that never slides therefore has a derivative of exactly 0. This is correct, and
//! [`Health`] lists it.
//!
//! Derivatives keep the contacts held that hybrid friction held. The tangential velocity of a held particle stays exactly 0 for
//! all parameters. For contacts of a rigid body it stays 0 to about 1e-3. These contacts have more constraints than the body has
//! degrees of freedom, and the solver determines their friction only as far as the motion depends on it.

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
pub use parameter::{Column, Constant, Parameter, SolvedStep, Start};
pub use record::{Recorder, Rollout};

/// Variation of a body's motion, or the derivative of a scalar with respect to the motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Variation {
    /// Shift δc of the centre of mass, m.
    pub shift: Vector3<f64>,
    /// Turn δθ, rad: dR = \[δθ\]R.
    pub turn: Vector3<f64>,
    /// Variation δv of the velocity of the centre of mass, m/s.
    pub velocity: Vector3<f64>,
    /// Variation δω of the spin, rad/s.
    pub spin: Vector3<f64>,
}

impl Variation {
    /// Multiplies the variation by a factor.
    pub fn scaled(&self, by: f64) -> Self {
        let [shift, turn, velocity, spin] = self.parts().map(|part| part * by);
        Self { shift, turn, velocity, spin }
    }

    /// Change of a scalar with the derivatives `by`.
    pub fn dot(&self, by: &Self) -> f64 {
        self.parts().iter().zip(by.parts()).map(|(part, by)| part.dot(&by)).sum()
    }

    fn parts(&self) -> [Vector3<f64>; 4] {
        [self.shift, self.turn, self.velocity, self.spin]
    }
}
