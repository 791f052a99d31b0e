//! Plans of one request with different times, each solved from a neighbour.

use crate::motion::Motion;
use crate::plan::{Plan, Status, TimingScore};
use crate::planning::{Options, Solution, first_attempt};
use crate::report::{Report, Row};
use crate::sensitivity::{Objective, Optimal, TimingPrices};
use crate::solve::Progress;
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Iteration limit of a solve from a neighbour. A cold start takes fewer iterations than a distant neighbour.
const MOST_ITERATIONS: usize = 60;
/// Fraction of the tolerance up to which a residual between samples does not matter in the comparison of plans.
const WELL: f64 = 0.5;

/// Plan with certain times.
#[derive(Clone, Debug)]
pub struct Candidate {
    pub solution: Solution,
    cost: f64,
    /// Result of the checks between samples, if they have run: true if the plan passes, and its largest residual.
    played: Option<(bool, f64)>,
}

impl Candidate {
    pub fn motion(&self) -> &Motion {
        &self.solution.plan.motion
    }

    pub fn cost(&self) -> f64 {
        self.cost
    }

    /// Returns true if the plan passes the checks as played, and its largest residual as a fraction of the tolerance.
    fn played(&mut self) -> (bool, f64) {
        *self.played.get_or_insert_with(|| played(&self.solution.plan))
    }

    fn score(&mut self) -> TimingScore {
        TimingScore { cost: self.cost(), as_played: self.played().1 }
    }
}

/// Returns true if a plan passes the checks as played, and its largest residual as a fraction of the tolerance.
fn played(plan: &Plan) -> (bool, f64) {
    let report = Report::as_played(plan);
    (report.judgement.is_good(), report.worst().map_or(0.0, Row::part_of_level))
}

/// Plan that the search has chosen.
pub struct Choice {
    pub solution: Solution,
    pub score: TimingScore,
    /// True if the plan passes the checks as played.
    pub holds: bool,
    /// Score of the plan with the given times; `None` if it did not converge.
    pub given: Option<TimingScore>,
}

impl Choice {
    /// Replaces the plan by one with more samples. The score stays that with the samples of the request, to which the score of
    /// the given times belongs.
    pub fn refine(&mut self, refined: Solution) {
        self.holds = played(&refined.plan).0;
        self.solution = refined;
    }
}

/// Plans found so far.
pub struct Candidates<'a> {
    robot: &'a Robot,
    given: &'a Motion,
    options: Options,
    progress: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
    converged: Vec<Candidate>,
    /// Motions without a plan.
    failed: Vec<Motion>,
    /// Iterations of all solves.
    spent: usize,
    interrupted: bool,
}

impl<'a> Candidates<'a> {
    pub fn new(
        robot: &'a Robot,
        given: &'a Motion,
        options: &Options,
        progress: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Self {
        let options = Options { refine: false, ..options.clone() };
        let (converged, failed) = (Vec::new(), Vec::new());
        Self { robot, given, options, progress, converged, failed, spent: 0, interrupted: false }
    }

    /// Returns the motion with the given times.
    pub fn given(&self) -> &'a Motion {
        self.given
    }

    /// Returns the number of timings for which a plan was sought.
    pub fn tried(&self) -> usize {
        self.converged.len() + self.failed.len()
    }

    pub fn interrupted(&self) -> bool {
        self.interrupted
    }

    pub fn at(&self, index: usize) -> &Candidate {
        &self.converged[index]
    }

    pub fn score(&mut self, index: usize) -> TimingScore {
        self.converged[index].score()
    }

    /// Plans a motion, from the plan `from` if given. Returns the index of its plan, or `None` if none is found.
    pub fn solve(&mut self, motion: Motion, from: Option<usize>) -> Option<usize> {
        if let Some(known) = self.converged.iter().position(|known| *known.motion() == motion) {
            return Some(known);
        }
        if self.interrupted || self.failed.contains(&motion) {
            return None;
        }
        let near = from.and_then(|from| self.near(from, &motion));
        match near.or_else(|| self.cold(&motion)) {
            Some(found) => {
                self.converged.push(found);
                Some(self.converged.len() - 1)
            }
            None => {
                self.failed.push(motion);
                None
            }
        }
    }

