//! Writer of rows: converts derivatives with respect to samples to derivatives with respect to unknowns.
//!
//! The first evaluation records the destination of every derivative. Later evaluations reuse it, because the pattern of the
//! rows is constant and terms write their derivatives in the same order at every point. Only rows of placed samples, whose
//! derivatives are mixed by the placement, are converted every time.
//!
//! Trial steps need values alone. At an accepted point, only rows that contribute to the energy need derivatives. [`Evaluation`]
//! selects the output. Rows of an edited robot mostly have the pattern of those before the edit: [`Evaluation::Again`] compares
//! every row and every derivative with it.

mod ground;

use super::{Columns, ComparedField, DifferentiatedRows, Role, Row, Rows, Subject};
use crate::families::Family;
use crate::plan::Placement;
use crate::problem::state::State;
use crate::problem::variables::Lift;
use crate::problem::{Problem, Unknowns};
use nalgebra::Vector3;
use std::ops::Range;
use std::sync::Arc;

/// Pattern of a system's rows, set by their first evaluation.
#[derive(Clone, Debug, Default)]
pub struct Pattern {
    rows: Arc<[Row]>,
    columns: Arc<[usize]>,
    /// End index of the entries of every row.
    ends: Vec<usize>,
    /// Range of each row in `places`. `None` for a row with a placed sample, whose derivatives have no fixed destinations.
    of_rows: Vec<Option<Range<usize>>>,
    /// Destinations of the derivatives of these rows, in the order in which terms write them.
    places: Vec<DerivativePlace>,
}

/// Destination of a derivative with respect to a variable of a sample of the window.
#[derive(Clone, Copy, Debug)]
struct DerivativePlace {
    sample: u16,
    variable: u16,
    /// Index in [`Rows::derivatives`], or [`NOWHERE`] for a frozen variable.
    entry: u32,
}

const NOWHERE: u32 = u32::MAX;

/// Output of an evaluation. The first evaluation finds the pattern and writes everything.
#[derive(Clone, Copy, Debug)]
pub enum Evaluation<'a> {
    /// Values and all derivatives.
    All,
    /// Values alone.
    Values,
    /// Values alone. The pattern and the reused rows come from another problem.
    Again,
    /// Derivatives of the rows whose flags are set, at a point whose values are known.
    Derivatives(&'a [bool]),
}

/// Collector of the rows of all terms.
pub struct RowWriter<'a> {
    problem: &'a Problem,
    columns: &'a Columns,
    placement: Placement,
    states: &'a [State],
    values: Vec<f64>,
    givens: Vec<(u32, ComparedField)>,
    derivatives: Vec<f64>,
    /// Descriptions of the rows written so far, unless the known pattern already contains them.
    rows: Vec<Row>,
    wanted: Evaluation<'a>,
    /// Known pattern. If `None`, `found` contains the pattern of the rows so far.
    known: Option<&'a Pattern>,
    found: Pattern,
    /// Columns of `found`.
    columns_found: Vec<usize>,
    /// Index of the row under construction.
    row: usize,
    /// Index of the first entry of the row under construction.
    start: usize,
    /// Index of the next derivative with a known destination.
    place: usize,
    /// Number of entries of the row under construction.
    entries: usize,
    /// True if the derivatives of the row under construction are requested.
    differentiates: bool,
    /// True if the derivatives of the row under construction have known destinations.
    is_direct: bool,
    /// True if all rows so far match the known pattern. After a mismatch, no more rows are written.
    fits: bool,
    family: Family,
    at: [usize; 3],
    scale: f64,
    level: f64,
    role: Role,
    given: Option<ComparedField>,
    /// Derivatives of the row under construction: a dense gradient for each sample of the window.
    gradients: [Vec<f64>; 3],
    /// Indices of the entries of `gradients` that were written.
    written: [Vec<usize>; 3],
    /// Flags of the entries of `gradients` that were written.
    is_written: [Vec<bool>; 3],
    /// Sample, variable and value of each derivative of the row under construction, in the order of writing, while the pattern
    /// is not known.
    calls: Vec<(usize, usize, f64)>,
    /// Position of each column in the row under construction, or [`NO_POSITION`]; scratch memory over all columns.
    position: Vec<u32>,
}

