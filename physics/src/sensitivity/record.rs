//! Recording of rollouts during simulation: the derivatives of each step's residual.

use crate::body::Body;
use crate::force::{Derivative, StickingFriction, View, Wrench};
use crate::matrix::BlockMatrix;
use crate::motion::{BodyMotion, Displacement, TrialMotion};
use crate::newton::Newton;
use crate::report::StepReport;
use crate::residual::{Equations, Step};
use crate::rotation::Increment;
use crate::sensitivity::parameter::{Column, Parameter, SolvedStep, Start};
use crate::sensitivity::rows::Rows;
use crate::sticking::Sticking;
use crate::system::{Observer, StepError, System};
use nalgebra::{Matrix3, Matrix6, Vector3};
use std::collections::BTreeMap;

/// Stiffness of held contacts of rigid bodies in derivatives, relative to the stiffness in the solver. A body held at many
/// points is overdetermined, and a much larger stiffness would hold contacts that the solver releases.
const HARDER: f64 = 100.0;

/// Relative excess over the friction limit that derivatives assume for friction at its limit, so that the contact counts as
/// sliding.
const BEYOND: f64 = 1e-6;

/// Record of a step, or of a substep of a halved step.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Values of the Newton matrix B.
    pub matrix: Vec<f64>,
    /// Matrix P of derivatives with respect to the motions at the beginning, poses first.
    pub by_last: Rows,
    /// Matrices Q and N of derivatives with respect to the motions one step earlier and the displacements since then. `None`
    /// for backward Euler.
    pub by_before: Option<(Rows, Rows)>,
    pub turns: Vec<Turn>,
    /// Weight g, 1/s.
    pub gain: f64,
    /// Weight s, 1/s.
    pub share: f64,
    /// Columns of ∂r/∂p, by parameter.
    pub columns: Vec<Entry>,
}

/// Propagation of a body's turn over a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    /// Rotation Exp(φ).
    pub carried: Matrix3<f64>,
    /// Left Jacobian J_l(φ).
    pub turn_by_phi: Matrix3<f64>,
    pub spin_by_phi: Matrix3<f64>,
}

/// Entry of a derivative with respect to a parameter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub parameter: u32,
    pub row: u32,
    pub value: f64,
}

/// Simulated rollout, with the records for its derivatives.
#[derive(Debug)]
pub struct Rollout {
    pub(super) layout: Layout,
    pub(super) parameters: Vec<Box<dyn Parameter>>,
    pub(super) starts: Vec<Start>,
    pub(super) parts: Vec<Part>,
    /// Number of records at the end of each step.
    pub(super) ends: Vec<usize>,
    masses_kg: Vec<f64>,
    motions: Vec<Vec<BodyMotion>>,
    times_s: Vec<f64>,
    reports: Vec<StepReport>,
}

/// Unknowns of the bodies, and pattern of the matrix.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    unknowns: Vec<usize>,
    pub firsts: Vec<usize>,
    /// Row and column of each block, ordered by row.
    pairs: Vec<(usize, usize)>,
}

impl Layout {
    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.firsts[self.unknowns.len()]
    }

    pub fn matrix(&self) -> BlockMatrix {
        BlockMatrix::new(&self.unknowns, self.pairs.iter().copied())
    }

    /// Returns true if a body has rotation unknowns.
    pub fn turns(&self, body: usize) -> bool {
        self.unknowns[body] == 6
    }
}

impl Rollout {
    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.ends.len()
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.parameters.len()
    }

    /// Motions of all bodies after `step` steps; initial motions for 0.
    pub fn motions(&self, step: usize) -> &[BodyMotion] {
        &self.motions[step]
    }

    /// Masses of the bodies, kg.
    pub fn masses_kg(&self) -> &[f64] {
        &self.masses_kg
    }

    /// Time after `step` steps, s.
    pub fn time_s(&self, step: usize) -> f64 {
        self.times_s[step]
    }

    /// Reports of all steps: cost and contact events.
    pub fn reports(&self) -> &[StepReport] {
        &self.reports
    }
}

