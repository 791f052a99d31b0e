//! Transitions: motions that lead from a state of one motion to a state of another (sec. 2.4.1,
//! boundary conditions), the edges of a motion graph.
//!
//! Position, joint angles and contact points at both ends come from the motions' splines, so that
//! what the firmware plays continues smoothly; where the end lies on the ground is free.

use crate::guess;
use crate::model::{BASE_POSITION, BASE_YAW, JOINTS, Model};
use crate::motion::{Ends, Goal, Motion};
use crate::optimise::{Options, write_plan};
use crate::plan::{Placement, Plan, Sample, Status};
use crate::problem::{PrescribedEnd, Problem, Unknowns};
use crate::sample::PlanSpline;
use crate::solver::{self, Progress};
use crate::variables::Layout;
use nalgebra::DVector;
use std::ops::ControlFlow;
use thiserror::Error;

/// A moment of a motion.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// The motion.
    pub plan: &'a Plan,
    /// Seconds since its start.
    pub time_s: f64,
}

/// Why two motions cannot be joined.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TransitionError {
    /// The motions belong to different robots.
    #[error(
        "transition {name}: {from} is planned for robot {from_robot}, {to} for {to_robot}; \
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
    /// A motion never has all feet on the ground.
    #[error(
        "motion {motion} never has all feet on the ground at once, so nothing can lead into or out \
         of it; raise the duty factor of its footfall pattern"
    )]
    NoSupport {
        /// The motion.
        motion: String,
    },
    /// The duration leaves no room for a motion.
    #[error("transition {name}: duration_s = {duration_s} is too short; use at least {least_s}")]
    TooShort {
        /// Name of the transition.
        name: String,
        /// Duration asked for, s.
        duration_s: f64,
        /// Least duration, s.
        least_s: f64,
    },
}

/// Sample spacing of transitions, s: every swing of the stepping pattern gets at least five samples.
const SPACING_S: f64 = 0.05;
/// Least duration of a transition, s.
const LEAST_DURATION_S: f64 = 0.3;
/// Frames per second of motion libraries.
const FRAME_RATE_HZ: f64 = 60.0;

/// First moment of a plan that a library frame falls on and at which all feet are on the ground; for
/// a motion that ends at rest and is to be left, its end.
pub fn support_moment(plan: &Plan, leave: bool) -> Result<f64, TransitionError> {
    if leave && plan.motion.ends != Ends::Periodic {
        return Ok(plan.motion.duration_s);
    }
    let h = plan.sample_interval_s;
    let all_down =
        |k: usize| plan.samples[k % plan.samples.len()].end_effectors.iter().all(|e| e.contact);
    let frames = (plan.motion.duration_s * FRAME_RATE_HZ).round() as usize;
    (0..frames)
        .map(|frame| frame as f64 / FRAME_RATE_HZ)
        .find(|time_s| {
            let at = time_s / h;
            // Between samples both neighbours must stand.
            all_down((at + 1e-6).floor() as usize) && all_down((at - 1e-6).ceil().max(0.0) as usize)
        })
        .ok_or_else(|| TransitionError::NoSupport { motion: plan.motion.name.clone() })
}

