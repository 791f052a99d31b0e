//! Start of the solve of a horizon: the gait, moved at the requested velocity, plus the measured error, which fades.
//!
//! Without the error in the start, the first interval would have to correct all of it. The previous horizon, shifted by the
//! elapsed samples, is a worse start: its end is free and bends away from the gait. In a trot of AgileBot, 60 solves from it
//! took 17 iterations in the median and 26 failed; from the gait, they took 3 and none failed. With the gait as the start, the
//! multipliers of the previous horizon save one iteration of three in a walk and none in a trot.

use super::gait::Gait;
use super::schedule::fade_out;
use crate::plan::Placement;
use crate::problem::variables::Lift;
use crate::problem::{Problem, Unknowns};
use crate::start::guess;
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW};
use rollwalk_multibody::rotation::yaw_rotation;

/// Time over which the measured error fades, s.
const FADES_S: f64 = 0.4;
/// Time constant with which the velocity approaches the requested one, s.
const SETTLES_S: f64 = 0.3;

/// State in which a horizon begins.
#[derive(Clone, Debug)]
pub(super) struct InitialState {
    /// Variables of the first sample, at the origin with heading 0.
    pub at: DVector<f64>,
    /// Variables one interval earlier, extrapolated at the initial velocity.
    pub before: DVector<f64>,
}

/// Samples of a gait from row `phase` on, displaced by the commanded velocity.
pub(super) fn from_gait(
    problem: &Problem,
    gait: &Gait,
    phase: usize,
    beginning: &InitialState,
) -> Unknowns {
    let h = problem.interval_s;
    let (at, before) = (&beginning.at, &beginning.before);
    let velocity = |k: usize| (at[k] - before[k]) / h;
    let measured = [velocity(BASE_POSITION), velocity(BASE_POSITION + 1), velocity(BASE_YAW)];
    let mut place = Placement::default();
    let slots = (0..=problem.samples)
        .map(|i| {
            let vars = &gait.cycle[(phase + i) % gait.samples()];
            let placed = Lift::Placed.apply(&problem.layout, vars, &place);
            let wanted = problem.steering[i.min(problem.steering.len() - 1)];
            let share = (-(i as f64) * h / SETTLES_S).exp();
            let now = [0, 1, 2].map(|c| wanted[c] + share * (measured[c] - wanted[c]));
            let yaw_rad = place.yaw_rad + 0.5 * h * now[2];
            let step = yaw_rotation(yaw_rad) * Vector3::new(now[0], now[1], 0.0) * h;
            place = Placement {
                offset_m: [place.offset_m[0] + step.x, place.offset_m[1] + step.y],
                yaw_rad: place.yaw_rad + h * now[2],
            };
            placed
        })
        .collect();
    with_error(problem, slots, beginning)
}

/// Adds the fading error to `slots`, so that they begin in the measured state. The last slot is the state after the horizon.
fn with_error(
    problem: &Problem,
    mut slots: Vec<DVector<f64>>,
    beginning: &InitialState,
) -> Unknowns {
    let (layout, h) = (&problem.layout, problem.interval_s);
    let InitialState { at, before } = beginning;
    let end = FADES_S / h;
    let off: Vec<[f64; 2]> = (0..layout.dofs)
        .map(|k| {
            let [first, second] = [slots[0][k], slots[1][k]];
            [at[k] - first, (at[k] - before[k]) - (second - first)]
        })
        .collect();
    for (i, vars) in slots.iter_mut().enumerate() {
        for (k, off) in off.iter().enumerate() {
            vars[k] += fade_out(*off, i as f64, end);
        }
        guess::follow_kinematics(&problem.model, layout, &problem.ground, vars);
        let stance = &problem.stance[(i + 1).min(problem.samples)];
        let force = |vars: &DVector<f64>, j: usize| {
            vars.fixed_rows::<3>(layout.end_effectors[j].force).norm() > 0.0
        };
        if (0..stance.len()).any(|j| force(vars, j) != stance[j]) {
            guess::share_weight(problem, (i + 1).min(problem.samples), vars);
        }
    }
    let after = slots.pop().expect("the state after");
    // Ground forces and wheel speeds of the first sample are free.
    let mut first = at.clone();
    for k in layout.vectors() {
        first.rows_mut(k, 3).copy_from(&slots[0].rows(k, 3));
    }
    for wheel in layout.end_effectors.iter().filter_map(|e| e.wheel) {
        first[wheel.speed] = slots[0][wheel.speed];
    }
    slots[0] = first;
    slots.extend([before.clone(), after]);
    Unknowns { slots, placement: Placement::default() }
}