    /// Plans a motion from a plan with other times.
    fn near(&mut self, from: usize, motion: &Motion) -> Option<Candidate> {
        let mut options = self.options.clone();
        options.settings.iterations = options.settings.iterations.min(MOST_ITERATIONS);
        let known = self.converged[from].solution.clone();
        self.watched(|robot, progress| {
            known
                .replan_near(robot, motion, &options, progress)
                .expect("one robot, one kind of ends")
        })
    }

    /// Plans a motion from its first start.
    fn cold(&mut self, motion: &Motion) -> Option<Candidate> {
        let options = self.options.clone();
        self.watched(|robot, progress| first_attempt(robot, motion, &options, progress))
    }

    /// Runs a solve. Its reported iteration count includes the iterations of all earlier solves.
    fn watched(
        &mut self,
        solve: impl FnOnce(&Robot, &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Solution,
    ) -> Option<Candidate> {
        let Self { robot, progress, spent, interrupted, options, .. } = self;
        if *interrupted {
            return None;
        }
        let solution = solve(robot, &mut |state| {
            let iteration = *spent + state.iteration;
            let answer = progress(&Progress { iteration, ..state.clone() });
            *interrupted |= answer.is_break();
            answer
        });
        *spent += solution.plan.solve.iterations;
        let cost = Objective::PlanCost.of_plan(&solution.plan, &options.weights);
        let converged = solution.plan.solve.status == Status::Converged;
        converged.then_some(Candidate { solution, cost, played: None })
    }

    /// Returns the prices of the times of a plan. `None` if its optimum is not found.
    pub fn prices(&mut self, index: usize) -> Option<TimingPrices> {
        let Self { converged, options, progress, interrupted, .. } = self;
        let optimal = Optimal::of(&converged[index].solution, options, &mut |state| {
            let answer = progress(state);
            *interrupted |= answer.is_break();
            answer
        });
        optimal.ok().map(|optimal| optimal.timing_prices())
    }

    /// Returns true if a plan passes the checks as played about as well as the plan with the given times.
    pub fn holds(&mut self, index: usize) -> bool {
        let most = match self.given_index().map(|given| self.converged[given].played()) {
            Some((true, as_played)) => as_played.max(WELL),
            _ => f64::INFINITY,
        };
        let (good, as_played) = self.converged[index].played();
        good && as_played <= most
    }

    fn given_index(&self) -> Option<usize> {
        self.converged.iter().position(|known| known.motion() == self.given)
    }

    /// Returns the cheapest plan that holds as played. If none does, returns the plan that misses the checks least. `None` if
    /// no plan was found.
    pub fn best(&mut self) -> Option<usize> {
        let mut order: Vec<usize> = (0..self.converged.len()).collect();
        order.sort_by(|&a, &b| self.at(a).cost().total_cmp(&self.at(b).cost()));
        if let Some(&best) = order.iter().find(|&&index| self.holds(index)) {
            return Some(best);
        }
        let part = |this: &mut Self, index: usize| this.converged[index].played().1;
        let parts: Vec<f64> = order.iter().map(|&index| part(self, index)).collect();
        let least = parts.iter().zip(order).min_by(|a, b| a.0.total_cmp(b.0));
        least.map(|(_, index)| index)
    }

    /// Ends the search with the best plan.
    pub fn finish(mut self) -> Option<Choice> {
        let index = self.best()?;
        let holds = self.holds(index);
        let given = self.given_index().map(|given| self.score(given));
        let score = self.score(index);
        let mut solution = self.converged.swap_remove(index).solution;
        solution.plan.solve.iterations = self.spent;
        Some(Choice { solution, score, holds, given })
    }
}
