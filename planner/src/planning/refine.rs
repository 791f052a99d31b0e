//! Refinement of the grid: a converged plan that fails the checks as played is planned again with more samples.
//!
//! The robot plays splines through the samples. Between samples, feet leave the ground and slip; the error shrinks with the
//! spacing. Each refinement halves the spacing everywhere, as far as the limit of samples permits, and starts from the plan
//! before it, which is nearly feasible on the finer grid. Refinement ends when the plan passes, when finer grids do not help,
//! or at the limit of samples. A plan that still fails has the status [`Status::FailsAsPlayed`].

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
/// Ratio of sample numbers from which a grid that cannot be doubled is refined to the limit of samples.
const WORTHWHILE: f64 = 1.3;
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
    let motion = &coarse.plan.motion;
    let finer = doubled(motion).or_else(|| with_most_samples(motion))?;
    let next = resolve(&coarse.plan, &finer, effort);
    (next.plan.solve.status == Status::Converged).then_some(next)
}

/// Returns the motion with twice the intervals, or `None` if the samples would be too many or too close.
pub(super) fn doubled(motion: &Motion) -> Option<Motion> {
    let samples = motion.stance.len();
    let twice = if motion.ends == Ends::Periodic { 2 * samples } else { 2 * samples - 1 };
    let finer = resampled(motion, twice);
    (twice <= SAMPLES_MAX as usize && is_sensible(&finer)).then_some(finer)
}

/// Returns the motion with the most samples that a motion may have, or `None` if they are hardly more or too close.
fn with_most_samples(motion: &Motion) -> Option<Motion> {
    let most = SAMPLES_MAX as usize;
    let finer = resampled(motion, most);
    (most as f64 >= WORTHWHILE * motion.stance.len() as f64 && is_sensible(&finer)).then_some(finer)
}

/// True if the samples are not too close. Half a percent is for the rounding of durations.
fn is_sensible(motion: &Motion) -> bool {
    motion.interval_s() > 0.995 * LEAST_SPACING_S
}

/// Returns the motion with more samples. Feet lift off and land at the times of the coarse motion: as played, a foot stands
/// between two samples if it stands at both.
fn resampled(motion: &Motion, samples: usize) -> Motion {
    let coarse = motion.stance.len();
    let (before, after) = match motion.ends {
        Ends::Periodic => (coarse, samples),
        Ends::AtRest | Ends::Prescribed => (coarse - 1, samples - 1),
    };
    let at = |i: usize| {
        let earlier = &motion.stance[i * before / after];
        let later = &motion.stance[(i * before).div_ceil(after) % coarse];
        earlier.iter().zip(later).map(|(a, b)| *a && *b).collect()
    };
    Motion { stance: (0..samples).map(at).collect(), ..motion.clone() }
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
    fn a_grid_that_cannot_be_doubled_is_refined_to_the_limit() {
        for ends in [Ends::Periodic, Ends::AtRest] {
            let pattern = "##########.....".repeat(20) + "#";
            let motion = Motion { duration_s: 20.0, ..walking(&pattern, ends) };
            assert_eq!(doubled(&motion), None);
            let finer = with_most_samples(&motion).expect("more samples");
            assert_eq!(finer.stance.len(), 480);
            // Every swing stays, and lasts as long, up to a sample at each end.
            let swings: Vec<usize> =
                flags(&finer).split('#').map(str::len).filter(|&of| of > 0).collect();
            assert_eq!(swings.len(), 20);
            let longest = 6 * 480 / 301 + 1;
            assert!(swings.iter().all(|of| (5 * 480 / 301..=longest).contains(of)), "{swings:?}");
        }
        let many = Motion { duration_s: 20.0, ..walking(&"#".repeat(400), Ends::AtRest) };
        assert_eq!(with_most_samples(&many), None);
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
