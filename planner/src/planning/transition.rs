//! Transitions: motions from a state of one motion to a state of another (sec. 2.4.1, boundary conditions). Transitions are the
//! edges of a motion graph.
//!
//! Position, joint angles and contact points at both ends come from the motions' splines, so that playback continues smoothly.
//! The end may be anywhere on the ground.

use super::effort::Effort;
use super::feasibility::search_feasible_values;
use super::probed_solve::solve;
use super::refine;
use super::request::{Options, Request};
use super::solution::Solution;
use super::trials::SolveMethods;
use crate::motion::{Ends, Footing, Motion};
use crate::plan::{Placement, Plan, SolveStart, StartKind};
use crate::problem::variables::{Layout, Lift};
use crate::problem::{PrescribedEnd, Problem};
use crate::sample::{PlanSpline, correction};
use crate::solve::{Progress, SolveMode};
use crate::start::{self, guess};
use nalgebra::DVector;
use rollwalk_multibody::euler::Model;
use std::ops::ControlFlow;
use thiserror::Error;

/// Reason why two motions cannot be joined.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TransitionError {
    /// The motions belong to different robots.
    #[error(
        "transition `{name}`: `{from}` is planned for robot `{from_robot}`, but `{to}` for robot \
         `{to_robot}`; plan both for the same robot"
    )]
    DifferentRobots {
        /// Name of the transition.
        name: String,
        /// Motion that the transition leaves.
        from: String,
        /// Robot of the motion `from`.
        from_robot: String,
        /// Motion that the transition enters.
        to: String,
        /// Robot of the motion `to`.
        to_robot: String,
    },
    /// A motion on terrain begins or ends on uneven ground.
    #[error(
        "at the end that transition `{name}` joins, feet of `{motion}` stand at heights from {low_mm:.0} to {high_mm:.0} mm; begin and end motions of a library on level parts of their terrain"
    )]
    Uneven {
        /// Name of the transition.
        name: String,
        /// Name of the motion.
        motion: String,
        /// Height of the lowest foot in stance, mm.
        low_mm: f64,
        /// Height of the highest foot in stance, mm.
        high_mm: f64,
    },
    /// Stance feet at an end of the transition differ from those of the motion there.
    #[error(
        "transition `{name}` joins `{motion}` with other feet in stance than `{motion}` has there; \
         correct the first and last mark of each row in the footfalls of the transition"
    )]
    OtherFeetDown {
        /// Name of the transition.
        name: String,
        /// Name of the motion.
        motion: String,
    },
}

/// Time in a plan.
#[derive(Clone, Copy)]
struct Moment<'a> {
    plan: &'a Plan,
    time_s: f64,
}

/// Optimises a transition from the end of `from` to the start of `to`. The end of a periodic motion is the end of a cycle.
///
/// `motion` has prescribed ends; its goal, if any, is an additional constraint. The posture is interpolated between those of
/// the two motions; the posture of `motion` is ignored. The plan's solve summary contains the outcome, as with
/// [`optimise`](crate::optimise).
///
/// # Errors
/// Returns an error if the motions belong to different robots, if footfalls at an end of `motion` differ from theirs, or if the
/// feet of a motion on terrain stand at several heights there.
pub fn optimise_transition(
    motion: &Motion,
    from: &Plan,
    to: &Plan,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Plan, TransitionError> {
    let lies = |plan: &Plan| plan.motion.lying_rad.is_some();
    if motion.lying_rad.is_none()
        && (lies(from) || lies(to))
        && let [Some(from), Some(to)] = [from, to].map(Plan::with_body_points)
    {
        let on_feet = from.robot.without_body_points();
        let motion = motion.lying_between(&from.motion, &to.motion, &on_feet);
        return optimise_transition(&motion, &from, &to, options, progress);
    }
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
    for (plan, time_s) in [(from, from.motion.exit_time_s()), (to, 0.0)] {
        let [low_mm, high_mm] = stance_heights_m(plan, time_s).map(|height_m| 1e3 * height_m);
        if high_mm - low_mm > LEVEL_MM {
            let (name, motion) = (motion.name.clone(), plan.motion.name.clone());
            // Adding 0 turns -0 into 0.
            let [low_mm, high_mm] = [low_mm, high_mm].map(|mm| mm.round() + 0.0);
            return Err(TransitionError::Uneven { name, motion, low_mm, high_mm });
        }
    }
    let joined = MotionPair { from, to };
    let request = Request { robot: &from.robot, motion, options };
    let effort = &mut Effort::new(&options.structures, progress);
    let solution = joined.solve(request, effort);
    let (_, solution) = search_feasible_values(request, &joined, solution, effort);
    let refined = refine::refine_until_valid(solution, options, effort, &mut |_, finer, effort| {
        joined.solve(Request { motion: finer, ..request }, effort)
    });
    let mut plan = refined.plan;
    correction::join(&mut plan, from, to);
    Ok(plan)
}

/// Two motions that a transition joins.
#[derive(Clone, Copy)]
struct MotionPair<'a> {
    from: &'a Plan,
    to: &'a Plan,
}

