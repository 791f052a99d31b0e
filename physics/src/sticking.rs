//! Hybrid friction: particles that stick are held, until that takes more than the friction cone gives (thesis 4.4.3).
//!
//! A step is solved roughly with friction proportional to sliding. Then what sticks is held across the normal, and its part
//! of the equations tells the friction that this takes. Where that is too much, the particle is let go for the rest of
//! the step. So a body at rest does not creep, and friction is always within its cone.

use crate::body::Body;
use crate::force::Force;
use crate::friction::Model;
use crate::residual::{Equations, Hold, Step};
use nalgebra::Vector3;

/// The particles whose contacts have hybrid friction, and which of them are held.
#[derive(Debug)]
pub(crate) struct Sticking {
    /// Forces that may hold, and their particles.
    able: Vec<(usize, usize)>,
    holds: Vec<Hold>,
    /// Force of each hold, and the friction that it takes, N.
    taken: Vec<(usize, Vector3<f64>)>,
    decided: bool,
}

impl Sticking {
    /// Of contacts of particles; those of bodies that turn keep to linear friction.
    pub fn new(bodies: &[Body], forces: &[Box<dyn Force>]) -> Self {
        let particle = |force: &dyn Force| match force.bodies() {
            &[body] if matches!(bodies[body], Body::Particle { .. }) => Some(body),
            _ => None,
        };
        let all = forces.iter().enumerate();
        let able = all.filter_map(|(number, force)| Some((number, particle(force.as_ref())?)));
        let able = able.collect();
        Self { able, holds: Vec::new(), taken: Vec::new(), decided: false }
    }

    /// At the beginning of a step nothing is held.
    pub fn begin(&mut self) {
        self.holds.clear();
        self.taken.clear();
        self.decided = false;
    }

    /// The held particles.
    pub fn holds(&self) -> &[Hold] {
        &self.holds
    }

    /// Friction that holds a contact's particle, N; none if it is not held.
    pub fn friction(&self, force: usize) -> Option<Vector3<f64>> {
        self.taken.iter().find(|(held, _)| *held == force).map(|(_, friction)| *friction)
    }

    /// Holds what sticks at a rough solution, later lets go what takes too much; whether anything changed.
    pub fn decide(&mut self, step: &Step<'_>, equations: &Equations) -> bool {
        let touch = |force: usize, body: usize| {
            step.forces[force].touch(&[equations.motions[body]]).filter(|touch| touch.gap_m < 0.0)
        };
        if !self.decided {
            self.decided = true;
            for &(force, body) in &self.able {
                let sticks = touch(force, body)
                    .filter(|touch| touch.friction.model == Model::Hybrid && !touch.slips);
                // Two contacts of one particle would hold it twice.
                let free = self.holds.iter().all(|hold| hold.body != body);
                if let (Some(touch), true) = (sticks, free) {
                    let scale_n_s_m = touch.friction.stick_n_s_m;
                    self.holds.push(Hold { body, normal: touch.normal, scale_n_s_m });
                    self.taken.push((force, Vector3::zeros()));
                }
            }
            return !self.holds.is_empty();
        }
        let mut kept = Vec::new();
        for ((hold, reaction), taken) in
            self.holds.iter().zip(&equations.reactions).zip(&mut self.taken)
        {
            let needed = reaction - hold.normal * hold.normal.dot(reaction);
            let limit = touch(taken.0, hold.body)
                .map_or(0.0, |touch| touch.friction.coefficient * touch.normal_n);
            taken.1 = needed;
            kept.push(needed.norm() <= limit);
        }
        let before = self.holds.len();
        let (mut of_holds, mut of_taken) = (kept.iter(), kept.iter());
        self.holds.retain(|_| *of_holds.next().expect("one for each"));
        self.taken.retain(|_| *of_taken.next().expect("one for each"));
        self.holds.len() < before
    }
}
