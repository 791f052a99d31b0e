//! Adjoint method: derivatives of one scalar with respect to all parameters, from the final step to the first.

use crate::sensitivity::parameter::Start;
use crate::sensitivity::record::{Layout, Part, Rollout};
use crate::sensitivity::{Residual, Variation};
use nalgebra::Vector3;

/// Derivatives of the objective with respect to motions and displacements, propagated backward step by step.
struct Backward<'a> {
    layout: &'a Layout,
    /// Derivatives with respect to poses, then rates, at the end of the present step.
    by_now: Vec<f64>,
    /// Derivatives with respect to poses, then rates, at the beginning of the step.
    by_last: Vec<f64>,
    /// Derivatives with respect to poses, then rates, one step earlier.
    by_before: Vec<f64>,
    /// Derivatives with respect to the displacements of the step; later the adjoint variables μ.
    by_moved: Vec<f64>,
    /// Derivatives with respect to the displacements of the previous step.
    by_moved_before: Vec<f64>,
}

impl Rollout {
    /// Derivatives of a scalar with respect to all parameters. `by` lists the derivatives of the scalar with respect to
    /// motions, as step, body and derivative.
    ///
    /// # Panics
    /// If the Newton matrix of a step is singular.
    pub fn adjoint<'b>(
        &self,
        by: impl IntoIterator<Item = (usize, usize, &'b Variation)>,
    ) -> Vec<f64> {
        let layout = &self.layout;
        let size = layout.size();
        let mut at_step: Vec<Vec<(usize, &Variation)>> = vec![Vec::new(); self.steps() + 1];
        for (step, body, by) in by {
            at_step[step].push((body, by));
        }
        let mut matrix = layout.matrix();
        let mut gradient = vec![0.0; self.parameters()];
        let mut backward = Backward {
            layout,
            by_now: vec![0.0; 2 * size],
            by_last: vec![0.0; 2 * size],
            by_before: vec![0.0; 2 * size],
            by_moved: vec![0.0; size],
            by_moved_before: vec![0.0; size],
        };
        for step in (1..=self.steps()).rev() {
            backward.add(&at_step[step]);
            let begin = if step == 1 { 0 } else { self.ends[step - 2] };
            for part in self.parts[begin..self.ends[step - 1]].iter().rev() {
                backward.motions(part);
                assert!(matrix.factorise(&part.matrix), "the step was solved");
                matrix.solve_transposed(&mut backward.by_moved);
                backward.residual(part, &mut gradient);
            }
        }
        backward.add(&at_step[0]);
        for (derivative, start) in gradient.iter_mut().zip(&self.starts) {
            let [now, before, moved] = layout.stacked(start);
            let product = |one: &[f64], other: &[f64]| -> f64 {
                one.iter().zip(other).map(|(one, other)| one * other).sum()
            };
            *derivative += product(&now, &backward.by_now)
                + product(&before, &backward.by_last)
                + product(&moved, &backward.by_moved);
        }
        gradient
    }

    /// Gradient of half the sum of squared residuals, by the adjoint method.
    pub fn gradient(&self, residuals: &[Residual]) -> Vec<f64> {
        let scaled: Vec<_> = (residuals.iter())
            .flat_map(|residual| {
                residual.by.iter().map(|(step, body, by)| (*step, *body, by.scaled(residual.value)))
            })
            .collect();
        self.adjoint(scaled.iter().map(|(step, body, by)| (*step, *body, by)))
    }
}

impl Layout {
    /// Vectors of the initial derivatives with respect to one parameter: motions, motions one step earlier, and displacements.
    pub fn stacked(&self, start: &Start) -> [Vec<f64>; 3] {
        let size = self.size();
        let parts =
            |first: usize, body: usize, to: &mut [f64], one: &Vector3<f64>, two: &Vector3<f64>| {
                to[first..first + 3].copy_from_slice(one.as_slice());
                if self.turns(body) {
                    to[first + 3..first + 6].copy_from_slice(two.as_slice());
                }
            };
        let motions = |of: &[Variation]| {
            let mut all = vec![0.0; 2 * size];
            for (body, by) in of.iter().enumerate() {
                let first = self.firsts[body];
                parts(first, body, &mut all, &by.shift, &by.turn);
                parts(size + first, body, &mut all, &by.velocity, &by.spin);
            }
            all
        };
        let mut moved = vec![0.0; size];
        for (body, by) in start.moved.iter().enumerate() {
            parts(self.firsts[body], body, &mut moved, &by.shift, &by.turn);
        }
        [motions(&start.now), motions(&start.last), moved]
    }
}

impl Backward<'_> {
    fn add(&mut self, by: &[(usize, &Variation)]) {
        let size = self.layout.size();
        for &(body, by) in by {
            let first = self.layout.firsts[body];
            let mut add = |begin: usize, part: &Vector3<f64>| {
                self.by_now[begin..begin + 3]
                    .iter_mut()
                    .zip(part)
                    .for_each(|(to, part)| *to += part);
            };
            add(first, &by.shift);
            add(size + first, &by.velocity);
            if self.layout.turns(body) {
                add(first + 3, &by.turn);
                add(size + first + 3, &by.spin);
            }
        }
    }

    /// Maps derivatives with respect to motions at the end of a step to displacements in the step and motions at its beginning.
    fn motions(&mut self, part: &Part) {
        let size = self.layout.size();
        let (poses, rates) = self.by_now.split_at(size);
        for (body, turn) in part.turns.iter().enumerate() {
            let first = self.layout.firsts[body];
            for k in first..first + 3 {
                self.by_moved[k] += poses[k] + rates[k] * part.gain;
                self.by_moved_before[k] -= rates[k] * part.share;
                self.by_last[k] += poses[k];
            }
            if self.layout.turns(body) {
                let begin = first + 3;
                let of = |from: &[f64]| Vector3::from_column_slice(&from[begin..begin + 3]);
                let (turned, spin) = (of(poses), of(rates));
                let add = |to: &mut [f64], part: &Vector3<f64>| {
                    to[begin..begin + 3].iter_mut().zip(part).for_each(|(to, part)| *to += part);
                };
                add(
                    &mut self.by_moved,
                    &(turn.turn_by_phi.tr_mul(&turned) + turn.spin_by_phi.tr_mul(&spin)),
                );
                add(&mut self.by_moved_before, &(turn.turn_by_phi.tr_mul(&spin) * -part.share));
                add(&mut self.by_last, &turn.carried.tr_mul(&turned));
            }
        }
    }

    /// Maps derivatives through the residual of a step to parameters and earlier motions. `by_moved` contains μ.
    fn residual(&mut self, part: &Part, gradient: &mut [f64]) {
        let mu = &self.by_moved;
        for entry in &part.columns {
            gradient[entry.parameter as usize] -= entry.value * mu[entry.row as usize];
        }
        part.by_last.subtract_transposed(mu, &mut self.by_last);
        if let Some((by_before, by_moved)) = &part.by_before {
            by_before.subtract_transposed(mu, &mut self.by_before);
            by_moved.subtract_transposed(mu, &mut self.by_moved_before);
        }
        std::mem::swap(&mut self.by_now, &mut self.by_last);
        std::mem::swap(&mut self.by_last, &mut self.by_before);
        self.by_before.fill(0.0);
        std::mem::swap(&mut self.by_moved, &mut self.by_moved_before);
        self.by_moved_before.fill(0.0);
    }
}
