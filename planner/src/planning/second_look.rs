//! A second look at a request that seems infeasible: numbers with which it works, and whether it does not work after all.
//!
//! A diagnosis estimates to first order, at the point with the least violation, which number would make the request
//! feasible. Here such numbers are tried: only one with which a plan was found stays in the diagnosis. From that plan the
//! request itself is tried again. Sometimes it is found there. Otherwise, if the number is near, the verdict has been
//! reached from both sides, and other starts are not worth their time.

use super::attempt::{attempt, counting_from};
use super::{Options, Solution, replan};
use crate::families::{Family, Kind};
use crate::motion::{Ends, Motion};
use crate::plan::{Culprit, Diagnosis, Ending, Plan, Status, Verdict};
use crate::solve::{Progress, Settings};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Relative change of a number up to which a request misses by little. Then a trial starts from the point with the least
/// violation; further away that is a worse start than none, because it is contorted. And if no way leads from the number
/// that works to the one asked for, no other start is tried.
const LITTLE: f64 = 0.1;
/// The first trial, as a multiple of the estimated change: of one from that point, and of others. A plan must also be
/// found by those who type the number.
const FIRST_NEAR: f64 = 2.0;
const FIRST: f64 = 1.1;
/// Numbers tried instead of the first and the second one that a diagnosis names, and of the others.
const TRIALS: [usize; 3] = [4, 2, 2];
/// Iteration limits: of a trial, of all of them, and on the way back by little, which is a re-plan and takes few.
const OF_TRIAL: usize = 100;
const OF_ALL: usize = 300;
const BACK: usize = 20;
/// Relative distance of a number that works from one that does not, at which no nearer one is sought.
const CLOSE: f64 = 0.2;
/// Part of the number asked for above which a number that works is said.
const LEAST_SAID: f64 = 0.05;

/// A request.
#[derive(Clone, Copy)]
pub(super) struct Request<'a> {
    pub robot: &'a Robot,
    pub motion: &'a Motion,
    /// With one of its starts.
    pub options: &'a Options,
}