const NO_POSITION: u32 = u32::MAX;

impl<'a> RowWriter<'a> {
    /// Creates a writer for one evaluation.
    ///
    /// `known` is the pattern from an earlier evaluation. The memory of `reuse`, an earlier result, is reused. With
    /// [`Evaluation::Derivatives`], `reuse` contains the values.
    pub fn new(
        problem: &'a Problem,
        columns: &'a Columns,
        unknowns: &Unknowns,
        states: &'a [State],
        known: Option<&'a Pattern>,
        wanted: Evaluation<'a>,
        reuse: Rows,
    ) -> Self {
        let Rows { mut values, mut givens, mut derivatives, .. } = reuse;
        if !matches!(wanted, Evaluation::Derivatives(_)) {
            values.clear();
            givens.clear();
        }
        derivatives.resize(known.map_or(0, |known| known.columns.len()), 0.0);
        let gradient = vec![0.0; problem.layout.len];
        let mut writer = Self {
            problem,
            columns,
            placement: unknowns.placement,
            states,
            values,
            givens,
            derivatives,
            rows: Vec::new(),
            wanted,
            known,
            found: Pattern::default(),
            columns_found: Vec::new(),
            row: 0,
            start: 0,
            place: 0,
            entries: 0,
            differentiates: false,
            is_direct: false,
            fits: true,
            family: Family::LinearDynamics,
            at: [0; 3],
            scale: 1.0,
            level: 1.0,
            role: Role::Equality,
            given: None,
            gradients: [gradient.clone(), gradient.clone(), gradient],
            written: Default::default(),
            is_written: std::array::from_fn(|_| vec![false; problem.layout.len]),
            calls: Vec::new(),
            position: vec![NO_POSITION; columns.count],
        };
        writer.begin_row();
        writer
    }

    /// Returns true if the finished rows match the known pattern, as far as their derivatives were requested.
    pub fn fits(&self) -> bool {
        self.fits && self.known.is_none_or(|known| self.row == known.ends.len())
    }

    /// Returns the finished rows, and their pattern if it was not known or belongs to another problem.
    pub fn finish(self) -> (Rows, Option<Pattern>) {
        let Self { values, givens, derivatives, rows, known, found, columns_found, .. } = self;
        let differentiated = match self.wanted {
            Evaluation::All => DifferentiatedRows::All,
            Evaluation::Values | Evaluation::Again => DifferentiatedRows::None,
            Evaluation::Derivatives(_) => DifferentiatedRows::Some,
        };
        let found = match (known, self.wanted) {
            (None, _) => {
                Some(Pattern { rows: rows.into(), columns: columns_found.into(), ..found })
            }
            (Some(known), Evaluation::Again) => {
                Some(Pattern { rows: rows.into(), ..known.clone() })
            }
            (Some(_), _) => None,
        };
        let Pattern { rows, columns, .. } = found.as_ref().or(known).expect("known or found");
        let (rows, columns, states) = (Arc::clone(rows), Arc::clone(columns), Vec::new());
        (Rows { rows, values, givens, columns, derivatives, differentiated, states }, found)
    }

    /// Begins rows of a family for these samples of the timeline.
    pub fn enter(&mut self, family: Family, at: [usize; 3]) {
        self.family = family;
        self.at = at;
    }

    /// Sets scale and role of the following rows. If the family's level is a fraction of a limit, `scale` must be that limit.
    pub fn set(&mut self, scale: f64, role: Role) {
        self.scale = scale;
        self.level = self.family.level().at(scale);
        self.role = role;
    }

    /// Returns true if the derivatives of the next row are requested. Otherwise they may be omitted.
    pub fn differentiates(&self) -> bool {
        self.differentiates
    }

    /// Skips the next row if neither its value nor its derivatives are requested. Returns true if the row was skipped.
    pub fn skips_row(&mut self) -> bool {
        let skips = matches!(self.wanted, Evaluation::Derivatives(_)) && !self.differentiates;
        if skips {
            self.begin_next_row(self.end());
        }
        skips
    }

