//! Transitions: motions that lead from a state of one motion to a state of another (sec. 2.4.1,
//! boundary conditions), the edges of a motion graph.
//!
//! Position, joint angles and contact points at both ends come from the motions' splines, so that
//! what the firmware plays continues smoothly; where the end lies on the ground is free.

use crate::guess;
use crate::model::{BASE_POSITION, BASE_YAW, JOINTS, Model};
use crate::motion::Motion;
use crate::optimise::{Options, write_plan};
use crate::plan::{Placement, Plan, Sample};
use crate::problem::{PrescribedEnd, Problem, Unknowns};
use crate::sample::PlanSpline;
use crate::solver::{self, Progress};
use crate::start::{StartKind, Started};
use crate::variables::{Layout, Lift};
use nalgebra::DVector;
use std::ops::ControlFlow;
use thiserror::Error;

/// Why two motions cannot be joined.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TransitionError {
    /// The motions belong to different robots.
    #[error(
        "transition `{name}`: `{from}` is planned for robot `{from_robot}`, `{to}` for `{to_robot}`; \
         plan both for one robot"
    )]
    DifferentRobots {
        /// Name of the transition.
        name: String,
        /// Motion it leaves.
        from: String,
        /// Its robot.
        from_robot: String,
        /// Motion it enters.
        to: String,
        /// Its robot.
        to_robot: String,
    },
    /// The footfall pattern does not continue that of a motion.
    #[error(
        "transition `{name}`: other feet are down than where it joins `{motion}`; the first and last \
         mark of its footfalls must agree with the motions it joins"
    )]
    OtherFeetDown {
        /// Name of the transition.
        name: String,
        /// The motion.
        motion: String,
    },
}

/// A moment of a motion.
#[derive(Clone, Copy)]
struct Moment<'a> {
    plan: &'a Plan,
    time_s: f64,
}

