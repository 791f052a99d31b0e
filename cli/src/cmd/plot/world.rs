//! Log of the simulated world, drawn as panels over time.

use miette::miette;
use rollwalk_planner::plot::chart::{self, Curve};
use rollwalk_simulate::log::Table;
use rollwalk_terminal::files;
use rollwalk_terminal::kind::Kind;
use std::path::Path;

/// Maximum number of points of a curve.
const POINTS_MAX: usize = 2000;
/// Minimum duration of a motion whose name is drawn, as a fraction of the duration of the log.
const NAMED: f64 = 0.04;

/// Draws the log in a file as SVG text.
pub fn figure(path: &Path) -> miette::Result<String> {
    let text = files::read_text(path, Kind::WorldLog)?;
    let table = Table::read(&text).map_err(|error| {
        let help = "make a world log with `rollwalk simulate PLAN.json --world-log RUN.csv`; \
            docs/formats/world-log.md describes the format";
        miette!(help = help, "{}: {error}", path.display())
    })?;
    let figure = Figure { time_s: table.column("time_s").unwrap_or_default(), table };
    let title = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(chart::panels(&title, "time (s)", &figure.panels(), &figure.marks()))
}

struct Figure {
    time_s: Vec<f64>,
    table: Table,
}

impl Figure {
    fn panels(&self) -> Vec<(String, Vec<Curve>)> {
        let [turn, tilt] = self.angles_deg();
        let of_end_effectors = |ending: &str| {
            let names = self.table.with_ending(ending);
            names.map(|name| self.curve(name, self.column(&format!("{name}{ending}")))).collect()
        };
        let speed = |axis: &str| self.column(&format!("com_v{axis}_m_s"));
        let speed = speed("x").iter().zip(&speed("y")).map(|(x, y)| x.hypot(*y)).collect();
        let way = |name: &str, axis: &str| self.curve(name, self.column(&format!("com_{axis}_m")));
        let panel = |title: &str, curves| (title.to_owned(), curves);
        vec![
            panel("position of the centre of mass (m)", vec![way("x", "x"), way("y", "y")]),
            panel("height of the body (m)", vec![self.curve("z", self.column("base_z_m"))]),
            panel("body (°)", vec![self.curve("heading", turn), self.curve("tilt", tilt)]),
            panel("speed over the ground (m/s)", vec![self.curve("centre of mass", speed)]),
            panel("force along the normal (N)", of_end_effectors("_normal_n")),
            panel("slip (m/s)", of_end_effectors("_slip_m_s")),
            panel("torque / limit", self.shares()),
        ]
    }

    /// Column that every table has, or one derived from the name of such a column.
    fn column(&self, name: &str) -> Vec<f64> {
        self.table.column(name).unwrap_or_else(|| vec![0.0; self.time_s.len()])
    }

    /// Points of a curve. Long curves are reduced to the minimum and maximum of each piece, so that no peak is lost.
    fn curve(&self, name: &str, values: Vec<f64>) -> Curve {
        let points: Vec<_> = self.time_s.iter().copied().zip(values).collect();
        if points.len() <= POINTS_MAX {
            return (name.to_owned(), points);
        }
        let pieces = points.chunks((2 * points.len()).div_ceil(POINTS_MAX));
        let ends = pieces.flat_map(|piece| {
            let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
            let (least, most) = (piece.iter().min_by(by_value), piece.iter().max_by(by_value));
            let mut ends = [least, most].map(|end| end.copied().unwrap_or_default());
            ends.sort_by(|a, b| a.0.total_cmp(&b.0));
            ends
        });
        (name.to_owned(), ends.collect())
    }

    /// Heading with full turns counted, and tilt of the body.
    fn angles_deg(&self) -> [Vec<f64>; 2] {
        let [w, x, y, z] = ["w", "x", "y", "z"].map(|part| self.column(&format!("base_q{part}")));
        let (mut headings, mut tilts) = (Vec::new(), Vec::new());
        let mut last_deg = 0.0;
        for k in 0..self.time_s.len() {
            let (w, x, y, z) = (w[k], x[k], y[k], z[k]);
            let heading_deg =
                (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)).to_degrees();
            last_deg += (heading_deg - last_deg + 180.0_f64).rem_euclid(360.0) - 180.0;
            headings.push(last_deg);
            tilts.push((1.0 - 2.0 * (x * x + y * y)).clamp(-1.0, 1.0).acos().to_degrees());
        }
        [headings, tilts]
    }

    /// Ratios of motor torque to torque limit: the maximum over all motors at each time, and the mean.
    fn shares(&self) -> Vec<Curve> {
        let motors: Vec<_> = self.table.with_ending("_limit_nm").collect();
        let (mut most, mut sum) = (vec![0.0; self.time_s.len()], vec![0.0; self.time_s.len()]);
        for motor in &motors {
            let torques = self.column(&format!("{motor}_nm"));
            let limits = self.column(&format!("{motor}_limit_nm"));
            for (k, (torque_nm, limit_nm)) in torques.iter().zip(&limits).enumerate() {
                let share = if *limit_nm > 0.0 { torque_nm.abs() / limit_nm } else { 0.0 };
                most[k] = f64::max(most[k], share);
                sum[k] += share;
            }
        }
        let mean = sum.iter().map(|sum| sum / motors.len().max(1) as f64).collect();
        vec![self.curve("most loaded motor", most), self.curve("mean", mean)]
    }

    /// Start times of motions, s, with their names if there is room.
    fn marks(&self) -> Vec<(f64, String)> {
        let motions = &self.table.motions;
        let starts = (0..motions.len()).filter(|&k| k == 0 || motions[k] != motions[k - 1]);
        let starts: Vec<usize> = starts.collect();
        let all_s = self.time_s[self.time_s.len() - 1] - self.time_s[0];
        let ends = starts.iter().skip(1).copied().chain([motions.len() - 1]);
        let named = starts.iter().zip(ends).map(|(&start, end)| {
            let has_room = self.time_s[end] - self.time_s[start] > NAMED * all_s;
            let name = if has_room { motions[start].clone() } else { String::new() };
            (self.time_s[start], name)
        });
        named.collect()
    }
}
