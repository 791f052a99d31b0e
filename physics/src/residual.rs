//! Equations of one step: residual, and matrix of derivatives with respect to the displacements of the bodies.
//!
//! The residual of a body is m (v̇ − g) − f, N, and L̇ − τ, N·m, with the angular momentum L about the centre of mass. A free
//! body therefore conserves angular momentum to rounding. The unknowns are the shift and the rotation increment of each body in
//! the step. Increments start at 0 in every step. The thesis uses rotation vectors from a fixed origin, which require
//! additional terms and a change of coordinates after each turn.

use crate::body::Body;
use crate::force::{Derivative, Force, StickingFriction, View, Wrench};
use crate::matrix::{BlockMatrix, Slot};
use crate::motion::{BodyMotion, Displacement, TrialMotion, Weights};
use crate::touch::Touch;
use nalgebra::{Matrix3, Matrix6, Vector3};

/// Known quantities of a step before it is solved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<'a> {
    pub bodies: &'a [Body],
    pub forces: &'a [Box<dyn Force>],
    pub gravity_m_s2: Vector3<f64>,
    pub weights: &'a Weights,
    /// Motions at the beginning of the step.
    pub now: &'a [BodyMotion],
    /// Motions one step before `now`.
    pub last: &'a [BodyMotion],
    /// Displacements of the bodies from `last` to `now`.
    pub moved: &'a [Displacement],
    /// Fraction of the previous acceleration in the initial guess of the step; 0 if this acceleration is unknown.
    pub acceleration_share: f64,
}

/// Derivatives to evaluate with a residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Derive {
    Nothing,
    Exact,
    /// Derivatives with [`View::tame`].
    Tame,
}

/// Particle that must not move in the tangent plane: strict sticking of hybrid friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StickConstraint {
    pub body: usize,
    pub normal: Vector3<f64>,
    /// Weight of the particle's velocity relative to the other equations, N·s/m.
    pub scale_n_s_m: f64,
}

impl StickConstraint {
    /// Holds a particle at a contact.
    pub fn new(body: usize, touch: &Touch) -> Self {
        Self { body, normal: touch.normal, scale_n_s_m: touch.friction.stick_n_s_m }
    }
}

/// Residual and matrix of a step, with working memory.
#[derive(Debug)]
pub(crate) struct Equations {
    pub matrix: BlockMatrix,
    pub residual: Vec<f64>,
    /// Index of the first unknown of each body, followed by the total number of unknowns.
    pub firsts: Vec<usize>,
    /// Motions at the end of the most recent trial.
    pub motions: Vec<BodyMotion>,
    /// Residual of each held particle without the constraint, N. Friction has to balance its tangential component.
    pub reactions: Vec<Vector3<f64>>,
    diagonal: Vec<Slot>,
    slots: Vec<Vec<Slot>>,
    trials: Vec<TrialMotion>,
    /// Motions of the bodies of one force: at the end of the step, at its beginning, and one step earlier.
    gathered: [Vec<BodyMotion>; 3],
    wrenches: Vec<Wrench>,
    derivatives: Vec<Derivative>,
    /// Contribution of earlier steps to the rate of momentum, N and N·m.
    inertial: Vec<Wrench>,
    /// True for each force that is skipped because it has no effect.
    asleep: Vec<bool>,
}

