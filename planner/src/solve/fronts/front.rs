//! Fronts: columns that are eliminated together, and the update matrices from earlier fronts.

/// Columns that are eliminated together. Positions refer to the order of elimination.
#[derive(Debug)]
pub(super) struct Front {
    /// Position of the first pivot.
    pub first: usize,
    /// Number of pivots.
    pub pivots: usize,
    /// Positions of the later columns that the pivots couple, ascending.
    pub border: Vec<usize>,
    /// Offset of the front's panel. The panel has a column for each pivot, and a line for each pivot and border column.
    pub panel: usize,
    /// Earlier fronts whose borders begin in these pivots.
    pub children: Vec<Child>,
}

impl Front {
    pub fn lines(&self) -> usize {
        self.pivots + self.border.len()
    }

    pub fn panel(&self) -> std::ops::Range<usize> {
        self.panel..self.panel + self.lines() * self.pivots
    }

    /// Returns the line of a position; `None` if the front does not contain it. `before` is a guess of the line just before it.
    pub fn line(&self, at: usize, before: usize) -> Option<usize> {
        if at < self.first + self.pivots {
            return at.checked_sub(self.first);
        }
        let next = (before + 1).checked_sub(self.pivots);
        if let Some(next) = next.filter(|&next| self.border.get(next) == Some(&at)) {
            return Some(self.pivots + next);
        }
        self.border.binary_search(&at).ok().map(|line| self.pivots + line)
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

impl Child {
    /// Extend-add: scatters the child's update matrix, a lower triangle by columns, into the parent's pivot columns.
    pub fn add_to_pivots(&self, left: &[f64], panel: &mut [f64], lines: usize) {
        self.add(0..self.of_pivots, left, panel, lines, 0);
    }

    /// Extend-add: scatters the rest of the child's update matrix into the parent's update matrix.
    pub fn add_to_border(&self, left: &[f64], update: &mut [f64], width: usize, pivots: usize) {
        self.add(self.of_pivots..self.runs.len(), left, update, width, pivots);
    }

    /// Adds the columns of some runs to a matrix. The first line and column of the matrix is line `skipped` of the parent.
    fn add(
        &self,
        columns: std::ops::Range<usize>,
        left: &[f64],
        matrix: &mut [f64],
        lines: usize,
        skipped: usize,
    ) {
        let count = self.runs.last().map_or(0, |run| run.from + run.count);
        for index in columns {
            let run = self.runs[index];
            for k in 0..run.count {
                let source = &left[(run.from + k) * count..][..count];
                let target = &mut matrix[(run.to + k - skipped) * lines..][..lines];
                let mut add = |from: usize, to: usize, count: usize| {
                    let (from, to) =
                        (&source[from..][..count], &mut target[to - skipped..][..count]);
                    to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
                };
                add(run.from + k, run.to + k, run.count - k);
                self.runs[index + 1..].iter().for_each(|run| add(run.from, run.to, run.count));
            }
        }
    }
}
