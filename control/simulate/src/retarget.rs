//! Retargeting: corrections of set-points, so that a robot with soft servos follows its plan (thesis 4.7.2).
//!
//! Soft servos sag, so that the body is late and low. Retargeting adds a curve to the set-points of each joint, and optimises
//! its knots until the centre of mass follows the plan.
//!
//! The rollout simulates the plan like [`run`](crate::run), and computes derivatives of every step with respect to all knots.
//! The Gauss–Newton method optimises the knots. Height errors have the weight of horizontal errors; otherwise nothing would
//! keep the robot from sagging. A small smoothness penalty determines the knots that do not affect the motion.

use crate::run::{begin, run_steps, step_s};
use crate::script::{REST_S, Script};
use nalgebra::Vector3;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::curve::{Curve, Degree};
use rollwalk_physics::sensitivity::gauss_newton::{self, Evaluation, Penalty, minimise};
use rollwalk_physics::sensitivity::parameter::Control;
use rollwalk_physics::sensitivity::{Recorder, Residual};
use rollwalk_physics::world::{FallWatch, Parameters};
use rollwalk_planner::plan::Plan;
use rollwalk_robot::{Actuator, Robot};
use std::sync::Arc;
use thiserror::Error;

/// Options of retargeting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// True if the planned torques are fed forward to the servos.
    pub feed_forward: bool,
    /// Number of simulated periods of a motion that repeats.
    pub cycles: usize,
    /// Approximate number of simulation steps per second.
    ///
    /// Use at least the rate at which the motion is played. Lower rates damp rocking gaits: a pace corrected at 120 Hz covers
    /// its distance there, but only 70 % of it at 240 Hz.
    pub rate_hz: u32,
    /// Number of knots of the curve of each joint over the motion.
    pub knots: usize,
    /// Maximum number of iterations.
    pub iterations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { feed_forward: true, cycles: 3, rate_hz: 240, knots: 12, iterations: 8 }
    }
}

/// Weight of the root-mean-square distance of the centre of mass from the plan, 1/m.
const PER_M: f64 = 30.0;
/// Weight of the squared change between adjacent knots, 1/rad².
const SMOOTH: f64 = 1e-3;
/// Weight of the squared deviation of a knot from its start value, 1/rad².
///
/// Forces between legs that press against each other do not move the centre of mass, but feet slide when one of them lifts.
const SMALL: f64 = 1e-4;
/// Weight of the squared change between the two knots at each end of a finite motion, 1/rad². Its set-points begin and end at
/// rest.
const ENDS: f64 = 10.0;
/// Largest change of a knot in an iteration, rad.
const MOST_RAD: f64 = 0.2;
/// Relative improvement of an iteration below which the search ends.
const TOLERANCE: f64 = 1e-3;

/// Result of retargeting.
#[derive(Clone, Debug)]
pub struct RetargetResult {
    /// Plan with its corrections.
    pub plan: Plan,
    /// Objective at the start and after each iteration.
    pub costs: Vec<f64>,
    /// Number of simulated rollouts.
    pub rollouts: usize,
    /// Largest correction, rad.
    pub largest_rad: f64,
}

/// Robot whose set-points cannot be corrected.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum RetargetError {
    /// Coupled motor, whose set-points concern several joints.
    #[error(
        "the motor of joint `{0}` is coupled (`motor_per_joint` or `linkage`), and setpoints of \
         such motors cannot be corrected"
    )]
    Coupled(String),
    /// Joint without a motor, which has no set-points.
    #[error(
        "joint `{0}` has no motor, and setpoints of robots with such joints cannot be corrected"
    )]
    Passive(String),
}

/// Checks that the set-points of a robot can be corrected.
///
/// # Errors
/// Returns the first joint that prevents it.
pub fn check(robot: &Robot) -> Result<(), RetargetError> {
    if let Some(joint) = robot.joints.iter().find(|joint| joint.is_coupled()) {
        return Err(RetargetError::Coupled(joint.name.clone()));
    }
    if let Some(joint) = robot.joints.iter().find(|joint| joint.is_passive()) {
        return Err(RetargetError::Passive(joint.name.clone()));
    }
    Ok(())
}

