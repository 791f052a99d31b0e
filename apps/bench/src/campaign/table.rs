//! Results of many runs: a row for each scenario and loss.

use super::scenario::Scenario;
use super::{Reaction, RunReport};
use rollwalk_sim_host::clock::SimTime;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Results of the runs of a scenario with a loss. Sums are integers, so that they do not depend on the order of runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub runs: u64,
    pub outcomes: BTreeMap<Reaction, u64>,
    /// Number of runs with violations or errors.
    pub broken: u64,
    /// Number of lost frames, and number of effects of all other faults.
    pub fired: [u64; 2],
    pub setpoints: u64,
    pub commands: u64,
    /// Longest time from the host's first emergency stop to motors without torque, ns.
    pub worst_stop_ns: Option<u64>,
    /// Number of falls on the ground.
    pub falls: u64,
    /// Largest tilt on the ground, rad.
    pub tilt_max_rad: f64,
    /// Longest distance on the ground without torque, m.
    pub coasted_m: f64,
    /// Longest time from the loss of torque until the robot rests, s.
    pub rested_after_s: f64,
    /// Virtual time of all runs, ns.
    pub virtual_ns: u64,
}

impl Row {
    pub fn add(&mut self, report: &RunReport) {
        self.runs += 1;
        *self.outcomes.entry(report.outcome).or_default() += 1;
        self.broken += u64::from(!report.is_clean());
        self.fired = [0, 1].map(|k| self.fired[k] + report.fired[k]);
        self.setpoints += report.coverage.setpoints;
        self.commands += report.coverage.commands;
        self.worst_stop_ns = self.worst_stop_ns.max(report.stopped_after.map(SimTime::as_ns));
        self.virtual_ns += report.took.as_ns();
        if let Some(world) = &report.world {
            self.falls += world.falls.len() as u64;
            self.tilt_max_rad = self.tilt_max_rad.max(world.tilt_max_rad);
            self.coasted_m = self.coasted_m.max(world.coasted_m);
            self.rested_after_s = self.rested_after_s.max(world.rested_after_s);
        }
    }

    /// Adds a run that panicked.
    pub fn add_failure(&mut self) {
        self.runs += 1;
        self.broken += 1;
    }

    /// Adds other runs of the same scenario and loss.
    pub fn merge(&mut self, other: &Self) {
        self.runs += other.runs;
        for (outcome, runs) in &other.outcomes {
            *self.outcomes.entry(*outcome).or_default() += runs;
        }
        self.broken += other.broken;
        self.fired = [0, 1].map(|k| self.fired[k] + other.fired[k]);
        self.setpoints += other.setpoints;
        self.commands += other.commands;
        self.worst_stop_ns = self.worst_stop_ns.max(other.worst_stop_ns);
        self.virtual_ns += other.virtual_ns;
        self.falls += other.falls;
        self.tilt_max_rad = self.tilt_max_rad.max(other.tilt_max_rad);
        self.coasted_m = self.coasted_m.max(other.coasted_m);
        self.rested_after_s = self.rested_after_s.max(other.rested_after_s);
    }
}

#[derive(Clone, Debug, Default)]
pub struct Table {
    rows: BTreeMap<(Scenario, u16), Row>,
}

impl Table {
    /// Adds runs of a scenario with a loss.
    pub fn add(&mut self, scenario: Scenario, loss_per_mille: u16, runs: &Row) {
        self.rows.entry((scenario, loss_per_mille)).or_default().merge(runs);
    }

    /// Rows, ordered by scenario and loss.
    pub fn rows(&self) -> impl Iterator<Item = (Scenario, u16, &Row)> {
        self.rows.iter().map(|(&(scenario, loss), row)| (scenario, loss, row))
    }
}
