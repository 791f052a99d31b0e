//! Residuals over a whole motion, and the search for the worst case of each.

use super::grid::{Timeline, Window};
use crate::families::{Family, PlayedTolerance};
use serde::Serialize;

/// Residual over the whole motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Family of the residual.
    #[serde(rename = "name")]
    pub family: Family,
    /// Number of the equation in the thesis, or a description.
    pub equation: &'static str,
    /// Times at which the residual is evaluated.
    pub grid: Grid,
    /// Worst residual, in `unit`. For limits, this is the excess, which is 0 within the limit.
    pub worst: f64,
    /// Unit of `worst` and `level`.
    pub unit: &'static str,
    /// Tolerance: the largest residual with which motions succeed in an independent simulator. `None` for residuals without
    /// one.
    pub level: Option<f64>,
    /// Sample and subject of the worst residual; `None` if the residual is 0 everywhere.
    pub place: Option<ResidualLocation>,
}

/// Times at which a residual is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Grid {
    /// Samples of the plan.
    #[serde(rename = "samples")]
    Samples,
    /// Plan resampled at the rate of motion libraries, 60 Hz.
    #[serde(rename = "60_hz")]
    Library60Hz,
    /// Plan resampled at the fastest control rate, 500 Hz.
    #[serde(rename = "500_hz")]
    Control500Hz,
}

/// Sample and subject of a worst residual.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResidualLocation {
    /// Index of the sample or of the resampled frame, from 0. For residuals of intervals, the index of the interval's start.
    pub sample: usize,
    /// Time of the sample or frame, s.
    pub time_s: f64,
    /// Name of the joint, end effector or links; `None` if the residual belongs to the whole robot.
    pub subject: Option<String>,
}

impl Row {
    /// Creates a row without residuals.
    pub(super) fn new(family: Family, grid: Grid) -> Self {
        let (unit, _) = family.unit().shown();
        let equation = family.equation();
        Self { family, equation, grid, worst: 0.0, unit, level: None, place: None }
    }

    /// True if the residual is evaluated between the samples.
    pub fn is_as_played(&self) -> bool {
        self.grid != Grid::Samples
    }

    /// True if the residual exceeds its tolerance.
    pub fn is_beyond(&self) -> bool {
        self.part_of_level() > 1.0
    }

    /// Worst residual as a fraction of its tolerance; 0 for residuals without a tolerance.
    pub fn part_of_level(&self) -> f64 {
        self.level.map_or(0.0, |level| self.worst / level)
    }
}

/// Search for the worst case of one family.
pub(super) struct WorstCase {
    row: Row,
    part: f64,
}

impl WorstCase {
    pub(super) fn of(family: Family, grid: Grid) -> Self {
        Self { row: Row::new(family, grid), part: 0.0 }
    }

    /// Records a residual, in the family's SI unit.
    pub(super) fn record(&mut self, residual: f64, at: &Window, subject: Option<&str>) {
        self.record_excess(residual, 1.0, at, subject);
    }

    /// Records an excess over a limit, in the family's SI unit.
    pub(super) fn record_excess(
        &mut self,
        residual: f64,
        limit: f64,
        at: &Window,
        subject: Option<&str>,
    ) {
        let (_, factor) = self.row.family.unit().shown();
        let (residual, level) = (residual * factor, self.row.family.level().at(limit) * factor);
        self.row.level.get_or_insert(level);
        let part = residual / level;
        if part > self.part {
            self.part = part;
            self.row.worst = residual;
            self.row.level = Some(level);
            self.row.place = Some(ResidualLocation {
                sample: at.index,
                time_s: at.here.sample.time_s,
                subject: subject.map(str::to_owned),
            });
        }
    }

    /// Records a residual of the whole motion, in the family's SI unit.
    pub(super) fn record_whole(&mut self, residual: f64) {
        let (_, factor) = self.row.family.unit().shown();
        self.row.worst = residual * factor;
        self.row.level = Some(self.row.family.level().at(1.0) * factor);
    }

    /// Returns the row, or `None` if no residual was recorded.
    pub(super) fn row(self) -> Option<Row> {
        self.row.level.is_some().then_some(self.row)
    }

    /// Returns the row with the tolerance of played motions, if the family has one.
    pub(super) fn row_as_played(self, timeline: &Timeline) -> Option<Row> {
        let mut row = self.row()?;
        let (_, factor) = row.family.unit().shown();
        row.level = match row.family.as_played() {
            PlayedTolerance::TimesLevel(times) => row.level.map(|level| times * level),
            of_robot => of_robot.at(&timeline.scales()).map(|level| level * factor),
        };
        Some(row)
    }
}