impl Equations {
    /// Creates the equations of bodies and the forces on them.
    ///
    /// # Panics
    /// If a force refers to a missing body.
    pub fn new(bodies: &[Body], forces: &[Box<dyn Force>]) -> Self {
        let pairs = |force: &dyn Force| {
            let on = force.bodies().to_vec();
            assert!(on.iter().all(|&body| body < bodies.len()), "{force:?} acts on no body");
            let rows = on.clone().into_iter();
            rows.flat_map(move |i| on.clone().into_iter().map(move |j| (i, j)))
        };
        let unknowns: Vec<_> = bodies.iter().map(Body::unknowns).collect();
        let coupled = forces.iter().flat_map(|force| pairs(force.as_ref()));
        let matrix = BlockMatrix::new(&unknowns, coupled);
        let slots = forces
            .iter()
            .map(|force| pairs(force.as_ref()).map(|(i, j)| matrix.slot(i, j)).collect())
            .collect();
        let mut firsts = vec![0];
        for count in &unknowns {
            firsts.push(firsts[firsts.len() - 1] + count);
        }
        Self {
            residual: vec![0.0; firsts[bodies.len()]],
            diagonal: (0..bodies.len()).map(|k| matrix.slot(k, k)).collect(),
            firsts,
            slots,
            matrix,
            motions: Vec::new(),
            reactions: Vec::new(),
            trials: Vec::new(),
            gathered: Default::default(),
            wrenches: Vec::new(),
            derivatives: Vec::new(),
            inertial: Vec::new(),
            asleep: vec![false; forces.len()],
        }
    }

    /// Computes the terms that are equal for all trials of a step, and the forces to skip.
    pub fn begin(&mut self, step: &Step<'_>) {
        self.inertial.clear();
        for ((body, now), last) in step.bodies.iter().zip(step.now).zip(step.last) {
            let none = Vector3::zeros();
            let (now_spin, last_spin) = (body.spin_momentum(now), body.spin_momentum(last));
            self.inertial.push(Wrench {
                force: step.weights.rate(none, now.velocity, last.velocity) * body.mass_kg(),
                moment: step.weights.rate(none, now_spin, last_spin),
            });
        }
        let step_s = step.weights.step_s;
        for (asleep, force) in self.asleep.iter_mut().zip(step.forces) {
            *asleep = is_far(force.as_ref(), step.now, step_s, &mut self.gathered[0]);
        }
    }

    /// Returns true if a force is skipped.
    pub fn is_asleep(&self, force: usize) -> bool {
        self.asleep[force]
    }

    /// Includes skipped forces again whose bodies are close together at the most recent trial. Returns true if there are any.
    pub fn wake(&mut self, step: &Step<'_>) -> bool {
        let mut any = false;
        for (asleep, force) in
            self.asleep.iter_mut().zip(step.forces).filter(|(asleep, _)| **asleep)
        {
            *asleep = is_far(force.as_ref(), &self.motions, 0.0, &mut self.gathered[0]);
            any |= !*asleep;
        }
        any
    }

    /// Evaluates the residual at a trial and returns its norm. Evaluates the matrix as well if `derive` requests derivatives.
    /// `holds` are the held particles; `held` has the held contacts of rigid bodies, indexed by force.
    pub fn evaluate(
        &mut self,
        step: &Step<'_>,
        trial: &[Displacement],
        holds: &[StickConstraint],
        held: &[Option<StickingFriction>],
        derive: Derive,
    ) -> f64 {
        let of_body = trial.iter().zip(step.now).zip(step.moved);
        self.trials.clear();
        self.trials.extend(
            of_body.map(|((trial, now), moved)| TrialMotion::new(step.weights, now, moved, trial)),
        );
        self.motions.clear();
        self.motions.extend(self.trials.iter().map(|trial| trial.motion));
        if derive != Derive::Nothing {
            self.matrix.clear();
        }
        for k in 0..step.bodies.len() {
            self.inertia(step, k, derive);
        }
        for k in 0..step.forces.len() {
            self.force(step, k, held, derive);
        }
        self.hold(step, holds, derive);
        self.residual.iter().map(|r| r * r).sum::<f64>().sqrt()
    }

