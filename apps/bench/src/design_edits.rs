//! Benchmark of editing a robot against planning from scratch: edits, exact derivatives, and plans predicted from them.

use crate::measure::{self, median};
use crate::row_filter::RowFilter;
use crate::{Block, Findings, inputs, table, unless_interrupted};
use cpu_time::ThreadTime;
use rollwalk_planner::motion::{Ends, Motion};
use rollwalk_planner::plan::Plan;
use rollwalk_planner::report::Report;
use rollwalk_planner::sensitivity::{Curvature, Design, Objective, Optimal, Parameter};
use rollwalk_planner::{Editing, Options, Solution};
use rollwalk_robot::Robot;
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;
use std::collections::BTreeSet;

/// Increase of the length of all links between joints, m.
const EDIT_M: f64 = 0.01;
/// Half of the interval of finite differences, m.
const HALF_M: f64 = 1e-5;

/// Number of runs. The run with the least CPU time counts. Derivatives take long, and are computed once.
const RUNS: usize = 3;

/// Measurements of one motion; CPU times in ms.
#[derive(Serialize)]
struct Row {
    motion: String,
    /// CPU time of planning the edited robot from scratch, ms.
    scratch_ms: f64,
    scratch_iterations: usize,
    /// CPU time of the first edit of a design, ms. This edit determines the structure of the problem.
    first_ms: f64,
    /// CPU time of an edit that follows another edit, ms.
    edit_ms: f64,
    edit_iterations: usize,
    /// Ratio of the cost of the edited plan to that of the plan from scratch.
    cost_ratio: f64,
    /// CPU time of the report of a plan, ms. The report includes the open-loop quality and the growth of deviations without
    /// feedback.
    report_ms: f64,
    /// CPU time of the optimum and its exact derivative, ms; null without a derivative.
    derived_ms: Option<f64>,
    /// CPU time of the edit from the predicted plan, ms; null without a prediction.
    predicted_ms: Option<f64>,
    predicted_iterations: Option<usize>,
    /// True if all plans converged.
    solved: bool,
}

pub fn run(only: &RowFilter) -> miette::Result<Option<Findings>> {
    let files: Vec<String> = crate::motions().collect::<BTreeSet<_>>().into_iter().collect();
    let mut rows: Vec<Row> = Vec::new();
    for file in only.choose(&files, |file| file)? {
        let (robot, motion) = inputs::motion(file)?;
        let has_links = longer(&robot, EDIT_M) != robot;
        if motion.ends == Ends::Prescribed || !has_links {
            continue;
        }
        output::print_line(&motion.name);
        rows.extend(measured(&robot, &motion));
        if interrupt::requested() {
            return Ok(None);
        }
    }
    let mut table = table([
        "motion",
        "scratch ms",
        "it",
        "first edit ms",
        "edit ms",
        "it",
        "costs",
        "report ms",
        "derived ms",
        "predicted ms",
        "it",
    ]);
    let tenths = |value: f64| format!("{value:.1}");
    let number = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.0}"));
    for row in &rows {
        table.push(vec![
            row.motion.clone(),
            number(Some(row.scratch_ms)),
            row.scratch_iterations.to_string(),
            tenths(row.first_ms),
            tenths(row.edit_ms),
            row.edit_iterations.to_string(),
            format!("{:.3}", row.cost_ratio),
            tenths(row.report_ms),
            number(row.derived_ms),
            number(row.predicted_ms),
            row.predicted_iterations.map_or("–".to_owned(), |count| count.to_string()),
        ]);
    }
    let blocks = vec![Block::Table(table), Block::Text(summary(&rows))];
    Ok(Some(Findings::new("design-edits", blocks, &rows)))
}

fn summary(rows: &[Row]) -> String {
    // `both` is added to both sides of the ratio, for example the report, which a plan from scratch needs as well.
    let with = |both: &dyn Fn(&Row) -> f64, cost: &dyn Fn(&Row) -> Option<f64>| {
        let both = rows.iter().filter_map(|row| {
            let both = both(row);
            Some((row.scratch_ms + both, cost(row)? + both))
        });
        let both: Vec<(f64, f64)> = both.collect();
        let times = median(both.iter().map(|(scratch, cost)| scratch / cost));
        let under = both.iter().filter(|(_, cost)| *cost < 50.0).count();
        format!("{times:.1} times faster than from scratch, {under} of {} under 50 ms", both.len())
    };
    let of = |cost: &dyn Fn(&Row) -> Option<f64>| with(&|_| 0.0, cost);
    let edit = |row: &Row| Some(row.edit_ms);
    let derived = |row: &Row| Some(row.derived_ms? + row.predicted_ms?);
    format!(
        "all links changed by {} m; medians of CPU time:\nedit after another: {}\nedit after \
         another, with the report of its plan: {}\nfirst edit of a design: {}\noptimum, exact \
         derivative and predicted plan: {}\npredicted plan, where the exact derivative is known: \
         {}",
        EDIT_M,
        of(&edit),
        with(&|row| row.report_ms, &edit),
        of(&|row| Some(row.first_ms)),
        of(&derived),
        of(&|row| row.predicted_ms),
    )
}