/// Looks again at the solution of a request; one that is not infeasible is returned as it is. Also returns what the
/// solution means for other starts.
pub(super) fn second_look(
    request: Request<'_>,
    mut solution: Solution,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> (Ending, Solution) {
    let ending = solution.plan.solve.ending();
    let Some(diagnosis) = solution.plan.solve.diagnosis.take() else { return (ending, solution) };
    let first = solution.plan.solve.iterations;
    let mut trials = Trials { request, first, spent: first, progress };
    let looked = trials.look(&solution.plan, diagnosis);
    let spent = trials.spent;
    let (ending, mut solution) = match looked {
        Looked::Found(found) => (Ending::Decided, *found),
        Looked::Interrupted => {
            solution.plan.solve.status = Status::Interrupted;
            (Ending::Decided, solution)
        }
        Looked::Told { diagnosis, from_both_sides } => {
            solution.plan.solve.diagnosis = Some(diagnosis);
            (if from_both_sides { Ending::Decided } else { ending }, solution)
        }
    };
    solution.plan.solve.iterations = spent;
    (ending, solution)
}

/// Result of a second look.
enum Looked {
    /// The request works.
    Found(Box<Solution>),
    /// The diagnosis, with numbers that work.
    Told {
        diagnosis: Diagnosis,
        from_both_sides: bool,
    },
    Interrupted,
}

/// The user has stopped a trial.
struct Stopped;

/// A number that works, and its plan.
struct Works {
    number: f64,
    solution: Solution,
}

/// Solves of other requests, one after the other.
struct Trials<'a, 'p> {
    request: Request<'a>,
    /// Iterations of the first solve, and so far, those of the first solve included.
    first: usize,
    spent: usize,
    progress: &'p mut dyn FnMut(&Progress) -> ControlFlow<()>,
}

impl Trials<'_, '_> {
    fn look(&mut self, nearest: &Plan, mut diagnosis: Diagnosis) -> Looked {
        let Request { robot, motion, .. } = self.request;
        let mut from_both_sides = None;
        let mut trials = TRIALS.into_iter();
        for culprit in &mut diagnosis.culprits {
            let Some(estimate) = culprit.would_do.take().or_else(|| guess(culprit)) else {
                continue;
            };
            // The time of one that misses by little goes into the number that is the easiest to change.
            if from_both_sides == Some(true) {
                continue;
            }
            let most = trials.next().unwrap_or_default();
            let works = match self.seek(culprit, estimate, nearest, most) {
                Ok(Some(works)) => works,
                Ok(None) => continue,
                Err(Stopped) => return Looked::Interrupted,
            };
            // A goal of next to nothing is no suggestion.
            let said = works.number.abs() > LEAST_SAID * culprit.given.unwrap_or_default().abs();
            culprit.would_do = said.then_some(works.number);
            if from_both_sides.is_some() {
                continue;
            }
            let given = culprit.given.unwrap_or_default();
            let little = (works.number - given).abs() <= LITTLE * given.abs();
            if little && diagnosis.verdict == Verdict::Contradiction {
                from_both_sides = Some(true);
                continue;
            }
            let most = if little { BACK } else { OF_TRIAL };
            match self.solve_back(&works.solution, robot, motion, most) {
                Err(Stopped) => return Looked::Interrupted,
                Ok(Some(again)) if again.plan.solve.status == Status::Converged => {
                    return Looked::Found(Box::new(again));
                }
                Ok(again) => from_both_sides = Some(again.is_some() && little),
            }
        }
        Looked::Told { diagnosis, from_both_sides: from_both_sides.unwrap_or(false) }
    }

    /// Seeks a number that works instead of the one that a culprit names, and one not much further from it than it
    /// has to be.
    fn seek(
        &mut self,
        culprit: &Culprit,
        estimate: f64,
        nearest: &Plan,
        most: usize,
    ) -> Result<Option<Works>, Stopped> {
        let Request { robot, motion, .. } = self.request;
        let given = culprit.given.unwrap_or_default();
        let little = (estimate - given).abs() <= LITTLE * given.abs();
        let mut fails = given;
        let mut works: Option<Works> = None;
        let mut number = beyond(given, estimate, if little { FIRST_NEAR } else { FIRST });
        for trial in 0..most {
            let Some((robot, motion)) = culprit.with_number(robot, motion, number) else { break };
            let solution = if little && trial == 0 {
                self.solve_near(nearest, &robot, &motion)?
            } else {
                self.solve_cold(&robot, &motion)?
            };
            let Some(solution) = solution else { break };
            if solution.plan.solve.status == Status::Converged {
                works = Some(Works { number, solution });
                if (number - fails).abs() <= CLOSE * fails.abs().max(number.abs()) {
                    break;
                }
            } else {
                let why = solution.plan.solve.diagnosis;
                let same = |other: &Culprit| {
                    (other.constraint, &other.field) == (culprit.constraint, &culprit.field)
                };
                let other = why.and_then(|why| why.culprits.into_iter().find(same)?.would_do);
                if works.is_none() {
                    let twice = beyond(given, number, 2.0);
                    let estimate = other.map_or(twice, |other| beyond(number, other, FIRST));
                    fails = number;
                    let further = (estimate - given).abs() > (twice - given).abs();
                    number = if further { estimate } else { twice };
                    continue;
                }
                fails = number;
            }
            if let Some(works) = &works {
                number = rounded(0.5 * (works.number + fails), works.number - given);
                if number == works.number || number == fails {
                    break;
                }
            }
        }
        Ok(works)
    }

    /// Solves a request from its start, as those do who type its numbers.
    fn solve_cold(&mut self, robot: &Robot, motion: &Motion) -> Result<Option<Solution>, Stopped> {
        self.solve(self.left(), |options, progress| Some(attempt(robot, motion, options, progress)))
    }

    /// Solves a request from a point near it.
    fn solve_near(
        &mut self,
        nearest: &Plan,
        robot: &Robot,
        motion: &Motion,
    ) -> Result<Option<Solution>, Stopped> {
        self.solve(self.left(), |options, progress| {
            replan::from(nearest, None, robot, motion, options, progress).ok()
        })
    }

    /// Solves a request from the solution of another one.
    fn solve_back(
        &mut self,
        known: &Solution,
        robot: &Robot,
        motion: &Motion,
        most: usize,
    ) -> Result<Option<Solution>, Stopped> {
        let multipliers = Some(&known.multipliers);
        self.solve(most, |options, progress| {
            replan::from(&known.plan, multipliers, robot, motion, options, progress).ok()
        })
    }

    /// Iterations that are left for the next number.
    fn left(&self) -> usize {
        (self.first + OF_ALL).saturating_sub(self.spent).min(OF_TRIAL)
    }

    /// Solves within a limit and that of the options; `None` if they leave no iteration, or it cannot be solved.
    fn solve(
        &mut self,
        most: usize,
        solve: impl FnOnce(&Options, &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Option<Solution>,
    ) -> Result<Option<Solution>, Stopped> {
        let Request { motion, options, .. } = self.request;
        let iterations = options.settings.iterations.saturating_sub(self.spent).min(most);
        if iterations == 0 || motion.ends == Ends::Prescribed {
            return Ok(None);
        }
        let settings = Settings { iterations, ..options.settings.clone() };
        let options = Options { settings, ..options.clone() };
        let Some(solution) = solve(&options, &mut counting_from(self.spent, self.progress)) else {
            return Ok(None);
        };
        self.spent += solution.plan.solve.iterations;
        match solution.plan.solve.status {
            Status::Interrupted => Err(Stopped),
            _ => Ok(Some(solution)),
        }
    }
}

/// A number to begin with where there is no estimate: half of what is asked for, twice a limit.
fn guess(culprit: &Culprit) -> Option<f64> {
    let given = culprit.given.filter(|given| *given != 0.0)?;
    match culprit.part {
        Kind::Request if culprit.constraint.is_goal() => Some(0.5 * given),
        Kind::Request if culprit.constraint == Family::ContactHeight => Some(0.5 * given),
        Kind::Limit => Some(2.0 * given),
        _ => None,
    }
}

/// A number that lies further from the given one than an estimate, or nearer to 0 without a change of sign.
fn beyond(given: f64, estimate: f64, times: f64) -> f64 {
    let change = estimate - given;
    let number = given + times * change;
    rounded(if number * given <= 0.0 { 0.5 * estimate } else { number }, change)
}

/// A number with few digits, moved a little further in the direction of a change: by less than half of the change and
/// of the number.
fn rounded(number: f64, change: f64) -> f64 {
    let decimals = (1.0 - change.abs().min(number.abs()).log10().floor()).clamp(0.0, 12.0);
    let unit = 0.5 * 10f64.powf(1.0 - decimals);
    let rounded =
        if change < 0.0 { (number / unit).floor() } else { (number / unit).ceil() } * unit;
    // Without the last digits of a product in binary.
    format!("{rounded:.*}", decimals as usize).parse().unwrap_or(rounded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_tried_have_few_digits_and_give_way_a_little_more() {
        for (given, estimate, times, expected) in [
            (1.5, 1.137, 1.0, 1.1),
            (1.5, 1.1, 1.0, 1.1),
            (1.707, 1.6861, 2.0, 1.665),
            (-0.53, -0.5213, 1.0, -0.521),
            (0.35, 0.4312, 1.0, 0.435),
            (6.05, 9.74, 1.0, 10.0),
            // Nearer to 0, but not beyond it.
            (1.0, 0.1, 2.0, 0.05),
        ] {
            assert_eq!(beyond(given, estimate, times), expected, "{given} {estimate} {times}");
        }
    }
}
