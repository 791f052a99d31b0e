//! Bodies and forces, and one implicit step of all of them: Newton's method on the force residual (thesis 4.2, 4.3).
//!
//! The residual of a body is m (v̇ − g) − f, N, and L̇ − τ, N·m, with the angular momentum L about the centre of mass:
//! angular momentum of a free body is conserved to rounding. Unknown is what each body moves in the step, as a shift and a
//! rotation increment that begins anew at every step; the thesis's rotation vectors from a fixed origin need terms of
//! their own and a change of coordinates at every turn.

use crate::force::{Derivative, Force, View, Wrench};
use crate::matrix::{BlockMatrix, UNKNOWNS};
use crate::motion::{Displacement, Motion, Scheme, Trial, Weights};
use nalgebra::{Matrix3, Matrix6, Vector3};
use rollwalk_multibody::rotation::skew;
use std::any::Any;

/// Mass and inertia of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Inertia about the centre of mass in body axes, kg·m².
    pub about_com_kg_m2: Matrix3<f64>,
}

impl Inertia {
    /// Angular momentum about the centre of mass, kg·m²/s, and the inertia, both in world axes.
    fn momentum(&self, motion: &Motion) -> (Vector3<f64>, Matrix3<f64>) {
        let inertia = motion.rotation * self.about_com_kg_m2 * motion.rotation.transpose();
        (inertia * motion.spin, inertia)
    }
}

/// Parameters of the stepper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Integrator.
    pub scheme: Scheme,
    /// Gravity, m/s².
    pub gravity_m_s2: Vector3<f64>,
    /// Norm of the residual at which a step is solved, N and N·m.
    pub tolerance: f64,
    /// Newton iterations after which a step is halved.
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

/// Times that the line search halves a Newton step.
const HALVINGS: u32 = 7;
/// Largest rotation increment of a body in one Newton iteration, rad: beyond it the series and the linearisation are
/// wrong.
const MOST_TURN_RAD: f64 = 0.3;
/// Times that a step that does not converge is halved.
const SUBDIVISIONS: u32 = 6;
/// Share of a Newton step below which the line search has met a kink.
const SHORT: f64 = 0.3;
/// Power of the residual along a correction, as a share of that at its beginning, at which a line search is content.
const FLAT: f64 = 0.5;

/// What a step took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Newton iterations, those of halved steps included.
    pub iterations: u32,
    /// Halvings of the line search.
    pub halvings: u32,
    /// Steps that did not converge and were taken in two halves.
    pub subdivisions: u32,
    /// Norm of the last residual.
    pub residual: f64,
}

/// A step has no solution that Newton's method finds, even in parts.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the step at {time_s:.6} s does not converge: residual {residual:.3e} after {iterations} \
     iterations, in parts of {part_s:.3e} s; the largest is that of body {body}"
)]
pub struct StepError {
    /// Time at the beginning of the step, s.
    pub time_s: f64,
    /// Length of the part that failed, s.
    pub part_s: f64,
    /// Norm of the residual, N and N·m.
    pub residual: f64,
    /// Newton iterations.
    pub iterations: u32,
    /// Body with the largest residual.
    pub body: usize,
}

/// Where a force's derivatives go in the matrix.
type Slots = Vec<[usize; UNKNOWNS]>;

/// Bodies with forces between them, and with the world.
#[derive(Debug)]
pub struct System {
    settings: Settings,
    inertias: Vec<Inertia>,
    forces: Vec<Box<dyn Force>>,
    time_s: f64,
    now: Vec<Motion>,
    /// At the end of the step before.
    last: Vec<Motion>,
    /// What the last step moved, for BDF2 and as the next one's first guess.
    moved: Vec<Displacement>,
    /// Length of the last step, s; BDF2 needs two of one length.
    last_step_s: Option<f64>,
    work: Work,
}

