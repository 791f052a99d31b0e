//! Hybrid friction: sticking contacts are held until the required force exceeds the friction cone (thesis 4.4.3).
//!
//! A step is first solved roughly with friction proportional to sliding. Contacts that stick are then held in the tangent
//! plane, and the solution gives the required friction. A contact that requires more than its cone is released for the rest of
//! the step. A body at rest therefore does not creep, and friction stays within its cone. The rough solution is skipped if all
//! touching particles were held in the previous step.
//!
//! For a particle, the constraint replaces its tangential equations, as in the thesis. Several contacts of a rigid body would
//! be overdetermined. Their friction is therefore taken from the previous solution, plus a stiffness against the remaining
//! sliding (augmented Lagrangian). Rounds repeat until the friction is constant; then the contacts do not slide, or their
//! friction is on the cone. Contacts with an indeterminate distribution of load share it as with stiff friction.

use crate::body::Body;
use crate::force::{Force, StickingFriction};
use crate::friction::FrictionModel;
use crate::residual::{Equations, Step, StickConstraint};
use nalgebra::Vector3;

/// Stiffness against sliding of a rigid body's contact, relative to the stiffness that stops all bodies within a step. A round
/// leaves about 1/FIRM of the sliding.
const FIRM: f64 = 30.0;
/// Accuracy of the friction of rigid bodies, as a fraction of its limit.
const ACCURACY: f64 = 1e-6;
/// Maximum number of rounds in a step. A box that tumbles over its corners needs about 40.
const ROUNDS: usize = 60;

/// Contacts with hybrid friction, and those that are held.
#[derive(Debug)]
pub(crate) struct Sticking {
    /// Indices of contacts on particles, each with its particle.
    able: Vec<(usize, usize)>,
    /// Indices of contacts on rigid bodies, each with its body.
    rigid: Vec<(usize, usize)>,
    /// Friction estimates of held contacts on rigid bodies, indexed by force; empty if no contact is held.
    held: Vec<Option<StickingFriction>>,
    rounds: usize,
    holds: Vec<StickConstraint>,
    /// Index of each held particle's contact, and its required friction, N.
    taken: Vec<(usize, Vector3<f64>)>,
    decided: bool,
}

impl Sticking {
    /// Collects the forces that act on a single body.
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

    /// Begins a step without held contacts, unless all touching particles were held in the previous step. Such particles are
    /// held again at once, because they probably still stick. This saves a factorisation.
    pub fn begin(&mut self, step: &Step<'_>) {
        self.holds.clear();
        let mut held = self.taken.iter().map(|(force, _)| *force);
        let mut all = true;
        for &(force, body) in self.able.iter().filter(|(force, _)| is_hybrid(step, *force)) {
            let touch = step.forces[force].touch(&[step.now[body]]);
            if let Some(touch) = touch.filter(|touch| touch.gap_m < 0.0) {
                all &= held.next() == Some(force);
                self.holds.push(StickConstraint::new(body, &touch));
            }
        }
        if !all || held.next().is_some() {
            self.forget();
        }
        self.decided = false;
        self.held.clear();
        self.rounds = 0;
    }

    /// Releases all particles, so that the next step begins without held contacts.
    pub fn forget(&mut self) {
        self.holds.clear();
        self.taken.clear();
    }

    /// Friction estimates of held contacts on rigid bodies, indexed by force.
    pub fn held(&self) -> &[Option<StickingFriction>] {
        &self.held
    }

    /// Held particles.
    pub fn holds(&self) -> &[StickConstraint] {
        &self.holds
    }

    /// Friction of a held contact, N; `None` if the contact is not held.
    pub fn friction(&self, force: usize) -> Option<Vector3<f64>> {
        if let Some(held) = self.held.get(force).copied().flatten() {
            return Some(held.force);
        }
        self.taken.iter().find(|(held, _)| *held == force).map(|(_, friction)| *friction)
    }

    /// Holds the sticking contacts of a rough solution, and releases contacts outside their friction cone. Returns true if
    /// anything changed.
    pub fn decide(&mut self, step: &Step<'_>, equations: &Equations) -> bool {
        let first = !self.decided;
        let particles = self.decide_particles(step, equations);
        let rigid = self.decide_rigid(step, equations, first);
        particles || rigid
    }

    /// Holds the sticking contacts of a rough solution, and updates the friction estimates from later solutions.
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
            let held = StickingFriction { force: friction.force, stick_n_s_m };
            let moves = before.map_or(f64::INFINITY, |before| (held.force - before.force).norm());
            changed |= moves > ACCURACY * touch.friction.coefficient * touch.normal_n;
            self.held[force] = Some(held);
        }
        changed
    }

    /// Releases particles outside their friction cone. On the first call in a step, also holds the sticking particles.
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
                // Two contacts of one particle would hold the particle twice.
                let free = self.holds.iter().all(|hold| hold.body != body);
                if let (Some(touch), true, false) = (sticks, free, let_go.contains(&body)) {
                    self.holds.push(StickConstraint::new(body, &touch));
                    self.taken.push((force, Vector3::zeros()));
                    changed = true;
                }
            }
        }
        changed
    }
}

fn is_hybrid(step: &Step<'_>, force: usize) -> bool {
    step.forces[force].friction().is_some_and(|friction| friction.model == FrictionModel::Hybrid)
}