/// Recorder for the steps of a system, which stores the data for derivatives with respect to parameters.
///
/// The system may be changed between steps through the methods of its forces. Changes that depend on a parameter must be part
/// of that parameter's derivatives.
#[derive(Debug)]
pub struct Recorder {
    rollout: Rollout,
    /// Indices of each force's body pairs in the list of all pairs.
    of_force: Vec<Vec<usize>>,
    /// Index of each body's pair with itself.
    diagonal: Vec<usize>,
    matrix: BlockMatrix,
    /// Derivatives of each pair with respect to the motions at the end of the step, at its beginning, and one step earlier.
    blocks: [Vec<Derivative>; 3],
    column: Column,
    /// Time at the end of the present step, s.
    time_s: f64,
}

impl Recorder {
    /// Creates a recorder that starts at the present state of a system.
    pub fn new(system: &System, parameters: Vec<Box<dyn Parameter>>) -> Self {
        let (bodies, forces) = (system.bodies(), system.forces());
        let mut numbers: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        let of = |on: &[usize]| -> Vec<(usize, usize)> {
            on.iter().flat_map(|&i| on.iter().map(move |&j| (i, j))).collect()
        };
        let all = forces.iter().flat_map(|force| of(force.bodies()));
        numbers.extend(all.chain((0..bodies.len()).map(|k| (k, k))).map(|pair| (pair, 0)));
        numbers.values_mut().enumerate().for_each(|(number, value)| *value = number);
        let unknowns: Vec<_> = bodies.iter().map(Body::unknowns).collect();
        let mut firsts = vec![0];
        for count in &unknowns {
            firsts.push(firsts[firsts.len() - 1] + count);
        }
        let layout =
            Layout { unknowns, firsts: firsts.clone(), pairs: numbers.keys().copied().collect() };
        let starts = parameters.iter().map(|parameter| {
            let mut start = Start::new(bodies.len());
            parameter.start(system, &mut start);
            start
        });
        let starts = starts.collect();
        let number_of = |pair: &(usize, usize)| numbers[pair];
        Self {
            of_force: (forces.iter())
                .map(|force| of(force.bodies()).iter().map(number_of).collect())
                .collect(),
            diagonal: (0..bodies.len()).map(|k| numbers[&(k, k)]).collect(),
            matrix: layout.matrix(),
            blocks: [0; 3].map(|_| vec![Derivative::default(); layout.pairs.len()]),
            column: Column::new(firsts),
            time_s: system.time_s(),
            rollout: Rollout {
                layout,
                parameters,
                starts,
                parts: Vec::new(),
                ends: Vec::new(),
                masses_kg: bodies.iter().map(Body::mass_kg).collect(),
                motions: vec![system.motions().to_vec()],
                times_s: vec![system.time_s()],
                reports: Vec::new(),
            },
        }
    }

    /// Returns the rollout up to the present step.
    pub fn finish(self) -> Rollout {
        self.rollout
    }

    /// Computes the derivatives of the residual with respect to motions.
    fn derive(
        &mut self,
        step: &Step<'_>,
        motions: &[BodyMotion],
        held: &[Option<StickingFriction>],
        equations: &Equations,
    ) {
        self.blocks.iter_mut().for_each(|blocks| blocks.fill(Derivative::default()));
        let [last_gain, before_gain] = step.weights.earlier_gains();
        let gains = [step.weights.gain(), last_gain, before_gain];
        let times = [motions, step.now, step.last];
        for (k, body) in step.bodies.iter().enumerate() {
            for ((blocks, motions), gain) in self.blocks.iter_mut().zip(times).zip(gains) {
                let by = body.momentum_by(&motions[k]);
                let block = &mut blocks[self.diagonal[k]];
                block.by_pose += by.by_pose * gain;
                block.by_rate += by.by_rate * gain;
            }
        }
        let mut gathered: [Vec<BodyMotion>; 3] = Default::default();
        let mut wrenches = Vec::new();
        let mut of_force: [Vec<Derivative>; 3] = Default::default();
        let all = step.forces.iter().enumerate();
        for (k, force) in all.filter(|(k, _)| !equations.is_asleep(*k)) {
            let bodies = force.bodies();
            for (gathered, all) in gathered.iter_mut().zip(times) {
                gathered.clear();
                gathered.extend(bodies.iter().map(|&body| all[body]));
            }
            wrenches.clear();
            wrenches.resize(bodies.len(), Wrench::default());
            for derivatives in &mut of_force {
                derivatives.clear();
                derivatives.resize(bodies.len() * bodies.len(), Derivative::default());
            }
            let [now, last, before] = &gathered;
            let held = held.get(k).copied().flatten();
            let view = View { now, last, before, weights: step.weights, tame: false, held };
            let [by_now, by_last, by_before] = &mut of_force;
            force.derivatives(&view, &mut wrenches, by_now);
            let times = if force.history(&view, by_last, by_before) { 3 } else { 1 };
            for (blocks, derivatives) in self.blocks.iter_mut().zip(&of_force).take(times) {
                for (&pair, by) in self.of_force[k].iter().zip(derivatives) {
                    blocks[pair].by_pose -= by.by_pose;
                    blocks[pair].by_rate -= by.by_rate;
                }
            }
        }
    }