/// Memory of a step, kept from step to step.
#[derive(Debug)]
struct Work {
    matrix: BlockMatrix,
    diagonal: Slots,
    slots: Vec<Slots>,
    trials: Vec<Trial>,
    /// Motions of one force's bodies, now, last and before, one after the other.
    gathered: [Vec<Motion>; 3],
    wrenches: Vec<Wrench>,
    derivatives: Vec<Derivative>,
    /// Motion at the end of the trial.
    motions: Vec<Motion>,
    /// The part of the momentum's rate that comes from earlier steps, N and N·m.
    inertial: Vec<Wrench>,
    residual: Vec<f64>,
    correction: Vec<f64>,
}

impl System {
    /// Bodies with their motions at time 0, and what acts on them.
    ///
    /// # Panics
    /// A force names a body that is not there, or there is not one motion for each inertia.
    pub fn new(
        settings: Settings,
        inertias: Vec<Inertia>,
        motions: Vec<Motion>,
        forces: Vec<Box<dyn Force>>,
    ) -> Self {
        assert_eq!(inertias.len(), motions.len(), "a motion for each body");
        let count = inertias.len();
        let pairs = |force: &dyn Force| {
            let bodies = force.bodies().to_vec();
            assert!(bodies.iter().all(|&body| body < count), "{force:?} acts on no body");
            let rows = bodies.clone().into_iter();
            rows.flat_map(move |i| bodies.clone().into_iter().map(move |j| (i, j)))
        };
        let matrix = BlockMatrix::new(count, forces.iter().flat_map(|force| pairs(force.as_ref())));
        let slots = forces
            .iter()
            .map(|force| pairs(force.as_ref()).map(|(i, j)| matrix.slot(i, j)).collect())
            .collect();
        let work = Work {
            diagonal: (0..count).map(|k| matrix.slot(k, k)).collect(),
            slots,
            matrix,
            trials: Vec::with_capacity(count),
            gathered: Default::default(),
            wrenches: Vec::new(),
            derivatives: Vec::new(),
            motions: Vec::with_capacity(count),
            inertial: Vec::with_capacity(count),
            residual: vec![0.0; UNKNOWNS * count],
            correction: vec![0.0; UNKNOWNS * count],
        };
        Self {
            settings,
            inertias,
            forces,
            time_s: 0.0,
            last: motions.clone(),
            now: motions,
            moved: vec![Displacement::default(); count],
            last_step_s: None,
            work,
        }
    }

    /// Time, s.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Motions of the bodies.
    pub fn motions(&self) -> &[Motion] {
        &self.now
    }

    /// Masses and inertias of the bodies.
    pub fn inertias(&self) -> &[Inertia] {
        &self.inertias
    }

    /// A force, if it is of this kind.
    pub fn force<F: Force>(&self, index: usize) -> Option<&F> {
        let force: &dyn Any = self.forces.get(index)?.as_ref();
        force.downcast_ref()
    }

    /// A force, to change what it does in the next step. It must keep its bodies.
    pub fn force_mut<F: Force>(&mut self, index: usize) -> Option<&mut F> {
        let force: &mut dyn Any = self.forces.get_mut(index)?.as_mut();
        force.downcast_mut()
    }

    /// Kinetic energy, energy of the springs and that of the weight above z = 0, J.
    pub fn energy_j(&self) -> f64 {
        let of_body = |(inertia, motion): (&Inertia, &Motion)| {
            let (momentum, _) = inertia.momentum(motion);
            0.5 * inertia.mass_kg * motion.velocity.norm_squared()
                + 0.5 * momentum.dot(&motion.spin)
                - inertia.mass_kg * self.settings.gravity_m_s2.dot(&motion.position)
        };
        let bodies: f64 = self.inertias.iter().zip(&self.now).map(of_body).sum();
        let of_force = |force: &Box<dyn Force>| {
            let motions: Vec<_> = force.bodies().iter().map(|&body| self.now[body]).collect();
            force.energy(&motions)
        };
        bodies + self.forces.iter().map(of_force).sum::<f64>()
    }

