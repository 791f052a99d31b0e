//! Solves on a single thread, measured in CPU time.

use crate::unless_interrupted;
use cpu_time::ThreadTime;
use rollwalk_planner::motion::{Goal, Motion};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options, ReplanError, Solution, optimise_solution};
use rollwalk_robot::Robot;

/// Solve with its cost.
pub struct Run {
    pub solution: Solution,
    /// Number of iterations of all starts.
    pub iterations: usize,
    /// CPU time of all starts, s.
    pub cpu_s: f64,
}

impl Run {
    /// True if the plan meets its constraints.
    pub fn solved(&self) -> bool {
        self.plan().solve.status == Status::Converged
    }

    pub fn plan(&self) -> &Plan {
        &self.solution.plan
    }
}

/// Options without refinement: tables report the samples of the motion files, and the cost of a solve with that number of
/// samples.
fn at_samples_of_file(options: &Options) -> Options {
    Options { refine: false, ..options.clone() }
}

/// Plans from scratch: tries the candidate starts one after the other until one yields a verdict.
pub fn cold(robot: &Robot, motion: &Motion, options: &Options) -> Run {
    let clock = ThreadTime::now();
    let mut iterations = 0;
    let solution = optimise_solution(robot, motion, &at_samples_of_file(options), &mut |_| {
        iterations += 1;
        unless_interrupted()
    });
    Run { solution, iterations, cpu_s: clock.elapsed().as_secs_f64() }
}

/// Plans an edited motion from a solution.
///
/// # Errors
/// Returns an error if [`Solution::replan`] does.
pub fn again(
    solution: &Solution,
    robot: &Robot,
    motion: &Motion,
    options: &Options,
) -> Result<Run, ReplanError> {
    let clock = ThreadTime::now();
    let options = at_samples_of_file(options);
    let solution = solution.replan(robot, motion, &options, &mut |_| unless_interrupted())?;
    let iterations = solution.plan.solve.iterations;
    Ok(Run { solution, iterations, cpu_s: clock.elapsed().as_secs_f64() })
}

/// Returns the motion with its goal multiplied by `factor`.
pub fn goal_times(motion: &Motion, factor: f64) -> Motion {
    let times = |goal: Option<f64>| goal.map(|goal| factor * goal);
    let Goal { forward_m, left_m, turn_rad } = motion.goal;
    let goal =
        Goal { forward_m: times(forward_m), left_m: times(left_m), turn_rad: times(turn_rad) };
    Motion { goal, ..motion.clone() }
}

/// Largest relative difference of the plan's displacement and turn from the goal. Goals of 0 are ignored.
pub fn goal_error(plan: &Plan) -> f64 {
    let Goal { forward_m, left_m, turn_rad } = plan.motion.goal;
    let asked = [forward_m, left_m, turn_rad];
    let errors = asked.into_iter().zip(plan.reached()).filter_map(|(asked, reached)| {
        asked.filter(|asked| *asked != 0.0).map(|asked| ((reached - asked) / asked).abs())
    });
    errors.fold(0.0, f64::max)
}

/// Median of some values; 0 for no values. For an even number of values it is the upper of the two middle ones.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn the_median_is_in_the_middle() {
        assert_eq!(median([3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median([4.0, 1.0, 2.0, 3.0]), 3.0);
        assert_eq!(median([]), 0.0);
    }
}
