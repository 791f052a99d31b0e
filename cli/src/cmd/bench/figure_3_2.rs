//! Figure 3.2 of the thesis: its warm start against none, on walking, trotting and harder gaits.

use super::chart::{self, Curve, Labels};
use super::only::Only;
use super::publish;
use crate::inputs::Source;
use crate::output::{self, Table};
use crate::{Exit, interrupt};
use cpu_time::ThreadTime;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::SolveSummary;
use rollwalk_planner::start::{Start, WarmStart};
use rollwalk_planner::{Options, optimise};
use serde::Serialize;
use std::ops::ControlFlow;
use std::path::Path;

/// Motion files.
const GAITS: [&str; 6] = ["trot", "walk", "walk_held", "flying_trot", "pronk", "pace"];
const STARTS: [(&str, Start); 3] = [
    ("standing", Start::Standing),
    ("warm start", Start::Warm(WarmStart { literal: false })),
    ("warm start, literal", Start::Warm(WarmStart { literal: true })),
];

/// One start of one gait, measured.
#[derive(Serialize)]
struct Row {
    gait: String,
    start: &'static str,
    cpu_s: f64,
    solve: SolveSummary,
}

/// Runs the benchmark.
pub fn run(only: &Only, out: &Path) -> miette::Result<Exit> {
    let mut table = Table::new(["gait", "start", "status", "iterations", "CPU ms"]);
    let mut rows = Vec::new();
    for gait in only.choose(&GAITS, |gait| gait)? {
        let (robot, motion) = Source::Shipped.motion(Path::new(&format!("motions/{gait}.toml")))?;
        output::say(&motion.name);
        let mut curves: Vec<Curve> = Vec::new();
        for (name, start) in STARTS {
            let options = Options { start, ..Options::default() };
            let clock = ThreadTime::now();
            let mut states = Vec::new();
            let plan = optimise(&robot, &motion, &options, &mut |progress| {
                states.push((1e3 * clock.elapsed().as_secs_f64(), progress.worst_level));
                if interrupt::requested() {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            if interrupt::requested() {
                return Ok(Exit::Interrupted);
            }
            let cpu_ms = 1e3 * clock.elapsed().as_secs_f64();
            table.row([
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
        draw(&motion, out, &curves)?;
    }
    let text = format!(
        "{}\n\nThe thesis reports a trot in 5 s with the warm start against 9.5 s without, and no walk within a \
         minute without.\nHere Gauss-Newton with multipliers plans both from standing in fewer iterations \
         than the warm start itself takes; it pays where standing\nends in a bad minimum. Iterations of the warm start include those of its four steps.",
        table.render()
    );
    publish(out, "figure-3-2", &text, &rows)?;
    Ok(Exit::Ok)
}

fn draw(motion: &Motion, out: &Path, curves: &[Curve]) -> miette::Result<()> {
    let labels = Labels {
        title: &format!("{}: with and without the warm start", motion.name),
        x: "CPU time, ms",
        y: "worst constraint of the problem at hand over its level",
    };
    chart::draw(&out.join(format!("figure-3-2-{}.svg", motion.name)), &labels, true, curves)
}