    /// Angular momentum of all bodies about the origin, kg·m²/s.
    pub fn angular_momentum(&self) -> Vector3<f64> {
        let of_body = |(inertia, motion): (&Inertia, &Motion)| {
            motion.position.cross(&motion.velocity) * inertia.mass_kg + inertia.momentum(motion).0
        };
        self.inertias.iter().zip(&self.now).map(of_body).sum()
    }

    /// Advances by `step_s`. Without convergence it takes the step in halves.
    ///
    /// # Errors
    /// A part of 1/64 of the step does not converge either. The system is then where it was before the step.
    pub fn step(&mut self, step_s: f64) -> Result<StepReport, StepError> {
        let kept = (
            self.time_s,
            self.now.clone(),
            self.last.clone(),
            self.moved.clone(),
            self.last_step_s,
        );
        let mut report = StepReport::default();
        let result = self.advance(step_s, SUBDIVISIONS, &mut report);
        if let Err(error) = result {
            (self.time_s, self.now, self.last, self.moved, self.last_step_s) = kept;
            return Err(error);
        }
        Ok(report)
    }

    fn advance(
        &mut self,
        step_s: f64,
        parts: u32,
        report: &mut StepReport,
    ) -> Result<(), StepError> {
        match self.newton(step_s, report) {
            Ok(()) => Ok(()),
            Err(_) if parts > 0 => {
                report.subdivisions += 1;
                self.advance(0.5 * step_s, parts - 1, report)?;
                self.advance(0.5 * step_s, parts - 1, report)
            }
            Err(error) => Err(error),
        }
    }

    /// One step by Newton's method, with a line search on the residual's norm.
    fn newton(&mut self, step_s: f64, report: &mut StepReport) -> Result<(), StepError> {
        let two_steps = self.last_step_s == Some(step_s);
        let scheme = if two_steps { self.settings.scheme } else { Scheme::Bdf1 };
        let weights = Weights::new(scheme, step_s);
        // A body goes on as it moves.
        let mut trial: Vec<Displacement> = self
            .now
            .iter()
            .map(|m| Displacement { shift: m.velocity * step_s, turn: m.spin * step_s })
            .collect();
        self.work.begin(&self.inertias, &weights, &self.now, &self.last);
        let mut secant = false;
        let mut norm = self.evaluate(&weights, &trial, Some(secant));
        let mut iterations = 0;
        while !(norm < self.settings.tolerance) {
            if iterations == self.settings.iterations || !norm.is_finite() {
                return Err(self.failure(step_s, norm, iterations));
            }
            iterations += 1;
            report.iterations += 1;
            if !self.work.correct() {
                return Err(self.failure(step_s, norm, iterations));
            }
            self.work.cap_turns();
            let (moved, share) = self.search(&weights, &trial, norm, report);
            trial = moved;
            // Where a kink cut the step short, the next one goes by the secants.
            secant = !secant && share < SHORT;
            norm = self.evaluate(&weights, &trial, Some(secant));
        }
        report.residual = norm;
        self.last = std::mem::replace(
            &mut self.now,
            self.work.trials.iter().map(|trial| trial.motion).collect(),
        );
        self.moved = trial;
        self.last_step_s = Some(step_s);
        self.time_s += step_s;
        Ok(())
    }

