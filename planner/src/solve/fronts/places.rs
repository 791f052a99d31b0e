//! Places of rows in the panels: where the products of their derivatives go.

use super::Fronts;

/// Where the products of the derivatives of one row go.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Places {
    /// Entries of the row in the order of elimination.
    entries: Vec<u32>,
    pieces: Vec<Piece>,
    /// Lines of entries in the fronts of the pieces.
    lines: Vec<u32>,
}

/// The entries of a row that are pivots of one front.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Place of the front's panel, and count of its lines.
    panel: usize,
    stride: usize,
    /// First entry and end of the entries in the order of elimination.
    first: usize,
    end: usize,
    /// Where the lines of these and all later entries begin.
    lines: usize,
}

impl Fronts {
    /// Places of the products of a row with these columns; `None` if it couples columns that no front has together.
    pub fn places(&self, columns: &[usize]) -> Option<Places> {
        let at = |entry: &u32| self.position[columns[*entry as usize]];
        let mut entries: Vec<u32> = (0..columns.len() as u32).collect();
        entries.sort_unstable_by_key(at);
        let (mut pieces, mut lines) = (Vec::new(), Vec::new());
        let mut first = 0;
        while first < entries.len() {
            let front = &self.fronts[self.front_of[at(&entries[first])]];
            let own = |entry: &u32| at(entry) < front.first + front.pivots;
            let end = first + entries[first..].partition_point(own);
            let (panel, stride) = (front.panel, front.lines());
            pieces.push(Piece { panel, stride, first, end, lines: lines.len() });
            let mut line = 0;
            for entry in &entries[first..] {
                line = front.line(at(entry), line)?;
                lines.push(line as u32);
            }
            first = end;
        }
        Some(Places { entries, pieces, lines })
    }
}

impl Places {
    /// Adds `factor` times the products of a row's derivatives to the panels. `sorted` is scratch memory.
    pub fn add(&self, derivatives: &[f64], factor: f64, panels: &mut [f64], sorted: &mut Vec<f64>) {
        sorted.clear();
        sorted.extend(self.entries.iter().map(|&entry| derivatives[entry as usize]));
        for piece in &self.pieces {
            let later = &sorted[piece.first..];
            let lines = &self.lines[piece.lines..][..later.len()];
            for own in 0..piece.end - piece.first {
                let start = piece.panel + lines[own] as usize * piece.stride;
                let column = &mut panels[start..][..piece.stride];
                let scaled = factor * later[own];
                for (&line, derivative) in lines[own..].iter().zip(&later[own..]) {
                    column[line as usize] += scaled * derivative;
                }
            }
        }
    }
}
