//! Factorisation along the timeline, compared with a dense one, for timelines of every shape.

use super::*;
use crate::families::Family;
use crate::formulation::rows::{Role, Row, Subject};
use crate::test_robots::uniform;
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

/// Shape of a timeline, which depends on the ends of the motion.
#[derive(Clone, Copy, Debug)]
enum Shape {
    /// The last slot is before the first, and a placement is free.
    Periodic,
    AtRest,
    /// Slots at both ends are frozen except for their last variables, and a placement is free.
    Transition,
}

struct Timeline {
    shape: Shape,
    slots: usize,
    /// Number of variables of a slot.
    variables: usize,
    /// Number of local variables, the last ones of a slot. Rows couple them with any of the neighbours, but not with each other
    /// across slots.
    local: usize,
}

impl Timeline {
    fn columns(&self) -> Columns {
        let mut count = 0;
        let mut next = || {
            count += 1;
            count - 1
        };
        let frozen = |slot: usize, variable: usize| {
            let end = slot == 0 || slot + 1 == self.slots;
            matches!(self.shape, Shape::Transition) && end && variable < self.variables - self.local
        };
        let of_slot = |slot| -> Vec<Option<usize>> {
            (0..self.variables).map(|v| (!frozen(slot, v)).then(&mut next)).collect()
        };
        let of_slot = (0..self.slots).map(of_slot).collect();
        let placement = !matches!(self.shape, Shape::AtRest);
        let placement = placement.then(|| [next(), next(), next()]);
        Columns { of_slot, placement, count }
    }

    /// Creates random rows about three consecutive slots. Each row contains about half of their columns. Rows at the seam of a
    /// periodic timeline and at the end of a transition also contain the placement.
    fn rows(&self, columns: &Columns, seed: u64) -> Rows {
        let mut random = uniform(seed);
        let mut rows = Rows::default();
        let (mut of_rows, mut of_entries) = (Vec::new(), Vec::new());
        for middle in 0..self.slots {
            for _ in 0..self.variables {
                let start = of_entries.len();
                for (k, slot) in [middle + self.slots - 1, middle, middle + 1].iter().enumerate() {
                    let inside = (1..=self.slots + self.slots).contains(&(slot + 1));
                    let wraps = !(self.slots..2 * self.slots).contains(slot) && k == 0
                        || *slot >= self.slots && k == 2;
                    let (slot, periodic) =
                        (slot % self.slots, matches!(self.shape, Shape::Periodic));
                    if !inside || wraps && !periodic {
                        continue;
                    }
                    for (variable, column) in columns.of_slot[slot].iter().enumerate() {
                        let local = variable >= self.variables - self.local;
                        let chosen = random() > 0.0 && (!local || k == 1);
                        let new = |column: &usize| !of_entries[start..].contains(column);
                        of_entries.extend(column.filter(|c| chosen && new(c)));
                    }
                }
                if middle + 1 == self.slots {
                    of_entries.extend(columns.placement.into_iter().flatten());
                }
                rows.derivatives.resize_with(of_entries.len(), &mut random);
                rows.values.push(random());
                of_rows.push(Row {
                    family: Family::Slip,
                    at: middle + 1,
                    subject: Subject::Whole,
                    scale: 1.0,
                    level: 1.0,
                    role: Role::Equality,
                    entries: start..of_entries.len(),
                });
            }
        }
        (rows.rows, rows.columns) = (of_rows.into(), of_entries.into());
        rows
    }
}

proptest! {
    #[test]
    fn it_solves_what_a_dense_factorisation_solves(
        shape in prop::sample::select(vec![Shape::Periodic, Shape::AtRest, Shape::Transition]),
        slots in 1..9usize,
        variables in 1..8usize,
        local in 0..4usize,
        seed: u64,
    ) {
        let timeline = Timeline { shape, slots, variables, local: local.min(variables) };
        let columns = timeline.columns();
        let rows = timeline.rows(&columns, seed);
        let counts = vec![true; rows.rows.len()];
        let locals = Locals::new(&rows, &columns);
        let mut fronts = Fronts::new(&rows, &counts, &columns, &locals);
        let mut panels = vec![0.0; fronts.len()];
        let mut dense = DMatrix::<f64>::zeros(columns.count, columns.count);
        for row in rows.rows.iter() {
            let derivatives = &rows.derivatives[row.entries.clone()];
            let of_row = &rows.columns[row.entries.clone()];
            let places = fronts.scatter_map(&[of_row]).expect("fronts have room for their rows");
            fronts.add(&places, &[(derivatives, Some(2.0))], &mut panels, &mut Vec::new());
            for (one, d) in of_row.iter().zip(derivatives) {
                for (other, e) in of_row.iter().zip(derivatives) {
                    dense[(*one, *other)] += 2.0 * d * e;
                }
            }
        }
        let damping = 0.1;
        prop_assert!(fronts.factorise(&panels, damping).is_some());
        let mut random = uniform(seed ^ 1);
        let wanted = DVector::from_fn(columns.count, |_, _| random());
        let right = &dense * &wanted + &wanted * damping;
        let mut solution: Vec<f64> = right.iter().copied().collect();
        fronts.solve(&mut solution);
        // Condition numbers are below 1e4: the largest of these matrices have norms of some hundred.
        let error = (DVector::from_vec(solution) - &wanted).norm();
        prop_assert!(error < 1e-10 * wanted.norm(), "{error}");

        // A matrix that is not positive definite is refused, and the next matrix is factorised nevertheless.
        prop_assert!(fronts.factorise(&panels, -1e3).is_none());
        prop_assert!(fronts.factorise(&panels, damping).is_some());
        let mut again: Vec<f64> = right.iter().copied().collect();
        fronts.solve(&mut again);
        prop_assert!((DVector::from_vec(again) - &wanted).norm() < 1e-10 * wanted.norm());
    }
}
