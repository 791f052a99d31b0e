//! Formulation: the constraints and objectives in E(m). Read it after [`crate::families`].
//!
//! With multipliers as shifts s, penalty ρ and ψ_ε of Eq. 2.16, over all rows r (divided by their scales):
//!
//! ```text
//! E(m) = Σ_equalities ρ (r + s)²  +  Σ_inequalities ρ ψ_ε(r + s)  +  Σ_costs w r²
//! ```
//!
//! [`TERMS`] lists the constraints, then the costs. Each term is a file in `formulation/terms/` with its equation, and writes
//! the rows of one family. [`crate::families`] is the table of their names, equations, units and levels.
//!
//! Equations 2.11 and 2.12 (centre of mass, body orientation) are satisfied by elimination. Periodic, at-rest and prescribed
//! ends follow from the construction of the timeline ([`crate::problem::variables`]).

pub mod rows;
mod term;
pub mod terms;

pub use term::{Span, Term, TermInfo};
pub(crate) use terms::LEAN;

use crate::families::FamilySet;
use crate::problem::variables::TimelineSample;
use crate::problem::{Problem, Unknowns};
use nalgebra::Vector3;
use rows::{Columns, DifferentiatedRows, Evaluation, Pattern, Row, RowWriter, Rows, Window};
use std::cell::{Cell, OnceCell};
use terms::{
    Anchor, BladeContact, Collision, ContactHeight, ContactPoint, Displacement, DynamicsAngular,
    DynamicsLinear, EndLean, EvenForce, Foothold, Friction, GroundClearance, HeightBound,
    JointLimit, JointSpeed, JointTorque, LiftOffSlip, LinkClearance, NoSlip, ObstacleClearance,
    PassiveJoint, Posture, Smoothness, Steering, SwingClearance, SwingForce, TargetHeading,
    TargetPosition, TargetVelocity, TorqueSpeed, Traction, Turn, WheelAxis, WheelEffort, WheelHeld,
    WheelSmoothness, WheelSpeed, WheelTorque,
};

/// Terms of the formulation.
pub static TERMS: &[&dyn Term] = &[
    &DynamicsLinear,
    &DynamicsAngular,
    &Friction,
    &Traction,
    &SwingForce,
    &NoSlip,
    &ContactHeight,
    &Collision,
    &LinkClearance,
    &GroundClearance,
    &WheelAxis,
    &ContactPoint,
    &BladeContact,
    &WheelHeld,
    &JointLimit,
    &JointSpeed,
    &WheelSpeed,
    &JointTorque,
    &PassiveJoint,
    &WheelTorque,
    &TorqueSpeed,
    &Anchor,
    &Displacement,
    &Turn,
    &TargetPosition,
    &TargetVelocity,
    &TargetHeading,
    &HeightBound,
    &Smoothness,
    &EvenForce,
    &Posture,
    &EndLean,
    &WheelEffort,
    &WheelSmoothness,
    &Steering,
    &LiftOffSlip,
    &Foothold,
    &SwingClearance,
    &ObstacleClearance,
];

/// Returns true if a term with this span has rows for the window around timeline sample `t`.
fn covers(problem: &Problem, span: Span, t: usize) -> bool {
    match span {
        Span::Samples => t <= problem.samples,
        Span::Intervals => t < problem.last(),
        Span::Ends => false,
    }
}

/// Selection of rows, and required forces of feet in swing.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// Families of the selected rows.
    pub families: FamilySet,
    /// Required forces of feet in swing, `[timeline sample][end effector]`, N. Empty if all are zero.
    pub swing_force_n: Vec<Vec<Vector3<f64>>>,
}

impl Default for Selection {
    fn default() -> Self {
        Self { families: FamilySet::ALL, swing_force_n: Vec::new() }
    }
}

/// Rows of a problem as functions of its unknowns, the interface to solvers.
pub struct System<'a> {
    problem: &'a Problem,
    selection: Selection,
    columns: Columns,
    /// Pattern of the rows, set by their first evaluation.
    pattern: OnceCell<Pattern>,
    fits: Cell<bool>,
}

/// Structure shared by systems whose problems differ in values only.
#[derive(Clone, Debug)]
pub struct Structure {
    pattern: Pattern,
    /// Slots of the timeline, which map derivatives to columns.
    timeline: Vec<TimelineSample>,
    /// Contact flags, `[timeline sample][end effector]`. They determine the rows of the system.
    stance: Vec<Vec<bool>>,
    columns: Columns,
}

impl Structure {
    /// Returns true if a problem may have this structure. [`System::again`] decides, from the rows of the problem.
    pub fn may_fit(&self, problem: &Problem) -> bool {
        self.timeline == problem.timeline
            && self.stance == problem.stance
            && self.columns == Columns::new(problem)
    }
}

impl<'a> System<'a> {
    /// Creates the system of the whole problem.
    #[cfg(test)]
    pub fn new(problem: &'a Problem) -> Self {
        Self::selected(problem, Selection::default())
    }

    /// Creates the system of selected rows.
    pub fn selected(problem: &'a Problem, selection: Selection) -> Self {
        let columns = Columns::new(problem);
        Self { problem, selection, columns, pattern: OnceCell::new(), fits: Cell::new(true) }
    }

