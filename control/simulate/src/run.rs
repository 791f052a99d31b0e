//! Simulation of a plan.

use crate::control::{Control, Controller};
use crate::mismatch::Mismatch;
use crate::outcome::{RunOutcome, Tracker};
use crate::script::{REST_S, Script};
use nalgebra::{Rotation3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::push::{Shove, mean_force};
use rollwalk_physics::world::{Parameters, ground_from_world, heading_rad, normal_at_start};
use rollwalk_physics::{StepError, World};
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use std::sync::Arc;

/// Options of playing a plan.
#[derive(Clone, Debug)]
pub struct Options {
    /// Method of playing the plan.
    pub control: Control,
    /// Number of periods of a motion that repeats.
    pub cycles: usize,
    /// Approximate number of simulation steps per second. The duration of the motion is a whole number of steps.
    pub rate_hz: u32,
    /// Ground under the robot; `None` for the ground of the plan. The robot begins at the origin. The plane of a plan for level
    /// ground touches the ground there.
    pub ground: Option<Arc<dyn Ground>>,
    /// Pushes. Their times count from the start of the simulation.
    pub shoves: Vec<Shove>,
    /// Differences between the planned robot and the simulated one.
    pub mismatch: Mismatch,
}

impl Options {
    /// Options for five periods on the ground of the plan, without pushes and mismatch.
    pub fn new(control: Control, rate_hz: u32) -> Self {
        let (shoves, mismatch) = (Vec::new(), Mismatch::default());
        Self { control, cycles: 5, rate_hz, ground: None, shoves, mismatch }
    }
}

/// State of a run at the end of a step.
pub struct Moment<'a> {
    /// Simulated time, s.
    pub done_s: f64,
    /// Duration of the whole run, s.
    pub all_s: f64,
    /// Time of a finite motion, s: 0 before it, and its duration after it. For a periodic motion, time of the present period.
    pub motion_s: f64,
    /// True if the robot has fallen, which ends the run.
    pub has_fallen: bool,
    /// True if further periods would be like the previous ones.
    pub has_settled: bool,
    /// The world.
    pub world: &'a World,
}