    /// Adds to the derivative of the next row with respect to `variable` of sample `k` of the window.
    pub fn d(&mut self, k: usize, variable: usize, derivative: f64) {
        if !self.differentiates || !self.fits {
            return;
        }
        if let (true, Some(known)) = (self.is_direct, self.known) {
            let place = known.places.get(self.place).copied();
            let is_known = |place: &DerivativePlace| {
                (place.sample as usize, place.variable as usize) == (k, variable)
            };
            let Some(place) = place.filter(is_known) else {
                self.fits = false;
                return;
            };
            self.place += 1;
            if place.entry != NOWHERE {
                let scaled = derivative * self.problem.layout.scale[variable];
                self.derivatives[place.entry as usize] += scaled;
            }
            return;
        }
        if self.known.is_none() {
            self.calls.push((k, variable, derivative));
        }
        // An entry that is zero here may be nonzero at the next point: it stays in the pattern.
        self.gradients[k][variable] += derivative;
        if !std::mem::replace(&mut self.is_written[k][variable], true) {
            self.written[k].push(variable);
        }
    }

    /// Adds derivatives with respect to three consecutive variables.
    pub fn d_vector(&mut self, k: usize, first: usize, derivative: &Vector3<f64>) {
        for c in 0..3 {
            self.d(k, first + c, derivative[c]);
        }
    }

    /// Sets the field that the next row compares with.
    pub fn given(&mut self, field: &'static str, value: f64, slope: f64) {
        self.given = Some(ComparedField { field, value, slope });
    }

    /// Ends a row for the whole robot, with its residual in the family's unit.
    pub fn row(&mut self, residual: f64) {
        self.row_of(Subject::Whole, residual);
    }

    /// Ends a row for a part of the robot, with its residual in the family's unit.
    #[inline]
    pub fn row_of(&mut self, subject: Subject, residual: f64) {
        if !matches!(self.wanted, Evaluation::Derivatives(_)) {
            if let Some(given) = self.given.take() {
                self.givens.push((self.row as u32, given));
            }
            self.values.push(residual / self.scale);
        }
        match self.wanted {
            Evaluation::Values => self.row += 1,
            _ => self.end_row(subject),
        }
    }

    /// Ends a row whose derivatives or description are requested.
    fn end_row(&mut self, subject: Subject) {
        if !self.fits {
            return;
        }
        let start = self.start;
        let end = match (self.differentiates, self.is_direct) {
            (false, _) => self.end(),
            (true, true) => {
                let of_row = self.known.and_then(|known| known.of_rows[self.row].as_ref());
                self.fits &= of_row.is_none_or(|of_row| of_row.end == self.place);
                let end = self.end();
                if self.scale != 1.0 {
                    self.derivatives[start..end].iter_mut().for_each(|d| *d /= self.scale);
                }
                end
            }
            (true, false) => self.collect(),
        };
        let known = self.known.map(|known| known.rows.get(self.row));
        if known.is_none() || matches!(self.wanted, Evaluation::Again) {
            let Self { family, at, scale, level, role, .. } = *self;
            let row = Row { family, at: at[1], subject, scale, level, role, entries: start..end };
            self.fits &= known.is_none_or(|known| known.is_some_and(|known| row.is_like(known)));
            self.rows.push(row);
        }
        self.begin_next_row(end);
    }

    /// End index of the entries of the row under construction, whose pattern is known.
    fn end(&self) -> usize {
        self.known.and_then(|known| known.ends.get(self.row).copied()).unwrap_or(self.start)
    }

    /// Starts the next row. `end` is the end index of the previous row's entries.
    fn begin_next_row(&mut self, end: usize) {
        (self.row, self.start, self.entries) = (self.row + 1, end, 0);
        self.begin_row();
    }

    fn begin_row(&mut self) {
        self.differentiates = match self.wanted {
            Evaluation::All => true,
            Evaluation::Values | Evaluation::Again => false,
            Evaluation::Derivatives(of_rows) => of_rows.get(self.row).copied().unwrap_or_default(),
        };
        let Some(known) = self.known.filter(|_| self.differentiates) else { return };
        let Some(&end) = known.ends.get(self.row) else { return };
        self.derivatives[self.start..end].fill(0.0);
        let of_row = &known.of_rows[self.row];
        self.is_direct = of_row.is_some();
        self.place = of_row.as_ref().map_or(0, |of_row| of_row.start);
    }

