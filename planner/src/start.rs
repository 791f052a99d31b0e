//! Starting points of a solve, selected by the caller.
//!
//! The optimiser finds a minimum near its start, and for some motions the obvious start is a bad one. Standing straight is a
//! saddle point for robots on free wheels: thrust grows with steering angle times stroke, so that every method stops there
//! without moving. A small smooth random swing of every joint leaves the saddle point, but harms motions from rest to rest.
//! [`crate::candidates`] lists the starts of a motion in the order of trial.
//!
//! Random numbers depend only on a seed: the same seed gives the same plan.

mod closed_way;
mod detour;
pub(crate) mod guess;
mod halved;
mod joined;
mod neighbour;
mod warm;

pub use closed_way::closed_way;
pub(crate) use halved::halved;
pub(crate) use joined::joined;
pub(crate) use neighbour::neighbour;
pub use warm::WarmStart;
pub(crate) use warm::warm;

use crate::motion::Motion;
use crate::plan::{SolveStart, StartKind};
use crate::problem::state::rolling_direction;
use crate::problem::{Problem, Unknowns};
use fastrand::Rng;
use rollwalk_multibody::euler::JOINTS;
use rollwalk_robot::Robot;
use std::f64::consts::TAU;

/// Kind of start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Start {
    /// Candidates of [`crate::candidates`] in order, until one converges.
    #[default]
    Auto,
    /// Standing, moved evenly towards the goal. With a seed other than 0, the joints swing slightly, so that different seeds
    /// give different starts.
    Standing,
    /// Standing start, moved round obstacles. The argument is the index of the path among those round them, the shortest first.
    Detour(usize),
    /// Standing start with a smooth random swing of every joint.
    Sinusoid,
    /// Plan of the same motion with half the samples, recursively until samples are few. The coarsest motion starts from a
    /// swing or from standing, depending on the robot.
    Coarse,
    /// Warm start of the thesis (sec. 3.3), without random numbers: standing, swaying, then stepping in place.
    Warm(WarmStart),
}

/// Amplitude of the random swing of [`Start::Sinusoid`], rad.
const SWING_RAD: f64 = 0.1;
/// Amplitude of the random joint motion that a seed other than 0 adds to the standing start, rad.
const NUDGE_RAD: f64 = 0.02;
/// Approximate duration of a swing in motions that are not periodic, s.
const SWING_S: f64 = 1.2;
/// Difference between the seeds of a motion's candidates. The difference is large enough that searches with different small
/// seeds have no candidate in common.
const SEED_STRIDE: u64 = 1000;

/// Returns the starts to try for a motion, in order. The first one nearly always converges. If the start is not automatic, it is
/// the only candidate.
///
/// [`Start::Auto`] depends on the robot:
///
/// - On free wheels that can be steered, it tries two random swings, then standing.
/// - Otherwise, it tries standing, then small random swings and a large one. For motions with steps, the warm start is last,
///   because it takes longest.
/// - On free wheels and skates, whose strokes are hardly found otherwise, [`Start::Coarse`] replaces the first of these starts,
///   and falls back to it. With many samples it is also the second candidate of other motions.
/// - If obstacles are in the path, the paths round them precede all of these.
pub(crate) fn in_order(
    robot: &Robot,
    motion: &Motion,
    start: Start,
    seed: u64,
) -> Vec<(Start, u64)> {
    let other = |i: u64| seed.wrapping_add(i * SEED_STRIDE);
    let swing = |i| (Start::Sinusoid, other(i));
    let nudge = |i| (Start::Standing, other(i));
    let mut starts = match start {
        Start::Auto if stands_on_free_wheels(robot, motion) => {
            vec![swing(0), swing(1), (Start::Standing, seed)]
        }
        Start::Auto => {
            let second = if seed == 0 { nudge(1) } else { (Start::Standing, 0) };
            let steps = motion.stance.iter().flatten().any(|stance| !stance);
            let warm = steps.then_some((Start::Warm(WarmStart::default()), 0));
            [nudge(0), second, nudge(2), swing(0)].into_iter().chain(warm).collect()
        }
        chosen => vec![(chosen, seed)],
    };
    if start == Start::Auto && halved(robot, motion).is_some() {
        match any_rolls_freely(robot, motion) {
            true => starts[0].0 = Start::Coarse,
            false => starts.insert(1, (Start::Coarse, seed)),
        }
    }
    if start == Start::Auto {
        let ways = detour::detours(robot, motion).len();
        starts.splice(0..0, (0..ways).map(|k| (Start::Detour(k), 0)));
    }
    starts
}

