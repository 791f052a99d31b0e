//! Benchmark of the cost as a function of the number of samples: one walk with 12 to 240 samples.

use crate::{Block, Findings, inputs, measure, table};
use rollwalk_planner::Options;
use rollwalk_planner::plot::chart::{self, Labels};
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;

pub const MOTION: &str = "motions/walk.toml";
const SAMPLES: [usize; 7] = [12, 24, 48, 72, 96, 120, 240];
/// Number of samples in a stride. Longer motions repeat it.
const STRIDE: usize = 12;

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    /// Numbers of samples, multiples of 12.
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_values_t = SAMPLES)]
    #[arg(value_parser = whole_strides)]
    samples: Vec<usize>,
}

fn whole_strides(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(samples) if samples > 0 && samples % STRIDE == 0 => Ok(samples),
        _ => Err(format!(
            "give a multiple of {STRIDE} samples, so that the walk consists of whole strides"
        )),
    }
}

/// Measurements for a number of samples.
#[derive(Serialize)]
struct Row {
    samples: usize,
    solved: bool,
    iterations: usize,
    cpu_s: f64,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> miette::Result<Option<Findings>> {
    let (robot, stride) = inputs::motion(MOTION)?;
    let mut table = table(["samples", "iterations", "CPU ms", "ms/iteration", "µs/sample"]);
    let mut rows = Vec::new();
    let (mut whole, mut single) = (Vec::new(), Vec::new());
    for &samples in &args.samples {
        let strides = (samples / STRIDE) as f64;
        let mut motion = measure::goal_times(&stride, strides);
        // Every second character of the pattern, in each stride.
        let pattern = &stride.stance;
        motion.stance =
            (0..samples).map(|i| pattern[(i % STRIDE) * pattern.len() / STRIDE].clone()).collect();
        motion.duration_s = stride.duration_s * strides;
        let run = measure::cold(&robot, &motion, &Options::default());
        if interrupt::requested() {
            return Ok(None);
        }
        output::print_line(format_args!("{samples} samples: {:?}", run.plan().solve.status));
        let per_iteration = 1e3 * run.cpu_s / run.iterations as f64;
        table.push(vec![
            samples.to_string(),
            run.iterations.to_string(),
            format!("{:.1}", 1e3 * run.cpu_s),
            format!("{per_iteration:.2}"),
            format!("{:.0}", 1e3 * per_iteration / samples as f64),
        ]);
        let (solved, iterations, cpu_s) = (run.solved(), run.iterations, run.cpu_s);
        rows.push(Row { samples, solved, iterations, cpu_s });
        whole.push((samples as f64, 1e3 * run.cpu_s));
        single.push((samples as f64, per_iteration));
    }
    let title = format!("Walking, one stride of {STRIDE} samples after the other.");
    let mut blocks = vec![Block::Text(title), Block::Table(table)];
    if let Some(slope) = exponent(&single) {
        let growth = format!("CPU time of an iteration grows as samples^{slope:.2}.");
        blocks.push(Block::Text(growth));
    }
    let labels = Labels { title: "Cost against samples", x: "samples", y: "CPU time, ms" };
    let curves = [("whole solve".to_owned(), whole), ("one iteration".to_owned(), single)];
    let charts = vec![("samples.svg".to_owned(), chart::logarithmic(&labels, &curves))];
    Ok(Some(Findings { charts, ..Findings::new("samples", blocks, &rows) }))
}

/// Slope of the least-squares line through the logarithms; `None` if all x are equal.
fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logs.len() as f64;
    let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / count;
    let covariance: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    let variance: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    (variance > 0.0).then_some(covariance / variance)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_exponent_of_a_power_is_found() {
        let points: Vec<_> = (1..9).map(|i| (f64::from(i), 3.0 * f64::from(i).powf(1.2))).collect();
        assert!((super::exponent(&points).unwrap() - 1.2).abs() < 1e-12); // rounding only
        assert_eq!(super::exponent(&points[..1]), None);
    }
}
