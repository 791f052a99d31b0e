//! From a motion goal, or from two motions to be joined, to a plan.

use crate::coarse;
use crate::families::Formulation;
use crate::model::Model;
use crate::motion::Motion;
use crate::plan::{EndEffectorSample, Plan, Sample, Status};
use crate::problem::{Problem, Unknowns, Weights};
use crate::solver::{self, Begin, Multipliers, Progress, Settings};
use crate::start::{self, Start};
use crate::state::State;
use crate::terms::motor_speed_rad_s;
use nalgebra::{Rotation3, UnitQuaternion};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// How to optimise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Weights of the formulation.
    pub weights: Weights,
    /// When the solver stops.
    pub settings: Settings,
    /// Where it starts.
    pub start: Start,
    /// Seed of everything random in the start.
    pub seed: u64,
}

/// A plan with what the solver knows beyond it, from which [`replan`](crate::replan) starts best.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The plan.
    pub plan: Plan,
    /// The multipliers of its constraints.
    pub multipliers: Multipliers,
}

/// Optimises a motion with periodic or at-rest ends.
///
/// With [`Start::Auto`] it starts from the first of [`start::candidates`]. The outcome is in the plan's
/// [`solve`](Plan::solve) summary; a plan that did not converge is returned too, so that it can be
/// looked at. `progress` may stop the solve.
pub fn optimise(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Plan {
    optimise_solution(robot, motion, options, progress).plan
}

/// [`optimise`], with the multipliers.
pub fn optimise_solution(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Solution {
    // There is always a first candidate.
    let mut first = start::candidates(robot, motion, options).swap_remove(0);
    if first.start == Start::Coarse {
        if let Some(halved) = coarse::halved(motion) {
            return coarse::from_coarse(robot, motion, &halved, &first, progress);
        }
        first.start = start::without_halving(robot, motion);
    }
    let problem = Problem::new(Model::new(robot), motion, options.weights.clone());
    let start::Beginning { mut unknowns, started, iterations: before, stopped } =
        start::initial(&problem, first.start, first.seed, progress);
    let mut counted = |state: &Progress| {
        progress(&Progress { iteration: before + state.iteration, ..state.clone() })
    };
    // After an interrupt the solve only writes down where things stand.
    let iterations = if stopped { 0 } else { options.settings.iterations };
    let settings = Settings { iterations, ..options.settings.clone() };
    let (mut solve, multipliers) =
        solver::solve_from(&problem, &mut unknowns, Begin::Cold, &settings, &mut counted);
    if stopped {
        solve.status = Status::Interrupted;
    }
    solve.start = started;
    solve.iterations += before;
    Solution { plan: write_plan(&problem, motion, &unknowns, solve), multipliers }
}

/// Writes a solution down as a plan.
pub(crate) fn write_plan(
    problem: &Problem,
    motion: &Motion,
    unknowns: &Unknowns,
    solve: crate::plan::SolveSummary,
) -> Plan {
    let states = problem.states(unknowns);
    let mut samples: Vec<Sample> =
        (0..states.len()).map(|t| sample(problem, t, &states[t], states.get(t + 1))).collect();
    // Quaternions have two signs; keep the one nearer to the sample before.
    for t in 1..samples.len() {
        let before = samples[t - 1].base_orientation_wxyz;
        let here = &mut samples[t].base_orientation_wxyz;
        let dot: f64 = before.iter().zip(here.iter()).map(|(a, b)| a * b).sum();
        if dot < 0.0 {
            here.iter_mut().for_each(|c| *c = -*c);
        }
    }
    let after = samples.pop().expect("the timeline has a sample after the last");
    let before = samples.remove(0);
    Plan {
        format: crate::plan::FORMAT.into(),
        version: crate::plan::VERSION,
        robot: problem.model.robot().clone(),
        motion: motion.clone(),
        sample_interval_s: problem.interval_s,
        samples,
        before,
        after,
        end_placement: unknowns.placement,
        solve,
        formulation: Formulation,
    }
}

/// One sample of the timeline as it is written down.
fn sample(problem: &Problem, t: usize, state: &State, after: Option<&State>) -> Sample {
    let layout = &problem.layout;
    let rotation = Rotation3::from_matrix_unchecked(state.pose.world_from_body);
    let quaternion = UnitQuaternion::from_rotation_matrix(&rotation);
    let end_effectors = layout
        .end_effectors
        .iter()
        .enumerate()
        .map(|(j, ee)| {
            let wheel = |pick: fn(crate::variables::WheelVars) -> usize| {
                ee.wheel.map_or(0.0, |w| state.vars[pick(w)])
            };
            EndEffectorSample {
                contact: problem.stance[t][j],
                position_m: state.vector(ee.position).into(),
                force_n: state.vector(ee.force).into(),
                wheel_speed_rad_s: wheel(|w| w.speed),
                // A held wheel's motor stands still, not nearly so.
                motor_speed_rad_s: after
                    .filter(|_| !problem.held[j])
                    .map_or(0.0, |after| motor_speed_rad_s(problem, j, state, after)),
                tilt_rad: wheel(|w| w.tilt),
                yaw_rad: wheel(|w| w.yaw),
            }
        })
        .collect();
    Sample {
        time_s: (t as f64 - 1.0) * problem.interval_s,
        base_position_m: state.vector(crate::model::BASE_POSITION).into(),
        base_yaw_pitch_roll_rad: state.vector(crate::model::BASE_YAW).into(),
        base_orientation_wxyz: [quaternion.w, quaternion.i, quaternion.j, quaternion.k],
        joint_rad: state
            .vars
            .rows(crate::model::JOINTS, problem.model.robot().joints.len())
            .iter()
            .copied()
            .collect(),
        com_m: state.pose.com.into(),
        end_effectors,
    }
}