    /// Creates the system of all rows of a problem with the structure of another problem. Returns the system and the values of
    /// its rows at a point, or `None` if its rows differ.
    ///
    /// `reuse` contains the rows of the other problem. A difference in the unknowns of a row is only detected when the rows are
    /// differentiated ([`fits`](Self::fits)).
    pub fn again(
        problem: &'a Problem,
        unknowns: &Unknowns,
        structure: Structure,
        reuse: Rows,
    ) -> Option<(Self, Rows)> {
        if !structure.may_fit(problem) {
            return None;
        }
        let (system, pattern) = (Self::selected(problem, Selection::default()), structure.pattern);
        let rows = system.evaluate(unknowns, Some(&pattern), Evaluation::Again, reuse);
        system.fits().then_some((system, rows))
    }

    /// Returns true if all rows and derivatives so far match the initial pattern. Otherwise they are invalid.
    pub fn fits(&self) -> bool {
        self.fits.get()
    }

    /// Returns the structure for reuse by another problem. The rows of this system must have been evaluated.
    pub fn into_structure(self) -> Structure {
        let pattern = self.pattern.into_inner().unwrap_or_default();
        let (timeline, stance) = (self.problem.timeline.clone(), self.problem.stance.clone());
        Structure { pattern, timeline, stance, columns: self.columns }
    }

    /// Returns the columns of the unknowns.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Returns the length of q, the first variables of a sample.
    pub fn dofs(&self) -> usize {
        self.problem.layout.dofs
    }

    /// Returns the penalty of every constraint.
    pub fn penalty(&self) -> f64 {
        self.problem.weights.penalty
    }

    /// Returns the unknowns after a step in scaled variables.
    pub fn moved(&self, from: &Unknowns, step: &[f64]) -> Unknowns {
        let mut unknowns = from.clone();
        self.columns.add_step(self.problem, &mut unknowns, step);
        unknowns
    }

    /// Computes residuals and Jacobian of every term. The memory of `reuse`, an earlier result, is reused.
    pub fn rows(&self, unknowns: &Unknowns, reuse: Rows) -> Rows {
        self.evaluate(unknowns, self.pattern.get(), Evaluation::All, reuse)
    }

    /// Computes the residuals of every term. Derivatives may be missing.
    pub fn values(&self, unknowns: &Unknowns, reuse: Rows) -> Rows {
        self.evaluate(unknowns, self.pattern.get(), Evaluation::Values, reuse)
    }

    /// Differentiates the rows that contribute to the energy, at the point `unknowns` with the multipliers `shifts`.
    pub fn differentiate(&self, unknowns: &Unknowns, rows: &mut Rows, shifts: &[f64]) {
        let counts = |((row, value), shift): ((&Row, f64), &f64)| row.counts(value + shift);
        let counts: Vec<bool> = rows.iter().zip(shifts).map(counts).collect();
        self.differentiate_some(unknowns, rows, &counts);
    }

    /// Differentiates at least the rows whose flags in `wanted` are set, at the point `unknowns`.
    pub fn differentiate_some(&self, unknowns: &Unknowns, rows: &mut Rows, wanted: &[bool]) {
        if rows.differentiated != DifferentiatedRows::All {
            let values = std::mem::take(rows);
            let wanted = Evaluation::Derivatives(wanted);
            *rows = self.evaluate(unknowns, self.pattern.get(), wanted, values);
        }
    }

    fn evaluate(
        &self,
        unknowns: &Unknowns,
        known: Option<&Pattern>,
        wanted: Evaluation<'_>,
        mut reuse: Rows,
    ) -> Rows {
        let Self { problem, selection, columns, pattern, fits } = self;
        let known_states = std::mem::take(&mut reuse.states);
        let mut states = match wanted {
            Evaluation::Derivatives(_) => known_states,
            Evaluation::Values | Evaluation::All | Evaluation::Again => {
                problem.states_in(unknowns, known_states)
            }
        };
        let wanted = if known.is_some() { wanted } else { Evaluation::All };
        if matches!(wanted, Evaluation::All | Evaluation::Derivatives(_)) {
            problem.differentiate(&mut states);
        }
        let mut out = RowWriter::new(problem, columns, unknowns, &states, known, wanted, reuse);
        let window = |at| Window::new(problem, at, &states, &selection.swing_force_n);
        let mut write = |term: &dyn Term, window: &Window<'_>| {
            out.enter(term.info().family, window.at);
            term.write(window, &mut out);
        };
        let active = || TERMS.iter().filter(|term| selection.families.contains(term.info().family));
        // Window by window, so that the part of the normal equations for the rows of a window stays in cache.
        for t in 1..states.len() - 1 {
            let window = window([t - 1, t, t + 1]);
            for term in active().filter(|term| covers(problem, term.info().span, t)) {
                write(*term, &window);
            }
        }
        let ends = window([0, 1, problem.last()]);
        for term in active().filter(|term| term.info().span == Span::Ends) {
            write(*term, &ends);
        }
        fits.set(fits.get() && out.fits());
        let (rows, found) = out.finish();
        if let Some(found) = found {
            pattern.get_or_init(|| found);
        }
        Rows { states, ..rows }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::{Family, Kind};

    #[test]
    fn every_family_but_checks_has_one_term_in_the_order_of_the_catalogue() {
        let of_terms: Vec<Family> = TERMS.iter().map(|term| term.info().family).collect();
        let solved = |family: &Family| family.kind() != Kind::Check;
        let of_catalogue: Vec<Family> = Family::ALL.iter().copied().filter(solved).collect();
        assert_eq!(of_terms, of_catalogue);
    }
}
