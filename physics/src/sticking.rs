//! Hybrid friction: contacts that stick are held, until that takes more than the friction cone gives (thesis 4.4.3).
//!
//! A step is first solved roughly with friction proportional to sliding. Sticking contacts are then held across the normal, and
//! the solution gives the friction that this takes. Where it is too much, the contact is let go for the rest of the step. So a
//! body at rest does not creep, and friction is always within its cone. If all particles that touch were held in the step before,
//! the first of these solutions is skipped.
//!
//! A particle is held by an equation in place of its own, as in the thesis. Several contacts of a rigid body would hold it too
//! often: there the friction that a solution has is taken as given, and only what slides in spite of it meets a
//! stiffness, until friction changes no more (an augmented Lagrangian): then nothing slides, or friction is that of the cone.
//! Contacts that could share a load in many ways share it as stiff friction does.

use crate::body::Body;
use crate::force::{Force, Held};
use crate::friction::Model;
use crate::residual::{Equations, Hold, Step};
use nalgebra::Vector3;

/// Stiffness of what holds a rigid body, as a multiple of what stops all bodies within a step: a round leaves a share of
/// the sliding of about its inverse.
const FIRM: f64 = 30.0;
/// Share of its limit up to which friction of a rigid body is found.
const ACCURACY: f64 = 1e-6;
/// Most rounds of a step: a box that tumbles over its corners takes some forty.
const ROUNDS: usize = 60;

/// The contacts with hybrid friction, and which of them are held.
#[derive(Debug)]
pub(crate) struct Sticking {
    /// Forces that may hold particles, and their particles.
    able: Vec<(usize, usize)>,
    /// Forces that may hold rigid bodies, and their bodies.
    rigid: Vec<(usize, usize)>,
    /// Friction that holds the contacts of rigid bodies, by force; empty if none is held.
    held: Vec<Option<Held>>,
    rounds: usize,
    holds: Vec<Hold>,
    /// Force of each hold, and the friction that it takes, N.
    taken: Vec<(usize, Vector3<f64>)>,
    decided: bool,
}

impl Sticking {
    /// Collects forces that act on one body each.
    pub fn new(bodies: &[Body], forces: &[Box<dyn Force>]) -> Self {
        let all = forces.iter().enumerate();
        let of_one = all.filter_map(|(number, force)| match force.bodies() {
            &[body] => Some((number, body)),
            _ => None,
        });
        let (able, rigid) =
            of_one.partition(|&(_, body)| matches!(bodies[body], Body::Particle { .. }));
        Self {
            able,
            rigid,
            held: Vec::new(),
            rounds: 0,
            holds: Vec::new(),
            taken: Vec::new(),
            decided: false,
        }
    }

    /// Begins a step without holds, unless all particles that touch were held in the step before. Those most likely stay in
    /// place, and finding them again takes a factorisation.
    pub fn begin(&mut self, step: &Step<'_>) {
        self.holds.clear();
        let mut held = self.taken.iter().map(|(force, _)| *force);
        let mut all = true;
        for &(force, body) in self.able.iter().filter(|(force, _)| is_hybrid(step, *force)) {
            let touch = step.forces[force].touch(&[step.now[body]]);
            if let Some(touch) = touch.filter(|touch| touch.gap_m < 0.0) {
                all &= held.next() == Some(force);
                self.holds.push(Hold::new(body, &touch));
            }
        }
        if !all || held.next().is_some() {
            self.forget();
        }
        self.decided = false;
        self.held.clear();
        self.rounds = 0;
    }

    /// Begins the next step without anything held.
    pub fn forget(&mut self) {
        self.holds.clear();
        self.taken.clear();
    }

    /// Friction that holds the contacts of rigid bodies, by force.
    pub fn held(&self) -> &[Option<Held>] {
        &self.held
    }

    /// The held particles.
    pub fn holds(&self) -> &[Hold] {
        &self.holds
    }

