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
use std::ops::Range;

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
    groups: Vec<Group>,
    trials: Vec<TrialMotion>,
    /// Motions of the bodies of one group at the end of the step.
    gathered: Vec<BodyMotion>,
    wrenches: Vec<Wrench>,
    derivatives: Vec<Derivative>,
    /// Contribution of earlier steps to the rate of momentum, N and N·m.
    inertial: Vec<Wrench>,
    /// True for each force that is skipped because it has no effect.
    asleep: Vec<bool>,
}

/// Successive forces on the same bodies, such as those of a hinge. Their derivatives are mapped to the unknowns together.
#[derive(Debug)]
struct Group {
    forces: Range<usize>,
    /// Matrix block of each pair of bodies.
    slots: Vec<Slot>,
    /// Motions of the bodies at the beginning of the step and one step earlier; empty until they are used in the step.
    earlier: [Vec<BodyMotion>; 2],
}

impl Group {
    /// Groups the forces. Their slots are still empty.
    fn of(forces: &[Box<dyn Force>]) -> Vec<Self> {
        let mut end = 0;
        let runs = forces.chunk_by(|a, b| a.bodies() == b.bodies());
        runs.map(|run| {
            let start = end;
            end += run.len();
            Self { forces: start..end, slots: Vec::new(), earlier: Default::default() }
        })
        .collect()
    }
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
        let mut groups = Group::of(forces);
        for group in &mut groups {
            let first = forces[group.forces.start].as_ref();
            group.slots = pairs(first).map(|(i, j)| matrix.slot(i, j)).collect();
        }
        let mut firsts = vec![0];
        for count in &unknowns {
            firsts.push(firsts[firsts.len() - 1] + count);
        }
        Self {
            residual: vec![0.0; firsts[bodies.len()]],
            diagonal: (0..bodies.len()).map(|k| matrix.slot(k, k)).collect(),
            firsts,
            groups,
            matrix,
            motions: Vec::new(),
            reactions: Vec::new(),
            trials: Vec::new(),
            gathered: Vec::new(),
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
            *asleep = is_far(force.as_ref(), step.now, step_s, &mut self.gathered);
        }
        for group in &mut self.groups {
            group.earlier.iter_mut().for_each(Vec::clear);
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
            *asleep = is_far(force.as_ref(), &self.motions, 0.0, &mut self.gathered);
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
        let of_body = || trial.iter().zip(step.now).zip(step.moved);
        let weights = step.weights;
        self.motions.clear();
        if derive == Derive::Nothing {
            let after = |((trial, now), moved)| BodyMotion::after(weights, now, moved, trial);
            self.motions.extend(of_body().map(after));
        } else {
            let after = |((trial, now), moved)| TrialMotion::new(weights, now, moved, trial);
            self.trials.clear();
            self.trials.extend(of_body().map(after));
            self.motions.extend(self.trials.iter().map(|trial| trial.motion));
            self.matrix.clear();
        }
        for k in 0..step.bodies.len() {
            self.inertia(step, k, derive);
        }
        for group in 0..self.groups.len() {
            self.forces(step, group, held, derive);
        }
        self.hold(step, holds, derive);
        self.residual.iter().map(|r| r * r).sum::<f64>().sqrt()
    }

    /// Sets the residual of a body to inertia and weight, and adds their derivatives to the matrix.
    fn inertia(&mut self, step: &Step<'_>, k: usize, derive: Derive) {
        let (body, motion, gain) = (&step.bodies[k], &self.motions[k], step.weights.gain());
        let mass_kg = body.mass_kg();
        let Wrench { force, moment } = self.inertial[k];
        let force = (motion.velocity * gain - step.gravity_m_s2) * mass_kg + force;
        let rows = &mut self.residual[self.firsts[k]..self.firsts[k + 1]];
        rows[..3].copy_from_slice(force.as_slice());
        let turns = matches!(body, Body::Rigid(_));
        if turns {
            rows[3..].copy_from_slice((body.spin_momentum(motion) * gain + moment).as_slice());
        }
        if derive != Derive::Nothing {
            let block = body.momentum_by(motion).chained(&self.trials[k], gain, turns) * gain;
            self.matrix.add(&self.diagonal[k], &block);
        }
    }

    /// Subtracts the forces of a group from the residuals of their bodies, and their derivatives from the matrix.
    fn forces(
        &mut self,
        step: &Step<'_>,
        group: usize,
        helds: &[Option<StickingFriction>],
        derive: Derive,
    ) {
        let Group { forces, slots, earlier } = &mut self.groups[group];
        if forces.clone().all(|k| self.asleep[k]) {
            return;
        }
        let bodies = step.forces[forces.start].bodies();
        if earlier[0].is_empty() {
            for (motions, all) in earlier.iter_mut().zip([step.now, step.last]) {
                motions.extend(bodies.iter().map(|&body| all[body]));
            }
        }
        self.gathered.clear();
        self.gathered.extend(bodies.iter().map(|&body| self.motions[body]));
        let (now, [last, before]) = (&self.gathered, &*earlier);
        let tame = derive == Derive::Tame;
        self.wrenches.clear();
        self.wrenches.resize(bodies.len(), Wrench::default());
        self.derivatives.clear();
        if derive != Derive::Nothing {
            self.derivatives.resize(slots.len(), Derivative::default());
        }
        for k in forces.clone().filter(|&k| !self.asleep[k]) {
            let held = helds.get(k).copied().flatten();
            let view = View { now, last, before, weights: step.weights, tame, held };
            let force = step.forces[k].as_ref();
            match derive {
                Derive::Nothing => force.wrenches(&view, &mut self.wrenches),
                _ => force.derivatives(&view, &mut self.wrenches, &mut self.derivatives),
            }
        }
        for ((derivative, slot), pair) in self.derivatives.iter().zip(&*slots).zip(0..) {
            let by = bodies[pair % bodies.len()];
            let turns = matches!(step.bodies[by], Body::Rigid(_));
            let block = derivative.chained(&self.trials[by], step.weights.gain(), turns);
            self.matrix.add(slot, &-block);
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