/// Measures one motion. Returns `None` if the unedited robot has no plan.
fn measured(robot: &Robot, motion: &Motion) -> Option<Row> {
    let options = Options { refine: false, ..Options::default() };
    let before = measure::cold(robot, motion, &options);
    if !before.solved() {
        return None;
    }
    let edited = longer(robot, EDIT_M);
    let scratch = least(|| Some(measure::cold(&edited, motion, &options)), |run| run.cpu_s)?;
    let on = &mut |_: &_| unless_interrupted();
    let timed = |editing: &mut Editing, robot: &Robot| {
        let clock = ThreadTime::now();
        let solution = editing.replan(robot, motion, &mut |_| unless_interrupted()).ok()?;
        Some((solution, 1e3 * clock.elapsed().as_secs_f64()))
    };
    let begun = || Editing::new(before.solution.clone(), &options);
    let ms = |(_, ms): &(Solution, f64)| *ms;
    let (_, first_ms) = least(|| timed(&mut begun(), &edited), ms)?;
    let after_another = || {
        let mut editing = begun();
        timed(&mut editing, robot)?;
        timed(&mut editing, &edited)
    };
    let (Solution { plan, .. }, edit_ms) = least(after_another, ms)?;
    let clock = ThreadTime::now();
    let _ = Report::new(&plan);
    let report_ms = 1e3 * clock.elapsed().as_secs_f64();
    let cost = |plan: &Plan| Objective::PlanCost.of_plan(plan, &options.weights);
    let [ahead, behind] = [HALF_M, -HALF_M].map(|by_m| longer(robot, by_m));
    let design = |robot| Design { robot, motion };
    let parameter =
        Parameter { ahead: design(&ahead), behind: design(&behind), apart: 2.0 * HALF_M };
    let clock = ThreadTime::now();
    let derived = Optimal::of(&before.solution, &options, on)
        .and_then(|mut optimal| Ok((optimal.changes(&[parameter])?.remove(0), optimal)))
        .ok()
        .filter(|(_, optimal)| optimal.curvature() == Curvature::Full);
    let derived_ms = 1e3 * clock.elapsed().as_secs_f64();
    let clock = ThreadTime::now();
    let predicted = derived.as_ref().and_then(|(change, optimal)| {
        let by = [(EDIT_M, change)];
        optimal.replan(design(&edited), &by, &options, on).ok()
    });
    let predicted_ms = 1e3 * clock.elapsed().as_secs_f64();
    let converged = |plan: &Plan| plan.solve.status.is_solved();
    Some(Row {
        motion: motion.name.clone(),
        scratch_ms: 1e3 * scratch.cpu_s,
        scratch_iterations: scratch.iterations,
        first_ms,
        edit_ms,
        edit_iterations: plan.solve.iterations,
        cost_ratio: cost(&plan) / cost(scratch.plan()),
        report_ms,
        derived_ms: derived.is_some().then_some(derived_ms),
        predicted_ms: predicted.as_ref().map(|_| predicted_ms),
        predicted_iterations: predicted.as_ref().map(|of| of.plan.solve.iterations),
        solved: scratch.solved()
            && converged(&plan)
            && predicted.is_none_or(|of| converged(&of.plan)),
    })
}

/// Returns the run with the least cost. All runs have equal results, but other programs on the machine slow some of them.
fn least<T>(run: impl FnMut() -> Option<T>, cost: impl Fn(&T) -> f64) -> Option<T> {
    std::iter::repeat_with(run).take(RUNS).flatten().min_by(|a, b| cost(a).total_cmp(&cost(b)))
}

/// Returns the robot with longer links between its joints.
fn longer(robot: &Robot, by_m: f64) -> Robot {
    let mut robot = robot.clone();
    for joint in robot.joints.iter_mut().filter(|joint| joint.parent != 0) {
        let z = &mut joint.parent_from_joint.translation.z;
        *z += if *z == 0.0 { 0.0 } else { z.signum() * by_m };
    }
    robot
}
