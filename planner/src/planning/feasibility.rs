//! Search for feasible values of a request that seems infeasible, and retry of the request from their plans.
//!
//! A diagnosis estimates to first order, at the point with the least violation, the value that would make the request
//! feasible. This module tries such values, and the diagnosis keeps a value only if a plan was found with it. From that plan,
//! the value moves back towards the requested one in steps, each from the plan before it. Such a continuation often reaches
//! the request itself. Otherwise the continuation ends between a feasible value and an infeasible one. If both are near the
//! request, they confirm the verdict, and no other starts are tried.

use super::effort::Effort;
use super::refine;
use super::request::Request;
use super::solution::Solution;
use super::trials::{Interrupted, SolveMethods, Trials};
use crate::diagnose::Mobility;
use crate::families::{Family, Kind};
use crate::motion::{Goal, Motion};
use crate::plan::{Culprit, DURATION, Diagnosis, StartOutcome, Status, Verdict};
use crate::report::{Report, UndoneGoal};
use rollwalk_robot::Robot;

/// Relative change of a value up to which a request counts as a near miss.
///
/// The first trial of a near miss starts from the point with the least violation. For larger changes that point is a worse
/// start than none, because it is contorted. No other start is tried if the continuation does not reach the request of a near
/// miss.
const LITTLE: f64 = 0.1;
/// First trial of a near miss, as a multiple of the estimated change. A cold start from the suggested value must find a plan
/// too.
const FIRST_NEAR: f64 = 2.0;
/// First trial of other requests, as a multiple of the estimated change.
const FIRST: f64 = 1.1;
/// Maximum number of trial values for the first, second and third field that a diagnosis names.
const TRIALS: [usize; 3] = [4, 2, 2];
/// Iteration limit of a trial.
const OF_TRIAL: usize = 100;
/// Total iteration limit of all trials.
const OF_ALL: usize = 300;
/// Iteration limit of a step from a feasible value back towards the request.
const OF_STEP: usize = 60;
/// Total iteration limit of the steps back towards the request.
const OF_STEPS: usize = 300;
/// Iteration limit of a step back to the request from a value near it. Such a solve needs few iterations.
const BACK: usize = 20;
/// Scale factor of the goal if no other value is feasible.
const NEARER: f64 = 0.5;
/// Scale factor of the duration if no other value is feasible.
const LONGER: f64 = 3.0;
/// Maximum number of trials of the goal, and of the duration.
const TRIALS_WHOLE: usize = 3;
/// Step of suggested durations, s: three library frames, so that durations have few digits.
const DURATIONS_S: f64 = 0.05;
/// Iteration limit of a search, as a multiple of the limit of a solve.
const MOST: usize = 2;
/// Relative distance between a feasible and an infeasible value below which the search ends.
const CLOSE: f64 = 0.05;
/// Fraction of the requested value above which a feasible value is suggested.
const LEAST_SAID: f64 = 0.05;
/// Fraction of the requested value below which a feasible goal or height counts as far too low, so that larger ones are tried.
const FAR_TOO_LOW: f64 = 0.5;
/// Maximum number of larger goals that are tried.
const TRIALS_UP: usize = 5;
/// Largest ratio of a larger goal to the largest goal that works.
const GROWTH: f64 = 1.5;
/// Iterations reserved for larger goals: divisor of the search's iteration limit, and maximum. They suffice for two goals, of
/// which the first is too far and the second nearer.
const RESERVED_UP: (usize, usize) = (4, 160);

