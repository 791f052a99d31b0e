//! Residual rows with exact sparse derivatives. Terms write the rows, and the solver reads them.
//!
//! Terms differentiate with respect to the timeline samples in their window. [`RowWriter`] converts these derivatives to
//! derivatives with respect to the unknowns, through placements and frozen entries, and sums derivatives in the same column.
//! Terms therefore contain no bookkeeping. The pattern of a problem is constant: every call writes the same rows with the same
//! columns.

mod writer;

pub use writer::{Evaluation, Pattern, RowWriter};

use crate::families::Family;
use crate::motion;
use crate::problem::state::State;
use crate::problem::{Problem, Unknowns};
use nalgebra::Vector3;
use rollwalk_robot::Robot;
use std::cell::OnceCell;
use std::mem::discriminant;
use std::sync::Arc;

/// Columns of the unknowns: the free entries of all slots, then Dx, Dy, ψ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    /// Column of each entry, `[slot][variable]`; `None` for frozen entries.
    pub of_slot: Vec<Vec<Option<usize>>>,
    /// Columns of Dx, Dy, ψ; `None` if the placement is fixed.
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
    /// Equality r = 0.
    Equality,
    /// Inequality r ≤ 0, smoothed as in Eq. 2.16.
    Inequality {
        /// Half-width ε of the smoothing over the row's scale.
        band: f64,
    },
    /// Cost: weighted square of r.
    Cost {
        /// Weight.
        weight: f64,
    },
}

/// Part of the robot to which a residual belongs, with its index in the robot's list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// Whole robot.
    Whole,
    /// End effector.
    EndEffector(usize),
    /// Joint.
    Joint(usize),
    /// Link.
    Link(usize),
    /// Pair of links.
    Links([usize; 2]),
}

impl Subject {
    /// Name in the robot file; `None` for the whole robot.
    pub fn name(self, robot: &Robot) -> Option<String> {
        match self {
            Self::Whole => None,
            Self::EndEffector(j) => Some(robot.end_effectors[j].name.clone()),
            Self::Joint(j) => Some(robot.joints[j].name.clone()),
            Self::Link(link) => Some(robot.links[link].name.clone()),
            Self::Links(links) => Some(robot.pair_name(links)),
        }
    }
}

impl From<motion::Subject> for Subject {
    fn from(subject: motion::Subject) -> Self {
        match subject {
            motion::Subject::Com | motion::Subject::Body => Self::Whole,
            motion::Subject::EndEffector(j) => Self::EndEffector(j),
        }
    }
}

/// Field of the motion or robot file that a residual compares with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparedField {
    /// Name of the field.
    pub field: &'static str,
    /// Value of the field.
    pub value: f64,
    /// Derivative of the residual with respect to the value.
    pub slope: f64,
}

/// Description of a residual: origin, scale, tolerance and role. It is constant for a problem.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Family of the residual.
    pub family: Family,
    /// Timeline index of the middle of the row's window.
    pub at: usize,
    /// Part of the robot to which the row belongs.
    pub subject: Subject,
    /// Residual at which the value of the row is 1, in the family's unit.
    pub scale: f64,
    /// Tolerance, in the family's unit.
    pub level: f64,
    /// Role in the energy.
    pub role: Role,
    /// Range of the row's derivatives in [`Rows::columns`] and [`Rows::derivatives`].
    pub entries: std::ops::Range<usize>,
}

impl Row {
    /// Returns true if the row contributes to the energy. `shifted` is its value plus the shift by its multiplier.
    pub fn counts(&self, shifted: f64) -> bool {
        match self.role {
            Role::Inequality { band } => shifted > -band,
            Role::Equality | Role::Cost { .. } => true,
        }
    }

    /// Returns true if two rows differ in values only.
    fn is_like(&self, other: &Self) -> bool {
        self.family == other.family
            && self.at == other.at
            && self.subject == other.subject
            && discriminant(&self.role) == discriminant(&other.role)
            && self.entries == other.entries
    }
}

/// Rows of a problem at one point.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Descriptions in the order of the terms. All points of a system share them.
    pub rows: Arc<[Row]>,
    /// Residuals over their scales.
    pub values: Vec<f64>,
    /// Fields that rows compare with, and the index of the row, ascending.
    pub(super) givens: Vec<(u32, ComparedField)>,
    /// Columns of all derivatives. All points of a system share them.
    pub columns: Arc<[usize]>,
    /// Derivatives of scaled residuals with respect to scaled unknowns; undefined for rows outside [`Self::differentiated`].
    pub derivatives: Vec<f64>,
    /// Set of rows with derivatives.
    pub differentiated: DifferentiatedRows,
    /// States of the timeline at the point.
    pub(super) states: Vec<State>,
}

impl Rows {
    /// Iterates over the rows and their values.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&Row, f64)> {
        self.rows.iter().zip(self.values.iter().copied())
    }

    /// Field that a row compares with, if any.
    pub fn given(&self, row: usize) -> Option<ComparedField> {
        let at = self.givens.binary_search_by_key(&(row as u32), |(row, _)| *row).ok()?;
        Some(self.givens[at].1)
    }
}

/// Set of rows with derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DifferentiatedRows {
    /// Empty set.
    #[default]
    None,
    /// Rows that the latest differentiation selected.
    Some,
    /// Set of all rows.
    All,
}

/// Input of a term: the problem and up to three samples of the timeline.
pub struct Window<'a> {
    /// Problem of the rows.
    pub problem: &'a Problem,
    /// Timeline indices of the samples.
    pub at: [usize; 3],
    /// States of the samples.
    pub states: [&'a State; 3],
    /// Required forces of feet in swing, `[timeline sample][end effector]`, N. Empty if all are zero.
    pub swing_force_n: &'a [Vec<Vector3<f64>>],
    /// Torques of the motors of joints at the middle sample, N·m. Several families limit them.
    pub motor_torques_nm: Vec<OnceCell<f64>>,
}

impl<'a> Window<'a> {
    /// Creates a window around the middle one of three timeline samples.
    pub fn new(
        problem: &'a Problem,
        at: [usize; 3],
        states: &'a [State],
        swing_force_n: &'a [Vec<Vector3<f64>>],
    ) -> Self {
        let motor_torques_nm = vec![OnceCell::new(); problem.model.robot().joints.len()];
        Self { problem, at, states: at.map(|t| &states[t]), swing_force_n, motor_torques_nm }
    }

    /// Contact flag of end effector `j` in sample `k` of the window.
    pub fn stance(&self, k: usize, j: usize) -> bool {
        self.problem.stance[self.at[k]][j]
    }
}

#[cfg(test)]
mod tests;
