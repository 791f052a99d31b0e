//! Report as an aligned text table.

use super::{FamilyCost, Grid, LargestTorque, MotorKind, Report, Row};
use std::fmt;

const HEADER: [&str; 6] = ["residual", "equation", "worst", "tolerance", "unit", "where"];

impl fmt::Display for Grid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Grid::Samples => "at the samples",
            Grid::Library60Hz => "as played, 60 Hz",
            Grid::Control500Hz => "as played, 500 Hz",
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} of {}", self.motion, self.robot)?;
        let cells: Vec<[String; 6]> = self.rows.iter().map(cells).collect();
        let mut width = HEADER.map(str::len);
        for row in &cells {
            for (width, cell) in width.iter_mut().zip(row) {
                *width = (*width).max(cell.chars().count());
            }
        }
        let line = |f: &mut fmt::Formatter<'_>, row: &[String; 6]| {
            let [name, equation, worst, level, unit, place] = row;
            let [a, b, c, d, e, _] = width;
            writeln!(f, "  {name:a$}  {equation:b$}  {worst:>c$}  {level:>d$}  {unit:e$}  {place}")
        };
        line(f, &HEADER.map(str::to_owned))?;
        let mut grid = None;
        for (row, cells) in self.rows.iter().zip(&cells) {
            if grid.replace(row.grid) != Some(row.grid) {
                writeln!(f, "{}", row.grid)?;
            }
            line(f, cells)?;
        }
        writeln!(f, "largest torques as played, 60 Hz")?;
        for (kind, word) in [(MotorKind::Joint, "joint"), (MotorKind::Wheel, "wheel")] {
            let motors = self.torques.iter().filter(|motor| motor.kind == kind);
            let hardest = motors.max_by(|a, b| a.part_of_limit().total_cmp(&b.part_of_limit()));
            let Some(motor) = hardest else { continue };
            let percent = 100.0 * motor.part_of_limit();
            let [torque_nm, limit_nm] = [motor.torque_nm, motor.limit_nm].map(number);
            let LargestTorque { motor, time_s, .. } = motor;
            writeln!(
                f,
                "  {word}: {torque_nm} of {limit_nm} N·m ({percent:.0} %) at {time_s:.3} s, {motor}"
            )?;
        }
        write!(f, "{}", self.room)?;
        if !self.costs.is_empty() {
            writeln!(f, "costs, weight × residual² over all rows, with the default weights")?;
        }
        let widest = self.costs.iter().map(|of| of.family.name().len()).max().unwrap_or(0);
        for FamilyCost { family, rows, weight: [low, high], cost, share } in &self.costs {
            let percent = format!("({:.1} %)", 100.0 * share);
            let low = number(*low);
            let weights = match number(*high) {
                high if high == low => format!("weight {low}"),
                high => format!("weights {low} to {high}"),
            };
            let cost = number(*cost);
            writeln!(f, "  {family:widest$}  {cost:>9} {percent:>9}  {rows} rows, {weights}")?;
        }
        // A large growth is printed with the verdict, below the table.
        if let Some(growth) = self.growth_per_cycle.filter(|growth| !growth.is_much()) {
            writeln!(f, "{growth}")?;
        }
        match self.rows.iter().filter(|row| row.is_beyond()).count() {
            0 => Ok(()),
            1 => writeln!(f, "1 residual is beyond its tolerance (marked with !)"),
            count => writeln!(f, "{count} residuals are beyond their tolerance (marked with !)"),
        }
    }
}

fn cells(row: &Row) -> [String; 6] {
    let mark = if row.is_beyond() { "!" } else { "" };
    let place = row.place.as_ref().map_or(String::new(), |place| {
        let subject = place.subject.as_ref().map_or(String::new(), |name| format!(", {name}"));
        format!("sample {} ({:.3} s){subject}", place.sample, place.time_s)
    });
    [
        row.family.name().to_owned(),
        row.equation.to_owned(),
        format!("{mark}{}", number(row.worst)),
        row.level.map_or("-".to_owned(), number),
        row.unit.to_owned(),
        place,
    ]
}

/// Formats a value with three significant digits; small values have an exponent.
pub(super) fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        small if small < 1e-3 => format!("{value:.2e}"),
        middle if middle < 10.0 => format!("{value:.3}"),
        _ => format!("{value:.1}"),
    }
}
