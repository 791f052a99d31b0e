//! Kinks of forces, where contacts open, close and begin to slide and where motors come to their limits; and Newton's
//! correction beyond them.
//!
//! Derivatives do not contain kinks: Newton's method would oscillate between the pieces of a force. But kinks are at few points,
//! and the factors that gave the correction also give the displacements by a force there. So the laws of these forces, instead of
//! their tangents, are solved on that small compliance first, without a new matrix of the whole system. The rest, which is
//! smooth, is left to Newton's method.

use crate::body::Body;
use crate::force::{Force, Held, Kink};
use crate::matrix::BlockMatrix;
use crate::residual::{Equations, Step};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Most kinks on particles for which this pays.
const MOST: usize = 24;
/// Share of its force by which a law must leave its tangent for the correction to be changed.
const LEAST: f64 = 0.02;
/// Share of the residual below which a force does not matter.
const SMALL: f64 = 1e-6;
/// Rounds over the kinks, each with the others' forces as they are.
const ROUNDS: usize = 4;
/// Newton iterations on all kinks at once that follow, and on one.
const ITERATIONS: usize = 12;
/// Accuracy, as a share of the largest displacement.
const ACCURACY: f64 = 1e-6;
/// Times that both are tried.
const TURNS: usize = 3;
/// Times that a step is halved.
const HALVINGS: usize = 6;
/// Steps to the root of a law in one direction.
const BISECTIONS: usize = 40;
/// Smallest share of a step.
const SHORTEST: f64 = 0.02;

/// The forces with kinks.
#[derive(Debug)]
pub(crate) struct Kinks {
    forces: Vec<usize>,
}

/// Outcome of correcting beyond kinks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Leap {
    /// Correction is unchanged: no kink lies in its way.
    Stays,
    /// Correction crosses kinks.
    Leaps,
    /// Solution among the kinks was not found: the matrix is not that of a minimum of a potential.
    Fails,
}

/// A kink in an iteration.
struct Port<'a> {
    kink: Kink<'a>,
    /// First unknown of each of its bodies, and the number of its unknowns.
    bodies: [(usize, usize); 2],
    /// Force of the law at the present state, N or N·m.
    force: Vector3<f64>,
    /// Derivative of the force by the displacement.
    by_shift: Matrix3<f64>,
    /// Displacement by Newton's correction.
    moved: Vector3<f64>,
}

impl Port<'_> {
    fn law(&self, gain: f64, shift: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        (self.kink.law)(gain, shift)
    }

    /// Adds what the law gives to a right side.
    fn spread(&self, force: &Vector3<f64>, side: &mut [f64]) {
        for (&(first, unknowns), lever) in self.bodies.iter().zip(&self.kink.levers) {
            let wrench = lever * force;
            for (row, part) in side[first..first + unknowns].iter_mut().zip(&wrench) {
                *row += part;
            }
        }
    }

    /// Displacement by one of the bodies.
    fn shift(&self, of: &[f64]) -> Vector3<f64> {
        let mut shift = Vector3::zeros();
        for (&(first, unknowns), lever) in self.bodies.iter().zip(&self.kink.levers) {
            for (part, row) in of[first..first + unknowns].iter().zip(lever.row_iter()) {
                shift += row.transpose() * *part;
            }
        }
        shift
    }
}

impl Kinks {
    /// Collects the kinks of forces on bodies.
    pub fn new(bodies: &[Body], forces: &[Box<dyn Force>]) -> Self {
        let on_particle = |force: &dyn Force| {
            force.bodies().iter().any(|&body| matches!(bodies[body], Body::Particle { .. }))
        };
        let with_kinks = |soft: bool| {
            let all = forces.iter().enumerate();
            let of_kind = all
                .filter(move |(_, force)| force.has_kink() && on_particle(force.as_ref()) == soft);
            of_kind.map(|(number, _)| number)
        };
        let mut of_all: Vec<_> = with_kinks(false).collect();
        if with_kinks(true).count() <= MOST {
            of_all.extend(with_kinks(true));
        }
        Self { forces: of_all }
    }