/// Searches for feasible values after the solution of a request. Returns the solution and its consequence for other starts. A
/// solution without a diagnosis is returned unchanged.
pub(super) fn search_feasible_values(
    request: Request<'_>,
    ways: &dyn SolveMethods,
    mut solution: Solution,
    effort: &mut Effort<'_>,
) -> (StartOutcome, Solution) {
    let ending = solution.plan.solve.ending();
    let Some(mut diagnosis) = solution.plan.solve.diagnosis.take() else {
        return (ending, solution);
    };
    let iterations = MOST * request.options.settings.iterations;
    let has_raised = diagnosis.culprits.iter().any(is_raised);
    let reserved = if has_raised { (iterations / RESERVED_UP.0).min(RESERVED_UP.1) } else { 0 };
    let most = effort.spent + iterations - reserved;
    let trials = Trials { request, ways, effort, most };
    let mut look =
        FeasibilitySearch { trials, nearest: &solution, left: OF_ALL, reserved, taken_back: false };
    let looked = look.at(&mut diagnosis);
    let spent = look.trials.effort.spent;
    let ending = match looked {
        Ok(SearchOutcome::Feasible(found)) => {
            solution = *found;
            StartOutcome::Decided
        }
        Ok(SearchOutcome::FromBothSides | SearchOutcome::Never) => StartOutcome::Decided,
        Ok(SearchOutcome::Open) => ending,
        Err(Interrupted) => {
            solution.plan.solve.status = Status::Interrupted;
            StartOutcome::Decided
        }
    };
    let solve = &mut solution.plan.solve;
    solve.diagnosis = Some(diagnosis).filter(|_| solve.status == Status::Infeasible);
    solve.iterations = spent;
    (ending, solution)
}

/// Result of a search.
enum SearchOutcome {
    /// The request is feasible.
    Feasible(Box<Solution>),
    /// A value near the requested one is feasible, but the continuation from there does not reach the request.
    FromBothSides,
    /// Posture alone meets the goal, whatever its value.
    Never,
    /// The outcome is open: other starts may find a plan.
    Open,
}

/// Feasible value and its plan.
struct FeasibleValue {
    number: f64,
    solution: Solution,
    /// True if the plan came from a cold start, as for a user who enters the value.
    cold: bool,
}

/// Search in progress.
struct FeasibilitySearch<'a, 'p> {
    trials: Trials<'a, 'p>,
    /// Solution at the point with the least violation.
    nearest: &'a Solution,
    /// Iterations left for trials.
    left: usize,
    /// Iterations reserved for [`Self::upwards`].
    reserved: usize,
    /// True if a trial met the goal by posture alone: back in its initial posture, the robot would have hardly moved.
    taken_back: bool,
}

impl FeasibilitySearch<'_, '_> {
    /// Replaces the estimates of a diagnosis by feasible values.
    fn at(&mut self, diagnosis: &mut Diagnosis) -> Result<SearchOutcome, Interrupted> {
        let Diagnosis { verdict, culprits } = diagnosis;
        let mut trials = TRIALS.into_iter();
        let mut looked = None;
        // Estimates that were not tried are not printed.
        let estimates: Vec<_> =
            culprits.iter_mut().map(|culprit| culprit.would_do.take()).collect();
        for (culprit, estimate) in culprits.iter_mut().zip(estimates) {
            let Some(estimate) = estimate.or_else(|| guess(culprit)) else {
                continue;
            };
            // Time for a goal that is missed by little is spent on the value that is easiest to change.
            if matches!(looked, Some(SearchOutcome::FromBothSides)) {
                continue;
            }
            let most = trials.next().unwrap_or_default();
            let Some(works) = self.seek(culprit, estimate, most)? else {
                if self.taken_back && looked.is_none() {
                    return Ok(SearchOutcome::Never);
                }
                continue;
            };
            if looked.is_some() {
                let works = self.upwards(culprit, works.number)?;
                suggest(culprit, works);
                continue;
            }
            let followed = self.follow(culprit, works, *verdict)?;
            if matches!(followed, SearchOutcome::Feasible(_)) {
                return Ok(followed);
            }
            looked = Some(followed);
        }
        match looked {
            Some(looked) => Ok(looked),
            None => self.at_whole(*verdict, culprits),
        }
    }

