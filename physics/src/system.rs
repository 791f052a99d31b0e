//! System of bodies and forces, and its implicit time step (thesis 4.3).

use crate::assembly::Assembly;
use crate::body::Body;
use crate::event::Contacts;
use crate::force::Force;
use crate::motion::{BodyMotion, Displacement, Scheme, Weights};
use crate::newton::{Failure, Newton};
use crate::residual::Step;
use crate::touch::Touch;
use nalgebra::Vector3;
use std::any::Any;

pub use crate::report::StepReport;

/// Parameters of the stepper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Integration scheme.
    pub scheme: Scheme,
    /// Gravity, m/s².
    pub gravity_m_s2: Vector3<f64>,
    /// Norm of the residual of a solved step, N and N·m.
    pub tolerance: f64,
    /// Maximum number of Newton iterations before a step is halved.
    pub iterations: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            scheme: Scheme::Bdf1,
            gravity_m_s2: Vector3::new(0.0, 0.0, -9.81),
            tolerance: 1e-8,
            iterations: 40,
        }
    }
}

/// Maximum number of successive halvings of a step.
const SUBDIVISIONS: u32 = 6;

/// Error of a step that does not converge, even after all halvings.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the step at {time_s:.6} s does not converge: the residual is {residual:.3e} after \
     {iterations} iterations with substeps of {part_s:.3e} s, and is largest for body {body}"
)]
pub struct StepError {
    /// Time at the beginning of the failed substep, s.
    pub time_s: f64,
    /// Length of the failed substep, s.
    pub part_s: f64,
    /// Norm of the residual, N and N·m.
    pub residual: f64,
    /// Number of Newton iterations.
    pub iterations: u32,
    /// Body with the largest residual.
    pub body: usize,
}

/// Energy of a system, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Kinetic energy, J.
    pub kinetic_j: f64,
    /// Potential energy of the weight above the origin, J.
    pub weight_j: f64,
    /// Elastic energy of springs, contacts and soft bodies, J.
    pub stored_j: f64,
}

impl Energy {
    /// Total energy.
    pub fn total_j(&self) -> f64 {
        self.kinetic_j + self.weight_j + self.stored_j
    }
}

/// Observer of the steps of a system.
pub(crate) trait Observer {
    /// Called at the beginning of a step, with the time of its end, s.
    fn begin_step(&mut self, end_s: f64);

    /// Called at the solution of a step or substep.
    fn part(&mut self, step: &Step<'_>, moved: &[Displacement], newton: &Newton);

    /// Called at the end of a step. `report` is `None` if the step failed.
    fn end_step(&mut self, motions: &[BodyMotion], report: Option<&StepReport>);
}

/// Bodies with forces between them and with the world.
#[derive(Debug)]
pub struct System {
    settings: Settings,
    bodies: Vec<Body>,
    forces: Vec<Box<dyn Force>>,
    state: State,
    contacts: Contacts,
    newton: Newton,
}

/// State that a step changes.
#[derive(Clone, Debug)]
struct State {
    time_s: f64,
    now: Vec<BodyMotion>,
    /// Motions at the beginning of the previous step.
    last: Vec<BodyMotion>,
    /// Displacements in the previous step, for BDF2.
    moved: Vec<Displacement>,
    /// Length of the previous step, s. BDF2 requires two steps of equal length.
    last_step_s: Option<f64>,
}

impl System {
    /// Creates a system at time 0.
    ///
    /// # Panics
    /// If a force refers to a missing body, or the numbers of bodies and motions differ.
    pub fn new(settings: Settings, assembly: Assembly) -> Self {
        let Assembly { bodies, motions, forces } = assembly;
        assert_eq!(bodies.len(), motions.len(), "a motion for each body");
        let newton = Newton::new(&bodies, &forces);
        let contacts = Contacts::new(&forces, &motions);
        let state = State {
            time_s: 0.0,
            last: motions.clone(),
            moved: vec![Displacement::default(); motions.len()],
            now: motions,
            last_step_s: None,
        };
        Self { settings, bodies, forces, state, contacts, newton }
    }

    /// Time, s.
    pub fn time_s(&self) -> f64 {
        self.state.time_s
    }

