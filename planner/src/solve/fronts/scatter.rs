//! Destinations of rows in the panels, to which the products of their derivatives are added.
//!
//! Rows that share most of their columns, such as the three components of one vector equation, are added together: every entry
//! of a panel is then read and written once instead of three times.

use super::front::Front;
use pulp::NullaryFnOnce;

/// Largest number of rows that share destinations.
pub(in super::super) const MOST_ROWS: usize = 3;
/// Number of columns up to which every product has a separate destination.
const FEW: usize = 4;

/// Destinations of the products of the derivatives of rows.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct ScatterMap {
    /// Number of columns of all rows together. Entries number these columns in the order of elimination.
    columns: usize,
    /// Entry of each derivative, row after row.
    entries: Vec<u32>,
    pieces: Vec<Piece>,
    /// Runs of entries and lines in the fronts of the pieces.
    runs: Vec<Run>,
    /// Panel index of each product of one row with few columns: by the first entry, then by the second.
    few: Vec<u32>,
}

/// Entries that are pivots of one front.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Offset of the front's panel.
    panel: usize,
    /// Number of lines of the panel.
    stride: usize,
    /// Entry after the last of the piece.
    end: usize,
    /// End index in `runs`. The runs of a piece begin at the end index of the previous piece, and cover its own and all later
    /// entries.
    runs: usize,
}

/// Consecutive entries in consecutive lines.
#[derive(Clone, Copy, Debug)]
struct Run {
    first: u32,
    end: u32,
    /// Line of the first entry.
    line: u32,
}

impl ScatterMap {
    /// Returns the destinations of the products of rows with the given columns. `None` if the rows couple columns that no front
    /// contains together.
    ///
    /// `position` contains the position of each column in the order of elimination, and `front_of` the front of each position.
    pub(super) fn of(
        rows: &[&[usize]],
        position: &[usize],
        front_of: &[usize],
        fronts: &[Front],
    ) -> Option<Self> {
        let at = positions(rows, position);
        let entry = |&column: &usize| at.partition_point(|&at| at < position[column]) as u32;
        let entries = rows.iter().copied().flatten().map(entry).collect();
        if rows.len() == 1 && at.len() <= FEW {
            let pairs =
                at.iter().enumerate().flat_map(|(k, a)| at[k..].iter().map(move |b| (*a, *b)));
            let place = |(a, b): (usize, usize)| fronts[front_of[a]].entry(a, b);
            let few =
                pairs.map(|pair| place(pair).map(|place| place as u32)).collect::<Option<_>>()?;
            return Some(Self { columns: at.len(), entries, few, ..Self::default() });
        }
        let (mut pieces, mut runs) = (Vec::new(), Vec::<Run>::with_capacity(at.len()));
        let mut first = 0;
        while first < at.len() {
            let front = &fronts[front_of[at[first]]];
            let end = first + at[first..].partition_point(|&at| at < front.first + front.pivots);
            let (mut line, of_piece) = (0, runs.len());
            for (entry, &at) in at.iter().enumerate().skip(first) {
                line = front.line(at, line)?;
                let (entry, line) = (entry as u32, line as u32);
                match runs[of_piece..].last_mut() {
                    Some(run) if run.line + (entry - run.first) == line => run.end = entry + 1,
                    _ => runs.push(Run { first: entry, end: entry + 1, line }),
                }
            }
            pieces.push(Piece { panel: front.panel, stride: front.lines(), end, runs: runs.len() });
            first = end;
        }
        Some(Self { columns: at.len(), entries, pieces, runs, few: Vec::new() })
    }

