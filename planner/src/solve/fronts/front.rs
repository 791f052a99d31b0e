//! Fronts: columns that are eliminated together, and the update matrices from earlier fronts.

use super::kernel::padded;
use pulp::NullaryFnOnce;

/// Columns that are eliminated together. Positions refer to the order of elimination.
#[derive(Debug)]
pub(super) struct Front {
    /// Position of the first pivot.
    pub first: usize,
    /// Number of pivots.
    pub pivots: usize,
    /// Positions of the later columns that the pivots couple, ascending.
    pub border: Vec<usize>,
    /// Offset of the front's panel. The panel has a column for each pivot, and a line for each pivot and border column. Lines
    /// of pivots are padded, and so are lines of the border.
    pub panel: usize,
    /// Earlier fronts whose borders begin in these pivots.
    pub children: Vec<Child>,
}

impl Front {
    /// Number of lines before the border.
    pub fn head(&self) -> usize {
        padded(self.pivots)
    }

    /// Length of a column of the panel.
    pub fn lines(&self) -> usize {
        self.head() + padded(self.border.len())
    }

    pub fn panel(&self) -> std::ops::Range<usize> {
        self.panel..self.panel + self.lines() * self.pivots
    }

    /// Returns the index of the product of the pivot `a` with `b` in the panels; `None` if the front does not contain `b`.
    pub fn entry(&self, a: usize, b: usize) -> Option<usize> {
        let line = self.line(b, 0)?;
        Some(self.panel + (a - self.first) * self.lines() + line)
    }

    /// Returns the line of a position; `None` if the front does not contain it. `before` is a guess of the line just before it.
    pub fn line(&self, at: usize, before: usize) -> Option<usize> {
        if at < self.first + self.pivots {
            return at.checked_sub(self.first);
        }
        let next = (before + 1).checked_sub(self.head());
        if let Some(next) = next.filter(|&next| self.border.get(next) == Some(&at)) {
            return Some(self.head() + next);
        }
        self.border.binary_search(&at).ok().map(|line| self.head() + line)
    }
}

/// Child of a front, with the lines of the parent to which its update matrix is added.
#[derive(Debug)]
pub(super) struct Child {
    pub front: usize,
    /// Lines of the parent for each line of the child's border: pivots of the parent first, then its border.
    pub runs: Vec<Run>,
    /// Number of runs that lead to pivots.
    pub of_pivots: usize,
}

/// Consecutive lines of a child that are consecutive lines of its parent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub from: usize,
    pub to: usize,
    pub count: usize,
}

/// Extend-add: scatters columns of a child's update matrix, a lower triangle by padded columns, into a matrix of its parent.
pub(super) struct ExtendAdd<'a> {
    runs: &'a [Run],
    /// Runs whose columns are added.
    columns: std::ops::Range<usize>,
    update: &'a [f64],
    matrix: &'a mut [f64],
    /// Length of a column of `matrix`.
    lines: usize,
    /// Line of the parent that is the first line and column of `matrix`.
    skipped: usize,
}

impl<'a> ExtendAdd<'a> {
    /// Adds to the pivot columns of the parent.
    pub fn to_pivots(
        child: &'a Child,
        update: &'a [f64],
        panel: &'a mut [f64],
        lines: usize,
    ) -> Self {
        let Child { runs, of_pivots, .. } = child;
        Self { runs, columns: 0..*of_pivots, update, matrix: panel, lines, skipped: 0 }
    }

    /// Adds the other columns to the update matrix of the parent, whose border begins at line `head`.
    pub fn to_border(
        child: &'a Child,
        update: &'a [f64],
        matrix: &'a mut [f64],
        lines: usize,
        head: usize,
    ) -> Self {
        let Child { runs, of_pivots, .. } = child;
        Self { runs, columns: *of_pivots..runs.len(), update, matrix, lines, skipped: head }
    }
}

impl NullaryFnOnce for ExtendAdd<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { runs, columns, update, matrix, lines, skipped } = self;
        let stride = padded(runs.last().map_or(0, |run| run.from + run.count));
        for index in columns {
            let run = runs[index];
            for k in 0..run.count {
                let source = &update[(run.from + k) * stride..][..stride];
                let target = &mut matrix[(run.to + k - skipped) * lines..][..lines];
                add(&source[run.from + k..run.from + run.count], target, run.to + k - skipped);
                for run in &runs[index + 1..] {
                    add(&source[run.from..][..run.count], target, run.to - skipped);
                }
            }
        }
    }
}

/// Adds entries to consecutive lines. A function is used because a closure would be compiled without the vector instructions
/// of the processor.
#[inline(always)]
fn add(from: &[f64], target: &mut [f64], line: usize) {
    let target = &mut target[line..][..from.len()];
    target.iter_mut().zip(from).for_each(|(to, from)| *to += from);
}