/// Computes corrections for a validated plan. Ignores and replaces its present corrections.
///
/// Calls `goes_on` before each rollout with the number of the rollout. If `goes_on` returns `false` the search ends with the
/// best corrections so far.
///
/// Returns `None` if the uncorrected plan falls, or if a step of the simulation has no solution.
///
/// # Errors
/// Returns the error of [`check`].
pub fn retarget(
    plan: &Plan,
    options: &Options,
    mut goes_on: impl FnMut(usize) -> bool,
) -> Result<Option<RetargetResult>, RetargetError> {
    check(&plan.robot)?;
    let mut bare = plan.clone();
    bare.samples.iter_mut().for_each(|sample| sample.joint_correction_rad.clear());
    let script = Script::new(&bare, options.feed_forward);
    let curve = curve(&script, options);
    let joints = plan.robot.joints.len();
    let mut count = 0;
    let mut run = |knots: &[f64]| {
        count += 1;
        goes_on(count).then(|| rollout(&script, options, &curve, knots)).flatten()
    };
    let mut penalties = Penalty::smooth(joints, curve.knots, curve.periodic, SMOOTH);
    let start = yielding(&script, options, &curve);
    let near = |(knot, at): (usize, &f64)| {
        let weight = f64::sqrt(SMALL);
        Penalty { factors: vec![(knot, weight)], target: weight * at }
    };
    penalties.extend(start.iter().enumerate().map(near));
    if !curve.periodic {
        for [knot, next] in [[0, 1], [curve.knots - 2, curve.knots - 1]] {
            let weight = f64::sqrt(ENDS);
            let of_joint = |joint: usize| Penalty {
                factors: vec![(knot * joints + joint, weight), (next * joints + joint, -weight)],
                target: 0.0,
            };
            penalties.extend((0..joints).map(of_joint));
        }
    }
    let search = gauss_newton::Options {
        iterations: options.iterations,
        tolerance: TOLERANCE,
        most: MOST_RAD,
        ..gauss_newton::Options::default()
    };
    // If the robot falls with these angles, it may stand without them.
    let fit = minimise(&start, &penalties, &search, &mut run)
        .or_else(|| minimise(&vec![0.0; start.len()], &penalties, &search, &mut run));
    let Some(fit) = fit else { return Ok(None) };
    let mut corrected = bare.clone();
    let offset_s = if script.repeats() { 0.0 } else { REST_S };
    let mut largest_rad: f64 = 0.0;
    for sample in &mut corrected.samples {
        let at = |joint: usize| {
            curve.at(&of_joint(&fit.parameters, joints, joint), sample.time_s + offset_s)[0]
        };
        sample.joint_correction_rad = (0..joints).map(at).collect();
        largest_rad =
            sample.joint_correction_rad.iter().fold(largest_rad, |most, c| most.max(c.abs()));
    }
    let (plan, costs, rollouts) = (corrected, fit.costs, fit.rollouts);
    Ok(Some(RetargetResult { plan, costs, rollouts, largest_rad }))
}

/// Curve of the corrections of a joint over the time of a rollout.
fn curve(script: &Script<'_>, options: &Options) -> Arc<Curve> {
    let repeats = script.repeats();
    let spaces = if repeats { options.knots } else { options.knots - 1 };
    Arc::new(Curve {
        begin_s: if repeats { 0.0 } else { REST_S },
        spacing_s: script.duration_s() / spaces as f64,
        knots: options.knots,
        degree: Degree::Cubic,
        periodic: repeats,
    })
}

/// Knot values of one joint. `knots` is ordered by knot, then by joint.
fn of_joint(knots: &[f64], joints: usize, joint: usize) -> Vec<f64> {
    knots.iter().skip(joint).step_by(joints).copied().collect()
}

/// Start values of the knots: corrections for which the stiffness of the servos alone yields the planned torques.
///
/// The values are 0 with feed-forward, which already supplies these torques.
fn yielding(script: &Script<'_>, options: &Options, curve: &Curve) -> Vec<f64> {
    let actuators: Vec<_> = script.robot().joints.iter().map(|joint| &joint.actuator).collect();
    if options.feed_forward {
        return vec![0.0; actuators.len() * curve.knots];
    }
    // Torques jump at touch-down, so the mean around a knot is used.
    const AROUND: [f64; 5] = [-0.4, -0.2, 0.0, 0.2, 0.4];
    let offset_s = if script.repeats() { 0.0 } else { REST_S };
    let of_knot = |knot: usize| {
        let torques: Vec<_> = AROUND
            .map(|share| curve.begin_s - offset_s + (knot as f64 + share) * curve.spacing_s)
            .map(|time_s| script.joint_torques_nm(time_s))
            .into();
        let mean =
            |joint: usize| torques.iter().map(|of| of[joint]).sum::<f64>() / AROUND.len() as f64;
        let offset = |(joint, actuator): (usize, &&Actuator)| match actuator.kp_nm_rad {
            kp_nm_rad if kp_nm_rad > 0.0 => mean(joint) / kp_nm_rad,
            _ => 0.0,
        };
        actuators.iter().enumerate().map(offset).collect::<Vec<_>>()
    };
    (0..curve.knots).flat_map(of_knot).collect()
}

