//! Dense convex quadratic programs, solved by the dual active-set method of Goldfarb and Idnani (*A numerically stable dual
//! method for solving strictly convex quadratic programs*, Mathematical Programming 27, 1983).
//!
//! The method begins at the unconstrained minimum and adds violated constraints one by one until all are satisfied. Hence it
//! needs no feasible starting point, and its number of steps is about the number of binding constraints. [`Solver::new`]
//! allocates all memory; a solve does not allocate, and equal input yields bitwise equal results.

use nalgebra::{DMatrix, DVector};

/// Quadratic program: min ½ xᵀHx + gᵀx with Nᵀx = b for the equalities, which come first, and Nᵀx ≥ b for the inequalities.
#[derive(Clone, Debug)]
pub struct Program {
    /// Symmetric positive definite matrix H; only its lower triangle is used.
    pub hessian: DMatrix<f64>,
    /// Vector g.
    pub gradient: DVector<f64>,
    /// Matrix N with a column for each constraint.
    pub normals: DMatrix<f64>,
    /// Vector b.
    pub bounds: DVector<f64>,
    /// Number of equalities, which are the first constraints.
    pub equalities: usize,
    /// Number of constraints; further columns are ignored.
    pub constraints: usize,
}

impl Program {
    /// Allocates a program for a number of unknowns and constraints, filled with zeros.
    pub fn zeros(unknowns: usize, constraints: usize) -> Self {
        Self {
            hessian: DMatrix::zeros(unknowns, unknowns),
            gradient: DVector::zeros(unknowns),
            normals: DMatrix::zeros(unknowns, constraints),
            bounds: DVector::zeros(constraints),
            equalities: 0,
            constraints: 0,
        }
    }
}

/// Reason why a solve failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SolveError {
    /// Matrix H that is not positive definite, or a value that is not finite.
    #[error("the quadratic program is not convex, or contains a value that is not finite")]
    NotConvex,
    /// Constraints that cannot all be satisfied.
    #[error("no solution meets all constraints")]
    Infeasible,
    /// Solve that takes more than [`Solver::STEPS_MAX`] steps.
    #[error("the solver exceeded its step limit")]
    TooManySteps,
}

/// Solver of programs with a fixed number of unknowns, with its memory.
#[derive(Clone, Debug)]
pub struct Solver {
    x: DVector<f64>,
    /// Matrix J = L⁻ᵀQ. Its first columns span the active normals; the others are the directions that keep the active
    /// constraints.
    directions: DMatrix<f64>,
    /// Upper triangular matrix R: the active normals are L Q [R; 0].
    factor: DMatrix<f64>,
    cholesky: DMatrix<f64>,
    /// Vector Jᵀn of the constraint that is being added.
    projected: DVector<f64>,
    /// Step of x per unit of the new multiplier.
    primal: DVector<f64>,
    /// Step of the multipliers per unit of the new multiplier.
    dual: DVector<f64>,
    /// Multipliers of the active constraints. The final one may belong to the constraint that is being added.
    multipliers: DVector<f64>,
    /// Active constraints, equalities first.
    active: Vec<usize>,
    is_active: Vec<bool>,
    steps: u32,
}

/// Relative violation up to which a constraint counts as satisfied. A dot product of some dozens of terms is rounded by 1e-14,
/// and a condition of 1e8 of H amplifies this to 1e-10.
const FEASIBLE: f64 = 1e-10;
/// Largest squared fraction of a normal outside the span of the active normals at which the normal counts as dependent: 1e-6
/// of its length.
const DEPENDENT: f64 = 1e-12;

impl Solver {
    /// Maximum number of steps of a solve.
    pub const STEPS_MAX: u32 = 500;

    /// Creates a solver for programs with a number of unknowns, and at most a number of constraints.
    pub fn new(unknowns: usize, constraints: usize) -> Self {
        Self {
            x: DVector::zeros(unknowns),
            directions: DMatrix::zeros(unknowns, unknowns),
            factor: DMatrix::zeros(unknowns, unknowns),
            cholesky: DMatrix::zeros(unknowns, unknowns),
            projected: DVector::zeros(unknowns),
            primal: DVector::zeros(unknowns),
            dual: DVector::zeros(unknowns + 1),
            multipliers: DVector::zeros(unknowns + 1),
            active: Vec::with_capacity(unknowns + 1),
            is_active: vec![false; constraints],
            steps: 0,
        }
    }

