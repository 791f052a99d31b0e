//! Where a solve starts: the first values of all unknowns, as a value that a caller can choose.
//!
//! The optimiser finds a minimum near its start, and for some motions the obvious start is a bad one.
//! Straight standing is a saddle for robots that stand on free wheels: thrust is second order in steer
//! times stroke, so every method stops there without moving. A small smooth random swing of every joint
//! frees them, and would only hurt motions from rest to rest. [`candidates`] knows which to try first.
//!
//! Everything random comes from a seed: the same seed gives the same plan.

pub(crate) mod guess;
mod halved;
mod joined;
mod neighbour;
mod warm;

pub(crate) use halved::halved;
pub(crate) use joined::joined;
pub(crate) use neighbour::neighbour;
pub use warm::WarmStart;
pub(crate) use warm::warm;

use crate::motion::Motion;
use crate::plan::{StartKind, Started};
use crate::problem::state::rolling_direction;
use crate::problem::{Problem, Unknowns};
use fastrand::Rng;
use rollwalk_multibody::euler::JOINTS;
use rollwalk_robot::Robot;
use std::f64::consts::TAU;

/// A way to start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Start {
    /// Each of [`candidates`] in order, until one converges.
    #[default]
    Auto,
    /// Standing, carried along the way to the goal. With a seed other than 0 joints swing a little, so
    /// that different seeds are different starts.
    Standing,
    /// The same with a smooth random swing of every joint.
    Sinusoid,
    /// The plan of the same motion with half the samples, and so on until samples are few; there a swing or
    /// standing, whichever suits.
    Coarse,
    /// The thesis's warm start (sec. 3.3): stands, sways, then steps in place, without anything random.
    Warm(WarmStart),
}

/// Amplitude of the swing that frees a robot on free wheels, rad.
const SWING_RAD: f64 = 0.1;
/// Amplitude of the swing that tells the seeds of a standing start apart, rad.
const NUDGE_RAD: f64 = 0.02;
/// About how long a swing takes in motions that do not repeat, s.
const SWING_S: f64 = 1.2;
/// How far apart the seeds of a motion's candidates are, so that those of small seeds stay different.
const SEED_STRIDE: u64 = 1000;

/// The starts to try for a motion, the one that nearly always serves first.
///
/// For [`Start::Auto`] these are: on free wheels that can be steered two random swings, then
/// standing; otherwise standing, with nudges if that fails, then a random swing, and last, for motions that
/// step, the warm start, which a flying trot needs. Where samples are many their half comes first on free wheels
/// and skates, whose strokes are hardly found otherwise, and second for all others. A chosen start is the
/// only candidate.
pub fn candidates(robot: &Robot, motion: &Motion, start: Start, seed: u64) -> Vec<(Start, u64)> {
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
    if start == Start::Auto && halved(motion).is_some() {
        let at =
            usize::from(!(0..robot.end_effectors.len()).any(|j| rolls_freely(robot, motion, j)));
        starts.insert(at, (Start::Coarse, seed));
    }
    starts
}

/// The start of a motion that samples are not halved for.
pub(crate) fn without_halving(robot: &Robot, motion: &Motion) -> Start {
    if stands_on_free_wheels(robot, motion) { Start::Sinusoid } else { Start::Standing }
}

/// Whether some end effector that touches the ground rolls freely and can be steered there. Blades
/// cannot: two wheels of one link that both stand forbid a turn, so a swing of their joints starts far
/// from anything possible, and strokes come about from standing.
fn stands_on_free_wheels(robot: &Robot, motion: &Motion) -> bool {
    let shares_link = |j: usize| {
        let link = robot.end_effectors[j].link;
        robot.end_effectors.iter().filter(|other| other.link == link).count() > 1
    };
    (0..robot.end_effectors.len()).any(|j| rolls_freely(robot, motion, j) && !shares_link(j))
}

/// Whether an end effector touches the ground at times and rolls freely there.
fn rolls_freely(robot: &Robot, motion: &Motion, j: usize) -> bool {
    let held = motion.held_wheels.get(j).copied().unwrap_or(false);
    let free = robot.end_effectors[j].contact.drag().is_some() && !held;
    free && motion.stance.iter().any(|stance| stance[j])
}

/// The start without any solve before it: all but [`Start::Warm`] and [`Start::Coarse`].
pub(crate) fn initial(problem: &Problem, start: Start, seed: u64) -> (Unknowns, Started) {
    let (kind, amplitude_rad) = match start {
        Start::Sinusoid => (StartKind::Sinusoid, SWING_RAD),
        _ if seed == 0 => (StartKind::Standing, 0.0),
        _ => (StartKind::Standing, NUDGE_RAD),
    };
    let mut unknowns = guess::from_standing(problem);
    if amplitude_rad > 0.0 {
        swing_joints(problem, &mut unknowns, amplitude_rad, seed);
    }
    (unknowns, Started { kind, seed })
}

/// Adds a sinusoid of random phase to every joint, and lets contact points and wheels follow.
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
        guess::follow_kinematics(&problem.model, &problem.layout, slot);
    }
    roll_along(problem, unknowns);
}

/// Sets wheel speeds to what the contact points' ways along the rolling directions ask.
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
