//! Warm start of sec. 3.3 (Table 3.1): standing, then swaying, then stepping in place.
//!
//! | step | unknowns | terms | ramp |
//! |---|---|---|---|
//! | 1 | forces | dynamics, friction | |
//! | 2 | forces, body | dynamics, friction, no force in swing | unloading of the feet in swing, over 99 problems |
//! | 3 | joints, contact points, wheels | kinematics | swing heights, over 20 problems |
//! | 4 | all | all, goals at zero | |
//!
//! In step 2 of the thesis, no term ties the body to the feet. The body drifts, and the limbs cannot reach the contact points
//! in step 3. Here, the posture term keeps the body near standing unless [`WarmStart::literal`] is set. Step 3 keeps the base
//! of step 2. The thesis keeps the centre of mass, which is not an unknown here.

use super::guess;
use crate::families::{Family, FamilySet};
use crate::formulation::Selection;
use crate::motion::Goal;
use crate::problem::variables::EndEffectorVars;
use crate::problem::{Problem, Unknowns};
use nalgebra::Vector3;
use rollwalk_multibody::euler::JOINTS;

/// Options of the warm start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WarmStart {
    /// True if step 2 leaves the body free to drift, as in the thesis.
    pub literal: bool,
}

/// Number of loads of the feet in swing in steps 1 and 2 (thesis: N₁ = 100). Step 1 has the whole load.
const UNLOADINGS: usize = 100;
/// Number of problems of step 3 (thesis: N₂, without a value).
const HEIGHTS: usize = 20;
/// Iteration limit of each problem of steps 2 and 3. Consecutive problems differ little.
const ITERATIONS_EACH: usize = 2;
/// Iteration limit of steps 1 and 4.
const ITERATIONS: usize = 300;

const STANDING: FamilySet = FamilySet::of(&[
    Family::LinearDynamics,
    Family::AngularDynamics,
    Family::Friction,
    Family::EvenForce,
]);
const SWAYING_LITERAL: FamilySet = STANDING.with(&[Family::SwingForce, Family::Anchor]);
const SWAYING: FamilySet = SWAYING_LITERAL.with(&[Family::Posture, Family::Smoothness]);
const STEPPING: FamilySet = FamilySet::OBSTACLES.with(&[
    Family::ContactPoint,
    Family::WheelAxis,
    Family::ContactHeight,
    Family::Foothold,
    Family::SwingClearance,
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

/// Function that solves one problem of the warm start with the selected families. Arguments: problem, selection, unknowns
/// (replaced by the solution), iteration limit.
pub(crate) type SolveStage<'a> = dyn FnMut(&Problem, &Selection, &mut Unknowns, usize) + 'a;

/// Computes a start for `problem`. `solve` solves the intermediate problems.
pub(crate) fn warm(problem: &Problem, how: WarmStart, solve: &mut SolveStage<'_>) -> Unknowns {
    let in_place = Problem { goal: Goal::default(), placement_free: false, ..problem.clone() };
    let mut unknowns = guess::from_standing(&in_place);

    let mut standing = in_place.clone();
    standing.stance.iter_mut().flatten().for_each(|flag| *flag = true);
    free(&mut standing, Part::Forces);
    // `from_standing` shares the weight among the feet in stance; in this problem all feet stand.
    for slot in &mut unknowns.slots {
        for ee in &problem.layout.end_effectors {
            let share = Vector3::new(0.0, 0.0, problem.force_scale_n());
            slot.fixed_rows_mut::<3>(ee.force).copy_from(&share);
        }
    }
    let selected = |families| Selection { families, ..Selection::default() };
    solve(&standing, &selected(STANDING), &mut unknowns, ITERATIONS);

    let loaded: Vec<Vec<Vector3<f64>>> = unknowns
        .slots
        .iter()
        .map(|slot| {
            let force = |ee: &EndEffectorVars| slot.fixed_rows::<3>(ee.force).into();
            problem.layout.end_effectors.iter().map(force).collect()
        })
        .collect();
    let families = if how.literal { SWAYING_LITERAL } else { SWAYING };
    let mut swaying = in_place.clone();
    free(&mut swaying, Part::ForcesAndBody);
    for k in 1..UNLOADINGS {
        let share = (UNLOADINGS - 1 - k) as f64 / (UNLOADINGS - 1) as f64;
        let swing_force_n = problem
            .timeline
            .iter()
            .map(|sample| loaded[sample.slot].iter().map(|force| force * share).collect())
            .collect();
        let selection = Selection { families, swing_force_n };
        solve(&swaying, &selection, &mut unknowns, ITERATIONS_EACH);
    }

    let mut stepping = in_place.clone();
    free(&mut stepping, Part::Limbs);
    for k in 1..=HEIGHTS {
        let share = k as f64 / HEIGHTS as f64;
        for (height, whole) in
            stepping.height_m.iter_mut().flatten().zip(problem.height_m.iter().flatten())
        {
            *height = share * whole;
        }
        solve(&stepping, &selected(STEPPING), &mut unknowns, ITERATIONS_EACH);
    }

    let zero = |goal: Option<f64>| goal.map(|_| 0.0);
    let Goal { forward_m, left_m, turn_rad } = problem.goal;
    let goal = Goal { forward_m: zero(forward_m), left_m: zero(left_m), turn_rad: zero(turn_rad) };
    let whole = Problem { goal, ..problem.clone() };
    solve(&whole, &Selection::default(), &mut unknowns, ITERATIONS);
    unknowns
}

/// Unknowns of a sample that a step optimises; the others are frozen.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Forces,
    ForcesAndBody,
    Limbs,
}

fn free(problem: &mut Problem, part: Part) {
    let layout = &problem.layout;
    let is_force = |v: usize| layout.vectors().any(|force| (force..force + 3).contains(&v));
    let moves = |v: usize| match part {
        Part::Forces => is_force(v),
        Part::ForcesAndBody => is_force(v) || v < JOINTS,
        Part::Limbs => !is_force(v) && v >= JOINTS,
    };
    let frozen: Vec<bool> = (0..layout.len).map(|v| !moves(v)).collect();
    problem.frozen = vec![frozen; problem.frozen.len()];
}