    /// The trial moved by a share of the correction; and the share.
    ///
    /// The residual is nearly the gradient of a potential, in which contacts and friction are smooth; its norm is not, and
    /// has lowest points at the kinks where contacts open and begin to slide. So the search is for the lowest point of the
    /// potential along the correction, where the residual's power along it is 0.
    fn search(
        &mut self,
        weights: &Weights,
        trial: &[Displacement],
        norm: f64,
        report: &mut StepReport,
    ) -> (Vec<Displacement>, f64) {
        let before = -self.work.power();
        let (mut low, mut high) = ((0.0, before), None);
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            let moved = self.work.moved(trial, share);
            let found = self.evaluate(weights, &moved, None);
            let power = -self.work.power();
            let descends = power < 0.0 && share == 1.0 || power.abs() <= FLAT * before.abs();
            if if before < 0.0 { descends } else { found < norm } {
                return (moved, share);
            }
            report.halvings += 1;
            if power < 0.0 {
                low = (share, power);
            } else {
                high = Some((share, power));
            }
            let Some((end, power)) = high else {
                share *= 0.5;
                continue;
            };
            // Regula falsi, kept away from the ends; bisection where the residual is no number.
            let guess = low.1 / (low.1 - power);
            let within = if guess.is_finite() { guess.clamp(0.1, 0.9) } else { 0.5 };
            share = low.0 + (end - low.0) * within;
        }
        // The whole step leads to the other side of a kink, whose derivatives know better.
        (self.work.moved(trial, 1.0), 1.0)
    }

    fn failure(&self, part_s: f64, residual: f64, iterations: u32) -> StepError {
        let size = |(_, rows): &(usize, &[f64])| rows.iter().map(|r| r * r).sum::<f64>();
        let of_bodies = self.work.residual.chunks(UNKNOWNS).enumerate();
        let worst = of_bodies.max_by(|a, b| size(a).total_cmp(&size(b)));
        let body = worst.map_or(0, |(body, _)| body);
        StepError { time_s: self.time_s, part_s, residual, iterations, body }
    }

    /// Residual at a trial, and its norm; with the matrix if asked for, exact or of secants.
    fn evaluate(&mut self, weights: &Weights, trial: &[Displacement], derive: Option<bool>) -> f64 {
        let before = if self.last_step_s == Some(weights.step_s) { &self.moved[..] } else { &[] };
        let work = &mut self.work;
        work.trials.clear();
        for (k, displacement) in trial.iter().enumerate() {
            let before = before.get(k).copied().unwrap_or_default();
            work.trials.push(Trial::new(weights, &self.now[k], &before, displacement));
        }
        work.motions.clear();
        work.motions.extend(work.trials.iter().map(|trial| trial.motion));
        if derive.is_some() {
            work.matrix.clear();
        }
        work.inertia(&self.inertias, weights, &self.settings.gravity_m_s2, derive.is_some());
        for (force, slots) in self.forces.iter().zip(&work.slots) {
            let bodies = force.bodies();
            for (gathered, all) in
                work.gathered.iter_mut().zip([&work.motions, &self.now, &self.last])
            {
                gathered.clear();
                gathered.extend(bodies.iter().map(|&body| all[body]));
            }
            let [now, last, before] = &work.gathered;
            let secant = derive == Some(true);
            let view = View { now, last, before, weights, secant };
            work.wrenches.clear();
            work.wrenches.resize(bodies.len(), Wrench::default());
            if derive.is_some() {
                work.derivatives.clear();
                work.derivatives.resize(bodies.len() * bodies.len(), Derivative::default());
                force.derivatives(&view, &mut work.wrenches, &mut work.derivatives);
                for ((derivative, slot), pair) in work.derivatives.iter().zip(slots).zip(0..) {
                    let by = &work.trials[bodies[pair % bodies.len()]];
                    work.matrix.add(slot, &-chained(derivative, by, weights.gain()));
                }
            } else {
                force.wrenches(&view, &mut work.wrenches);
            }
            for (&body, wrench) in bodies.iter().zip(&work.wrenches) {
                let rows = &mut work.residual[UNKNOWNS * body..][..UNKNOWNS];
                for (row, part) in rows.iter_mut().zip(&wrench.stacked()) {
                    *row -= part;
                }
            }
        }
        work.residual.iter().map(|r| r * r).sum::<f64>().sqrt()
    }
}

