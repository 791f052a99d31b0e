//! Where the solve of a horizon starts: the gait, moved with the wanted velocity, or the horizon before it, shifted.
//!
//! Both begin in the measured state, and its distance to them fades over the first part of the horizon: with the undisturbed
//! samples as they are, the solve would have to take all of it back in its first interval.

use super::gait::{Gait, base_placement};
use super::schedule::faded;
use crate::families::Family;
use crate::formulation::rows::{Rows, Subject};
use crate::plan::Placement;
use crate::problem::variables::Lift;
use crate::problem::{Problem, Unknowns};
use crate::solve::Multipliers;
use crate::start::guess;
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW};
use rollwalk_multibody::rotation::yaw_rotation;
use std::collections::BTreeMap;

/// Time over which the measured error fades, s.
const FADES_S: f64 = 0.4;
/// Time in which a velocity that differs from the wanted one becomes it in a start from the gait, s.
const SETTLES_S: f64 = 0.3;

/// The state in which a horizon begins.
#[derive(Clone, Debug)]
pub(super) struct Beginning {
    /// Variables of its first sample: at the origin with heading 0.
    pub at: DVector<f64>,
    /// Variables one interval before, at its velocity.
    pub before: DVector<f64>,
}

/// A solved horizon, as the start of the next.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    /// Samples in order, and the state after the last.
    pub slots: Vec<DVector<f64>>,
    /// Number of the first sample.
    pub at: i64,
    /// Where its frame is in the world.
    pub world_from_plan: Placement,
    /// Shift of each row that has one, by family, sample, part of the robot and number among those rows.
    pub shifts: BTreeMap<Key, f64>,
}

/// A row, whatever other rows its problem has.
pub(super) type Key = (usize, usize, Subject, usize);

/// Keys of rows in their order.
pub(super) fn keys(rows: &Rows) -> impl Iterator<Item = Key> + '_ {
    let mut seen: (Option<(Family, usize, Subject)>, usize) = (None, 0);
    rows.rows.iter().map(move |row| {
        let this = (row.family, row.at, row.subject);
        seen = if seen.0 == Some(this) { (seen.0, seen.1 + 1) } else { (Some(this), 0) };
        (row.family as usize, row.at, row.subject, seen.1)
    })
}

/// Samples of a gait from a row on, moved with the steering.
pub(super) fn from_gait(
    problem: &Problem,
    gait: &Gait,
    phase: usize,
    beginning: &Beginning,
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

/// Samples of the horizon before, `elapsed` of them later, and beyond its end those of the gait.
pub(super) fn shifted(
    problem: &Problem,
    gait: &Gait,
    phase: usize,
    solved: &Solved,
    elapsed: usize,
    world_from_plan: &Placement,
    beginning: &Beginning,
) -> Unknowns {
    let layout = &problem.layout;
    let here_from = |there: &Placement| {
        let [x, y, _] = world_from_plan.inverse().point([there.offset_m[0], there.offset_m[1], 0.0]);
        Placement { offset_m: [x, y], yaw_rad: there.yaw_rad - world_from_plan.yaw_rad }
    };
    let here_from_before = here_from(&solved.world_from_plan);
    let known = solved.slots.iter().skip(elapsed);
    let mut slots: Vec<_> =
        known.map(|vars| Lift::Placed.apply(layout, vars, &here_from_before)).collect();
    while slots.len() <= problem.samples {
        let i = slots.len();
        let last = &slots[i - 1];
        let from = base_placement(last);
        let wanted = problem.steering[(i - 1).min(problem.steering.len() - 1)];
        let h = problem.interval_s;
        let step = yaw_rotation(from.yaw_rad + 0.5 * h * wanted[2])
            * Vector3::new(wanted[0], wanted[1], 0.0)
            * h;
        let place = Placement {
            offset_m: [from.offset_m[0] + step.x, from.offset_m[1] + step.y],
            yaw_rad: from.yaw_rad + h * wanted[2],
        };
        let vars = &gait.cycle[(phase + i) % gait.samples()];
        slots.push(Lift::Placed.apply(layout, vars, &place));
    }
    slots.truncate(problem.samples + 1);
    with_error(problem, slots, beginning)
}

/// Samples that begin in the measured state, the last one of which is the state after the horizon.
fn with_error(
    problem: &Problem,
    mut slots: Vec<DVector<f64>>,
    beginning: &Beginning,
) -> Unknowns {
    let (layout, h) = (&problem.layout, problem.interval_s);
    let Beginning { at, before } = beginning;
    let end = FADES_S / h;
    let off: Vec<[f64; 2]> = (0..layout.dofs)
        .map(|k| {
            let [first, second] = [slots[0][k], slots[1][k]];
            [at[k] - first, (at[k] - before[k]) - (second - first)]
        })
        .collect();
    for (i, vars) in slots.iter_mut().enumerate() {
        for (k, off) in off.iter().enumerate() {
            vars[k] += faded(*off, i as f64, end);
        }
        guess::follow_kinematics(&problem.model, layout, vars);
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

/// Multipliers of the horizon before for these rows, `elapsed` samples later; beyond its end those one period earlier.
pub(super) fn shifted_multipliers(
    rows: &Rows,
    solved: &Solved,
    elapsed: usize,
    period: usize,
    penalty: f64,
) -> Multipliers {
    let shift = |(family, at, subject, number): Key| {
        let later = [at + elapsed, (at + elapsed).saturating_sub(period)];
        let found = later.iter().find_map(|&at| solved.shifts.get(&(family, at, subject, number)));
        found.copied().unwrap_or(0.0)
    };
    Multipliers::of(rows, keys(rows).map(shift).collect(), penalty)
}

/// What the next horizon needs of an outcome.
pub(super) fn remembered(
    rows: &Rows,
    shifts: &[f64],
    slots: &[DVector<f64>],
    samples: usize,
    at: i64,
    world_from_plan: Placement,
) -> Solved {
    let in_order = slots[..samples].iter().chain([&slots[samples + 1]]).cloned().collect();
    let shifts = keys(rows).zip(shifts.iter().copied()).filter(|(_, shift)| *shift != 0.0).collect();
    Solved { slots: in_order, at, world_from_plan, shifts }
}
