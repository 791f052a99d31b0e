//! Standing start, moved evenly towards the goal.

use super::detour::Detour;
use crate::formulation::LEAN;
use crate::motion::Footing;
use crate::problem::state::{ContactFrame, rolling_direction, tilt_and_yaw};
use crate::problem::variables::Layout;
use crate::problem::{Problem, Unknowns};
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, Model};
use rollwalk_multibody::ground::ElevationMap;

/// Sets the variables that follow from `q` by forward kinematics: contact points and wheel angles. Yaw angles are unwrapped to
/// stay near those in `vars`.
pub fn follow_kinematics(
    model: &Model,
    layout: &Layout,
    ground: &Footing,
    vars: &mut DVector<f64>,
) {
    follow_on(model, layout, |j, center| ground.contact(j, true, center), vars);
}

/// Sets the variables of timeline sample `t` that follow from `q`, as [`follow_kinematics`] does, on the ground at its contacts.
pub(crate) fn follow_contacts(problem: &Problem, t: usize, vars: &mut DVector<f64>) {
    let ground = |j: usize, _: &Vector3<f64>| problem.contacts[t][j].map.clone();
    follow_on(&problem.model, &problem.layout, ground, vars);
}

fn follow_on(
    model: &Model,
    layout: &Layout,
    ground: impl Fn(usize, &Vector3<f64>) -> ElevationMap,
    vars: &mut DVector<f64>,
) {
    let pose = model.pose_values(&vars.rows(0, layout.dofs).into_owned());
    for (j, ee) in layout.end_effectors.iter().enumerate() {
        let mount = &pose.end_effectors[j];
        let radius = model.robot().end_effectors[j].radius_m;
        let angles = ee.wheel.map(|wheel| {
            let (tilt, yaw) = tilt_and_yaw(&mount.axis, vars[wheel.yaw]);
            (vars[wheel.tilt], vars[wheel.yaw]) = (tilt, yaw);
            [tilt, yaw]
        });
        let map = ground(j, &mount.center);
        let frame = ContactFrame::below(radius, angles, &map, &mount.center);
        vars.fixed_rows_mut::<3>(ee.position).copy_from(&(mount.center + frame.to_contact));
    }
}

/// Raises a robot that stands on the plane z = 0 to the height of the ground below its base.
fn stand_on(ground: &Footing, vars: &mut DVector<f64>) {
    let base = vars.fixed_rows::<3>(BASE_POSITION).into();
    vars[BASE_POSITION + 2] += ground.body().at(&base).height_m;
}

/// Variables of the robot at the origin in a posture with its weight shared evenly.
fn standing(problem: &Problem, posture_q: &DVector<f64>) -> DVector<f64> {
    let layout = &problem.layout;
    let mut vars = DVector::zeros(layout.len);
    vars.rows_mut(0, layout.dofs).copy_from(posture_q);
    stand_on(&problem.ground, &mut vars);
    follow_kinematics(&problem.model, layout, &problem.ground, &mut vars);
    for ee in &layout.end_effectors {
        vars[ee.force + 2] = problem.force_scale_n();
    }
    vars
}

/// Unknowns with a standing robot at all samples, moved and turned evenly towards the goal.
pub fn from_standing(problem: &Problem) -> Unknowns {
    along(problem, &Detour::default())
}

/// Unknowns with a standing robot at all samples, moved along a detour. The robot faces along it.
pub(super) fn along(problem: &Problem, detour: &Detour) -> Unknowns {
    let placement = problem.goal_placement();
    let way = Vector3::new(placement.offset_m[0], placement.offset_m[1], 0.0);
    let turn = placement.yaw_rad;
    let left = Vector3::new(-way.y, way.x, 0.0).try_normalize(0.0).unwrap_or_default();
    let intervals = (problem.last() - 1) as f64;
    let duration_s = intervals * problem.interval_s;
    let slots = (0..problem.samples)
        .map(|i| {
            let u = i as f64 / intervals;
            let posture_q = &problem.posture_q[i];
            let mut vars = standing(problem, posture_q);
            vars[BASE_POSITION + 2] = posture_q[BASE_POSITION + 2];
            for (c, distance) in way.iter().enumerate().take(2) {
                vars[BASE_POSITION + c] += u * distance;
            }
            let [(aside_m, slope), (lower_m, _)] =
                [&detour.aside, &detour.duck].map(|offsets| offsets.at(u * way.norm()));
            vars[BASE_POSITION + 2] -= lower_m;
            vars[BASE_POSITION] += aside_m * left.x;
            vars[BASE_POSITION + 1] += aside_m * left.y;
            let turn = u * turn + slope.atan();
            vars[BASE_YAW] += turn;
            stand_on(&problem.ground, &mut vars);
            for ee in problem.layout.end_effectors.iter().filter_map(|e| e.wheel) {
                vars[ee.yaw] += turn;
            }
            follow_kinematics(&problem.model, &problem.layout, &problem.ground, &mut vars);
            for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
                if let Some(wheel) = ee.wheel {
                    let radius = problem.model.robot().end_effectors[j].radius_m;
                    let rolling = rolling_direction(vars[wheel.yaw]);
                    vars[wheel.speed] = way.dot(&rolling) / duration_s / radius;
                }
            }
            share_weight(problem, i + 1, &mut vars);
            vars
        })
        .collect();
    let mut unknowns = Unknowns { slots, placement };
    if problem.ground.terrain().is_some() {
        on_terrain(problem, &mut unknowns);
    }
    unknowns
}