/// Optimises a transition. Tries first with all feet on the ground, then with a step of each foot in
/// turn; returns the first that converges, else the better one.
pub fn optimise_transition(
    name: &str,
    duration_s: f64,
    from: Moment,
    to: Moment,
    swing_height_m: f64,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Plan, TransitionError> {
    if from.plan.robot != to.plan.robot {
        return Err(TransitionError::DifferentRobots {
            name: name.into(),
            from: from.plan.motion.name.clone(),
            from_robot: from.plan.robot.name.clone(),
            to: to.plan.motion.name.clone(),
            to_robot: to.plan.robot.name.clone(),
        });
    }
    if duration_s.is_nan() || duration_s < LEAST_DURATION_S {
        return Err(TransitionError::TooShort {
            name: name.into(),
            duration_s,
            least_s: LEAST_DURATION_S,
        });
    }
    let samples = (duration_s / SPACING_S).round() as usize + 1;
    let feet = from.plan.robot.end_effectors.len();
    let standing = vec![vec![true; feet]; samples];
    let mut best: Option<Plan> = None;
    let mut iterations = 0;
    for stance in [standing, stepping_pattern(samples, feet)] {
        let motion = Motion {
            name: name.into(),
            duration_s,
            ends: Ends::Prescribed,
            stance,
            swing_height_m,
            goal: Goal::default(),
        };
        let mut plan = attempt(&motion, from, to, options, progress);
        iterations += plan.solve.iterations;
        plan.solve.iterations = iterations;
        let done = matches!(plan.solve.status, Status::Converged | Status::Interrupted);
        if best.as_ref().is_none_or(|b| done || plan.solve.worst_level < b.solve.worst_level) {
            best = Some(plan);
        }
        if done {
            break;
        }
    }
    Ok(best.expect("the loop above runs twice"))
}

/// All feet down at both ends; in between every foot swings once, one after the other.
fn stepping_pattern(samples: usize, feet: usize) -> Vec<Vec<bool>> {
    // A stance sample at both ends of every swing.
    let swing = (samples - 1) as f64 / feet as f64;
    (0..samples)
        .map(|i| {
            (0..feet)
                .map(|j| {
                    // Rear foot, then the front foot of the same side: a lateral sequence.
                    let turn = if feet == 4 { [1, 3, 0, 2][j] } else { j };
                    let (start, end) = (turn as f64 * swing, (turn + 1) as f64 * swing);
                    !((i as f64) > start + 0.5 && (i as f64) < end - 0.5)
                })
                .collect()
        })
        .collect()
}

fn attempt(
    motion: &Motion,
    from: Moment,
    to: Moment,
    options: &Options,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Plan {
    let model = Model::new(&from.plan.robot);
    let spacing_s = motion.duration_s / (motion.stance.len() - 1) as f64;
    let start = prescribed_end(&model, from, -spacing_s);
    let end = prescribed_end(&model, to, spacing_s);
    let (problem, fixed) =
        Problem::transition(model, motion, &start, &end, options.weights.clone());
    let mut unknowns = initial(&problem, fixed);
    let solve = solver::solve(&problem, &mut unknowns, &options.settings, progress);
    write_plan(&problem, motion, &unknowns, solve)
}

/// The state at a moment and one interval beyond it, both placed so that the base stands at the
/// origin with heading 0 at the moment itself.
fn prescribed_end(model: &Model, moment: Moment, step_s: f64) -> PrescribedEnd {
    let spline = PlanSpline::new(moment.plan);
    let at = spline.sample(moment.time_s);
    // A motion at rest is at rest beyond its ends, too.
    let beyond = match moment.plan.motion.ends {
        Ends::Periodic => spline.sample(moment.time_s + step_s),
        Ends::AtRest | Ends::Prescribed => at.clone(),
    };
    let stance = at.end_effectors.iter().map(|e| e.contact).collect();
    let origin = Placement {
        offset_m: [at.base_position_m[0], at.base_position_m[1]],
        yaw_rad: at.base_yaw_pitch_roll_rad[0],
    };
    let layout = Layout::new(model);
    let local = |sample: &Sample| {
        crate::variables::Lift::PlacedBack.apply(&layout, &variables(&layout, sample), &origin)
    };
    let (mut at, mut beyond) = (local(&at), local(&beyond));
    for vars in [&mut at, &mut beyond] {
        guess::follow_kinematics(model, &layout, vars);
    }
    PrescribedEnd { at, beyond, stance }
}

/// The variables of a written sample.
fn variables(layout: &Layout, sample: &Sample) -> DVector<f64> {
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
    let placed = crate::variables::Lift::Placed.apply(&problem.layout, &end, &placement);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_foot_steps_once_between_full_supports() {
        let pattern = stepping_pattern(25, 4);
        assert!(pattern[0].iter().chain(&pattern[24]).all(|&down| down));
        for j in 0..4 {
            let column: Vec<bool> = pattern.iter().map(|row| row[j]).collect();
            let lifts = column.windows(2).filter(|w| w[0] && !w[1]).count();
            let swing = column.iter().filter(|&&down| !down).count();
            assert_eq!((lifts, swing), (1, 5), "{column:?}");
        }
        assert!(pattern.iter().all(|row| row.iter().filter(|&&down| !down).count() <= 1));
    }
}