    /// Replaces a correction, which Newton's method subtracts, by that with the forces' own laws, and returns the outcome.
    /// `equations` have the factors that gave the correction; `norm` is that of their residual.
    pub fn correct(
        &self,
        step: &Step<'_>,
        equations: &mut Equations,
        held: &[Option<Held>],
        norm: f64,
        correction: &mut [f64],
    ) -> Leap {
        let gain = step.weights.gain();
        let mut ports = Vec::with_capacity(self.forces.len());
        let mut beyond = 0.0_f64;
        let mut now = Vec::with_capacity(2);
        for &number in &self.forces {
            let Equations { motions, firsts, .. } = &*equations;
            if equations.is_asleep(number) {
                continue;
            }
            let force = step.forces[number].as_ref();
            let on = force.bodies();
            now.clear();
            now.extend(on.iter().map(|&body| motions[body]));
            let Some(kink) = force.kink(&now, held.get(number).copied().flatten()) else {
                continue;
            };
            let unknowns = |body: Option<&usize>| {
                body.map_or((0, 0), |&body| (firsts[body], firsts[body + 1] - firsts[body]))
            };
            let (force, by_shift) = (kink.law)(gain, &Vector3::zeros());
            let bodies = [unknowns(on.first()), unknowns(on.get(1))];
            let mut port = Port { kink, bodies, force, by_shift, moved: Vector3::zeros() };
            port.moved = -port.shift(correction);
            let (found, _) = port.law(gain, &port.moved);
            let leaves = (found - force - by_shift * port.moved).norm();
            beyond = beyond.max(leaves / (force.norm() + found.norm()).max(SMALL * norm));
            if port.kink.always || leaves > SMALL * norm {
                ports.push(port);
            }
        }
        if ports.is_empty() || beyond <= LEAST {
            return Leap::Stays;
        }
        let matrix = &mut equations.matrix;
        let compliance = Compliance::new(&ports, gain, matrix, correction.len());
        let Some(shifts) = compliance.solve(&ports) else { return Leap::Fails };
        let mut side = vec![0.0; correction.len()];
        for (port, shift) in ports.iter().zip(&shifts) {
            let (found, _) = port.law(gain, shift);
            port.spread(&(found - port.force - port.by_shift * shift), &mut side);
        }
        matrix.solve_again(&mut side);
        if side.iter().any(|part| !part.is_finite()) {
            return Leap::Fails;
        }
        for (part, more) in correction.iter_mut().zip(&side) {
            *part -= more;
        }
        Leap::Leaps
    }
}

/// Compliance at the kinks: displacements by forces there.
struct Compliance {
    gain: f64,
    /// Displacements by forces, without the laws' own tangents.
    matrix: DMatrix<f64>,
    /// Displacements without a change of the forces.
    free: DVector<f64>,
}

