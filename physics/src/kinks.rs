//! Kinks of forces, and the correction of a Newton step beyond them. Kinks occur where contacts open, close or begin to slide,
//! and where motors reach their limits.
//!
//! Derivatives omit kinks, so that Newton's method would oscillate between the branches of a force. But kinks act at few
//! points, and the factors of the Newton matrix also give the compliance at these points. The exact laws of these forces are
//! therefore solved first on this small compliance, without factorising the whole system again. Newton's method solves the
//! remaining smooth problem.

use crate::body::Body;
use crate::force::{Force, Kink, StickingFriction};
use crate::matrix::BlockMatrix;
use crate::residual::{Equations, Step};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Maximum number of forces with kinks on particles. If there are more, none of them is corrected.
const MOST: usize = 24;
/// Relative deviation of a law from its tangent above which the correction is changed.
const LEAST: f64 = 0.02;
/// Fraction of the residual below which a force is negligible.
const SMALL: f64 = 1e-6;
/// Number of Gauss-Seidel rounds over the kinks.
const ROUNDS: usize = 4;
/// Maximum number of Newton iterations, on all kinks together and on one kink.
const ITERATIONS: usize = 12;
/// Relative accuracy of the solution among the kinks.
const ACCURACY: f64 = 1e-6;
/// Maximum number of repetitions of Gauss-Seidel rounds and Newton iterations.
const TURNS: usize = 3;
/// Maximum number of halvings of a Newton step on one kink.
const HALVINGS: usize = 6;
/// Maximum number of bisection steps to the root of a force law along one direction.
const BISECTIONS: usize = 40;
/// Smallest fraction of a Newton step on all kinks.
const SHORTEST: f64 = 0.02;

/// Forces that can have kinks.
#[derive(Debug)]
pub(crate) struct Kinks {
    forces: Vec<usize>,
}

/// Outcome of a correction beyond kinks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KinkOutcome {
    /// The correction is unchanged, because it crosses no kink.
    Stays,
    /// The correction crosses kinks and was changed.
    Leaps,
    /// Failure to find a solution among the kinks: the matrix is not that of a minimum of a potential.
    Fails,
}

/// Kink of one force in an iteration.
struct Port<'a> {
    kink: Kink<'a>,
    /// First unknown of each body, and the number of its unknowns.
    bodies: [(usize, usize); 2],
    /// Force of the law at the present state, N or N·m.
    force: Vector3<f64>,
    /// Derivative of the force with respect to the displacement.
    by_shift: Matrix3<f64>,
    /// Displacement of the uncorrected Newton step.
    moved: Vector3<f64>,
}

impl Port<'_> {
    fn law(&self, gain: f64, shift: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        (self.kink.law)(gain, shift)
    }

    /// Adds the wrenches of a force to a right-hand side.
    fn spread(&self, force: &Vector3<f64>, side: &mut [f64]) {
        for (&(first, unknowns), lever) in self.bodies.iter().zip(&self.kink.levers) {
            let wrench = lever * force;
            for (row, part) in side[first..first + unknowns].iter_mut().zip(&wrench) {
                *row += part;
            }
        }
    }

    /// Displacement at the kink for given changes of the unknowns.
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
    /// Collects the forces with kinks.
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

    /// Changes a Newton correction so that it uses the exact laws of the forces with kinks. The caller subtracts the
    /// correction. `equations` contain the factors that gave the correction; `norm` is the norm of their residual.
    pub fn correct(
        &self,
        step: &Step<'_>,
        equations: &mut Equations,
        held: &[Option<StickingFriction>],
        norm: f64,
        correction: &mut [f64],
    ) -> KinkOutcome {
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
            return KinkOutcome::Stays;
        }
        let matrix = &mut equations.matrix;
        let compliance = Compliance::new(&ports, gain, matrix, correction.len());
        let Some(shifts) = compliance.solve(&ports) else { return KinkOutcome::Fails };
        let mut side = vec![0.0; correction.len()];
        for (port, shift) in ports.iter().zip(&shifts) {
            let (found, _) = port.law(gain, shift);
            port.spread(&(found - port.force - port.by_shift * shift), &mut side);
        }
        matrix.solve_again(&mut side);
        if side.iter().any(|part| !part.is_finite()) {
            return KinkOutcome::Fails;
        }
        for (part, more) in correction.iter_mut().zip(&side) {
            *part -= more;
        }
        KinkOutcome::Leaps
    }
}

/// Compliance at the kinks: displacements per force.
struct Compliance {
    gain: f64,
    /// Compliance matrix without the tangents of the laws.
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
        // The factors contain the tangents D of the laws: W = (W0⁻¹ − D)⁻¹, so that W0 = (1 + W D)⁻¹ W.
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

    /// Displacements that satisfy the laws of all kinks; `None` if the solve does not converge.
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

    /// Solves one kink after another, with the forces of the others fixed, in Gauss-Seidel rounds.
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

    /// Residual for given displacements, and the derivatives of the laws there.
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

    /// Displacement y of one kink with the law λ, by damped Newton steps: y = a + W λ(y). The displacement `from` is a,
    /// `compliance` is W.
    fn one(
        &self,
        port: &Port<'_>,
        from: &Vector3<f64>,
        compliance: &Matrix3<f64>,
        mut shift: Vector3<f64>,
    ) -> Vector3<f64> {
        // The contact stays open.
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

    /// Displacement for a law in one direction, whose force decreases with the displacement: bracketed Newton's method.
    fn scalar(&self, port: &Port<'_>, from: f64, compliance: f64) -> f64 {
        let wrong = |shift: f64| {
            let (force, by_shift) = port.law(self.gain, &Vector3::new(shift, 0.0, 0.0));
            (shift - from - compliance * force.x, 1.0 - compliance * by_shift[(0, 0)])
        };
        // The root lies between the displacement without force and the displacement with the force at that point.
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

    /// Solves all kinks together by Newton's method, and returns the final norm of the residual.
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
