//! Setpoints with which a robot as it is follows its plan (thesis 4.7.2): soft servos sag, and what they carry comes late and
//! low. A curve is added to the setpoints of each joint, and its knots are optimised until the centre of mass goes where the
//! plan says.
//!
//! The rollout is that of [`run`](crate::run), with derivatives of every step by all knots; Gauss–Newton's method moves them. Heights
//! count as much as ways, else nothing stops the robot from sagging. Smoothness costs a little, so that knots that the motion
//! does not depend on stay.

use crate::run::{REST_S, beats, begin, step_s};
use crate::script::Script;
use nalgebra::Vector3;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::curve::{Curve, Degree};
use rollwalk_physics::sensitivity::gauss_newton::{self, Evaluation, Penalty, minimise};
use rollwalk_physics::sensitivity::parameter::Control;
use rollwalk_physics::sensitivity::{Recorder, Residual};
use rollwalk_physics::world::{FallWatch, Parameters};
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Actuator;
use std::sync::Arc;

/// Options of the search for setpoints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// True if the planned torques are added to the servos' own.
    pub feed_forward: bool,
    /// Periods of a motion that repeats.
    pub cycles: usize,
    /// Steps of the world per second, about. With fewer than those in which it is played, gaits that rock find setpoints that
    /// its longer steps steady: a pace that makes its way at 120 Hz falls back to 0.7 of it at 240.
    pub rate_hz: u32,
    /// Knots of the curve of each joint over the motion.
    pub knots: usize,
    /// Most iterations.
    pub iterations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { feed_forward: true, cycles: 3, rate_hz: 240, knots: 12, iterations: 8 }
    }
}

/// Objective of a robot that is 1 m away from its plan all the time.
const PER_M: f64 = 30.0;
/// Price of a change of 1 rad from knot to knot, and of 1 rad from where the planned torque alone holds the joint: legs that
/// press against each other move no centre of mass, but feet slide when one of them lifts.
const SMOOTH: f64 = 1e-3;
const SMALL: f64 = 1e-4;
/// Price of a change of 1 rad between the two knots at each end of a motion that ends: its setpoints begin and end at rest.
const ENDS: f64 = 10.0;
/// Largest change of a knot in an iteration, rad.
const MOST_RAD: f64 = 0.2;
/// Improvement of an iteration that is too small to go on, as a share.
const TOLERANCE: f64 = 1e-3;

/// Result of retargeting.
#[derive(Clone, Debug)]
pub struct Retargeted {
    /// The plan with its corrections.
    pub plan: Plan,
    /// Objective at the beginning and after each iteration.
    pub costs: Vec<f64>,
    /// Simulated rollouts.
    pub rollouts: usize,
    /// Largest correction, rad.
    pub largest_rad: f64,
}

/// Finds corrections for a validated plan, whose own corrections are left out. Calls `goes_on` for each rollout; `false` ends the
/// search, and the best corrections so far are returned.
///
/// Returns `None` if the uncorrected plan falls, or a step of the world has no solution.
pub fn retarget(
    plan: &Plan,
    options: &Options,
    mut goes_on: impl FnMut(usize) -> bool,
) -> Option<Retargeted> {
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
    // Where the robot falls with these angles, it may stand without.
    let fit = minimise(&start, &penalties, &search, &mut run)
        .or_else(|| minimise(&vec![0.0; start.len()], &penalties, &search, &mut run))?;
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
    Some(Retargeted { plan: corrected, costs: fit.costs, rollouts: fit.rollouts, largest_rad })
}

/// The curve of a joint's corrections over the time of a rollout.
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

/// Knots of one joint: those of all joints stand beside each other, one knot after the other.
fn of_joint(knots: &[f64], joints: usize, joint: usize) -> Vec<f64> {
    knots.iter().skip(joint).step_by(joints).copied().collect()
}

/// Knots with which the servos' stiffness alone gives the planned torques: where the search begins. 0 with feed-forward, which
/// gives them already.
fn yielding(script: &Script<'_>, options: &Options, curve: &Curve) -> Vec<f64> {
    let actuators: Vec<_> = script.robot().joints.iter().map(|joint| &joint.actuator).collect();
    if options.feed_forward {
        return vec![0.0; actuators.len() * curve.knots];
    }
    // Torques jump where feet touch down: the mean around a knot.
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

/// Distances of the centre of mass from its plan at all steps; `None` if the robot falls.
fn rollout(
    script: &Script<'_>,
    options: &Options,
    curve: &Arc<Curve>,
    knots: &[f64],
) -> Option<Evaluation> {
    let robot = script.robot();
    let joints = robot.joints.len();
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let (mut world, _) = begin(script, robot, &ground, &Parameters::new(robot));
    let fall_watch = FallWatch::new(&world, &ground);
    let curves: Vec<_> = (0..joints).map(|joint| of_joint(knots, joints, joint)).collect();
    let parameters = Control::of_all(&world.motors()[..joints], curve);
    let mut recorder = Recorder::new(world.system(), parameters);
    let step_s = step_s(script, options.rate_hz);
    let (beats, count) = beats(script, options.cycles, step_s);
    let mut planned = Vec::with_capacity(count);
    for beat in beats {
        let end_s = world.system().time_s() + step_s;
        for (channel, mut law) in script.laws(beat.time_s).into_iter().enumerate() {
            if let Some(knots) = curves.get(channel) {
                let [correction_rad, rate_rad_s] = curve.at(knots, end_s);
                law.position_rad += correction_rad;
                law.speed_rad_s += rate_rad_s;
            }
            world.set_law(channel, law);
        }
        world.system_mut().step_recorded(step_s, &mut recorder).ok()?;
        if fall_watch.look(&world).is_some() {
            return None;
        }
        // A motion that repeats goes on in later periods.
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