impl Compliance {
    fn new(ports: &[Port<'_>], gain: f64, matrix: &mut BlockMatrix, unknowns: usize) -> Self {
        let size = 3 * ports.len();
        let mut compliance = DMatrix::zeros(size, size);
        let mut side = vec![0.0; unknowns];
        for (k, port) in ports.iter().enumerate() {
            for axis in 0..port.kink.directions {
                side.fill(0.0);
                port.spread(&Vector3::ith(axis, 1.0), &mut side);
                matrix.solve_again(&mut side);
                for (j, other) in ports.iter().enumerate() {
                    let mut rows = compliance.fixed_view_mut::<3, 1>(3 * j, 3 * k + axis);
                    rows.copy_from(&other.shift(&side));
                }
            }
        }
        // The factors have the laws' tangents D in them: W = (W0⁻¹ − D)⁻¹, so that W0 = (1 + W D)⁻¹ W.
        let mut with_tangents = DMatrix::identity(size, size);
        let mut moved = DVector::zeros(size);
        for (k, port) in ports.iter().enumerate() {
            let columns = compliance.columns(3 * k, 3) * port.by_shift;
            let mut target = with_tangents.columns_mut(3 * k, 3);
            target += columns;
            moved.fixed_rows_mut::<3>(3 * k).copy_from(&port.moved);
        }
        let lu = with_tangents.lu();
        let nan = || DVector::from_element(size, f64::NAN);
        let free = lu.solve(&moved).unwrap_or_else(nan);
        let matrix = lu.solve(&compliance).unwrap_or(compliance);
        Self { gain, matrix, free }
    }

    fn block(&self, row: usize, column: usize) -> Matrix3<f64> {
        self.matrix.fixed_view::<3, 3>(3 * row, 3 * column).into()
    }

    /// Displacements at which all have the forces of their laws; none where that is not found.
    fn solve(&self, ports: &[Port<'_>]) -> Option<Vec<Vector3<f64>>> {
        let mut shifts: Vec<Vector3<f64>> = ports.iter().map(|port| port.moved).collect();
        let start = self.wrong(ports, &shifts).0.norm();
        for _ in 0..TURNS {
            self.rounds(ports, &mut shifts);
            let left = self.polish(ports, &mut shifts);
            if left <= ACCURACY * start {
                return Some(shifts);
            }
            if !left.is_finite() {
                return None;
            }
        }
        None
    }

    /// Solves one after the other with the others' forces as they are.
    fn rounds(&self, ports: &[Port<'_>], shifts: &mut [Vector3<f64>]) {
        let change =
            |k: usize, shift: &Vector3<f64>| ports[k].law(self.gain, shift).0 - ports[k].force;
        let mut changes: Vec<_> = (0..).zip(&*shifts).map(|(k, shift)| change(k, shift)).collect();
        for _ in 0..ROUNDS {
            for (k, port) in ports.iter().enumerate() {
                let mut from: Vector3<f64> = self.free.fixed_rows::<3>(3 * k).into();
                for (j, change) in changes.iter().enumerate().filter(|(j, _)| *j != k) {
                    from += self.block(k, j) * change;
                }
                let own = self.block(k, k);
                shifts[k] = self.one(port, &(from - own * port.force), &own, shifts[k]);
                changes[k] = change(k, &shifts[k]);
            }
        }
    }

    /// Residual of displacements, and the derivatives of the laws there.
    fn wrong(
        &self,
        ports: &[Port<'_>],
        shifts: &[Vector3<f64>],
    ) -> (DVector<f64>, Vec<Matrix3<f64>>) {
        let mut changes = DVector::zeros(self.free.len());
        let mut wrong = -&self.free;
        let mut tangents = Vec::with_capacity(ports.len());
        for ((k, port), shift) in ports.iter().enumerate().zip(shifts) {
            let (force, by_shift) = port.law(self.gain, shift);
            changes.fixed_rows_mut::<3>(3 * k).copy_from(&(force - port.force));
            let mut own = wrong.fixed_rows_mut::<3>(3 * k);
            own += shift;
            tangents.push(by_shift);
        }
        (wrong - &self.matrix * changes, tangents)
    }

    /// Displacement y of one with the law λ, from where it is without a force: y = a + W λ(y).
    fn one(
        &self,
        port: &Port<'_>,
        from: &Vector3<f64>,
        compliance: &Matrix3<f64>,
        mut shift: Vector3<f64>,
    ) -> Vector3<f64> {
        // It stays open.
        if port.law(self.gain, from).0 == Vector3::zeros() {
            return *from;
        }
        if port.kink.directions == 1 {
            return Vector3::new(self.scalar(port, from.x, compliance[(0, 0)]), 0.0, 0.0);
        }
        let wrong = |shift: &Vector3<f64>| {
            let (force, by_shift) = port.law(self.gain, shift);
            (shift - from - compliance * force, by_shift)
        };
        let (mut left, mut by_shift) = wrong(&shift);
        for _ in 0..ITERATIONS {
            let Some(inverse) = (Matrix3::identity() - compliance * by_shift).try_inverse() else {
                break;
            };
            let step = inverse * left;
            let mut share = 1.0;
            let mut found = (shift, left, by_shift);
            for _ in 0..HALVINGS {
                let moved = shift - step * share;
                let (wrong, by_shift) = wrong(&moved);
                found = (moved, wrong, by_shift);
                if wrong.norm() < left.norm() {
                    break;
                }
                share *= 0.5;
            }
            (shift, left, by_shift) = found;
            if step.norm() <= ACCURACY * shift.norm() {
                break;
            }
        }
        shift
    }

    /// The same of a law in one direction, which falls with the displacement: Newton's method within bounds.
    fn scalar(&self, port: &Port<'_>, from: f64, compliance: f64) -> f64 {
        let wrong = |shift: f64| {
            let (force, by_shift) = port.law(self.gain, &Vector3::new(shift, 0.0, 0.0));
            (shift - from - compliance * force.x, 1.0 - compliance * by_shift[(0, 0)])
        };
        // The displacement without the force, and with what it would give there, have the root between them.
        let (mut low, mut high) = (from, from - wrong(from).0);
        if low > high {
            std::mem::swap(&mut low, &mut high);
        }
        let mut shift = low;
        for _ in 0..BISECTIONS {
            let (left, slope) = wrong(shift);
            if left < 0.0 {
                low = shift;
            } else {
                high = shift;
            }
            let newton = shift - left / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - shift).abs() <= ACCURACY * (next - from).abs() {
                return next;
            }
            shift = next;
        }
        shift
    }

    /// Solves all equations by Newton's method; returns the norm of the residual at its end.
    fn polish(&self, ports: &[Port<'_>], shifts: &mut Vec<Vector3<f64>>) -> f64 {
        let size = self.free.len();
        let (mut left, mut tangents) = self.wrong(ports, shifts);
        for _ in 0..ITERATIONS {
            let mut jacobian = DMatrix::identity(size, size);
            for (k, by_shift) in tangents.iter().enumerate() {
                let columns = self.matrix.columns(3 * k, 3) * by_shift;
                let mut target = jacobian.columns_mut(3 * k, 3);
                target -= columns;
            }
            let Some(step) = jacobian.lu().solve(&left) else { break };
            let mut share = 1.0;
            let found = loop {
                let moved: Vec<Vector3<f64>> = (shifts.iter().enumerate())
                    .map(|(k, shift)| shift - step.fixed_rows::<3>(3 * k) * share)
                    .collect();
                let wrong = self.wrong(ports, &moved);
                if wrong.0.norm() < left.norm() {
                    break Some((moved, wrong));
                }
                share *= 0.5;
                if share < SHORTEST {
                    break None;
                }
            };
            let Some((moved, wrong)) = found else { break };
            *shifts = moved;
            (left, tangents) = wrong;
        }
        left.norm()
    }
}
