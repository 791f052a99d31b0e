//! Prices of the times of a motion: changes of the costs of the best plan per second, from the multipliers.
//!
//! The costs of the best plan change with the spacing h as the energy does at fixed unknowns and multipliers (envelope theorem).
//! No further solve is needed, but accurate multipliers are: a solve ends when its costs are flat, where prices may still be off
//! by a factor of ten. Only an [`Optimal`] has prices.
//!
//! The price of a single interval needs the derivatives with respect to its own length. Rows of a non-uniform grid are
//! functions of the differences (x₊ − x)/h₊ and (x − x₋)/h₋ and of the mean (h₋ + h₊)/2. A longer interval therefore acts like
//! a neighbour that is nearer by the same factor, and half of what remains of ∂E/∂h belongs to either interval. Means of forces
//! have the weights h₋/6h̄, 1 − (h₋ + h₊)/6h̄ and h₊/6h̄ with the mean h̄ of the intervals.

use super::Optimal;
use crate::formulation::rows::{Columns, Role, Row, Rows};
use crate::formulation::{Span, System, TERMS};
use crate::motion::Motion;
use crate::problem::{Problem, Unknowns};
use crate::solve::normal::row_energy;
use nalgebra::DVector;

/// Relative change of the spacing in the difference quotient. Energies are smooth in the spacing, and their rounding errors
/// are 1e-16.
const STEP: f64 = 1e-5;

/// Costs of a plan and prices of its times.
#[derive(Clone, Debug, PartialEq)]
pub struct TimingPrices {
    /// Sum of the costs.
    pub cost: f64,
    /// Change of the costs per second of the whole duration, if all intervals change by the same factor.
    pub duration_per_s: f64,
    /// Change of the costs per second of each interval. Their mean is [`Self::duration_per_s`].
    pub interval_per_s: Vec<f64>,
}

impl TimingPrices {
    /// Computes the prices at a point with its rows and multipliers.
    fn at(
        system: &System<'_>,
        here: &Problem,
        motion: &Motion,
        unknowns: &Unknowns,
        rows: &Rows,
        shifts: &[f64],
    ) -> Self {
        let near = [1.0 + STEP, 1.0 - STEP].map(|factor| {
            let motion = motion.stretched(factor * motion.duration_s);
            let other = Problem::new(here.model.clone(), &motion, here.weights.clone());
            System::selected(&other, Default::default()).values(unknowns, Rows::default())
        });
        let costs = rows.iter().filter(|(row, _)| matches!(row.role, Role::Cost { .. }));
        let cost = costs.map(|(row, value)| row_energy(row, value, 0.0, system.penalty())[0]).sum();
        let (h, intervals) = (here.interval_s, here.last() - 1);
        let neighbours = Neighbours::new(here, system.columns(), unknowns);
        let mut interval_per_s = vec![0.0; intervals];
        for (index, row) in rows.rows.iter().enumerate() {
            let [ahead, behind] = near.each_ref().map(|near| {
                let (row, value) = (&near.rows[index], near.values[index]);
                row_energy(row, value, shifts[index], system.penalty())[0]
            });
            let by_spacing = (ahead - behind) / (2.0 * STEP * h);
            let mut add = |interval: usize, part: f64| {
                interval_per_s[interval_index(here, interval)] += part;
            };
            if is_of_interval(row) {
                add(row.at, by_spacing);
                continue;
            }
            let slope = row_energy(row, rows.values[index], shifts[index], system.penalty())[1];
            let [before, after] = neighbours.parts(rows, row).map(|part| slope * part);
            let rest = 0.5 * (by_spacing - before - after);
            add(row.at - 1, before + rest);
            add(row.at, after + rest);
        }
        let duration_per_s = interval_per_s.iter().sum::<f64>() / intervals as f64;
        Self { cost, duration_per_s, interval_per_s }
    }
}

impl Optimal {
    /// Returns the prices of the motion's times.
    pub fn timing_prices(&self) -> TimingPrices {
        let Self { problem, motion, unknowns, shifts, .. } = self;
        let system = System::selected(problem, Default::default());
        let rows = system.rows(unknowns, Rows::default());
        TimingPrices::at(&system, problem, motion, unknowns, &rows, shifts)
    }
}

