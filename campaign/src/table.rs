//! Results of many runs: a row for each scenario and loss.

use super::scenario::Scenario;
use super::{Case, Outcome, Report};
use rollwalk_sim_host::clock::SimTime;
use std::collections::BTreeMap;

/// The runs of a scenario with a loss.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// All runs.
    pub runs: u64,
    /// Runs by outcome.
    pub outcomes: BTreeMap<Outcome, u64>,
    /// Runs with violations or errors.
    pub broken: u64,
    /// Frames lost, and disturbances by other faults.
    pub fired: [u64; 2],
    /// Setpoints checked.
    pub setpoints: u64,
    /// Commands checked.
    pub commands: u64,
    /// Longest time from the host's first emergency stop to motors without torque.
    pub worst_stop: Option<SimTime>,
    /// Falls on the ground.
    pub falls: u64,
    /// Greatest tilt on the ground, rad.
    pub tilt_max_rad: f64,
    /// Longest way on the ground without torque, m.
    pub coasted_m: f64,
    /// Longest time without torque before the robot rested, s.
    pub rested_after_s: f64,
    /// Virtual time of all runs, s.
    pub virtual_s: f64,
}

/// All runs.
#[derive(Clone, Debug, Default)]
pub struct Table {
    rows: BTreeMap<(Scenario, u16), Row>,
}

impl Table {
    /// Adds a run.
    pub fn add(&mut self, report: &Report) {
        let row = self.row(report.case);
        row.runs += 1;
        *row.outcomes.entry(report.outcome).or_default() += 1;
        row.broken += u64::from(!report.is_clean());
        row.fired = [0, 1].map(|k| row.fired[k] + report.fired[k]);
        row.setpoints += report.coverage.setpoints;
        row.commands += report.coverage.commands;
        row.worst_stop = row.worst_stop.max(report.stopped_after);
        row.virtual_s += report.took.as_s();
        if let Some(world) = &report.world {
            row.falls += world.falls.len() as u64;
            row.tilt_max_rad = row.tilt_max_rad.max(world.tilt_max_rad);
            row.coasted_m = row.coasted_m.max(world.coasted_m);
            row.rested_after_s = row.rested_after_s.max(world.rested_after_s);
        }
    }

    /// Adds a run that panicked.
    pub fn add_failure(&mut self, case: Case) {
        let row = self.row(case);
        row.runs += 1;
        row.broken += 1;
    }

    fn row(&mut self, case: Case) -> &mut Row {
        self.rows.entry((case.scenario, case.loss_per_mille)).or_default()
    }

    /// The rows, by scenario and loss.
    pub fn rows(&self) -> impl Iterator<Item = (Scenario, u16, &Row)> {
        self.rows.iter().map(|(&(scenario, loss), row)| (scenario, loss, row))
    }
}