    /// Converts the derivatives of a row to entries, and returns their end index. Adds the row to the pattern if the pattern
    /// is not known yet.
    fn collect(&mut self) -> usize {
        let start = self.start;
        let mut is_direct = true;
        for k in 0..3 {
            if self.written[k].is_empty() {
                continue;
            }
            let sample = self.problem.timeline[self.at[k]];
            let mut written = std::mem::take(&mut self.written[k]);
            let mut gradient = std::mem::take(&mut self.gradients[k]);
            if sample.lift != Lift::Identity {
                is_direct = false;
                self.pull_back(sample.lift, k, &mut written, &mut gradient);
            }
            for &variable in &written {
                self.is_written[k][variable] = false;
                if let Some(column) = self.columns.of_slot[sample.slot][variable] {
                    self.push(column, gradient[variable] * self.problem.layout.scale[variable]);
                }
                gradient[variable] = 0.0;
            }
            written.clear();
            self.written[k] = written;
            self.gradients[k] = gradient;
        }
        let end = start + self.entries;
        if self.known.is_none() {
            self.find(is_direct, end);
        }
        let columns = self.known.map_or(&self.columns_found[..], |known| &known.columns);
        for &column in &columns[start..end] {
            self.position[column] = NO_POSITION;
        }
        self.fits &= self.known.is_none() || end == self.end();
        end
    }

    /// Adds the row under construction to the pattern. Sums the derivatives with destinations in the order of later evaluations,
    /// so that all evaluations round alike.
    fn find(&mut self, is_direct: bool, end: usize) {
        let Self { problem, columns, at, start, scale, position, found, derivatives, .. } = self;
        let first = found.places.len();
        found.ends.push(end);
        if is_direct {
            derivatives[*start..end].fill(0.0);
        }
        for (k, variable, derivative) in self.calls.drain(..).filter(|_| is_direct) {
            let column = columns.of_slot[problem.timeline[at[k]].slot][variable];
            let entry = column.map_or(NOWHERE, |column| *start as u32 + position[column]);
            if let Some(sum) = derivatives.get_mut(entry as usize) {
                *sum += derivative * problem.layout.scale[variable];
            }
            let (sample, variable) = (k as u16, variable as u16);
            found.places.push(DerivativePlace { sample, variable, entry });
        }
        if is_direct && *scale != 1.0 {
            derivatives[*start..end].iter_mut().for_each(|d| *d /= *scale);
        }
        found.of_rows.push(is_direct.then_some(first..found.places.len()));
    }

    /// Converts derivatives with respect to a placed sample to derivatives with respect to its slot and the placement.
    fn pull_back(&mut self, lift: Lift, k: usize, written: &mut Vec<usize>, gradient: &mut [f64]) {
        let layout = &self.problem.layout;
        // A turn mixes the horizontal components of a vector, so the pattern needs both.
        for first in layout.points().chain(layout.vectors()) {
            let [x, y] = [first, first + 1].map(|variable| self.is_written[k][variable]);
            if x != y {
                written.push(if x { first + 1 } else { first });
            }
        }
        let vars = &self.states[self.at[k]].vars;
        let to_placement = lift.pull_back(layout, vars, &self.placement, gradient);
        if let Some(columns) = self.columns.placement {
            for (column, derivative) in columns.into_iter().zip(to_placement) {
                self.push(column, derivative);
            }
        }
    }

    /// Adds a derivative to a column of the row under construction.
    fn push(&mut self, column: usize, derivative: f64) {
        let derivative = derivative / self.scale;
        let position = self.position[column];
        if position != NO_POSITION {
            self.derivatives[self.start + position as usize] += derivative;
            return;
        }
        let entry = self.start + self.entries;
        if self.known.is_some_and(|known| known.columns.get(entry) != Some(&column)) {
            self.fits = false;
            return;
        }
        self.position[column] = self.entries as u32;
        self.entries += 1;
        if self.known.is_some() {
            self.derivatives[entry] = derivative;
        } else {
            self.columns_found.push(column);
            self.derivatives.push(derivative);
        }
    }
}
