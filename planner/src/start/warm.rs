//! The warm start of sec. 3.3 (Table 3.1): learn to stand, then to sway, then to step in place.
//!
//! | step | unknowns | terms | grows |
//! |---|---|---|---|
//! | 1 | forces | dynamics, friction | |
//! | 2 | forces, body | the same, and no force in swing | unloading of the feet in swing, over 100 problems |
//! | 3 | joints, contact points, wheels | kinematics | swing heights, over 20 problems |
//! | 4 | all | all, goals at zero | |
//!
//! Taken literally step 2 lets the body wander, since nothing ties it to the feet, and step 3 then cannot
//! reach. Here the body is held near standing by the posture's pull unless [`WarmStart::literal`] asks
//! otherwise. Step 3 differs from the thesis's in that the base stays where step 2 left it, not the
//! centre of mass, which is no unknown of ours.

use crate::families::{Family, FamilySet};
use crate::guess;
use crate::model::JOINTS;
use crate::motion::Goal;
use crate::plan::Status;
use crate::problem::{Problem, Unknowns};
use crate::solver::{self, Begin, Progress, Settings};
use nalgebra::Vector3;
use std::ops::ControlFlow;

/// How the warm start goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WarmStart {
    /// Whether step 2 lets the body go where it likes, as the thesis has it.
    pub literal: bool,
}

/// Problems of step 2 (thesis: N₁ = 100) and step 3 (N₂, not given).
const UNLOADINGS: usize = 100;
const HEIGHTS: usize = 20;
/// Iterations of each: the next problem is near.
const ITERATIONS_EACH: usize = 2;

const STANDING: FamilySet = FamilySet::of(&[
    Family::LinearDynamics,
    Family::AngularDynamics,
    Family::Friction,
    Family::EvenForce,
]);
const SWAYING_LITERAL: FamilySet = STANDING.with(&[Family::SwingForce, Family::Anchor]);
const SWAYING: FamilySet = SWAYING_LITERAL.with(&[Family::Posture, Family::Smoothness]);
const STEPPING: FamilySet = FamilySet::of(&[
    Family::ContactPoint,
    Family::WheelAxis,
    Family::ContactHeight,
    Family::Slip,
    Family::HeldWheel,
    Family::EndEffectorClearance,
    Family::JointLimit,
    Family::BladeContact,
    Family::Posture,
    Family::Smoothness,
    Family::WheelEffort,
    Family::WheelSmoothness,
]);

/// A start for `problem`, the iterations that it took, and whether `progress`, which sees them all, stopped
/// it.
pub(super) fn warm(
    problem: &Problem,
    how: WarmStart,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> (Unknowns, usize, bool) {
    let in_place = Problem { goal: Goal::default(), placement_free: false, ..problem.clone() };
    let mut walk =
        Walk { unknowns: guess::from_standing(&in_place), iterations: 0, stopped: false, progress };

    let mut standing = Problem { only: STANDING, ..in_place.clone() };
    standing.stance.iter_mut().flatten().for_each(|flag| *flag = true);
    free(&mut standing, Part::Forces);
    // from_standing has shared the weight among the feet in stance; here all of them stand.
    for slot in &mut walk.unknowns.slots {
        for ee in &problem.layout.end_effectors {
            let share = Vector3::new(0.0, 0.0, problem.force_scale_n());
            slot.fixed_rows_mut::<3>(ee.force).copy_from(&share);
        }
    }
    walk.solve(&standing, Settings::default().iterations);

    let loaded: Vec<Vec<Vector3<f64>>> = walk
        .unknowns
        .slots
        .iter()
        .map(|slot| {
            let force =
                |ee: &crate::variables::EndEffectorVars| slot.fixed_rows::<3>(ee.force).into();
            problem.layout.end_effectors.iter().map(force).collect()
        })
        .collect();
    let families = if how.literal { SWAYING_LITERAL } else { SWAYING };
    let mut swaying = Problem { only: families, ..in_place.clone() };
    free(&mut swaying, Part::ForcesAndBody);
    for k in 1..UNLOADINGS {
        let share = (UNLOADINGS - 1 - k) as f64 / (UNLOADINGS - 1) as f64;
        swaying.swing_force_n = problem
            .timeline
            .iter()
            .map(|sample| loaded[sample.slot].iter().map(|force| force * share).collect())
            .collect();
        walk.solve(&swaying, ITERATIONS_EACH);
    }

    let mut stepping = Problem { only: STEPPING, ..in_place.clone() };
    free(&mut stepping, Part::Limbs);
    for k in 1..=HEIGHTS {
        let share = k as f64 / HEIGHTS as f64;
        for (height, whole) in
            stepping.height_m.iter_mut().flatten().zip(problem.height_m.iter().flatten())
        {
            *height = share * whole;
        }
        walk.solve(&stepping, ITERATIONS_EACH);
    }

    let zero = |goal: Option<f64>| goal.map(|_| 0.0);
    let Goal { forward_m, left_m, turn_rad } = problem.goal;
    let goal = Goal { forward_m: zero(forward_m), left_m: zero(left_m), turn_rad: zero(turn_rad) };
    walk.solve(&Problem { goal, ..problem.clone() }, Settings::default().iterations);
    (walk.unknowns, walk.iterations, walk.stopped)
}

/// The warm start under way.
struct Walk<'a> {
    unknowns: Unknowns,
    iterations: usize,
    stopped: bool,
    progress: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
}

impl Walk<'_> {
    fn solve(&mut self, problem: &Problem, iterations: usize) {
        if self.stopped {
            return;
        }
        let settings = Settings { iterations, ..Settings::default() };
        let before = self.iterations;
        let progress = &mut *self.progress;
        let mut counted = |state: &Progress| {
            progress(&Progress { iteration: before + state.iteration, ..state.clone() })
        };
        let (summary, _) =
            solver::solve_from(problem, &mut self.unknowns, Begin::Cold, &settings, &mut counted);
        self.iterations += summary.iterations;
        self.stopped = summary.status == Status::Interrupted;
    }
}

/// Which unknowns of a sample a step moves.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Forces,
    ForcesAndBody,
    Limbs,
}

fn free(problem: &mut Problem, part: Part) {
    let layout = &problem.layout;
    let is_force =
        |v: usize| layout.end_effectors.iter().any(|ee| (ee.force..ee.force + 3).contains(&v));
    let moves = |v: usize| match part {
        Part::Forces => is_force(v),
        Part::ForcesAndBody => is_force(v) || v < JOINTS,
        Part::Limbs => !is_force(v) && v >= JOINTS,
    };
    let frozen: Vec<bool> = (0..layout.len).map(|v| !moves(v)).collect();
    problem.frozen = vec![frozen; problem.frozen.len()];
}
