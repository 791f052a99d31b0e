//! Figure 2.3 of the thesis: convergence of its Newton methods, of L-BFGS and of our method.

use crate::row_filter::RowFilter;
use crate::{Block, Findings, inputs, table, unless_interrupted};
use cpu_time::ThreadTime;
use rollwalk_planner::plan::SolveSummary;
use rollwalk_planner::plot::chart::{self, Curve, Labels};
use rollwalk_planner::{Method, Options, candidates, optimise};
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;

const METHODS: [(Method, &str); 4] = [
    (Method::GaussNewton, "Gauss-Newton with multipliers"),
    (Method::NewtonFiltered, "Newton, Filtered Hessian"),
    (Method::NewtonTrue, "Newton, true Hessian"),
    (Method::Lbfgs, "L-BFGS"),
];
pub const MOTIONS: [&str; 2] =
    ["motions/table_2_1/swizzlebot_forward.toml", "motions/table_2_1/creature3_walk.toml"];
/// Largest ratio of a residual to its tolerance at which a constraint counts as met.
const MET: f64 = 1.0;

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    /// Maximum number of iterations of the Newton methods; L-BFGS gets ten times as many.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,
    #[command(flatten)]
    only: RowFilter,
}

/// Measurements of one method on one motion.
#[derive(Serialize)]
struct Row {
    motion: String,
    method: &'static str,
    cpu_s: f64,
    /// Iteration and CPU time, s, after which all constraints were met; null if they were not.
    met_after: Option<(usize, f64)>,
    solve: SolveSummary,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> miette::Result<Option<Findings>> {
    let (mut blocks, mut rows, mut charts) = (Vec::new(), Vec::new(), Vec::new());
    for file in args.only.choose(&MOTIONS, |file| file)? {
        let (robot, motion) = inputs::motion(file)?;
        let mut table = table([
            "method",
            "iterations",
            "CPU s",
            "met after",
            "at CPU s",
            "final level",
            "status",
        ]);
        let (mut by_iteration, mut by_time): (Vec<Curve>, Vec<Curve>) = (Vec::new(), Vec::new());
        for (method, name) in METHODS {
            output::print_line(format_args!("{} with {name}", motion.name));
            let mut options = Options { seed: 1, refine: false, ..Options::default() };
            options.settings.method = method;
            let factor = if method == Method::Lbfgs { 10 } else { 1 };
            options.settings.iterations = factor * args.iterations as usize;
            // All methods have one start, because a second start would begin a new curve.
            let options = candidates(&robot, &motion, &options).swap_remove(0);
            let clock = ThreadTime::now();
            let mut states = Vec::new();
            let plan = optimise(&robot, &motion, &options, &mut |progress| {
                let cpu_s = clock.elapsed().as_secs_f64();
                states.push((progress.iteration as f64, cpu_s, progress.worst_level));
                unless_interrupted()
            });
            if interrupt::requested() {
                return Ok(None);
            }
            let met = states.iter().find(|state| state.2 <= MET);
            let or_never = |value: Option<String>| value.unwrap_or("never".into());
            table.push(vec![
                name.into(),
                plan.solve.iterations.to_string(),
                format!("{:.2}", clock.elapsed().as_secs_f64()),
                or_never(met.map(|state| format!("{}", state.0))),
                or_never(met.map(|state| format!("{:.2}", state.1))),
                format!("{:.1e}", plan.solve.worst_level),
                format!("{:?}", plan.solve.status),
            ]);
            rows.push(Row {
                motion: motion.name.clone(),
                method: name,
                cpu_s: clock.elapsed().as_secs_f64(),
                met_after: met.map(|state| (state.0 as usize, state.1)),
                solve: plan.solve,
            });
            by_iteration.push((name.into(), states.iter().map(|s| (s.0, s.2)).collect()));
            by_time.push((name.into(), states.iter().map(|s| (s.1.max(1e-4), s.2)).collect()));
        }
        blocks.push(Block::Text(format!("{} on {}", motion.name, robot.name)));
        blocks.push(Block::Table(table));
        for (curves, what, x) in
            [(&by_iteration, "iterations", "iteration"), (&by_time, "time", "CPU time, s")]
        {
            let labels = Labels {
                title: &format!("{}: convergence", motion.name),
                x,
                y: "worst constraint / its tolerance",
            };
            let name = format!("figure-2-3-{}-{what}.svg", motion.name);
            charts.push((name, chart::logarithmic(&labels, curves)));
        }
    }
    let text = "The methods of the thesis minimise its penalty energy (weight 10000, goals 50), \
             ours the same\nconstraints with multipliers, so the common measure is the worst \
             constraint or goal divided by its\ntolerance. Second derivatives come from \
             differences of exact\ngradients, which makes a Newton iteration more expensive than \
             the closed forms of the thesis: compare iterations, not\nCPU time, between the two.";
    blocks.push(Block::Text(text.into()));
    Ok(Some(Findings { charts, ..Findings::new("figure-2-3", blocks, &rows) }))
}