    /// Parameters of the stepper.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Parameters of the stepper, mutable.
    pub fn settings_mut(&mut self) -> &mut Settings {
        &mut self.settings
    }

    /// Motions of the bodies.
    pub fn motions(&self) -> &[BodyMotion] {
        &self.state.now
    }

    /// Bodies of the system.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Body, mutable for changes of its mass. A rigid body must stay a rigid body, and a particle must stay a particle.
    pub fn body_mut(&mut self, body: usize) -> &mut Body {
        &mut self.bodies[body]
    }

    /// Replaces the motions. The next step has no previous one, as at time 0.
    ///
    /// # Panics
    /// If the numbers of bodies and motions differ.
    pub fn restart(&mut self, motions: Vec<BodyMotion>) {
        assert_eq!(self.bodies.len(), motions.len(), "a motion for each body");
        self.state = State {
            time_s: self.state.time_s,
            last: motions.clone(),
            moved: vec![Displacement::default(); motions.len()],
            now: motions,
            last_step_s: None,
        };
        self.contacts = Contacts::new(&self.forces, &self.state.now);
        self.end_step();
    }

    pub(crate) fn forces(&self) -> &[Box<dyn Force>] {
        &self.forces
    }

    /// Force of type `F` at an index; `None` if the force is of another type.
    pub fn force<F: Force>(&self, index: usize) -> Option<&F> {
        let force: &dyn Any = self.forces.get(index)?.as_ref();
        force.downcast_ref()
    }

    /// Force of type `F` at an index, mutable for changes in the next step. The caller must not change its bodies.
    pub fn force_mut<F: Force>(&mut self, index: usize) -> Option<&mut F> {
        let force: &mut dyn Any = self.forces.get_mut(index)?.as_mut();
        force.downcast_mut()
    }

    /// State of the contact at a force index; `None` for other forces.
    pub fn touch(&self, force: usize) -> Option<Touch> {
        let touch = self.of_force(force, |force, now| force.touch(now))?;
        // The force of a hard hold is not a force of the contact itself.
        let held = self.newton.sticking().friction(force).unwrap_or_default();
        Some(Touch { force: touch.force + held, ..touch })
    }

    /// Energy of all bodies and forces.
    pub fn energy(&self) -> Energy {
        let mut energy = Energy::default();
        for (body, motion) in self.bodies.iter().zip(&self.state.now) {
            energy.kinetic_j += body.kinetic_j(motion);
            energy.weight_j -= body.mass_kg() * self.settings.gravity_m_s2.dot(&motion.position);
        }
        for force in 0..self.forces.len() {
            energy.stored_j += self.of_force(force, |force, now| force.energy(now));
        }
        energy
    }

    fn of_force<T>(&self, force: usize, what: impl Fn(&dyn Force, &[BodyMotion]) -> T) -> T {
        let force = self.forces[force].as_ref();
        let now: Vec<_> = force.bodies().iter().map(|&body| self.state.now[body]).collect();
        what(force, &now)
    }

    /// Momentum of all bodies, kg·m/s.
    pub fn momentum(&self) -> Vector3<f64> {
        let of_body = |(body, motion): (&Body, &BodyMotion)| motion.velocity * body.mass_kg();
        self.bodies.iter().zip(&self.state.now).map(of_body).sum()
    }

    /// Angular momentum of all bodies about the origin, kg·m²/s.
    pub fn angular_momentum(&self) -> Vector3<f64> {
        let of_body = |(body, motion): (&Body, &BodyMotion)| {
            motion.position.cross(&motion.velocity) * body.mass_kg() + body.spin_momentum(motion)
        };
        self.bodies.iter().zip(&self.state.now).map(of_body).sum()
    }

    /// Advances by `step_s`. A step that does not converge is halved.
    ///
    /// # Errors
    /// If a substep of 1/64 of the step does not converge. The system is then in its state before the step.
    pub fn step(&mut self, step_s: f64) -> Result<StepReport, StepError> {
        self.take(step_s, None)
    }