    /// Seeks a feasible nearer goal or a feasible longer duration, if no feasible value of a culprit is known.
    fn at_whole(
        &mut self,
        verdict: Verdict,
        culprits: &mut Vec<Culprit>,
    ) -> Result<SearchOutcome, Interrupted> {
        let motion = self.trials.request.motion;
        let nearer = goal(self.trials.request.robot, motion).filter(|goal| {
            culprits
                .iter()
                .all(|culprit| (&culprit.field, culprit.given) != (&goal.field, goal.given))
        });
        let longer = culprits.first().map(|first| Culprit {
            field: Some(DURATION.to_owned()),
            given: Some(motion.duration_s),
            ..first.clone()
        });
        for (mut culprit, times) in
            nearer.map(|c| (c, NEARER)).into_iter().chain(longer.map(|c| (c, LONGER)))
        {
            self.left = self.left.max(OF_TRIAL);
            let estimate = times * culprit.given.unwrap_or_default();
            if let Some(works) = self.seek(&culprit, estimate, TRIALS_WHOLE)? {
                let looked = self.follow(&mut culprit, works, verdict)?;
                let told = culprit.would_do.is_some();
                if told {
                    culprits.insert(0, culprit);
                }
                if told || matches!(looked, SearchOutcome::Feasible(_)) {
                    return Ok(looked);
                }
            }
        }
        Ok(SearchOutcome::Open)
    }

    /// Seeks a feasible value for the field of a culprit.
    fn seek(
        &mut self,
        culprit: &Culprit,
        estimate: f64,
        most: usize,
    ) -> Result<Option<FeasibleValue>, Interrupted> {
        let Request { robot, motion, .. } = self.trials.request;
        let asked = RequestedValue::by(culprit);
        let near = asked.is_near(estimate);
        let mut number = asked.beyond(estimate, if near { FIRST_NEAR } else { FIRST });
        for trial in 0..most {
            let Some((robot, motion)) = culprit.with_number(robot, motion, number) else { break };
            let most = self.left.min(OF_TRIAL);
            let before = self.trials.effort.spent;
            let from = Some(self.nearest).filter(|_| near && trial == 0);
            let solution = self.trials.solve(&robot, &motion, from, most)?;
            self.left = self.left.saturating_sub(self.trials.effort.spent - before);
            let Some(solution) = solution else { break };
            if is_consistent(&solution) {
                return Ok(Some(FeasibleValue { number, solution, cold: from.is_none() }));
            }
            if solution.plan.solve.status == Status::Converged
                && UndoneGoal::of(&solution.plan).is_some_and(|of| of.is_whole())
            {
                self.taken_back = true;
                break;
            }
            let why = solution.plan.solve.diagnosis;
            let same = |other: &Culprit| {
                (other.constraint, &other.field) == (culprit.constraint, &culprit.field)
            };
            let other = why.and_then(|why| why.culprits.into_iter().find(same)?.would_do);
            let twice = asked.beyond(number, 2.0);
            // Starts at the value that has just failed.
            let failed = RequestedValue { number, ..asked };
            let estimate = other.map_or(twice, |other| failed.beyond(other, FIRST));
            let further = (estimate - asked.number).abs() > (twice - asked.number).abs();
            number = if further { estimate } else { twice };
        }
        Ok(None)
    }