    /// Computes the derivatives of the residual with respect to parameters.
    fn columns(&mut self, solved: &SolvedStep<'_>) -> Vec<Vec<(usize, f64)>> {
        let Self { rollout, column, .. } = self;
        let mut of = |parameter: &dyn Parameter| {
            parameter.residual(solved, column);
            column.take()
        };
        rollout.parameters.iter().map(|parameter| of(parameter.as_ref())).collect()
    }

    /// Replaces the tangential equations of held particles by zero tangential velocity, in all derivatives.
    fn hold(&mut self, sticking: &Sticking, columns: &mut [Vec<(usize, f64)>]) {
        let layout = &self.rollout.layout;
        for hold in sticking.holds() {
            let along = hold.normal * hold.normal.transpose();
            let mut mix = Matrix6::identity();
            mix.fixed_view_mut::<3, 3>(0, 0).copy_from(&along);
            let begin = layout.pairs.partition_point(|&(row, _)| row < hold.body);
            let of_row = layout.pairs[begin..].iter().take_while(|&&(row, _)| row == hold.body);
            for pair in begin..begin + of_row.count() {
                for blocks in &mut self.blocks {
                    blocks[pair].by_pose = mix * blocks[pair].by_pose;
                    blocks[pair].by_rate = mix * blocks[pair].by_rate;
                }
            }
            let across = (Matrix3::identity() - along) * hold.scale_n_s_m;
            let block = &mut self.blocks[0][self.diagonal[hold.body]];
            let mut part = block.by_rate.fixed_view_mut::<3, 3>(0, 0);
            part += across;
            let first = layout.firsts[hold.body];
            for column in columns.iter_mut() {
                let mut force = Vector3::zeros();
                column.retain(|&(row, value)| {
                    let own = (first..first + 3).contains(&row);
                    if own {
                        force[row - first] = value;
                    }
                    !own
                });
                let mixed = along * force;
                column
                    .extend((0..3).map(|k| (first + k, mixed[k])).filter(|(_, part)| *part != 0.0));
            }
        }
    }
}

impl Observer for Recorder {
    fn begin_step(&mut self, end_s: f64) {
        self.time_s = end_s;
    }

    fn end_step(&mut self, motions: &[BodyMotion], report: Option<&StepReport>) {
        let Rollout { parts, ends, motions: all, times_s, reports, .. } = &mut self.rollout;
        match report {
            Some(report) => {
                ends.push(parts.len());
                all.push(motions.to_vec());
                times_s.push(self.time_s);
                reports.push(report.clone());
            }
            None => parts.truncate(ends.last().copied().unwrap_or(0)),
        }
    }