impl SolveMethods for MotionPair<'_> {
    fn cold(&self, request: Request<'_>, effort: &mut Effort<'_>) -> Option<Solution> {
        // The motions are plans of one robot.
        (*request.robot == self.from.robot).then(|| self.solve(request, effort))
    }

    fn near(
        &self,
        _: &Solution,
        request: Request<'_>,
        effort: &mut Effort<'_>,
    ) -> Option<Solution> {
        self.cold(request, effort)
    }
}

impl MotionPair<'_> {
    /// Optimises a transition between the two motions. From rest to a motion on terrain, the robot ends where it began, because
    /// the motion begins at the origin of the terrain.
    fn solve(&self, request: Request<'_>, effort: &mut Effort<'_>) -> Solution {
        let (Self { from, to }, Request { robot, motion, options }) = (*self, request);
        let model = motion.model(robot);
        let spacing_s = motion.duration_s / (motion.stance.len() - 1) as f64;
        let exit = Moment { plan: from, time_s: from.motion.exit_time_s() };
        let start = prescribed_end(&model, &motion.ground, exit, -spacing_s);
        let entry = Moment { plan: to, time_s: 0.0 };
        let end = prescribed_end(&model, &motion.ground, entry, spacing_s);
        let (mut problem, fixed) =
            Problem::transition(model, motion, &start, &end, options.weights.clone());
        problem.placement_free = to.motion.terrain.is_none() || from.motion.ends != Ends::AtRest;
        let unknowns = start::joined(&problem, fixed);
        let solved = solve(&problem, unknowns, SolveMode::Cold, &options.settings, effort);
        solved.write(&problem, motion, SolveStart { kind: StartKind::Joined, seed: 0 })
    }
}

/// Largest difference of heights of feet on level ground, mm.
const LEVEL_MM: f64 = 2.0;

/// Lowest and highest contact of a plan on terrain in stance, m; 0 on level ground and in flight.
fn stance_heights_m(plan: &Plan, time_s: f64) -> [f64; 2] {
    if plan.motion.terrain.is_none() {
        return [0.0; 2];
    }
    let here = PlanSpline::new(plan).sample(time_s);
    let standing = here.end_effectors.iter().filter(|end| end.contact);
    let heights_m = standing.map(|end| [end.position_m[2]; 2]);
    let both = |[low, high]: [f64; 2], [other, _]: [f64; 2]| [low.min(other), high.max(other)];
    heights_m.reduce(both).unwrap_or_default()
}

/// Time step of the difference quotient for the velocity of a spline, s. With accelerations of 20 rad/s², the error is 1e-4
/// rad/s.
const VELOCITY_STEP_S: f64 = 1e-5;

/// State of a plan at one time, and that state extrapolated by one interval at its velocity. Both are moved so that the base at
/// the time itself is at the origin with heading 0, and lowered from the landing of a terrain to the plane z = 0.
///
/// `step_s` is the interval, negative at the motion that the transition leaves. The velocity is a one-sided difference within
/// the plan.
fn prescribed_end(model: &Model, ground: &Footing, moment: Moment, step_s: f64) -> PrescribedEnd {
    let layout = Layout::new(model);
    let spline = PlanSpline::new(moment.plan);
    let here = spline.sample(moment.time_s);
    let inside_s = VELOCITY_STEP_S.copysign(step_s);
    let inside = layout.variables_of(&spline.sample(moment.time_s + inside_s));
    let origin = Placement {
        offset_m: [here.base_position_m[0], here.base_position_m[1]],
        yaw_rad: here.base_yaw_pitch_roll_rad[0],
    };
    let stance: Vec<bool> = here.end_effectors.iter().map(|e| e.contact).collect();
    let here = layout.variables_of(&here);
    let mut beyond = here.clone();
    for dof in 0..layout.dofs {
        beyond[dof] += (inside[dof] - here[dof]) / inside_s * step_s;
    }
    let ground_m = stance_heights_m(moment.plan, moment.time_s)[0];
    let local = |vars: &DVector<f64>| {
        let mut vars = Lift::PlacedBack.apply(&layout, vars, &origin);
        layout.points().for_each(|point| vars[point + 2] -= ground_m);
        guess::follow_kinematics(model, &layout, ground, &mut vars);
        vars
    };
    let ends = model.robot().end_effectors.iter().zip(&stance);
    let lies = ends.into_iter().any(|(end, stands)| end.contact.is_body_point() && *stands);
    let of = &moment.plan.motion;
    let lying_rad = of.lying_rad.as_ref().filter(|_| lies);
    let posture_rad = lying_rad.unwrap_or(&of.posture_rad).clone();
    PrescribedEnd { at: local(&here), beyond: local(&beyond), stance, posture_rad }
}