    /// Solution of the previous solve that had one.
    #[cfg(test)]
    pub fn solution(&self) -> &DVector<f64> {
        &self.x
    }

    /// Number of steps of the previous solve.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Binding constraints at the previous solution, and their multipliers. Multipliers of inequalities are not negative.
    #[cfg(test)]
    fn active(&self) -> impl Iterator<Item = (usize, f64)> {
        self.active.iter().copied().zip(self.multipliers.iter().copied())
    }

    /// Solves a program.
    ///
    /// # Errors
    /// Returns an error if the program is not convex or has no solution, or if the solve exceeds [`Self::STEPS_MAX`].
    ///
    /// # Panics
    /// Panics if the program has another number of unknowns than the solver, or more constraints.
    pub fn solve(&mut self, program: &Program) -> Result<&DVector<f64>, SolveError> {
        self.begin(program)?;
        for constraint in 0..program.equalities {
            self.add(program, constraint)?;
        }
        while let Some(constraint) = self.most_violated(program) {
            self.add(program, constraint)?;
        }
        match self.x.iter().all(|x| x.is_finite()) {
            true => Ok(&self.x),
            false => Err(SolveError::NotConvex),
        }
    }

    /// Computes the unconstrained minimum: J = L⁻ᵀ, x = −J Jᵀ g.
    fn begin(&mut self, program: &Program) -> Result<(), SolveError> {
        let n = self.x.len();
        assert_eq!(
            program.gradient.len(),
            n,
            "the solver was created for a problem of another size"
        );
        self.active.clear();
        self.is_active.fill(false);
        self.steps = 0;
        for j in 0..n {
            for i in j..n {
                let mut sum = program.hessian[(i, j)];
                for k in 0..j {
                    sum -= self.cholesky[(i, k)] * self.cholesky[(j, k)];
                }
                if i > j {
                    self.cholesky[(i, j)] = sum / self.cholesky[(j, j)];
                } else if sum > 0.0 {
                    self.cholesky[(j, j)] = sum.sqrt();
                } else {
                    return Err(SolveError::NotConvex);
                }
            }
        }
        // Column c of L⁻¹ by forward substitution; it is row c of L⁻ᵀ.
        for c in 0..n {
            for i in 0..n {
                let mut sum = f64::from(u8::from(i == c));
                for k in c..i {
                    sum -= self.cholesky[(i, k)] * self.directions[(c, k)];
                }
                self.directions[(c, i)] = if i < c { 0.0 } else { sum / self.cholesky[(i, i)] };
            }
        }
        self.projected.gemv_tr(1.0, &self.directions, &program.gradient, 0.0);
        self.x.gemv(-1.0, &self.directions, &self.projected, 0.0);
        Ok(())
    }

    /// Satisfies a constraint and adds it to the active ones. Releases constraints whose multipliers would change sign.
    fn add(&mut self, program: &Program, constraint: usize) -> Result<(), SolveError> {
        let normal = program.normals.column(constraint);
        let is_equality = constraint < program.equalities;
        let mut slack = normal.dot(&self.x) - program.bounds[constraint];
        self.multipliers[self.active.len()] = 0.0;
        loop {
            self.steps += 1;
            if self.steps > Self::STEPS_MAX {
                return Err(SolveError::TooManySteps);
            }
            let count = self.active.len();
            self.projected.gemv_tr(1.0, &self.directions, &normal, 0.0);
            let free = self.directions.columns_range(count..);
            self.primal.gemv(1.0, &free, &self.projected.rows_range(count..), 0.0);
            for i in (0..count).rev() {
                let mut sum = self.projected[i];
                for k in i + 1..count {
                    sum -= self.factor[(i, k)] * self.dual[k];
                }
                self.dual[i] = sum / self.factor[(i, i)];
            }
            let curvature = self.projected.rows_range(count..).norm_squared();
            let depends = curvature <= DEPENDENT * self.projected.norm_squared();
            if depends && is_equality {
                // A redundant constraint needs no place; a contradictory constraint has no solution.
                let says_it_again = slack.abs() <= self.rounding(program, constraint);
                return if says_it_again { Ok(()) } else { Err(SolveError::Infeasible) };
            }
            let full = if depends { f64::INFINITY } else { -slack / curvature };
            let blocking = if is_equality { None } else { self.blocking(program) };
            let partial = blocking.map_or(f64::INFINITY, |(_, length)| length);
            let length = full.min(partial);
            if length == f64::INFINITY {
                return Err(SolveError::Infeasible);
            }
            for i in 0..count {
                self.multipliers[i] -= length * self.dual[i];
            }
            self.multipliers[count] += length;
            if !depends {
                self.x.axpy(length, &self.primal, 1.0);
                slack += length * curvature;
            }
            match blocking {
                Some((place, _)) if partial < full => self.let_go(place),
                _ => {
                    self.take_in(constraint);
                    return Ok(());
                }
            }
        }
    }

