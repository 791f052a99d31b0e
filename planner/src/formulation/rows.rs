//! Residual rows with exact sparse derivatives: terms write them and the solver reads them.
//!
//! Terms differentiate with respect to the timeline samples in their window. [`RowWriter`] converts these derivatives
//! to derivatives with respect to the unknowns, through placements and frozen entries, and sums those in the same
//! column, so that terms contain no bookkeeping. The pattern of a problem never changes: every call writes the same
//! rows with the same columns.

use crate::families::Family;
use crate::motion;
use crate::plan::Placement;
use crate::problem::state::State;
use crate::problem::variables::Lift;
use crate::problem::{Problem, Unknowns};
use nalgebra::Vector3;

/// Columns of the unknowns: free entries of all slots, then Dx, Dy, ψ.
#[derive(Clone, Debug)]
pub struct Columns {
    /// `[slot][variable]`, `None` for frozen entries.
    pub of_slot: Vec<Vec<Option<usize>>>,
    /// Columns of Dx, Dy, ψ.
    pub placement: Option<[usize; 3]>,
    /// Number of columns.
    pub count: usize,
}

impl Columns {
    /// Assigns columns to the unknowns of a problem.
    pub fn new(problem: &Problem) -> Self {
        let mut count = 0;
        let mut next = || {
            count += 1;
            count - 1
        };
        let of_slot = problem
            .frozen
            .iter()
            .map(|slot| slot.iter().map(|&frozen| (!frozen).then(&mut next)).collect())
            .collect();
        let placement = problem.placement_free.then(|| [next(), next(), next()]);
        Self { of_slot, placement, count }
    }

    /// Adds a step, given in scaled variables, to the unknowns.
    pub fn add_step(&self, problem: &Problem, unknowns: &mut Unknowns, step: &[f64]) {
        for (slot, columns) in unknowns.slots.iter_mut().zip(&self.of_slot) {
            for (variable, column) in columns.iter().enumerate() {
                if let Some(column) = column {
                    slot[variable] += step[*column] * problem.layout.scale[variable];
                }
            }
        }
        if let Some([x, y, yaw]) = self.placement {
            unknowns.placement.offset_m[0] += step[x];
            unknowns.placement.offset_m[1] += step[y];
            unknowns.placement.yaw_rad += step[yaw];
        }
    }
}

/// Role of a row in the energy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// r = 0.
    Equality,
    /// r ≤ 0, smoothed over a band of this half-width in scaled units (Eq. 2.16: ε).
    Inequality {
        /// ε over the row's scale.
        band: f64,
    },
    /// Weighted square of r.
    Cost {
        /// Weight.
        weight: f64,
    },
}

/// Part of the robot to which a residual belongs, with its index in the robot's list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// The whole robot.
    Whole,
    /// An end effector.
    EndEffector(usize),
    /// A joint.
    Joint(usize),
}

impl From<motion::Subject> for Subject {
    fn from(subject: motion::Subject) -> Self {
        match subject {
            motion::Subject::Com | motion::Subject::Body => Self::Whole,
            motion::Subject::EndEffector(j) => Self::EndEffector(j),
        }
    }
}

/// Number in the motion or robot file that a residual compares with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Given {
    /// Name of its field.
    pub field: &'static str,
    /// The number.
    pub value: f64,
    /// Derivative of the residual with respect to it.
    pub slope: f64,
}

/// One residual.
#[derive(Clone, Debug)]
pub struct Row {
    /// Family of the residual.
    pub family: Family,
    /// Timeline index of the middle of the window it was written for.
    pub at: usize,
    /// Part of the robot to which it belongs.
    pub subject: Subject,
    /// Number that it compares with, if any.
    pub given: Option<Given>,
    /// Residual over its scale.
    pub value: f64,
    /// Residual at which `value` is 1, in the family's unit.
    pub scale: f64,
    /// Largest residual that is physically credible, in the family's unit.
    pub level: f64,
    /// Role in the energy.
    pub role: Role,
    /// Range of its derivatives in [`Rows::columns`] and [`Rows::derivatives`].
    pub entries: std::ops::Range<usize>,
}

/// All rows of a problem at one point.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// The rows.
    pub rows: Vec<Row>,
    /// Columns of all derivatives.
    pub columns: Vec<usize>,
    /// Derivatives of scaled residuals with respect to scaled unknowns.
    pub derivatives: Vec<f64>,
}

/// Input of a term: the problem and up to three samples of the timeline.
pub struct Window<'a> {
    /// The problem.
    pub problem: &'a Problem,
    /// Timeline indices of the samples.
    pub at: [usize; 3],
    /// The samples.
    pub states: [&'a State; 3],
    /// Forces required of feet in swing, `[timeline sample][end effector]`, N; empty for none.
    pub swing_force_n: &'a [Vec<Vector3<f64>>],
}

impl Window<'_> {
    /// Contact flag of end effector `j` in sample `k` of the window.
    pub fn stance(&self, k: usize, j: usize) -> bool {
        self.problem.stance[self.at[k]][j]
    }
}

/// Collector of the rows of all terms.
pub struct RowWriter<'a> {
    problem: &'a Problem,
    columns: &'a Columns,
    placement: Placement,
    states: &'a [State],
    rows: Rows,
    family: Family,
    at: [usize; 3],
    scale: f64,
    level: f64,
    role: Role,
    given: Option<Given>,
    /// Derivatives of the row under construction: a dense gradient for each sample of the window, the indices of
    /// entries that were written, and for each entry whether it was written.
    gradients: [Vec<f64>; 3],
    written: [Vec<usize>; 3],
    is_written: [Vec<bool>; 3],
    /// Position of each column in the row, if it has one; dense scratch memory over all columns.
    position: Vec<u32>,
}

