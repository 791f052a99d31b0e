//! Refinement of the grid: a converged plan that fails the checks as played is planned again with more samples.
//!
//! The robot plays splines through the samples. Between samples, feet leave the ground and slip; the error shrinks with the
//! spacing. Each refinement halves the spacing everywhere and starts from the plan before it, which is nearly feasible on the
//! finer grid. Refinement ends when the plan passes, when finer grids do not help, or at the limit of samples. A plan that
//! still fails has the status [`Status::FailsAsPlayed`].

use super::attempt::attempt;
use super::effort::Effort;
use super::neighbour;
use super::request::{Options, Request};
use super::solution::Solution;
use crate::motion::file::SAMPLES_MAX;
use crate::motion::{Ends, Motion};
use crate::plan::{Plan, Refinement, Status};
use crate::report::{Judgement, Report};
use crate::solve::Method;
use rollwalk_robot::Robot;

/// Shortest spacing of a refined plan, s: half the spacing of library frames, which the controller plays.
const LEAST_SPACING_S: f64 = 1.0 / 120.0;
/// Iteration limit of a solve on a finer grid. Half of 30 refinements took at most 20 iterations; the longest took 199.
const MOST_ITERATIONS: usize = 200;
/// Largest ratio of the worst residual after a refinement to the smallest before it, up to which the refinement counts as
/// helpful.
const HELPS: f64 = 0.8;
/// Number of unhelpful refinements after which no finer grid is tried.
const IN_VAIN: usize = 2;

/// Function that plans a motion with more samples from the plan with fewer.
type Resolve<'a> = dyn FnMut(&Plan, &Motion, &mut Effort<'_>) -> Solution + 'a;

/// Runs [`refine_until_valid`] for a motion with periodic or at-rest ends.
pub(crate) fn motion(
    solution: Solution,
    robot: &Robot,
    options: &Options,
    effort: &mut Effort<'_>,
) -> Solution {
    let mut limited = options.clone();
    limited.settings.iterations = limited.settings.iterations.min(MOST_ITERATIONS);
    refine_until_valid(solution, options, effort, &mut |coarse, finer, effort| {
        let request = Request { robot, motion: finer, options: &limited };
        let near =
            neighbour::from(coarse, None, request, effort).expect("one robot, one kind of ends");
        match near.plan.solve.status {
            Status::Converged | Status::Interrupted => near,
            _ => attempt(request, effort),
        }
    })
}

/// Refines the grid of a plan until the plan passes the checks as played.
///
/// If the final grid fails, cannot be solved or is interrupted, the returned plan is the last one that converged, with
/// [`Status::FailsAsPlayed`].
pub(super) fn refine_until_valid(
    mut best: Solution,
    options: &Options,
    effort: &mut Effort<'_>,
    resolve: &mut Resolve<'_>,
) -> Solution {
    if !options.refine || options.settings.method != Method::GaussNewton {
        return best;
    }
    let (mut least, mut in_vain) = (f64::INFINITY, 0);
    while best.plan.solve.status == Status::Converged {
        let report = Report::as_played(&best.plan);
        let Some(row) = report.worst().filter(|_| report.judgement == Judgement::FailsAsPlayed)
        else {
            break;
        };
        let coarser = Refinement {
            samples: best.plan.samples.len(),
            residual: row.family,
            worst: row.worst,
            tolerance: row.level.unwrap_or_default(),
            unit: row.unit.to_owned(),
        };
        let part = row.part_of_level();
        in_vain += usize::from(part > HELPS * least);
        least = least.min(part);
        let refined = if in_vain < IN_VAIN { solved(&best, effort, resolve) } else { None };
        match refined {
            Some(mut refined) => {
                let solve = &mut refined.plan.solve;
                solve.start = best.plan.solve.start;
                solve.refinements = best.plan.solve.refinements.clone();
                solve.refinements.push(coarser);
                best = refined;
            }
            None => best.plan.solve.status = Status::FailsAsPlayed,
        }
    }
    best
}

/// Returns the plan on the next finer grid, or `None` if the solve does not converge there.
fn solved(
    coarse: &Solution,
    effort: &mut Effort<'_>,
    resolve: &mut Resolve<'_>,
) -> Option<Solution> {
    let finer = doubled(&coarse.plan.motion)?;
    let next = resolve(&coarse.plan, &finer, effort);
    (next.plan.solve.status == Status::Converged).then_some(next)
}

/// Returns the motion with twice the intervals, or `None` if the samples would be too many or too close. Feet lift off and land
/// at the times of the coarse motion: as played, a foot stands between two samples if it stands at both.
pub(super) fn doubled(motion: &Motion) -> Option<Motion> {
    let next = |i: usize| match motion.stance.get(i + 1) {
        None if motion.ends == Ends::Periodic => motion.stance.first(),
        next => next,
    };
    let mut stance = Vec::with_capacity(2 * motion.stance.len());
    for (i, here) in motion.stance.iter().enumerate() {
        stance.push(here.clone());
        let between = |next: &Vec<bool>| here.iter().zip(next).map(|(a, b)| *a && *b).collect();
        stance.extend(next(i).map(between));
    }
    let finer = Motion { stance, ..motion.clone() };
    // Half a percent for the rounding of durations.
    let sensible = finer.interval_s() > 0.995 * LEAST_SPACING_S;
    (finer.stance.len() <= SAMPLES_MAX as usize && sensible).then_some(finer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_robots;

    fn walking(flags: &str, ends: Ends) -> Motion {
        let robot = test_robots::all().swap_remove(0);
        let mut motion = test_robots::motion(&robot, ends);
        let feet = robot.end_effectors.len();
        motion.stance =
            flags.chars().map(|c| (0..feet).map(|j| j > 0 || c == '#').collect()).collect();
        motion
    }

    fn flags(motion: &Motion) -> String {
        motion.stance.iter().map(|feet| if feet[0] { '#' } else { '.' }).collect()
    }

    #[test]
    fn feet_lift_off_and_land_when_they_did() {
        let periodic = doubled(&walking("##...#", Ends::Periodic)).expect("few samples");
        assert_eq!(flags(&periodic), "###.......##");
        let at_rest = doubled(&walking("##...#", Ends::AtRest)).expect("few samples");
        assert_eq!(flags(&at_rest), "###.......#");
        // A swing across the end of the period.
        let across = doubled(&walking(".####.", Ends::Periodic)).expect("few samples");
        assert_eq!(flags(&across), "..#######...");
    }

    #[test]
    fn there_is_a_finest_grid() {
        let doubles = |samples: usize, duration_s: f64| {
            let motion = walking(&"#".repeat(samples), Ends::Periodic);
            doubled(&Motion { duration_s, ..motion }).is_some()
        };
        assert!(doubles(240, 10.0) && !doubles(241, 10.0), "of samples");
        assert!(doubles(30, 0.5) && !doubles(31, 0.5), "of frames");
    }
}