/// Start of a motion that is not halved further.
pub(crate) fn without_halving(robot: &Robot, motion: &Motion) -> Start {
    if stands_on_free_wheels(robot, motion) { Start::Sinusoid } else { Start::Standing }
}

/// Returns true if an end effector that touches the ground rolls freely and can be steered.
///
/// Blades that consist of two wheels of one link cannot be steered, because the two wheels prevent a turn in stance. A swing of
/// the joints starts far from any feasible motion of such blades, while strokes develop from standing.
fn stands_on_free_wheels(robot: &Robot, motion: &Motion) -> bool {
    let shares_link = |j: usize| {
        let link = robot.end_effectors[j].link;
        robot.end_effectors.iter().filter(|other| other.link == link).count() > 1
    };
    (0..robot.end_effectors.len()).any(|j| rolls_freely(robot, motion, j) && !shares_link(j))
}

/// Returns true if the robot rolls freely but cannot be steered by the axes of its wheels, as on blades.
fn skates(robot: &Robot, motion: &Motion) -> bool {
    any_rolls_freely(robot, motion) && !stands_on_free_wheels(robot, motion)
}

/// Returns true if any end effector rolls freely in stance.
pub(crate) fn any_rolls_freely(robot: &Robot, motion: &Motion) -> bool {
    (0..robot.end_effectors.len()).any(|j| rolls_freely(robot, motion, j))
}

/// Returns true if an end effector is in stance at some time and rolls freely.
fn rolls_freely(robot: &Robot, motion: &Motion, j: usize) -> bool {
    let held = motion.held_wheels.get(j).copied().unwrap_or(false);
    let free = robot.end_effectors[j].contact.drag().is_some() && !held;
    free && motion.stance.iter().any(|stance| stance[j])
}

/// Returns a start that needs no solve: any except [`Start::Warm`] and [`Start::Coarse`].
pub(crate) fn initial(
    problem: &Problem,
    motion: &Motion,
    start: Start,
    seed: u64,
) -> (Unknowns, SolveStart) {
    if let Start::Detour(k) = start {
        let ways = detour::detours(problem.model.robot(), motion);
        if let Some(way) = ways.get(k) {
            let mut unknowns = guess::along(problem, way);
            roll_along(problem, &mut unknowns);
            return (unknowns, SolveStart { kind: StartKind::Detour, seed: k as u64 });
        }
    }
    let (kind, amplitude_rad) = match start {
        Start::Sinusoid => (StartKind::Sinusoid, SWING_RAD),
        _ if seed == 0 => (StartKind::Standing, 0.0),
        _ => (StartKind::Standing, NUDGE_RAD),
    };
    let mut unknowns = guess::from_standing(problem);
    if amplitude_rad > 0.0 {
        swing_joints(problem, &mut unknowns, amplitude_rad, seed);
    }
    (unknowns, SolveStart { kind, seed })
}

/// Adds a sinusoid of random phase to every joint, and updates contact points and wheels.
fn swing_joints(problem: &Problem, unknowns: &mut Unknowns, amplitude_rad: f64, seed: u64) {
    let mut random = Rng::with_seed(seed);
    let joints = problem.model.robot().joints.len();
    let phases: Vec<f64> = (0..joints).map(|_| TAU * random.f64()).collect();
    let intervals = (problem.last() - 1) as f64;
    let cycles = if problem.periodic {
        1.0
    } else {
        (intervals * problem.interval_s / SWING_S).round().max(1.0)
    };
    for (i, slot) in unknowns.slots.iter_mut().enumerate() {
        let angle = TAU * cycles * i as f64 / intervals;
        for (j, phase) in phases.iter().enumerate() {
            slot[JOINTS + j] += amplitude_rad * (angle + phase).sin();
        }
        guess::follow_kinematics(&problem.model, &problem.layout, &problem.ground, slot);
    }
    roll_along(problem, unknowns);
}

/// Sets wheel speeds from the travel of the contact points along the rolling directions.
fn roll_along(problem: &Problem, unknowns: &mut Unknowns) {
    let states = problem.states(unknowns);
    for (i, slot) in unknowns.slots.iter_mut().enumerate() {
        let (here, after) = (&states[i + 1], &states[i + 2]);
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            let Some(wheel) = ee.wheel else { continue };
            let way = after.vector(ee.position) - here.vector(ee.position);
            let rolling = rolling_direction(0.5 * (here.vars[wheel.yaw] + after.vars[wheel.yaw]));
            let radius = problem.model.robot().end_effectors[j].radius_m;
            slot[wheel.speed] = way.dot(&rolling) / problem.interval_s / radius;
        }
    }
}