    /// Sets the residual of a body to inertia and weight, and adds their derivatives to the matrix.
    fn inertia(&mut self, step: &Step<'_>, k: usize, derive: Derive) {
        let (body, trial, gain) = (&step.bodies[k], &self.trials[k], step.weights.gain());
        let (mass_kg, motion) = (body.mass_kg(), &trial.motion);
        let Wrench { force, moment } = self.inertial[k];
        let force = (motion.velocity * gain - step.gravity_m_s2) * mass_kg + force;
        let rows = &mut self.residual[self.firsts[k]..self.firsts[k + 1]];
        rows[..3].copy_from_slice(force.as_slice());
        let turns = matches!(body, Body::Rigid(_));
        if turns {
            rows[3..].copy_from_slice((body.spin_momentum(motion) * gain + moment).as_slice());
        }
        if derive != Derive::Nothing {
            let block = body.momentum_by(motion).chained(trial, gain, turns) * gain;
            self.matrix.add(&self.diagonal[k], &block);
        }
    }

    /// Subtracts a force from the residuals of its bodies, and its derivatives from the matrix.
    fn force(
        &mut self,
        step: &Step<'_>,
        k: usize,
        helds: &[Option<StickingFriction>],
        derive: Derive,
    ) {
        if self.asleep[k] {
            return;
        }
        let force = step.forces[k].as_ref();
        let bodies = force.bodies();
        for (gathered, all) in
            self.gathered.iter_mut().zip([&self.motions[..], step.now, step.last])
        {
            gathered.clear();
            gathered.extend(bodies.iter().map(|&body| all[body]));
        }
        let [now, last, before] = &self.gathered;
        let tame = derive == Derive::Tame;
        let held = helds.get(k).copied().flatten();
        let view = View { now, last, before, weights: step.weights, tame, held };
        self.wrenches.clear();
        self.wrenches.resize(bodies.len(), Wrench::default());
        if derive == Derive::Nothing {
            force.wrenches(&view, &mut self.wrenches);
        } else {
            self.derivatives.clear();
            self.derivatives.resize(bodies.len() * bodies.len(), Derivative::default());
            force.derivatives(&view, &mut self.wrenches, &mut self.derivatives);
            for ((derivative, slot), pair) in self.derivatives.iter().zip(&self.slots[k]).zip(0..) {
                let by = bodies[pair % bodies.len()];
                let turns = matches!(step.bodies[by], Body::Rigid(_));
                let block = derivative.chained(&self.trials[by], step.weights.gain(), turns);
                self.matrix.add(slot, &-block);
            }
        }
        for (&body, wrench) in bodies.iter().zip(&self.wrenches) {
            let rows = &mut self.residual[self.firsts[body]..self.firsts[body + 1]];
            for (row, part) in rows.iter_mut().zip(&wrench.stacked()) {
                *row -= part;
            }
        }
    }

    /// Replaces the tangential equations of held particles by zero tangential velocity.
    fn hold(&mut self, step: &Step<'_>, holds: &[StickConstraint], derive: Derive) {
        self.reactions.clear();
        for hold in holds {
            let along = hold.normal * hold.normal.transpose();
            let across = (Matrix3::identity() - along) * hold.scale_n_s_m;
            let rows = &mut self.residual[self.firsts[hold.body]..][..3];
            let residual = Vector3::from_column_slice(rows);
            self.reactions.push(residual);
            let held = along * residual + across * self.motions[hold.body].velocity;
            rows.copy_from_slice(held.as_slice());
            if derive != Derive::Nothing {
                self.matrix.mix_rows(hold.body, &along);
                let mut block = Matrix6::zeros();
                block.fixed_view_mut::<3, 3>(0, 0).copy_from(&(across * step.weights.gain()));
                self.matrix.add(&self.diagonal[hold.body], &block);
            }
        }
    }
}

/// Evaluates [`Force::is_far`] for the motions of all bodies.
fn is_far(
    force: &dyn Force,
    motions: &[BodyMotion],
    step_s: f64,
    now: &mut Vec<BodyMotion>,
) -> bool {
    now.clear();
    now.extend(force.bodies().iter().map(|&body| motions[body]));
    force.is_far(now, step_s)
}
