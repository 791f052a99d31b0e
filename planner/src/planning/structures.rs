//! Structures of recent solves, for solves of the same pattern.
//!
//! Half of the time of a re-plan would go into the sparsity pattern of the constraints, the elimination order and fresh memory.
//! Goals, durations, limits and dimensions change none of them. Results do not depend on what is kept, to the last digit.

use crate::formulation::rows::Rows;
use crate::formulation::{Selection, Structure, System};
use crate::problem::{Problem, Unknowns};
use crate::solve::Point;
use crate::solve::normal::NormalEquations;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Number of structures that are kept. Each takes some megabytes.
const MOST: usize = 4;

/// Structures of recent solves. Clones share them, also between threads.
#[derive(Clone, Default)]
pub struct Structures(Arc<Mutex<Vec<SolveStructure>>>);

/// Structure of a completed solve, with its memory.
struct SolveStructure {
    structure: Structure,
    normal: NormalEquations,
    rows: Rows,
}

/// System at a starting point, with its normal equations.
pub(super) struct Prepared<'a> {
    pub system: System<'a>,
    pub point: Point,
    pub normal: NormalEquations,
    /// True if the structure is that of an earlier solve. It may turn out not to fit ([`System::fits`]).
    pub is_kept: bool,
}

impl Structures {
    /// Prepares the solve of all rows of a problem. With `fresh`, kept structures are not used.
    pub(super) fn prepare<'a>(
        &self,
        problem: &'a Problem,
        unknowns: Unknowns,
        fresh: bool,
    ) -> Prepared<'a> {
        let kept = if fresh { None } else { self.take(problem) };
        let known = kept.and_then(|SolveStructure { structure, normal, rows }| {
            let (system, rows) = System::again(problem, &unknowns, structure, rows)?;
            Some((system, rows, normal))
        });
        let is_kept = known.is_some();
        let (system, rows, normal) = known.unwrap_or_else(|| {
            let system = System::selected(problem, Selection::default());
            let rows = system.rows(&unknowns, Rows::default());
            let normal = NormalEquations::new(&rows, system.columns());
            (system, rows, normal)
        });
        Prepared { system, point: Point { unknowns, rows }, normal, is_kept }
    }

    /// Keeps the structure of a completed solve.
    pub(super) fn keep(&self, system: System<'_>, mut normal: NormalEquations, rows: Rows) {
        if !system.fits() {
            return;
        }
        normal.reset(&rows);
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.insert(0, SolveStructure { structure: system.into_structure(), normal, rows });
        kept.truncate(MOST);
    }

    fn take(&self, problem: &Problem) -> Option<SolveStructure> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let at = kept.iter().position(|kept| kept.structure.may_fit(problem))?;
        Some(kept.remove(at))
    }
}

/// Equal in every case, because the stored structures do not affect results.
impl PartialEq for Structures {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Structures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Structures").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests;
