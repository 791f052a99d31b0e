//! Search over footfall patterns for the goal of a motion (`--search-gaits`), ranked by the simulation of their plans.

use super::simulated;
use rollwalk_planner::motion::{Motion, Pattern, PatternKind};
use rollwalk_planner::plan::Plan;
use rollwalk_planner::report::{Report, Row};
use rollwalk_planner::sensitivity::Objective;
use rollwalk_planner::{Options, timing};
use rollwalk_robot::Robot;
use rollwalk_simulate::Verdict;
use rollwalk_terminal::progress::SolveProgress;
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;

/// Pattern with its plan and the criteria of the ranking.
#[derive(Serialize)]
pub struct RankedPattern {
    /// Footfalls, as text.
    footfalls: String,
    /// Duration of the plan, s; null without a plan.
    duration_s: Option<f64>,
    /// True if the plan passes the checks as played.
    consistent: bool,
    /// Verdict of the simulation; null for a plan that is not consistent, and with `--no-simulation`.
    simulation: Option<Verdict>,
    /// Largest residual as played, as a fraction of its tolerance.
    as_played: Option<f64>,
    /// Sum of the costs.
    cost: Option<f64>,
    /// Keys of a motion file with this pattern; null for the pattern of the file.
    motion_keys: Option<String>,
    #[serde(skip)]
    plan: Option<Plan>,
}

impl RankedPattern {
    fn new(kind: PatternKind, plan: Option<Plan>, options: &Options, simulates: bool) -> Self {
        let report = plan.as_ref().map(Report::new);
        let consistent = report.as_ref().is_some_and(|report| report.judgement.is_good());
        let simulation =
            plan.as_ref().filter(|_| consistent && simulates && !interrupt::requested());
        let played = report.as_ref().and_then(|report| report.worst_of(true));
        Self {
            footfalls: kind.to_string(),
            duration_s: plan.as_ref().map(|plan| plan.motion.duration_s),
            consistent,
            simulation: simulation.and_then(simulated),
            as_played: played.map(Row::part_of_level),
            cost: plan.as_ref().map(|plan| Objective::PlanCost.of_plan(plan, &options.weights)),
            motion_keys: kind.footfall_keys().zip(plan.as_ref()).map(|(footfalls, plan)| {
                let Motion { duration_s, swing_height_m, stance, .. } = &plan.motion;
                format!(
                    "duration_s = {duration_s:.4}, swing_height_m = {swing_height_m:.3}, samples = {}, and \
                     [footfalls] with {footfalls}",
                    stance.len()
                )
            }),
            plan,
        }
    }

    /// Rank of a plan: passes the simulation, is consistent as played, exists. Within a rank, plans with lower costs come first.
    fn order(&self) -> (bool, bool, bool, f64) {
        let holds = self.simulation.as_ref().is_some_and(Verdict::holds);
        (!holds, !self.consistent, self.plan.is_none(), self.cost.unwrap_or(f64::INFINITY))
    }

    fn cells(&self, rank: usize) -> [String; 6] {
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "–".to_owned(), |value| format!("{value:.digits$}"))
        };
        let played = match (&self.plan, &self.simulation) {
            (None, _) => "no plan",
            (_, Some(verdict)) if verdict.holds() => "passes the simulation",
            (_, Some(_)) => "fails in simulation",
            (_, None) if self.consistent => "consistent, not simulated",
            (_, None) => "not consistent as played",
        };
        [
            rank.to_string(),
            self.footfalls.clone(),
            number(self.duration_s, 3),
            played.to_owned(),
            number(self.as_played, 2),
            number(self.cost, 4),
        ]
    }
}

/// Patterns in the order of their ranks.
pub struct GaitSearch {
    pub patterns: Vec<RankedPattern>,
}

impl GaitSearch {
    /// Plans, judges and ranks all footfall patterns that suit a robot. After Ctrl-C, the ranking contains the patterns so far.
    pub fn run(
        robot: &Robot,
        motion: &Motion,
        options: &Options,
        simulates: bool,
        verbose: bool,
    ) -> Self {
        let tried = motion.patterns(robot);
        let with_cycles =
            |pattern: &Pattern| matches!(pattern.kind, PatternKind::Gait { cycles: Some(_), .. });
        if tried.iter().any(with_cycles) {
            output::print_line(
                "the search gives each gait about one cycle a second, in place of `cycles` of the \
                 motion file; the pattern \"as given\" keeps `cycles`",
            );
        }
        let mut patterns = Vec::new();
        for pattern in tried {
            if interrupt::requested() {
                break;
            }
            let watch = SolveProgress::start(&pattern.kind.to_string(), verbose);
            let progress = &mut |state: &_| watch.iteration(state);
            let plan = timing::attempt(robot, &pattern.motion, options, progress);
            watch.finish();
            let plan = plan.map(|solution| solution.plan);
            patterns.push(RankedPattern::new(pattern.kind, plan, options, simulates));
        }
        patterns.sort_by(|a, b| {
            let ((a0, a1, a2, a), (b0, b1, b2, b)) = (a.order(), b.order());
            (a0, a1, a2).cmp(&(b0, b1, b2)).then(a.total_cmp(&b))
        });
        Self { patterns }
    }

    /// Takes the best plan and its verdict. `None` if no pattern has a plan.
    pub fn best(&mut self) -> Option<(Plan, Option<Verdict>)> {
        let best = self.patterns.first_mut()?;
        Some((best.plan.take()?, best.simulation.clone()))
    }

    /// Table of the ranks. Call this before [`Self::best`].
    pub fn table(&self) -> String {
        let header = ["", "footfalls", "duration, s", "as played", "residual / tolerance", "costs"];
        let mut rows = vec![header.map(str::to_owned)];
        rows.extend(self.patterns.iter().enumerate().map(|(at, pattern)| pattern.cells(at + 1)));
        let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max();
        let widths: [usize; 6] = std::array::from_fn(|column| width(column).unwrap_or(0));
        let mut text = String::new();
        for row in &rows {
            let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}"));
            let line = cells.collect::<Vec<_>>().join("  ");
            text += line.trim_end();
            text.push('\n');
        }
        match self.patterns.first().and_then(|best| best.motion_keys.as_ref()) {
            Some(keys) => text += &format!("the plan has pattern 1; its motion file: {keys}\n"),
            None => text += "the plan has pattern 1, as given\n",
        }
        text
    }
}