const NO_POSITION: u32 = u32::MAX;

impl<'a> RowWriter<'a> {
    /// Creates a writer for one evaluation. `reuse` is an earlier result whose memory is reused.
    pub fn new(
        problem: &'a Problem,
        columns: &'a Columns,
        unknowns: &Unknowns,
        states: &'a [State],
        reuse: Rows,
    ) -> Self {
        let mut rows = reuse;
        rows.rows.clear();
        rows.columns.clear();
        rows.derivatives.clear();
        let gradient = vec![0.0; problem.layout.len];
        Self {
            problem,
            columns,
            placement: unknowns.placement,
            states,
            rows,
            family: Family::LinearDynamics,
            at: [0; 3],
            scale: 1.0,
            level: 1.0,
            role: Role::Equality,
            given: None,
            gradients: [gradient.clone(), gradient.clone(), gradient],
            written: Default::default(),
            is_written: std::array::from_fn(|_| vec![false; problem.layout.len]),
            position: vec![NO_POSITION; columns.count],
        }
    }

    /// Returns the finished rows.
    pub fn finish(self) -> Rows {
        self.rows
    }

    /// Begins rows of a family for these samples of the timeline.
    pub fn enter(&mut self, family: Family, at: [usize; 3]) {
        self.family = family;
        self.at = at;
    }

    /// Sets scale and role of the following rows. A row that compares with a limit has that limit as its scale if the
    /// family's level is a fraction of the limit.
    pub fn set(&mut self, scale: f64, role: Role) {
        self.scale = scale;
        self.level = self.family.level().at(scale);
        self.role = role;
    }

    /// Adds to the derivative of the next row with respect to `variable` of sample `k` of the window.
    pub fn d(&mut self, k: usize, variable: usize, derivative: f64) {
        // An entry that is zero here may be nonzero at the next point: it stays in the pattern.
        self.gradients[k][variable] += derivative;
        if !std::mem::replace(&mut self.is_written[k][variable], true) {
            self.written[k].push(variable);
        }
    }

    /// Adds derivatives with respect to three consecutive variables.
    pub fn d_vector(&mut self, k: usize, first: usize, derivative: &Vector3<f64>) {
        for c in 0..3 {
            self.d(k, first + c, derivative[c]);
        }
    }

    /// Sets the number that the next row compares with.
    pub fn given(&mut self, field: &'static str, value: f64, slope: f64) {
        self.given = Some(Given { field, value, slope });
    }

    /// Ends a row for the whole robot, with its residual in the family's unit.
    pub fn row(&mut self, residual: f64) {
        self.row_of(Subject::Whole, residual);
    }

    /// Ends a row for a part of the robot, with its residual in the family's unit.
    pub fn row_of(&mut self, subject: Subject, residual: f64) {
        let start = self.rows.columns.len();
        for k in 0..3 {
            if self.written[k].is_empty() {
                continue;
            }
            let sample = self.problem.timeline[self.at[k]];
            let mut written = std::mem::take(&mut self.written[k]);
            let mut gradient = std::mem::take(&mut self.gradients[k]);
            for &variable in &written {
                self.is_written[k][variable] = false;
            }
            if sample.lift != Lift::Identity {
                self.pull_back(start, sample.lift, self.at[k], &mut written, &mut gradient);
            }
            for &variable in &written {
                if let Some(column) = self.columns.of_slot[sample.slot][variable] {
                    let derivative = gradient[variable] * self.problem.layout.scale[variable];
                    self.push(start, column, derivative / self.scale);
                }
                gradient[variable] = 0.0;
            }
            written.clear();
            self.written[k] = written;
            self.gradients[k] = gradient;
        }
        let end = self.rows.columns.len();
        for &column in &self.rows.columns[start..end] {
            self.position[column] = NO_POSITION;
        }
        self.rows.rows.push(Row {
            family: self.family,
            at: self.at[1],
            subject,
            given: self.given.take(),
            value: residual / self.scale,
            scale: self.scale,
            level: self.level,
            role: self.role,
            entries: start..end,
        });
    }

    /// Converts derivatives with respect to a placed sample to those with respect to its slot and the placement.
    fn pull_back(
        &mut self,
        start: usize,
        lift: Lift,
        at: usize,
        written: &mut Vec<usize>,
        gradient: &mut [f64],
    ) {
        let layout = &self.problem.layout;
        // A turn mixes the horizontal components of a vector, so the pattern needs both.
        for first in layout.points().chain(layout.vectors()) {
            let (x, y) = (written.contains(&first), written.contains(&(first + 1)));
            if x != y {
                written.push(if x { first + 1 } else { first });
            }
        }
        let to_placement = lift.pull_back(layout, &self.states[at].vars, &self.placement, gradient);
        if let Some(columns) = self.columns.placement {
            for (column, derivative) in columns.into_iter().zip(to_placement) {
                self.push(start, column, derivative / self.scale);
            }
        }
    }

    /// Adds a derivative to a column of the row that starts at `start`.
    fn push(&mut self, start: usize, column: usize, derivative: f64) {
        match self.position[column] {
            NO_POSITION => {
                self.position[column] = (self.rows.columns.len() - start) as u32;
                self.rows.columns.push(column);
                self.rows.derivatives.push(derivative);
            }
            position => self.rows.derivatives[start + position as usize] += derivative,
        }
    }
}

#[cfg(test)]
mod tests;
