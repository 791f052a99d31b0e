//! Figure 3.2 of the thesis: convergence with and without its warm start, on walking, trotting and harder gaits.

use crate::row_filter::RowFilter;
use crate::{Block, Findings, inputs, table, unless_interrupted};
use cpu_time::ThreadTime;
use rollwalk_planner::plan::SolveSummary;
use rollwalk_planner::plot::chart::{self, Curve, Labels};
use rollwalk_planner::start::{Start, WarmStart};
use rollwalk_planner::{Options, optimise};
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;

pub const GAITS: [&str; 6] = ["trot", "walk", "walk_held", "flying_trot", "pronk", "pace"];
const STARTS: [(&str, Start); 3] = [
    ("standing", Start::Standing),
    ("warm start", Start::Warm(WarmStart { literal: false })),
    ("warm start, literal", Start::Warm(WarmStart { literal: true })),
];

/// Measurements of one start of one gait.
#[derive(Serialize)]
struct Row {
    gait: String,
    start: &'static str,
    cpu_s: f64,
    solve: SolveSummary,
}

pub fn run(only: &RowFilter) -> miette::Result<Option<Findings>> {
    let mut table = table(["gait", "start", "status", "iterations", "CPU ms"]);
    let (mut rows, mut charts) = (Vec::new(), Vec::new());
    for gait in only.choose(&GAITS, |gait| gait)? {
        let (robot, motion) = inputs::motion(&format!("motions/{gait}.toml"))?;
        output::print_line(&motion.name);
        let mut curves: Vec<Curve> = Vec::new();
        for (name, start) in STARTS {
            let options = Options { start, refine: false, ..Options::default() };
            let clock = ThreadTime::now();
            let mut states = Vec::new();
            let plan = optimise(&robot, &motion, &options, &mut |progress| {
                states.push((1e3 * clock.elapsed().as_secs_f64(), progress.worst_level));
                unless_interrupted()
            });
            if interrupt::requested() {
                return Ok(None);
            }
            let cpu_ms = 1e3 * clock.elapsed().as_secs_f64();
            table.push(vec![
                motion.name.clone(),
                name.into(),
                format!("{:?}", plan.solve.status),
                plan.solve.iterations.to_string(),
                format!("{cpu_ms:.0}"),
            ]);
            rows.push(Row {
                gait: motion.name.clone(),
                start: name,
                cpu_s: 1e-3 * cpu_ms,
                solve: plan.solve,
            });
            curves.push((name.into(), states));
        }
        let labels = Labels {
            title: &format!("{}: with and without the warm start", motion.name),
            x: "CPU time, ms",
            y: "worst constraint of the current problem / its tolerance",
        };
        charts.push((
            format!("figure-3-2-{}.svg", motion.name),
            chart::logarithmic(&labels, &curves),
        ));
    }
    let text = "The thesis reports a trot in 5 s with the warm start and in 9.5 s without it, and no \
         walk within a minute without it.\nHere Gauss-Newton with multipliers plans both gaits \
         from the standing pose in fewer iterations than the warm start needs;\nthe warm start \
         helps if the standing pose leads to a bad local minimum. Its iterations include those of \
         its four steps.";
    let blocks = vec![Block::Table(table), Block::Text(text.into())];
    Ok(Some(Findings { charts, ..Findings::new("figure-3-2", blocks, &rows) }))
}
