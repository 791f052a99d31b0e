//! Residual rows with exact sparse derivatives: terms write them and the solver reads them.
//!
//! Terms differentiate with respect to the timeline samples in their window. [`RowWriter`] converts these derivatives
//! to derivatives with respect to the unknowns, through placements and frozen entries, and sums those in the same
//! column, so that terms contain no bookkeeping. The pattern of a problem never changes: every call writes the same
//! rows with the same columns.

mod writer;

pub use writer::{Pattern, RowWriter, Wanted};

use crate::families::Family;
use crate::motion;
use crate::problem::state::State;
use crate::problem::{Problem, Unknowns};
use nalgebra::Vector3;
use rollwalk_robot::Robot;
use std::mem::discriminant;
use std::sync::Arc;

/// Columns of the unknowns: free entries of all slots, then Dx, Dy, ψ.
#[derive(Clone, Debug, PartialEq, Eq)]
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
    /// A link.
    Link(usize),
    /// Two links.
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

/// Residual with its scale, tolerance and role.
#[derive(Clone, Debug, PartialEq)]
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
    /// Tolerance, in the family's unit.
    pub level: f64,
    /// Role in the energy.
    pub role: Role,
    /// Range of its derivatives in [`Rows::columns`] and [`Rows::derivatives`].
    pub entries: std::ops::Range<usize>,
}

impl Row {
    /// True if the row takes part in the energy when it is shifted by its multiplier.
    pub fn counts(&self, shift: f64) -> bool {
        match self.role {
            Role::Inequality { band } => self.value + shift > -band,
            Role::Equality | Role::Cost { .. } => true,
        }
    }

    /// True if the rows differ in numbers only.
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
    /// The rows.
    pub rows: Vec<Row>,
    /// Columns of all derivatives, shared by all rows of one system.
    pub columns: Arc<[usize]>,
    /// Derivatives of scaled residuals with respect to scaled unknowns; undefined for rows without.
    pub derivatives: Vec<f64>,
    /// Rows that have derivatives.
    pub differentiated: Differentiated,
    /// The timeline at the point.
    pub(super) states: Vec<State>,
}

/// Rows that have derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Differentiated {
    /// Empty set: only values are known.
    #[default]
    None,
    /// Rows that count with the multipliers of the differentiation.
    Counting,
    /// Full set.
    All,
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

#[cfg(test)]
mod tests;