    fn part(&mut self, step: &Step<'_>, moved: &[Displacement], newton: &Newton) {
        let sticking = newton.sticking();
        let trials: Vec<TrialMotion> = (moved.iter().zip(step.now).zip(step.moved))
            .map(|((moved, now), before)| TrialMotion::new(step.weights, now, before, moved))
            .collect();
        let motions: Vec<BodyMotion> = trials.iter().map(|trial| trial.motion).collect();
        let held = harder(step, &motions, sticking.held());
        self.derive(step, &motions, &held, newton.equations());
        let solved = SolvedStep { step, motions: &motions, held: &held, time_s: self.time_s };
        let mut columns = self.columns(&solved);
        self.hold(sticking, &mut columns);
        let columns = entries(&columns);
        let turns = trials.iter().zip(moved).map(|(trial, moved)| Turn {
            carried: Increment::new(moved.turn).rotation(),
            turn_by_phi: trial.turn_by_phi,
            spin_by_phi: trial.spin_by_phi,
        });
        let turns: Vec<Turn> = turns.collect();
        let gain = step.weights.gain();
        self.matrix.clear();
        let layout = &self.rollout.layout;
        for (&(row, column), block) in layout.pairs.iter().zip(&self.blocks[0]) {
            let block = block.chained(&trials[column], gain, layout.turns(column));
            self.matrix.add(&self.matrix.slot(row, column), &block);
        }
        let [_, share] = step.weights.earlier_gains();
        let [now, last, before] = &self.blocks;
        let carried = |pair: usize, column: usize| {
            let mut by_pose = last[pair].by_pose + now[pair].by_pose;
            let by_turn = now[pair].by_pose.fixed_columns::<3>(3)
                * (turns[column].carried - Matrix3::identity());
            let mut target = by_pose.fixed_columns_mut::<3>(3);
            target += by_turn;
            [by_pose, last[pair].by_rate]
        };
        let by_last = layout.rows(carried);
        let by_before = (share != 0.0).then(|| {
            let by_moved = |pair: usize, column: usize| {
                let mut by_moved = now[pair].by_rate * -share;
                let by_turn = by_moved.fixed_columns::<3>(3) * turns[column].turn_by_phi;
                by_moved.fixed_columns_mut::<3>(3).copy_from(&by_turn);
                [by_moved]
            };
            let by_before = layout.rows(|pair, _| [before[pair].by_pose, before[pair].by_rate]);
            (by_before, layout.rows(by_moved))
        });
        let matrix = self.matrix.values().to_vec();
        self.rollout.parts.push(Part { matrix, by_last, by_before, turns, gain, share, columns });
    }
}

impl System {
    /// [`step`](Self::step) with a recorder, which must have been created for this system.
    ///
    /// # Errors
    /// Returns the errors of `step`. The record is then unchanged.
    pub fn step_recorded(
        &mut self,
        step_s: f64,
        recorder: &mut Recorder,
    ) -> Result<StepReport, StepError> {
        self.take(step_s, Some(recorder))
    }
}

impl Layout {
    /// Builds a sparse matrix from `N` square matrices side by side. `blocks` returns the `N` blocks of a pair of bodies, given
    /// the index of the pair and its second body.
    fn rows<const N: usize>(&self, blocks: impl Fn(usize, usize) -> [Matrix6<f64>; N]) -> Rows {
        let mut rows = Rows::default();
        let mut begin = 0;
        for (body, &unknowns) in self.unknowns.iter().enumerate() {
            let count = self.pairs[begin..].iter().take_while(|&&(row, _)| row == body).count();
            let of_row: Vec<_> = (begin..begin + count)
                .map(|pair| (self.pairs[pair].1, blocks(pair, self.pairs[pair].1)))
                .collect();
            begin += count;
            for row in 0..unknowns {
                for (column, of_kinds) in &of_row {
                    for (kind, block) in of_kinds.iter().enumerate() {
                        let first = kind * self.size() + self.firsts[*column];
                        for within in 0..self.unknowns[*column] {
                            rows.push(first + within, block[(row, within)]);
                        }
                    }
                }
                rows.end_row();
            }
        }
        rows
    }
}

/// Flattens the columns to entries, ordered by parameter.
fn entries(columns: &[Vec<(usize, f64)>]) -> Vec<Entry> {
    let of = |(parameter, column): (usize, &Vec<(usize, f64)>)| {
        let entry = move |&(row, value): &(usize, f64)| Entry {
            parameter: parameter as u32,
            row: row as u32,
            value,
        };
        column.iter().map(entry).collect::<Vec<_>>()
    };
    columns.iter().enumerate().flat_map(of).collect()
}

/// Stiffens held contacts for derivatives, so that sticking contacts do not move and sliding contacts have friction on the
/// cone.
fn harder(
    step: &Step<'_>,
    motions: &[BodyMotion],
    held: &[Option<StickingFriction>],
) -> Vec<Option<StickingFriction>> {
    let of = |(k, held): (usize, &Option<StickingFriction>)| {
        let held = (*held)?;
        let now: Vec<_> = step.forces[k].bodies().iter().map(|&body| motions[body]).collect();
        let touch = step.forces[k].touch(&now)?;
        let stick_n_s_m = HARDER * held.stick_n_s_m;
        let friction = touch.friction.held_force(Some(&held), &touch.sliding, touch.normal_n);
        let force = match friction.slips {
            // Just beyond the cone, so that the direction is kept even if other contacts hold the body.
            true => friction.force * (1.0 + BEYOND),
            false => friction.force + touch.sliding * stick_n_s_m,
        };
        Some(StickingFriction { force, stick_n_s_m })
    };
    held.iter().enumerate().map(of).collect()
}