    /// Moves a feasible value in steps towards the requested one. Stores in the culprit a value near the requested one
    /// whose plan from a cold start is consistent too.
    fn follow(
        &mut self,
        culprit: &mut Culprit,
        mut works: FeasibleValue,
        verdict: Verdict,
    ) -> Result<SearchOutcome, Interrupted> {
        let Request { robot, motion, .. } = self.trials.request;
        let asked = RequestedValue::by(culprit);
        let given = asked.number;
        let (mut worked, found_cold) = (vec![works.number], works.cold);
        let mut left = OF_STEPS;
        let mut step = given - works.number;
        let mut near = asked.is_near(works.number);
        while !(near && verdict == Verdict::Contradiction) {
            let whole = step.abs() >= 0.999 * (given - works.number).abs();
            let number = if whole { given } else { asked.rounded(works.number + step, -step) };
            if number == works.number {
                break;
            }
            let Some((robot, motion)) = culprit.with_number(robot, motion, number) else { break };
            let most = if near { BACK } else { OF_STEP }.min(left);
            let before = self.trials.effort.spent;
            let known = Some(&works.solution);
            let Some(solution) = self.trials.solve(&robot, &motion, known, most)? else { break };
            left = left.saturating_sub(self.trials.effort.spent - before);
            if solution.plan.solve.status != Status::Converged {
                step *= 0.5;
                if near || step.abs() < CLOSE * works.number.abs() {
                    break;
                }
            } else if whole {
                return Ok(SearchOutcome::Feasible(Box::new(solution)));
            } else {
                worked.push(number);
                works = FeasibleValue { number, solution, cold: false };
                near = asked.is_near(number);
            }
        }
        let looked = if near { SearchOutcome::FromBothSides } else { SearchOutcome::Open };
        let mut last = worked.len() - 1;
        while let Some((robot, other)) = culprit.with_number(robot, motion, worked[last]) {
            let samples = other.stance.len();
            let typed = other.sampled_as(motion);
            // With the sample count of a shorter motion, a wheel may slip between samples.
            if last == 0 && found_cold && typed.stance.len() == samples {
                break;
            }
            let solved = self.trials.solve(&robot, &typed, None, OF_TRIAL)?;
            if solved.is_some_and(|solved| is_consistent(&solved)) {
                break;
            }
            if last == 0 {
                return Ok(looked);
            }
            last /= 2;
        }
        let works = self.upwards(culprit, worked[last])?;
        suggest(culprit, works);
        Ok(looked)
    }

    /// Raises a feasible goal or height that is far too low, by [`GROWTH`] or half of the distance to the smallest value that
    /// failed, each trial from a cold start. Returns the largest value that works.
    ///
    /// The steps from plan to plan end at a contorted plan, although a cold start may find a plan for a larger goal.
    fn upwards(&mut self, culprit: &Culprit, works: f64) -> Result<f64, Interrupted> {
        let Request { robot, motion, .. } = self.trials.request;
        let asked = RequestedValue::by(culprit);
        let (mut works, mut fails) = (works, asked.number);
        if !is_raised(culprit) || works.abs() >= FAR_TOO_LOW * fails.abs() {
            return Ok(works);
        }
        self.trials.most += std::mem::take(&mut self.reserved);
        for _ in 0..TRIALS_UP {
            let mean = 0.5 * (works + fails);
            let number = if mean.abs() > (GROWTH * works).abs() { GROWTH * works } else { mean };
            let number = asked.rounded(number, works - fails);
            let Some((robot, motion)) = culprit.with_number(robot, motion, number) else { break };
            let Some(solution) = self.trials.solve(&robot, &motion, None, OF_TRIAL)? else { break };
            if self.is_consistent_refined(&robot, solution)? {
                works = number;
            } else {
                fails = number;
            }
        }
        Ok(works)
    }

    /// Returns true if a plan converged and passes the checks as played, if necessary with more samples. Longer strides need more
    /// samples, and a later request with this value is refined too.
    fn is_consistent_refined(
        &mut self,
        robot: &Robot,
        solution: Solution,
    ) -> Result<bool, Interrupted> {
        let Trials { request, effort, most, .. } = &mut self.trials;
        let mut options = request.options.clone();
        options.settings.iterations = OF_TRIAL.min(most.saturating_sub(effort.spent));
        let refined = refine::motion(solution, robot, &options, effort);
        if effort.interrupted { Err(Interrupted) } else { Ok(is_consistent(&refined)) }
    }
}

/// True for a goal or a swing height, which is raised if the feasible value is far too low.
fn is_raised(culprit: &Culprit) -> bool {
    let is_request = culprit.field.as_deref() != Some(DURATION);
    is_request && (culprit.constraint.is_goal() || culprit.constraint == Family::ContactHeight)
}

/// Returns true if a plan converged and passes the checks as played.
fn is_consistent(solution: &Solution) -> bool {
    let plan = &solution.plan;
    plan.solve.status == Status::Converged && Report::as_played(plan).judgement.is_good()
}