    /// Friction that holds a contact, N; none if it is not held.
    pub fn friction(&self, force: usize) -> Option<Vector3<f64>> {
        if let Some(held) = self.held.get(force).copied().flatten() {
            return Some(held.force);
        }
        self.taken.iter().find(|(held, _)| *held == force).map(|(_, friction)| *friction)
    }

    /// Holds what sticks at a rough solution, later lets go what takes too much; whether anything changed.
    pub fn decide(&mut self, step: &Step<'_>, equations: &Equations) -> bool {
        let first = !self.decided;
        let particles = self.decide_particles(step, equations);
        let rigid = self.decide_rigid(step, equations, first);
        particles || rigid
    }

    /// Holds what sticks at a rough solution, and takes as given what friction later solutions have.
    fn decide_rigid(&mut self, step: &Step<'_>, equations: &Equations, first: bool) -> bool {
        let mass_kg: f64 = step.bodies.iter().map(Body::mass_kg).sum();
        let stick_n_s_m = FIRM * mass_kg * step.weights.gain();
        self.rounds += 1;
        if self.rounds > ROUNDS {
            return false;
        }
        let mut changed = false;
        for &(force, body) in self.rigid.iter().filter(|(force, _)| is_hybrid(step, *force)) {
            let before = self.held.get(force).copied().flatten();
            if before.is_none() && !first {
                continue;
            }
            let touch = step.forces[force].touch(&[equations.motions[body]]);
            let Some(touch) = touch.filter(|touch| touch.gap_m < 0.0) else { continue };
            let friction =
                touch.friction.held_force(before.as_ref(), &touch.sliding, touch.normal_n);
            if before.is_none() && friction.slips {
                continue;
            }
            self.held.resize(step.forces.len(), None);
            let held = Held { force: friction.force, stick_n_s_m };
            let moves = before.map_or(f64::INFINITY, |before| (held.force - before.force).norm());
            changed |= moves > ACCURACY * touch.friction.coefficient * touch.normal_n;
            self.held[force] = Some(held);
        }
        changed
    }

    /// Lets go what takes too much; the first time in a step holds what sticks, too.
    fn decide_particles(&mut self, step: &Step<'_>, equations: &Equations) -> bool {
        let touch = |force: usize, body: usize| {
            step.forces[force].touch(&[equations.motions[body]]).filter(|touch| touch.gap_m < 0.0)
        };
        let (mut kept, mut let_go) = (Vec::new(), Vec::new());
        for ((hold, reaction), taken) in
            self.holds.iter().zip(&equations.reactions).zip(&mut self.taken)
        {
            let needed = reaction - hold.normal * hold.normal.dot(reaction);
            let limit = touch(taken.0, hold.body)
                .map_or(0.0, |touch| touch.friction.coefficient * touch.normal_n);
            taken.1 = needed;
            kept.push(needed.norm() <= limit);
            if needed.norm() > limit {
                let_go.push(hold.body);
            }
        }
        let (mut of_holds, mut of_taken) = (kept.iter(), kept.iter());
        self.holds.retain(|_| *of_holds.next().expect("one for each"));
        self.taken.retain(|_| *of_taken.next().expect("one for each"));
        let mut changed = !let_go.is_empty();
        if !self.decided {
            self.decided = true;
            for &(force, body) in self.able.iter().filter(|(force, _)| is_hybrid(step, *force)) {
                let sticks = touch(force, body).filter(|touch| !touch.slips);
                // Two contacts of one particle would hold it twice.
                let free = self.holds.iter().all(|hold| hold.body != body);
                if let (Some(touch), true, false) = (sticks, free, let_go.contains(&body)) {
                    self.holds.push(Hold::new(body, &touch));
                    self.taken.push((force, Vector3::zeros()));
                    changed = true;
                }
            }
        }
        changed
    }
}

fn is_hybrid(step: &Step<'_>, force: usize) -> bool {
    step.forces[force].friction().is_some_and(|friction| friction.model == Model::Hybrid)
}