/// True for rows that depend on the interval after their sample only.
fn is_of_interval(row: &Row) -> bool {
    let of_family = TERMS.iter().find(|term| term.info().family == row.family);
    of_family.is_some_and(|term| term.info().span == Span::Intervals)
}

/// Index of the interval after timeline sample `t`. Before the first sample of a period, this is the last interval of the period;
/// beyond an end at rest, the nearest interval.
fn interval_index(problem: &Problem, t: usize) -> usize {
    let intervals = problem.last() - 1;
    if problem.periodic { (t + intervals - 1) % intervals } else { t.clamp(1, intervals) - 1 }
}

/// Effect of longer intervals on rows, as changes of the neighbouring samples.
struct Neighbours<'a> {
    problem: &'a Problem,
    /// Slot and variable of every column.
    of_column: Vec<(usize, usize)>,
    /// Change of every slot that acts like a longer interval before its sample on rows of the previous sample, per second.
    nearer_before: Vec<DVector<f64>>,
    /// Change of every slot that acts like a longer interval after its sample on rows of the next sample, per second.
    nearer_after: Vec<DVector<f64>>,
    /// Half of the sums of forces and moments of every slot, over the spacing.
    wrench: Vec<DVector<f64>>,
}

impl<'a> Neighbours<'a> {
    fn new(problem: &'a Problem, columns: &Columns, unknowns: &Unknowns) -> Self {
        let (layout, h) = (&problem.layout, problem.interval_s);
        let mut of_column = vec![(usize::MAX, 0); columns.count];
        for (slot, of_slot) in columns.of_slot.iter().enumerate() {
            for (variable, column) in of_slot.iter().enumerate() {
                if let Some(column) = column {
                    of_column[*column] = (slot, variable);
                }
            }
        }
        let lifted = |t: usize| {
            let sample = problem.timeline[t];
            sample.lift.apply(layout, &unknowns.slots[sample.slot], &unknowns.placement)
        };
        let forces = layout.vectors().flat_map(|k| k..k + 3);
        let speeds = layout.end_effectors.iter().filter_map(|ee| ee.wheel.map(|w| w.speed));
        // Forces and wheel speeds are not differentiated in time.
        let still: Vec<usize> = forces.chain(speeds).collect();
        let rate = |t: usize| {
            let mut change = (lifted(t + 1) - lifted(t)) / h;
            still.iter().for_each(|&k| change[k] = 0.0);
            change.component_div_assign(&layout.scale);
            change
        };
        let slots = 0..unknowns.slots.len();
        let nearer_before = slots.clone().map(|slot| -rate(slot)).collect();
        let nearer_after = slots.clone().map(|slot| rate(slot + 1)).collect();
        let wrench = |slot: usize| {
            let mut half = DVector::zeros(layout.len);
            let sums = unknowns.slots[slot].rows(layout.wrench, 6) / (2.0 * h);
            half.rows_mut(layout.wrench, 6).copy_from(&sums);
            half.component_div_assign(&layout.scale);
            half
        };
        let wrench = slots.map(wrench).collect();
        Self { problem, of_column, nearer_before, nearer_after, wrench }
    }

    /// Changes of the value of a row per second by which the intervals before and after its sample become longer.
    fn parts(&self, rows: &Rows, row: &Row) -> [f64; 2] {
        let slot_of = |t: usize| self.problem.timeline[t].slot;
        let [before, own, after] = [row.at - 1, row.at, row.at + 1].map(slot_of);
        let has_both = before != own && after != own;
        let mut parts = [0.0; 2];
        for k in row.entries.clone() {
            let (slot, variable) = self.of_column[rows.columns[k]];
            let derivative = rows.derivatives[k];
            if slot == before && slot != own {
                parts[0] += derivative * self.nearer_after[slot][variable];
            } else if slot == after && slot != own {
                parts[1] += derivative * self.nearer_before[slot][variable];
            }
            if has_both && (slot == before || slot == after) {
                let mean = derivative * self.wrench[slot][variable];
                let mean = if slot == after { mean } else { -mean };
                parts[0] -= mean;
                parts[1] += mean;
            }
        }
        parts
    }
}
