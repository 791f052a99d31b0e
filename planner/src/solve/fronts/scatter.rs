//! Destinations of rows in the panels, to which the products of their derivatives are added.

use super::front::Front;
use pulp::NullaryFnOnce;

/// Destinations of the products of the derivatives of one row.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct ScatterMap {
    /// Entries of the row in the order of elimination.
    entries: Vec<u32>,
    pieces: Vec<Piece>,
    /// Runs of entries and lines in the fronts of the pieces.
    runs: Vec<Run>,
}

/// Entries of a row that are pivots of one front.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Offset of the front's panel.
    panel: usize,
    /// Number of lines of the panel.
    stride: usize,
    /// End index of the piece in `entries`.
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
    /// Returns the destinations of the products of a row with these columns. `None` if the row couples columns that no front
    /// contains together.
    ///
    /// `position` contains the position of each column in the order of elimination, and `front_of` the front of each position.
    pub(super) fn of(
        columns: &[usize],
        position: &[usize],
        front_of: &[usize],
        fronts: &[Front],
    ) -> Option<Self> {
        let at = |entry: &u32| position[columns[*entry as usize]];
        let mut entries: Vec<u32> = (0..columns.len() as u32).collect();
        entries.sort_unstable_by_key(at);
        let (mut pieces, mut runs) = (Vec::new(), Vec::<Run>::with_capacity(columns.len()));
        let mut first = 0;
        while first < entries.len() {
            let front = &fronts[front_of[at(&entries[first])]];
            let own = |entry: &u32| at(entry) < front.first + front.pivots;
            let end = first + entries[first..].partition_point(own);
            let (mut line, of_piece) = (0, runs.len());
            for (entry, column) in entries.iter().enumerate().skip(first) {
                line = front.line(at(column), line)?;
                let (entry, line) = (entry as u32, line as u32);
                match runs[of_piece..].last_mut() {
                    Some(run) if run.line + (entry - run.first) == line => run.end = entry + 1,
                    _ => runs.push(Run { first: entry, end: entry + 1, line }),
                }
            }
            let (panel, stride) = (front.panel, front.lines());
            pieces.push(Piece { panel, stride, end, runs: runs.len() });
            first = end;
        }
        Some(Self { entries, pieces, runs })
    }
}

/// Operation that adds `factor` times the products of a row's derivatives to the panels. `sorted` is scratch memory.
pub(super) struct Products<'a> {
    pub places: &'a ScatterMap,
    pub derivatives: &'a [f64],
    pub factor: f64,
    pub panels: &'a mut [f64],
    pub sorted: &'a mut Vec<f64>,
}

impl NullaryFnOnce for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { places, derivatives, factor, panels, sorted } = self;
        sorted.clear();
        sorted.extend(places.entries.iter().map(|&entry| derivatives[entry as usize]));
        let mut runs = &places.runs[..];
        let mut before = 0;
        for piece in &places.pieces {
            let (of_piece, others) = runs.split_at(piece.runs - before);
            (runs, before) = (others, piece.runs);
            for (index, own) in of_piece.iter().enumerate() {
                for entry in own.first as usize..piece.end.min(own.end as usize) {
                    let line = own.line as usize + entry - own.first as usize;
                    let column = &mut panels[piece.panel + line * piece.stride..][..piece.stride];
                    let scaled = factor * sorted[entry];
                    let mut add = |first: usize, end: usize, line: usize| {
                        let later = &sorted[first..end];
                        let lines = &mut column[line..][..later.len()];
                        lines.iter_mut().zip(later).for_each(|(sum, d)| *sum += scaled * d);
                    };
                    add(entry, own.end as usize, line);
                    for run in &of_piece[index + 1..] {
                        add(run.first as usize, run.end as usize, run.line as usize);
                    }
                }
            }
        }
    }
}