    /// Advances the state like [`step`](Self::step), with an observer.
    pub(crate) fn take(
        &mut self,
        step_s: f64,
        mut observer: Option<&mut dyn Observer>,
    ) -> Result<StepReport, StepError> {
        let kept = self.state.clone();
        let mut report = StepReport::default();
        if let Some(observer) = &mut observer {
            observer.begin_step(self.state.time_s + step_s);
        }
        let taken = self.advance(step_s, SUBDIVISIONS, &mut report, &mut observer);
        let taken = match taken {
            Ok(()) => {
                report.events = self.contacts.update(&self.forces, &self.state.now);
                Ok(report)
            }
            Err(error) => {
                self.state = kept;
                self.end_step();
                Err(error)
            }
        };
        if let Some(observer) = observer {
            observer.end_step(&self.state.now, taken.as_ref().ok());
        }
        taken
    }

    fn advance(
        &mut self,
        step_s: f64,
        parts: u32,
        report: &mut StepReport,
        observer: &mut Option<&mut dyn Observer>,
    ) -> Result<(), StepError> {
        match self.solve(step_s, report, observer) {
            Ok(()) => Ok(()),
            Err(_) if parts > 0 => {
                report.subdivisions += 1;
                self.advance(0.5 * step_s, parts - 1, report, observer)?;
                self.advance(0.5 * step_s, parts - 1, report, observer)
            }
            Err(Failure { residual, iterations, body }) => {
                let time_s = self.state.time_s;
                Err(StepError { time_s, part_s: step_s, residual, iterations, body })
            }
        }
    }

    /// Solves one step without halving. With BDF2, the first step and any step after a change of length use BDF1.
    fn solve(
        &mut self,
        step_s: f64,
        report: &mut StepReport,
        observer: &mut Option<&mut dyn Observer>,
    ) -> Result<(), Failure> {
        let Settings { scheme, gravity_m_s2, tolerance, iterations } = self.settings;
        let goes_on = self.state.last_step_s == Some(step_s);
        let weights = Weights::new(if goes_on { scheme } else { Scheme::Bdf1 }, step_s);
        // At the end of a step of BDF1, bodies have the mean velocity of the step.
        let acceleration_share = match (goes_on, scheme) {
            (false, _) => 0.0,
            (true, Scheme::Bdf1) => 1.0,
            (true, Scheme::Bdf2) => 0.5,
        };
        let step = Step {
            bodies: &self.bodies,
            forces: &self.forces,
            gravity_m_s2,
            weights: &weights,
            now: &self.state.now,
            last: &self.state.last,
            moved: &self.state.moved,
            acceleration_share,
        };
        let moved = self.newton.solve(&step, tolerance, iterations, report)?;
        if let Some(observer) = observer {
            observer.part(&step, &moved, &self.newton);
        }
        let ends = self.newton.equations().motions.clone();
        let state = &mut self.state;
        state.time_s += step_s;
        state.last = std::mem::replace(&mut state.now, ends);
        state.moved = moved;
        state.last_step_s = Some(step_s);
        self.end_step();
        Ok(())
    }

    /// Next step, for tests of its residual.
    #[cfg(test)]
    pub(crate) fn next_step<'a>(&'a self, weights: &'a Weights) -> Step<'a> {
        Step {
            bodies: &self.bodies,
            forces: &self.forces,
            gravity_m_s2: self.settings.gravity_m_s2,
            weights,
            now: &self.state.now,
            last: &self.state.last,
            moved: &self.state.moved,
            acceleration_share: 0.0,
        }
    }

    /// Replaces the history by a uniform motion at the present velocities, with steps of `step_s`.
    #[cfg(test)]
    pub(crate) fn glide(&mut self, step_s: f64) {
        let moved = |motion: &BodyMotion| Displacement {
            shift: motion.velocity * step_s,
            turn: motion.spin * step_s,
        };
        self.state.moved = self.state.now.iter().map(moved).collect();
        for (last, moved) in self.state.last.iter_mut().zip(&self.state.moved) {
            last.position -= moved.shift;
        }
        self.state.last_step_s = Some(step_s);
    }

    fn end_step(&mut self) {
        for force in &mut self.forces {
            force.end_step(&self.state.now);
        }
    }
}