/// Simulates the motion and returns the distances of the centre of mass from the plan at all steps; `None` if the robot falls.
fn rollout(
    script: &Script<'_>,
    options: &Options,
    curve: &Arc<Curve>,
    knots: &[f64],
) -> Option<Evaluation> {
    let robot = script.robot();
    let joints = robot.joints.len();
    let planned = script.plan().motion.ground.solid();
    let ground: Arc<dyn Ground> = planned.unwrap_or_else(|| Arc::new(Plane::level()));
    let (mut world, _) = begin(script, robot, &ground, &Parameters::new(robot));
    let mut fall_watch = FallWatch::new(&world, &ground);
    let curves: Vec<_> = (0..joints).map(|joint| of_joint(knots, joints, joint)).collect();
    let takes_speed: Vec<_> = robot.channels().map(|of| robot.takes_speed(&of)).collect();
    let parameters = Control::of_all(&world.motors()[..joints], &takes_speed[..joints], curve);
    let mut recorder = Recorder::new(world.system(), parameters);
    let step_s = step_s(script, options.rate_hz);
    let (beats, count) = run_steps(script, options.cycles, step_s);
    let mut planned = Vec::with_capacity(count);
    for beat in beats {
        let end_s = world.system().time_s() + step_s;
        for (channel, mut law) in script.laws(beat.time_s).into_iter().enumerate() {
            if let Some(knots) = curves.get(channel) {
                let [correction_rad, rate_rad_s] = curve.at(knots, end_s);
                law.position_rad += correction_rad;
                if takes_speed[channel] {
                    law.speed_rad_s += rate_rad_s;
                }
            }
            world.set_law(channel, law);
        }
        world.system_mut().step_recorded(step_s, &mut recorder).ok()?;
        if fall_watch.check(&world).is_some() {
            return None;
        }
        // A periodic motion continues in later periods.
        let done_s = (planned.len() + 1) as f64 * step_s;
        planned.push(script.com(if script.repeats() { done_s } else { beat.time_s }));
    }
    let rollout = recorder.finish();
    let weight = PER_M / (count as f64).sqrt();
    let of_step = |(step, target): (usize, &Vector3<f64>)| {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        axes.map(|axis| Residual::com(&rollout, step, target, axis * weight))
    };
    let residuals: Vec<_> = (1..).zip(&planned).flat_map(of_step).collect();
    Some((rollout, residuals).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_planner::motion::Motion;
    use rollwalk_planner::{Options as SolverOptions, optimise};
    use rollwalk_robot::JointRatio;
    use std::ops::ControlFlow;

    /// The library and the command refuse the same robots.
    #[test]
    fn robots_without_a_servo_for_each_joint_are_refused() {
        let robot = |name: &str, text: &str| Robot::from_toml(name, text).unwrap();
        let mut pup = robot("pup", include_str!("../../../shipped/robots/pup.toml"));
        assert_eq!(check(&pup), Ok(()));
        let knee = pup.joints[1].name.clone();
        pup.joints[1].actuator = Actuator::none();
        assert_eq!(check(&pup), Err(RetargetError::Passive(knee.clone())));
        pup.joints[1].motor_per_joint = vec![JointRatio { joint: 0, ratio: 1.0 }];
        assert_eq!(check(&pup), Err(RetargetError::Coupled(knee)));
    }

    /// Compares the derivatives of a rollout on servos that accept no speed of joints with differences.
    #[test]
    fn rollouts_on_servos_without_speed_have_their_derivatives() {
        let shipped = |path: &str| {
            let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped");
            std::fs::read_to_string(format!("{root}/{path}.toml")).unwrap()
        };
        let robot =
            |name: &str| Robot::from_toml(name, &shipped(&format!("robots/{name}"))).unwrap();
        let agilebot = robot("agilebot");
        let motion = Motion::from_toml("duck", &shipped("motions/duck"), &agilebot).unwrap();
        let mut go_on = |_: &_| ControlFlow::Continue(());
        let mut plan = optimise(&agilebot, &motion, &SolverOptions::default(), &mut go_on);
        let bus = robot("pup").buses[&0];
        for number in agilebot.channels().map(|channel| channel.actuator().bus) {
            plan.robot.buses.insert(number, bus);
        }
        let options = Options { rate_hz: 60, ..Options::default() };
        let script = Script::new(&plan, true);
        let curve = curve(&script, &options);
        let knots = vec![0.0; agilebot.joints.len() * curve.knots];
        let run = |knots: &[f64]| rollout(&script, &options, &curve, knots).unwrap();
        let jacobian = (run(&knots).jacobian)();
        for number in (5..knots.len()).step_by(11) {
            let moved = |by: f64| {
                let mut knots = knots.clone();
                knots[number] += by;
                nalgebra::DVector::from_vec(run(&knots).values)
            };
            let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            let off = (&difference - jacobian.column(number)).norm() / difference.norm();
            assert!(off < 1e-3, "{number}: off by {off:e} of {}", difference.norm());
        }
    }
}
