//! Parameters for derivatives: one kind in each file of this folder.
//!
//! | kind | parameter |
//! |---|---|
//! | [`Control`] | knot of a curve for a motor's target |
//! | [`Initial`] | initial pose and velocity of bodies |
//! | [`BodyMass`] | mass of a body, or an entry of its inertia |
//! | [`Softness`] | shear modulus, λ, viscosity or density of a soft body |
//! | [`ContactParameter`] | stiffness and damping of contacts, friction, rolling resistance |
//! | [`MotorParameter`] | gains and rotor inertia of motors |
//! | [`Targets`] | any quantity that changes motors' targets, such as a delay or an offset |
//! | [`Elastic`] | stiffness and damping of springs and joints |
//! | [`Handle`] | knot of a curve for the position of an anchor |
//! | [`Pose`] | knot of a curve for the pose of a hold, such as a gripper |
//! | [`Gravity`] | gravity along an axis, which models a tilt of the ground |
//!
//! A kind implements [`Parameter`], and [`Constant`] if the system stores its value. The implementation gives the derivatives
//! of a step's residual and of the initial motions. Both methods need nothing else.

mod contact;
mod control;
mod gravity;
mod handle;
mod initial;
mod mass;
mod material;
mod motor;
mod pose;
mod spring;
mod targets;
#[cfg(test)]
mod tests;

use crate::body::Body;
use crate::force::{Force, StickingFriction, View, Wrench};
use crate::motion::{BodyMotion, Displacement};
use crate::residual::Step;
use crate::sensitivity::Variation;
use crate::system::System;
use nalgebra::Vector3;
use std::any::Any;
use std::fmt::Debug;

pub use crate::contact::ContactQuantity;
pub use contact::ContactParameter;
pub use control::Control;
pub use gravity::Gravity;
pub use handle::Handle;
pub use initial::{Freedom, Initial};
pub use mass::{BodyMass, MassQuantity};
pub use material::{MaterialQuantity, Softness};
pub use motor::{MotorParameter, MotorQuantity};
pub use pose::{Coordinate, Pose};
pub use spring::{Elastic, SpringForce, SpringQuantity};
pub use targets::Targets;

/// Scalar on which a rollout depends.
pub trait Parameter: Debug + Send + Sync {
    /// Adds the derivative of the residual of a solved step.
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column);

    /// Adds the derivative of the initial motions.
    fn start(&self, _system: &System, _start: &mut Start) {}
}

/// Parameter whose value is stored in the system and constant during a rollout.
pub trait Constant: Parameter {
    /// Current value.
    fn value(&self, system: &System) -> f64;

    /// Sets the value before the first step.
    fn set(&self, system: &mut System, value: f64);
}

/// Solved step, from which a parameter computes its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct SolvedStep<'a> {
    pub(crate) step: &'a Step<'a>,
    pub(crate) motions: &'a [BodyMotion],
    pub(crate) held: &'a [Option<StickingFriction>],
    /// Time at the end of the whole step, s. The solved step may be a substep.
    pub time_s: f64,
}

impl SolvedStep<'_> {
    /// Returns a body.
    pub fn body(&self, body: usize) -> &Body {
        &self.step.bodies[body]
    }

    /// Returns a force of type `F`.
    ///
    /// # Panics
    /// If the force is of another type.
    pub fn force<F: Force>(&self, force: usize) -> &F {
        let force: &dyn Any = self.step.forces[force].as_ref();
        force.downcast_ref().expect("a parameter's force is of its kind")
    }

    /// Calls `what` with the motions of the bodies at which the solver evaluated the force.
    pub fn view<T>(&self, force: usize, what: impl FnOnce(&View<'_>) -> T) -> T {
        let bodies = self.step.forces[force].bodies();
        let of = |all: &[BodyMotion]| -> Vec<BodyMotion> {
            bodies.iter().map(|&body| all[body]).collect()
        };
        let (now, last, before) = (of(self.motions), of(self.step.now), of(self.step.last));
        let held = self.held.get(force).copied().flatten();
        let (weights, tame) = (self.step.weights, false);
        what(&View { now: &now, last: &last, before: &before, weights, tame, held })
    }

    /// Rate of a quantity of a body's motion, by the backward difference of the step.
    pub fn rate(&self, body: usize, of: impl Fn(&BodyMotion) -> Vector3<f64>) -> Vector3<f64> {
        let [now, last, before] = [self.motions, self.step.now, self.step.last];
        self.step.weights.rate(of(&now[body]), of(&last[body]), of(&before[body]))
    }

    /// Acceleration of a body minus gravity, m/s².
    pub fn resisted_m_s2(&self, body: usize) -> Vector3<f64> {
        self.rate(body, |motion| motion.velocity) - self.step.gravity_m_s2
    }
}

/// Derivative of the whole residual with respect to one parameter.
#[derive(Clone, Debug)]
pub struct Column {
    firsts: Vec<usize>,
    parts: Vec<f64>,
    /// Bodies with added entries.
    touched: Vec<usize>,
}

impl Column {
    pub(super) fn new(firsts: Vec<usize>) -> Self {
        let parts = vec![0.0; firsts[firsts.len() - 1]];
        Self { firsts, parts, touched: Vec::new() }
    }

    /// Returns the nonzero entries as row and value, and resets the column to 0.
    pub(super) fn take(&mut self) -> Vec<(usize, f64)> {
        let mut taken = Vec::new();
        self.touched.sort_unstable();
        self.touched.dedup();
        for body in self.touched.drain(..) {
            for row in self.firsts[body]..self.firsts[body + 1] {
                let value = std::mem::take(&mut self.parts[row]);
                if value != 0.0 {
                    taken.push((row, value));
                }
            }
        }
        taken
    }

    /// Adds to the residual of a body. Moments on particles are ignored.
    pub fn add(&mut self, body: usize, residual: &Wrench) {
        self.touched.push(body);
        let rows = &mut self.parts[self.firsts[body]..self.firsts[body + 1]];
        rows.iter_mut().zip(&residual.stacked()).for_each(|(row, part)| *row += part);
    }

    /// Adds the derivative of a force's wrenches on its bodies. The sign is reversed, because the residual subtracts forces.
    pub fn add_force(&mut self, bodies: &[usize], wrenches: &[Wrench]) {
        for (&body, wrench) in bodies.iter().zip(wrenches) {
            self.add(body, &Wrench { force: -wrench.force, moment: -wrench.moment });
        }
    }
}

/// Derivative of the initial motions with respect to one parameter.
#[derive(Clone, Debug)]
pub struct Start {
    pub(super) now: Vec<Variation>,
    /// Derivatives of the motions one step earlier, for a system that already moves.
    pub(super) last: Vec<Variation>,
    /// Derivatives of the displacements since then.
    pub(super) moved: Vec<Displacement>,
}

impl Start {
    pub(super) fn new(bodies: usize) -> Self {
        let none = vec![Variation::default(); bodies];
        Self { now: none.clone(), last: none, moved: vec![Displacement::default(); bodies] }
    }

    /// Adds the derivative of a body's motion.
    pub fn add(&mut self, body: usize, by: &Variation) {
        let of_body = &mut self.now[body];
        of_body.shift += by.shift;
        of_body.turn += by.turn;
        of_body.velocity += by.velocity;
        of_body.spin += by.spin;
    }
}