/// Returns the largest component of the goal as a culprit, or `None` if all are 0.
fn goal(robot: &Robot, motion: &Motion) -> Option<Culprit> {
    let Goal { forward_m, left_m, turn_rad } = motion.goal;
    let numbers = [
        (Family::DisplacementGoal, "forward_m", forward_m),
        (Family::DisplacementGoal, "left_m", left_m),
        (Family::TurningGoal, "turn_rad", turn_rad),
    ];
    let size = |number: Option<f64>| number.unwrap_or_default().abs();
    let (family, field, given) =
        numbers.into_iter().max_by(|a, b| size(a.2).total_cmp(&size(b.2)))?;
    let mobility = Mobility::of(robot, &motion.stance, &motion.goal, motion.duration_s);
    given.filter(|given| *given != 0.0).map(|given| Culprit {
        constraint: family,
        part: family.kind(),
        subject: None,
        time_s: [0.0, motion.duration_s],
        worst: 0.0,
        unit: family.unit().symbol().to_owned(),
        share: 0.0,
        field: Some(field.to_owned()),
        given: Some(given),
        would_do: None,
        advice: mobility.advice(family),
    })
}

/// Stores a feasible value in a culprit, unless it is at most [`LEAST_SAID`] of the requested one.
fn suggest(culprit: &mut Culprit, number: f64) {
    let said = number.abs() > LEAST_SAID * culprit.given.unwrap_or_default().abs();
    culprit.would_do = said.then_some(number);
}

/// First trial value without an estimate: half of a requested value, twice a limit.
fn guess(culprit: &Culprit) -> Option<f64> {
    let given = culprit.given.filter(|given| *given != 0.0)?;
    match culprit.part {
        Kind::Request if culprit.constraint.is_goal() => Some(0.5 * given),
        Kind::Request if culprit.constraint == Family::ContactHeight => Some(0.5 * given),
        Kind::Limit => Some(2.0 * given),
        _ => None,
    }
}

/// Requested value.
#[derive(Clone, Copy)]
struct RequestedValue {
    number: f64,
    is_duration: bool,
}

impl RequestedValue {
    fn by(culprit: &Culprit) -> Self {
        let is_duration = culprit.field.as_deref() == Some(DURATION);
        Self { number: culprit.given.unwrap_or_default(), is_duration }
    }

    /// Returns true if `number` differs from the requested value by at most [`LITTLE`] of it.
    fn is_near(self, number: f64) -> bool {
        (number - self.number).abs() <= LITTLE * self.number.abs()
    }

    /// Returns `requested + times * (estimate - requested)`, rounded. If that would reach 0 or change sign, returns half the
    /// estimate instead.
    fn beyond(self, estimate: f64, times: f64) -> f64 {
        let change = estimate - self.number;
        let number = self.number + times * change;
        let crosses = number * self.number <= 0.0;
        self.rounded(if crosses { 0.5 * estimate } else { number }, change)
    }

    /// Rounds a value to few digits in the direction of `change`. Durations are rounded to [`DURATIONS_S`], other values by
    /// less than half of the change and of the value.
    fn rounded(self, number: f64, change: f64) -> f64 {
        let (decimals, unit) = if self.is_duration {
            (2.0, DURATIONS_S)
        } else {
            let decimals = 1.0 - change.abs().min(number.abs()).log10().floor();
            let decimals = decimals.clamp(0.0, 12.0);
            (decimals, 0.5 * 10f64.powf(1.0 - decimals))
        };
        let rounded =
            if change < 0.0 { (number / unit).floor() } else { (number / unit).ceil() } * unit;
        // Removes the last digits of a binary product.
        format!("{rounded:.*}", decimals as usize).parse().unwrap_or(rounded)
    }
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
            // Closer to 0, but not beyond.
            (1.0, 0.1, 2.0, 0.05),
        ] {
            let asked = RequestedValue { number: given, is_duration: false };
            assert_eq!(asked.beyond(estimate, times), expected, "{given} {estimate} {times}");
        }
    }
}