    /// Index among the active constraints of the inequality whose multiplier reaches 0 first, and the step length to it.
    fn blocking(&self, program: &Program) -> Option<(usize, f64)> {
        let inequalities =
            self.active.iter().enumerate().filter(|(_, c)| **c >= program.equalities);
        inequalities
            .filter(|(place, _)| self.dual[*place] > 0.0)
            .map(|(place, _)| (place, self.multipliers[place] / self.dual[place]))
            .min_by(|one, other| one.1.total_cmp(&other.1))
    }

    /// Appends a constraint to the active ones: rotates the free columns of J so that only one of them has a component along
    /// its normal.
    fn take_in(&mut self, constraint: usize) {
        let (n, count) = (self.x.len(), self.active.len());
        for j in (count + 1..n).rev() {
            self.rotate(j - 1, j);
        }
        for i in 0..=count {
            self.factor[(i, count)] = self.projected[i];
        }
        self.active.push(constraint);
        self.is_active[constraint] = true;
    }

    /// Rotates columns i and j of J so that entry j of Jᵀn becomes 0.
    fn rotate(&mut self, i: usize, j: usize) {
        let (a, b) = (self.projected[i], self.projected[j]);
        let length = a.hypot(b);
        if b == 0.0 || length == 0.0 {
            return;
        }
        let (cosine, sine) = (a / length, b / length);
        (self.projected[i], self.projected[j]) = (length, 0.0);
        turn_columns(&mut self.directions, i, j, cosine, sine);
    }

    /// Removes an active constraint and makes R triangular again.
    fn let_go(&mut self, place: usize) {
        let count = self.active.len();
        self.is_active[self.active.remove(place)] = false;
        for i in place..count {
            self.multipliers[i] = self.multipliers[i + 1];
        }
        for column in place + 1..count {
            for row in 0..=column {
                self.factor[(row, column - 1)] = self.factor[(row, column)];
            }
        }
        for i in place..count - 1 {
            let (a, b) = (self.factor[(i, i)], self.factor[(i + 1, i)]);
            let length = a.hypot(b);
            if b == 0.0 || length == 0.0 {
                continue;
            }
            let (cosine, sine) = (a / length, b / length);
            (self.factor[(i, i)], self.factor[(i + 1, i)]) = (length, 0.0);
            for column in i + 1..count - 1 {
                let (upper, lower) = (self.factor[(i, column)], self.factor[(i + 1, column)]);
                self.factor[(i, column)] = cosine * upper + sine * lower;
                self.factor[(i + 1, column)] = cosine * lower - sine * upper;
            }
            turn_columns(&mut self.directions, i, i + 1, cosine, sine);
        }
    }

    /// Violation of a constraint that may be due to rounding.
    fn rounding(&self, program: &Program, constraint: usize) -> f64 {
        let length = program.normals.column(constraint).norm();
        FEASIBLE * (program.bounds[constraint].abs() + length * (1.0 + self.x.norm()))
    }

    /// Index of the inequality with the largest violation relative to the length of its normal; `None` if all are satisfied.
    fn most_violated(&self, program: &Program) -> Option<usize> {
        let (mut worst, mut found) = (0.0, None);
        for constraint in program.equalities..program.constraints {
            if self.is_active[constraint] {
                continue;
            }
            let normal = program.normals.column(constraint);
            let (length, bound) = (normal.norm(), program.bounds[constraint]);
            let violation = bound - normal.dot(&self.x);
            if violation > self.rounding(program, constraint) && violation > worst * length {
                (worst, found) = (violation / length, Some(constraint));
            }
        }
        found
    }
}

fn turn_columns(matrix: &mut DMatrix<f64>, i: usize, j: usize, cosine: f64, sine: f64) {
    let (mut one, mut other) = matrix.columns_range_pair_mut(i, j);
    for (one, other) in one.iter_mut().zip(other.iter_mut()) {
        (*one, *other) = (cosine * *one + sine * *other, cosine * *other - sine * *one);
    }
}

#[cfg(test)]
mod tests;
