//! A plan played in the world, open loop.

use crate::outcome::{Outcome, Tracker};
use crate::script::Script;
use nalgebra::{Rotation3, Vector3};
use rollwalk_physics::ground::{Ground, Plane};
use rollwalk_physics::world::Parameters;
use rollwalk_physics::{StepError, World};
use rollwalk_planner::plan::Plan;
use std::sync::Arc;

/// How a plan is played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Whether the planned torques go on top of the servos' own.
    pub feed_forward: bool,
    /// Periods of a motion that repeats.
    pub cycles: usize,
    /// Steps of the world per second, about: a motion is a whole number of them.
    pub rate_hz: u32,
    /// Slope of the ground, rad, rising ahead of the robot.
    pub slope_rad: f64,
}

/// Time for which a motion that ends stands still before and after, s.
const REST_S: f64 = 1.0;

/// Plays a validated plan. `goes_on` hears how many of all seconds are done, and ends the run by answering `false`.
///
/// # Errors
/// A step of the world without a solution.
pub fn play(
    plan: &Plan,
    options: &Options,
    mut goes_on: impl FnMut(f64, f64) -> bool,
) -> Result<Outcome, StepError> {
    let script = Script::new(plan, options.feed_forward);
    let parameters = Parameters::new(&plan.robot);
    let ground: Arc<dyn Ground> = Arc::new(Plane::rising(options.slope_rad));
    // Nose up is a turn against the y axis.
    let world_from_plan = Rotation3::from_axis_angle(&Vector3::y_axis(), -options.slope_rad);
    let start = script.start(&world_from_plan);
    let mut world = World::new(&plan.robot, &ground, &parameters, &start);
    let mut tracker = Tracker::new(&script, &world, world_from_plan);
    // So that a motion is a whole number of steps.
    let count = (script.duration_s() * f64::from(options.rate_hz)).round().max(1.0);
    let step_s = script.duration_s() / count;
    let (beats, total) = beats(&script, options.cycles, step_s);
    let total_s = total as f64 * step_s;
    for (done, beat) in (1..).zip(beats) {
        // The law at the end of the step is the one that acts in it.
        for (channel, law) in script.laws(beat.time_s).into_iter().enumerate() {
            world.set_law(channel, law);
        }
        let report = world.step(step_s)?;
        tracker.add(&world, step_s, &report);
        if tracker.has_fallen() || !goes_on(done as f64 * step_s, total_s) {
            break;
        }
        match beat.mark {
            Some(Mark::Start) => tracker.begin(&world),
            Some(Mark::End) => tracker.end_cycle(&world),
            None => {}
        }
    }
    Ok(tracker.finish(&world))
}

/// A step.
struct Beat {
    /// Time of the motion at its end, s.
    time_s: f64,
    /// What is at its end.
    mark: Option<Mark>,
}

#[derive(Clone, Copy)]
enum Mark {
    /// The motion begins.
    Start,
    /// A period, or the motion and the rest after it, ends.
    End,
}

/// All steps, and how many they are: of a motion that repeats its periods, of another one rest, motion and rest.
fn beats(
    script: &Script<'_>,
    cycles: usize,
    step_s: f64,
) -> (Box<dyn Iterator<Item = Beat>>, usize) {
    let duration_s = script.duration_s();
    let count = (duration_s / step_s).round() as usize;
    let beat = move |number: usize, of: usize, time_s: f64, mark: Mark| Beat {
        time_s,
        mark: (number == of).then_some(mark),
    };
    let period = move || (1..=count).map(move |k| beat(k, count, k as f64 * step_s, Mark::End));
    if script.repeats() {
        return (Box::new((0..cycles).flat_map(move |_| period())), count * cycles);
    }
    let rest = (REST_S / step_s).round() as usize;
    let before = (1..=rest).map(move |k| beat(k, rest, 0.0, Mark::Start));
    let moving = period().map(|beat| Beat { mark: None, ..beat });
    let after = (1..=rest).map(move |k| beat(k, rest, duration_s, Mark::End));
    (Box::new(before.chain(moving).chain(after)), count + 2 * rest)
}