/// Plays a validated plan.
///
/// Calls `goes_on` at the end of each step; `false` ends the run.
///
/// # Errors
/// Returns an error if a step of the simulation has no solution.
pub fn play(
    plan: &Plan,
    options: &Options,
    mut goes_on: impl FnMut(&Moment<'_>) -> bool,
) -> Result<RunOutcome, StepError> {
    let script = Script::new(plan, options.control != Control::Servos);
    let robot = options.mismatch.of(&plan.robot);
    let parameters = options.mismatch.parameters(&robot);
    let planned = || plan.motion.ground.solid().unwrap_or_else(|| Arc::new(Plane::level()));
    let ground = options.ground.clone().unwrap_or_else(planned);
    let (mut world, world_from_plan) = begin(&script, &robot, &ground, &parameters);
    let mut tracker = Tracker::new(&script, &world, &ground, world_from_plan.inverse());
    let step_s = step_s(&script, options.rate_hz);
    let (beats, total) = run_steps(&script, options.cycles, step_s);
    let total_s = total as f64 * step_s;
    let mut controller = Controller::new(
        &script,
        options.control,
        &options.mismatch,
        &world,
        &world_from_plan,
        step_s,
    );
    let mut from_s = 0.0;
    for (done, beat) in (1..).zip(beats) {
        let done_s = done as f64 * step_s;
        let time_s = if script.repeats() { done_s } else { beat.time_s };
        for (channel, law) in controller.laws([from_s, time_s], &world).into_iter().enumerate() {
            world.set_law(channel, law);
        }
        let heading_rad = heading_rad(&world.base().1);
        world.push(mean_force(&options.shoves, world.system().time_s(), step_s, heading_rad));
        let report = world.step(step_s)?;
        tracker.add(&world, step_s, &report);
        match beat.mark.filter(|_| !tracker.has_fallen()) {
            Some(MotionEvent::Start) => tracker.begin(),
            Some(MotionEvent::End) => tracker.end_cycle(),
            None => {}
        }
        let moment = Moment {
            done_s,
            all_s: total_s,
            motion_s: beat.time_s,
            has_fallen: tracker.has_fallen(),
            has_settled: tracker.has_settled(),
            world: &world,
        };
        from_s = time_s;
        if !goes_on(&moment) || tracker.has_fallen() {
            break;
        }
    }
    Ok(tracker.finish(&world, &controller))
}

/// Duration of a step, s, at a rate of about `rate_hz`. The duration of the motion is a whole number of steps.
pub(crate) fn step_s(script: &Script<'_>, rate_hz: u32) -> f64 {
    let count = (script.duration_s() * f64::from(rate_hz)).round().max(1.0);
    script.duration_s() / count
}

/// World with the robot in the start state of its plan, on the ground at the origin, and the rotation of the plan in this
/// world. A plan for a terrain is in the frame of that terrain.
pub(crate) fn begin(
    script: &Script<'_>,
    robot: &Robot,
    ground: &Arc<dyn Ground>,
    parameters: &Parameters,
) -> (World, Rotation3<f64>) {
    if script.plan().motion.terrain.is_some() {
        let start = script.start(&Rotation3::identity());
        return (World::new(robot, ground, parameters, &start), Rotation3::identity());
    }
    let surface = ground.at(&Vector3::zeros());
    let normal = normal_at_start(ground.as_ref());
    let plane = match normal == surface.normal {
        true => Plane { point: -normal * surface.gap_m, normal },
        false => Plane::level(),
    };
    let world_from_plan = ground_from_world(ground.as_ref()).inverse();
    let mut start = script.start(&world_from_plan);
    start.base_position_m += plane.point;
    // On uneven ground, the robot starts as close to the ground as the plan is to its plane.
    let flat: Arc<dyn Ground> = Arc::new(plane);
    let planned_m = World::new(robot, &flat, parameters, &start).clearance_m();
    let mut world = World::new(robot, ground, parameters, &start);
    for _ in 0..20 {
        start.base_position_m.z += planned_m - world.clearance_m();
        world = World::new(robot, ground, parameters, &start);
    }
    (world, world_from_plan)
}

pub(crate) struct RunStep {
    /// Time of the motion at the end of the step, s.
    pub time_s: f64,
    /// Event at the end of the step.
    mark: Option<MotionEvent>,
}

#[derive(Clone, Copy)]
enum MotionEvent {
    /// Start of the motion.
    Start,
    /// End of a period. For a finite motion, end of the rest after the motion.
    End,
}

/// Steps of a run and their number.
///
/// A periodic motion consists of its periods, a finite one of rest, motion and rest.
pub(crate) fn run_steps(
    script: &Script<'_>,
    cycles: usize,
    step_s: f64,
) -> (Box<dyn Iterator<Item = RunStep>>, usize) {
    let duration_s = script.duration_s();
    let count = (duration_s / step_s).round() as usize;
    let beat = move |number: usize, of: usize, time_s: f64, mark: MotionEvent| RunStep {
        time_s,
        mark: (number == of).then_some(mark),
    };
    let period =
        move || (1..=count).map(move |k| beat(k, count, k as f64 * step_s, MotionEvent::End));
    if script.repeats() {
        return (Box::new((0..cycles).flat_map(move |_| period())), count * cycles);
    }
    let rest = (REST_S / step_s).round() as usize;
    let before = (1..=rest).map(move |k| beat(k, rest, 0.0, MotionEvent::Start));
    let moving = period().map(|beat| RunStep { mark: None, ..beat });
    let after = (1..=rest).map(move |k| beat(k, rest, duration_s, MotionEvent::End));
    (Box::new(before.chain(moving).chain(after)), count + 2 * rest)
}