/// Leans the body with the mean ground below it, and moves contact points to their footholds.
fn on_terrain(problem: &Problem, unknowns: &mut Unknowns) {
    let (layout, model) = (&problem.layout, &problem.model);
    for (i, vars) in unknowns.slots.iter_mut().enumerate() {
        lean_on(problem, vars);
        follow_kinematics(model, layout, &problem.ground, vars);
        onto_footholds(problem, i, vars);
    }
}

/// Raises the body of a robot that stands on the plane z = 0 onto the mean ground below it, and leans it.
pub(crate) fn lean(problem: &Problem, vars: &mut DVector<f64>) {
    stand_on(&problem.ground, vars);
    lean_on(problem, vars);
}

fn lean_on(problem: &Problem, vars: &mut DVector<f64>) {
    let base: Vector3<f64> = vars.fixed_rows::<3>(BASE_POSITION).into();
    let slope = problem.ground.body().at(&base).slope;
    let (sine, cosine) = vars[BASE_YAW].sin_cos();
    vars[BASE_YAW + 1] -= LEAN * (slope.x * cosine + slope.y * sine);
    vars[BASE_YAW + 2] += LEAN * (slope.y * cosine - slope.x * sine);
}

/// Moves the contact points of sample `i` to their footholds. Swings follow their envelope on a straight line from one foothold
/// to the next.
pub(crate) fn onto_footholds(problem: &Problem, i: usize, vars: &mut DVector<f64>) {
    for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
        let contact = &problem.contacts[i + 1][j];
        let mut point: Vector3<f64> = vars.fixed_rows::<3>(ee.position).into();
        if let Some(foothold) = contact.foothold {
            point = foothold;
        } else {
            if let Some(between) = between_footholds(problem, i + 1, j) {
                point = between;
            }
            for border in &contact.borders {
                let over_m = border.outward.dot(&point.xy()) - border.at_m;
                point -= border.outward.push(0.0) * over_m.max(0.0);
            }
            point.z = contact.map.at(&point).height_m + problem.height_m[i + 1][j];
        }
        vars.fixed_rows_mut::<3>(ee.position).copy_from(&point);
    }
}

/// Position of a swing foot on the straight line between the footholds before and after the swing. `None` if one of them is not
/// planned.
fn between_footholds(problem: &Problem, t: usize, j: usize) -> Option<Vector3<f64>> {
    let stands = |t: &usize| problem.stance[*t][j];
    let from = (1..t).rev().find(stands)?;
    let to = (t + 1..=problem.samples).find(stands)?;
    let [begin, end] = [from, to].map(|t| problem.contacts[t][j].foothold);
    // Smooth, at rest at both ends.
    let u = (t - from) as f64 / (to - from) as f64;
    Some(begin?.lerp(&end?, u * u * (3.0 - 2.0 * u)))
}

/// Shares the weight evenly among the feet in stance.
pub(crate) fn share_weight(problem: &Problem, timeline_sample: usize, vars: &mut DVector<f64>) {
    let stance = &problem.stance[timeline_sample];
    let standing = stance.iter().filter(|&&c| c).count().max(1);
    let share = problem.force_scale_n() * stance.len() as f64 / standing as f64;
    for (ee, &down) in problem.layout.end_effectors.iter().zip(stance) {
        let force = if down { Vector3::new(0.0, 0.0, share) } else { Vector3::zeros() };
        vars.fixed_rows_mut::<3>(ee.force).copy_from(&force);
    }
}