    /// Adds the products of the derivatives of each row, times its factor, to the panels. A row without factor is left out.
    /// `sorted` is scratch memory.
    pub(super) fn add(
        &self,
        simd: pulp::Arch,
        rows: &[(&[f64], Option<f64>)],
        panels: &mut [f64],
        sorted: &mut Vec<f64>,
    ) {
        let columns = self.columns;
        sorted.clear();
        sorted.resize(rows.len() * columns, 0.0);
        let mut factors = [0.0; MOST_ROWS];
        let mut entries = &self.entries[..];
        for (index, (derivatives, factor)) in rows.iter().enumerate() {
            let (own, others) = entries.split_at(derivatives.len());
            entries = others;
            let Some(factor) = factor else { continue };
            factors[index] = *factor;
            let row = &mut sorted[index * columns..][..columns];
            own.iter().zip(*derivatives).for_each(|(&entry, d)| row[entry as usize] = *d);
        }
        if !self.few.is_empty() {
            let mut places = self.few.iter();
            for (first, d) in sorted.iter().enumerate() {
                let scaled = factors[0] * d;
                let products = sorted[first..].iter().zip(&mut places);
                products.for_each(|(d, &place)| panels[place as usize] += scaled * d);
            }
            return;
        }
        let sorted = &sorted[..];
        match *rows {
            [_] => simd.dispatch(Products { places: self, factors: [factors[0]], panels, sorted }),
            [_, _] => {
                let factors = [factors[0], factors[1]];
                simd.dispatch(Products { places: self, factors, panels, sorted });
            }
            _ => simd.dispatch(Products { places: self, factors, panels, sorted }),
        }
    }
}

/// Returns the positions of all columns of rows, ascending. A row contains each column once, and the rows share most of them, so
/// that mostly only those of the first need a sort.
fn positions(rows: &[&[usize]], position: &[usize]) -> Vec<usize> {
    let Some((first, others)) = rows.split_first() else { return Vec::new() };
    let mut at: Vec<usize> = first.iter().map(|&column| position[column]).collect();
    at.sort_unstable();
    for row in others {
        let known = at.len();
        for &column in *row {
            if at[..known].binary_search(&position[column]).is_err() {
                at.push(position[column]);
            }
        }
        if at.len() > known {
            at.sort_unstable();
        }
    }
    at
}

/// Operation that adds the products of `M` rows to the panels. `sorted` contains their derivatives by entry.
struct Products<'a, const M: usize> {
    places: &'a ScatterMap,
    factors: [f64; M],
    panels: &'a mut [f64],
    sorted: &'a [f64],
}

impl<const M: usize> NullaryFnOnce for Products<'_, M> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { places, factors, panels, sorted } = self;
        let rows: [&[f64]; M] =
            std::array::from_fn(|row| &sorted[row * places.columns..][..places.columns]);
        let mut first_run = 0;
        for piece in &places.pieces {
            let runs = &places.runs[first_run..piece.runs];
            for (index, own) in runs.iter().enumerate() {
                for entry in own.first as usize..piece.end.min(own.end as usize) {
                    let line = own.line as usize + entry - own.first as usize;
                    let column = &mut panels[piece.panel + line * piece.stride..][..piece.stride];
                    let scaled = std::array::from_fn(|row| factors[row] * rows[row][entry]);
                    add(column, line, rows, scaled, entry..own.end as usize);
                    for run in &runs[index + 1..] {
                        let entries = run.first as usize..run.end as usize;
                        add(column, run.line as usize, rows, scaled, entries);
                    }
                }
            }
            first_run = piece.runs;
        }
    }
}

/// Adds the products with the entries of a run to its lines of a column. A function is used because a closure would be compiled
/// without the vector instructions of the processor.
#[inline(always)]
fn add<const M: usize>(
    column: &mut [f64],
    line: usize,
    rows: [&[f64]; M],
    scaled: [f64; M],
    entries: std::ops::Range<usize>,
) {
    let count = entries.len();
    let lines = &mut column[line..][..count];
    let rows: [&[f64]; M] = std::array::from_fn(|row| &rows[row][entries.clone()][..count]);
    for (k, sum) in lines.iter_mut().enumerate() {
        let mut products = scaled[0] * rows[0][k];
        for row in 1..M {
            products += scaled[row] * rows[row][k];
        }
        *sum += products;
    }
}