/// Derivative by the unknowns of a body: by shift and turn, and through velocity and spin.
fn chained(derivative: &Derivative, by: &Trial, gain: f64) -> Matrix6<f64> {
    let Derivative { by_pose, by_rate } = derivative;
    let mut by_unknowns = Matrix6::zeros();
    let mut shift = by_unknowns.fixed_columns_mut::<3>(0);
    shift.copy_from(&by_pose.fixed_columns::<3>(0));
    shift += by_rate.fixed_columns::<3>(0) * gain;
    let mut turn = by_unknowns.fixed_columns_mut::<3>(3);
    turn.copy_from(&(by_pose.fixed_columns::<3>(3) * by.turn_by_phi));
    turn += by_rate.fixed_columns::<3>(3) * by.spin_by_phi;
    by_unknowns
}

impl Work {
    /// What the inertia terms of a step take from earlier steps.
    fn begin(&mut self, inertias: &[Inertia], weights: &Weights, now: &[Motion], last: &[Motion]) {
        self.inertial.clear();
        for ((inertia, now), last) in inertias.iter().zip(now).zip(last) {
            let none = Vector3::zeros();
            self.inertial.push(Wrench {
                force: weights.rate(none, now.velocity, last.velocity) * inertia.mass_kg,
                moment: weights.rate(none, inertia.momentum(now).0, inertia.momentum(last).0),
            });
        }
    }

    /// Sets the residual to the inertia terms and the weight, and adds them to the matrix.
    fn inertia(
        &mut self,
        inertias: &[Inertia],
        weights: &Weights,
        gravity_m_s2: &Vector3<f64>,
        derive: bool,
    ) {
        let gain = weights.gain();
        for (k, (inertia, trial)) in inertias.iter().zip(&self.trials).enumerate() {
            let motion = &trial.motion;
            let (momentum, about_com) = inertia.momentum(motion);
            let Wrench { force, moment } = self.inertial[k];
            let force = (motion.velocity * gain - gravity_m_s2) * inertia.mass_kg + force;
            let moment = momentum * gain + moment;
            let rows = &mut self.residual[UNKNOWNS * k..][..UNKNOWNS];
            rows.copy_from_slice(Wrench { force, moment }.stacked().as_slice());
            if derive {
                // L = I ω: δL = δθ × L − I (δθ × ω) + I δω.
                let by_turn = about_com * skew(&motion.spin) - skew(&momentum);
                let by_phi = by_turn * trial.turn_by_phi + about_com * trial.spin_by_phi;
                let mut block = Matrix6::zeros();
                let of_shift = Matrix3::identity() * (inertia.mass_kg * gain * gain);
                block.fixed_view_mut::<3, 3>(0, 0).copy_from(&of_shift);
                block.fixed_view_mut::<3, 3>(3, 3).copy_from(&(by_phi * gain));
                self.matrix.add(&self.diagonal[k], &block);
            }
        }
    }

    /// Newton's correction of the last residual; false without one.
    fn correct(&mut self) -> bool {
        if !self.matrix.factorise() {
            return false;
        }
        self.correction.copy_from_slice(&self.residual);
        self.matrix.solve(&mut self.correction);
        self.correction.iter().all(|value| value.is_finite())
    }

    /// Power of the residual along the correction.
    fn power(&self) -> f64 {
        self.residual.iter().zip(&self.correction).map(|(r, c)| r * c).sum()
    }

    /// Shortens the correction's turn of each body that it turns too far.
    fn cap_turns(&mut self) {
        for of_body in self.correction.chunks_mut(UNKNOWNS) {
            let turn = Vector3::from_column_slice(&of_body[3..]).norm();
            if turn > MOST_TURN_RAD {
                of_body[3..].iter_mut().for_each(|part| *part *= MOST_TURN_RAD / turn);
            }
        }
    }

    /// A trial moved by a share of the correction.
    fn moved(&self, trial: &[Displacement], share: f64) -> Vec<Displacement> {
        let by = self.correction.chunks(UNKNOWNS);
        let moved = |(displacement, by): (&Displacement, &[f64])| Displacement {
            shift: displacement.shift - Vector3::from_column_slice(&by[..3]) * share,
            turn: displacement.turn - Vector3::from_column_slice(&by[3..]) * share,
        };
        trial.iter().zip(by).map(moved).collect()
    }
}