/// Optimises a transition that leaves `from` where it ends (a periodic motion: where its cycle closes)
/// and enters `to` at its start.
///
/// `motion` has prescribed ends; its goal, if any, is met on top of them. Its posture goes evenly from
/// that of the one motion to that of the other, whatever its own. As with
/// [`optimise`](crate::optimise) the outcome is in the plan's solve summary.
///
/// # Errors
/// The motions cannot be joined, whatever the optimiser does.
pub fn optimise_transition(
    motion: &Motion,
    from: &Plan,
    to: &Plan,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Plan, TransitionError> {
    if from.robot != to.robot {
        return Err(TransitionError::DifferentRobots {
            name: motion.name.clone(),
            from: from.motion.name.clone(),
            from_robot: from.robot.name.clone(),
            to: to.motion.name.clone(),
            to_robot: to.robot.name.clone(),
        });
    }
    let joins = [
        (from, motion.stance.first(), from.motion.exit_stance()),
        (to, motion.stance.last(), to.motion.entry_stance()),
    ];
    for (plan, own, joined) in joins {
        if own != joined {
            return Err(TransitionError::OtherFeetDown {
                name: motion.name.clone(),
                motion: plan.motion.name.clone(),
            });
        }
    }
    let model = Model::new(&from.robot);
    let spacing_s = motion.duration_s / (motion.stance.len() - 1) as f64;
    let exit = Moment { plan: from, time_s: from.motion.exit_time_s() };
    let start = prescribed_end(&model, exit, -spacing_s);
    let end = prescribed_end(&model, Moment { plan: to, time_s: 0.0 }, spacing_s);
    let (problem, fixed) =
        Problem::transition(model, motion, &start, &end, options.weights.clone());
    let mut unknowns = initial(&problem, fixed);
    let mut solve = solver::solve(&problem, &mut unknowns, &options.settings, progress);
    solve.start = Started { kind: StartKind::Joined, seed: 0 };
    Ok(write_plan(&problem, motion, &unknowns, solve))
}

/// Time step of the difference quotient that takes a velocity off a spline, s: accelerations of
/// 20 rad/s² make it wrong by 1e-4 rad/s.
const VELOCITY_STEP_S: f64 = 1e-5;

/// The state at a moment, and the state on the other side of it after one interval at its velocity,
/// both placed so that the base stands at the origin with heading 0 at the moment itself.
///
/// `step_s` is the interval, negative where the plan is left. The velocity is taken inside the plan.
fn prescribed_end(model: &Model, moment: Moment, step_s: f64) -> PrescribedEnd {
    let layout = Layout::new(model);
    let spline = PlanSpline::new(moment.plan);
    let here = spline.sample(moment.time_s);
    let inside_s = VELOCITY_STEP_S.copysign(step_s);
    let inside = variables(&layout, &spline.sample(moment.time_s + inside_s));
    let origin = Placement {
        offset_m: [here.base_position_m[0], here.base_position_m[1]],
        yaw_rad: here.base_yaw_pitch_roll_rad[0],
    };
    let stance = here.end_effectors.iter().map(|e| e.contact).collect();
    let here = variables(&layout, &here);
    let mut beyond = here.clone();
    for dof in 0..layout.dofs {
        beyond[dof] += (inside[dof] - here[dof]) / inside_s * step_s;
    }
    let local = |vars: &DVector<f64>| {
        let mut vars = Lift::PlacedBack.apply(&layout, vars, &origin);
        guess::follow_kinematics(model, &layout, &mut vars);
        vars
    };
    let posture_rad = moment.plan.motion.posture_rad.clone();
    PrescribedEnd { at: local(&here), beyond: local(&beyond), stance, posture_rad }
}

/// The variables of a written sample.
pub(crate) fn variables(layout: &Layout, sample: &Sample) -> DVector<f64> {
    let mut vars = DVector::zeros(layout.len);
    for c in 0..3 {
        vars[BASE_POSITION + c] = sample.base_position_m[c];
        vars[BASE_YAW + c] = sample.base_yaw_pitch_roll_rad[c];
    }
    for (j, angle) in sample.joint_rad.iter().enumerate() {
        vars[JOINTS + j] = *angle;
    }
    for (at, ee) in layout.end_effectors.iter().zip(&sample.end_effectors) {
        for c in 0..3 {
            vars[at.position + c] = ee.position_m[c];
            vars[at.force + c] = ee.force_n[c];
        }
        if let Some(wheel) = at.wheel {
            vars[wheel.speed] = ee.wheel_speed_rad_s;
            vars[wheel.tilt] = ee.tilt_rad;
            vars[wheel.yaw] = ee.yaw_rad;
        }
    }
    vars
}

/// A cubic between the ends that leaves and arrives with their velocities.
fn initial(problem: &Problem, fixed: [DVector<f64>; 4]) -> Unknowns {
    let [start, end, before, after] = fixed;
    let last = problem.samples - 1;
    let h = problem.interval_s;
    let duration_s = h * last as f64;
    let dofs = problem.layout.dofs;
    let velocity_in = (start.rows(0, dofs) - before.rows(0, dofs)) / h;
    let velocity_out = (after.rows(0, dofs) - end.rows(0, dofs)) / h;
    // Where the end would lie if the velocity went evenly from the one to the other.
    let mean = |k: usize| 0.5 * (velocity_in[k] + velocity_out[k]) * duration_s;
    let placement = Placement {
        offset_m: [mean(BASE_POSITION), mean(BASE_POSITION + 1)],
        yaw_rad: mean(BASE_YAW),
    };
    let placed = Lift::Placed.apply(&problem.layout, &end, &placement);
    let mut slots: Vec<DVector<f64>> = (0..problem.samples)
        .map(|i| {
            let u = i as f64 / last as f64;
            let (b0, b1) = (1.0 - u * u * (3.0 - 2.0 * u), u * u * (3.0 - 2.0 * u));
            let (m0, m1) = (u * (1.0 - u) * (1.0 - u), -u * u * (1.0 - u));
            let mut vars = &start * b0 + &placed * b1;
            for k in 0..dofs {
                vars[k] += (velocity_in[k] * m0 + velocity_out[k] * m1) * duration_s;
            }
            guess::follow_kinematics(&problem.model, &problem.layout, &mut vars);
            guess::share_weight(problem, i + 1, &mut vars);
            vars
        })
        .collect();
    let forces_of = |from: &DVector<f64>, to: &DVector<f64>| {
        let mut vars = to.clone();
        for ee in &problem.layout.end_effectors {
            vars.rows_mut(ee.force, 3).copy_from(&from.rows(ee.force, 3));
        }
        vars
    };
    slots[0] = forces_of(&slots[0], &start);
    slots[last] = forces_of(&slots[last], &end);
    slots.extend([before, after]);
    Unknowns { slots, placement }
}
