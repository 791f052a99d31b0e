//! Steering of a simulated robot: horizons are planned repeatedly from its measured state, and tracked.
//!
//! Planning takes simulated time: the plan from a measured state takes over [`Options::planning_s`] after the measurement. It
//! begins in the state that is predicted for that time. Meanwhile the previous plan continues, and the prediction keeps the
//! deviation of the measured state from this plan. A plan that is not accepted does not take over.
//!
//! On terrain, the planner uses the map of the terrain file or one that a simulated sensor delivers. Each plan uses the newest
//! map.

use crate::closed_loop::PlacedPlan;
use crate::elevation::{ElevationSensor, Sensing};
use crate::script::servo;
use crate::tick::law;
use rollwalk_multibody::State;
use rollwalk_multibody::ground::{Ground, Plane, Terrain};
use rollwalk_physics::motor::Law;
use rollwalk_physics::push::{Shove, mean_force};
use rollwalk_physics::world::{FallWatch, ObstacleContact, ObstacleWatch, Parameters, heading_rad};
use rollwalk_physics::{StepError, World};
use rollwalk_planner::families::Family;
use rollwalk_planner::receding::{
    Gait, Horizon, HorizonError, HorizonGround, MeasuredState, Steering,
};
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_robot::Robot;
use rollwalk_tracking::Tracker;
use rollwalk_tracking::tasks::Weights;
use serde::Serialize;
use std::ops::ControlFlow;
use std::sync::Arc;
use thiserror::Error;

/// Command of an operator.
#[derive(Clone, Debug)]
pub struct Command {
    /// Time of the command, s.
    pub at_s: f64,
    /// Steering from this time on.
    pub steering: Steering,
    /// Gait from this time on; `None` to keep the present gait.
    pub gait: Option<Gait>,
}

/// Options of a steered run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Duration of the run, s.
    pub duration_s: f64,
    /// Number of samples of a horizon after which the next one takes over.
    pub replan_samples: usize,
    /// Time from a measurement until its plan takes over, s.
    pub planning_s: f64,
    /// Maximum number of iterations of a plan.
    pub iterations: usize,
    /// Approximate number of steps of simulation and controller per second. A sample of the horizon lasts a whole number of
    /// steps.
    pub rate_hz: u32,
    /// Pushes.
    pub shoves: Vec<Shove>,
    /// Ground; `None` for level ground.
    pub ground: Option<SteeredGround>,
}

/// Ground of a steered run.
#[derive(Clone, Debug)]
pub struct SteeredGround {
    /// Terrain of the simulated world.
    pub terrain: Terrain,
    /// Sensor of the planner's map. `None` if the planner uses the terrain file.
    pub sensing: Option<Sensing>,
}

/// Event of a steered run, for measurements of planning times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SteeredEvent {
    /// Start of planning, before the processing of a map.
    PlanBegins,
    /// End of planning.
    PlanEnds,
    /// Step of the simulation.
    Step,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            duration_s: 10.0,
            replan_samples: 2,
            planning_s: 0.1,
            iterations: 20,
            rate_hz: 500,
            shoves: Vec::new(),
            ground: None,
        }
    }
}

/// Result of planning a horizon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HorizonResult {
    /// Number of iterations.
    pub iterations: usize,
    /// True if the plan was accepted.
    pub accepted: bool,
    /// Largest ratio of a residual to its tolerance.
    pub worst_level: f64,
    /// Constraint with this residual.
    pub worst_constraint: Family,
}

/// Outcome of a steered run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SteeredOutcome {
    /// Time at which the robot fell, s; `None` if it did not fall.
    pub fell_at_s: Option<f64>,
    /// First contact with an obstacle; `None` without contacts.
    pub collision: Option<ObstacleContact>,
    /// Simulated time, s.
    pub time_s: f64,
    /// Plans, in order of time.
    pub plans: Vec<HorizonResult>,
    /// Number of ticks without a solution of the tracker, in which the motors kept their set-points.
    pub untracked: u32,
    /// Simulation rate, steps per second.
    pub rate_hz: f64,
    /// Velocity of the body after each step: forward and left in its heading frame, m/s, and rate of the heading, rad/s.
    pub velocities: Vec<[f64; 3]>,
    /// Position of the body at the end, m. The run begins at x = y = 0.
    pub end_m: [f64; 3],
}

impl SteeredOutcome {
    /// Number of plans that were not accepted.
    pub fn rejected(&self) -> usize {
        self.plans.iter().filter(|plan| !plan.accepted).count()
    }

    /// Mean of [`velocities`](Self::velocities) between two times.
    pub fn mean(&self, from_s: f64, to_s: f64) -> [f64; 3] {
        let index = |time_s: f64| {
            ((time_s * self.rate_hz).round().max(0.0) as usize).min(self.velocities.len())
        };
        let span = &self.velocities[index(from_s)..index(to_s)];
        [0, 1, 2].map(|c| span.iter().map(|v| v[c]).sum::<f64>() / span.len().max(1) as f64)
    }

    /// Time from a command at `at_s` until component `c` of the velocity has made 63 % of its change, s.
    ///
    /// Velocities are averaged over a period of the gait to remove its sway. Returns `None` if 63 % is not reached before the
    /// end of the run.
    pub fn latency_s(
        &self,
        at_s: f64,
        c: usize,
        [from, to]: [f64; 2],
        period_s: f64,
    ) -> Option<f64> {
        let end_s = self.velocities.len() as f64 / self.rate_hz - 0.5 * period_s;
        let times = (0..).map(|k| at_s + f64::from(k) / self.rate_hz).take_while(|t| *t < end_s);
        let half = (0.5 * period_s).max(1.0 / self.rate_hz);
        let reached = |t: &f64| (self.mean(t - half, t + half)[c] - from) / (to - from) >= 0.63;
        times.into_iter().find(reached).map(|t| t - at_s)
    }
}

/// Error of a steered run.
#[derive(Debug, Error)]
pub enum SteeredError {
    /// Step of the simulation without a solution.
    #[error(transparent)]
    Step(#[from] StepError),
    /// Horizon that cannot be planned.
    #[error(transparent)]
    Horizon(#[from] HorizonError),
    /// First plan that is not accepted.
    #[error(
        "the robot cannot stand in the initial pose of the horizon, because its first plan does \
         not meet the constraints"
    )]
    CannotStand,
    /// Planning time that exceeds the time between plans.
    #[error(
        "planning_s is {planning_s} s; expected at least 0 s and less than {replan_s} s, the time \
         until the next plan takes over"
    )]
    Late {
        /// Planning time, s.
        planning_s: f64,
        /// Time between plans, s.
        replan_s: f64,
    },
}

/// Planner of a steered run, with its time grid.
struct Planner {
    horizon: Horizon,
    steering: Steering,
    iterations: usize,
    /// Number of simulation steps in a sample of the horizon.
    steps: usize,
    /// Duration of a simulation step, s.
    step_s: f64,
    plans: Vec<HorizonResult>,
}

impl Planner {
    /// Plans from the state that is predicted for a step. Returns `None` if the plan is not accepted.
    fn plan(
        &mut self,
        measured: MeasuredState<'_>,
        step: usize,
    ) -> Result<Option<PlacedPlan>, HorizonError> {
        let mut left = self.iterations;
        let limit = &mut |_: &_| {
            left = left.saturating_sub(1);
            if left > 0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let at = (step / self.steps) as u64;
        let found = self.horizon.plan(measured, at, self.steering, limit)?;
        let (iterations, accepted) = (found.plan.solve.iterations, found.is_accepted());
        let (worst_level, worst_constraint) =
            (found.plan.solve.worst_level, found.plan.solve.worst_constraint);
        self.plans.push(HorizonResult { iterations, accepted, worst_level, worst_constraint });
        let (world_from_plan, from_s) = (found.world_from_plan, step as f64 * self.step_s);
        Ok(accepted.then(|| PlacedPlan {
            body: WholeBody::new(&found.plan),
            world_from_plan,
            from_s,
        }))
    }

    /// Plans for step `then` from the state measured at step `now`, while the plan `tracked` is followed.
    fn plan_ahead(
        &mut self,
        tracked: &mut PlacedPlan,
        measured: MeasuredState<'_>,
        [now, then]: [usize; 2],
    ) -> Result<Option<PlacedPlan>, HorizonError> {
        let [here, there] = [now, then].map(|step| tracked.at(step as f64 * self.step_s));
        let touches: Vec<bool> = (here.stands.iter().zip(&there.stands).zip(measured.touches))
            .map(|((here, there), touches)| if here == there { *touches } else { *there })
            .collect();
        let state = expected(measured.state, &here.state, there.state);
        self.plan(MeasuredState { state: &state, touches: &touches }, then)
    }
}

/// Steers a robot that initially stands at the origin.
///
/// Commands are in order of time; the robot stands still until the first one. The first plan is made before the run begins.
/// `on_event` receives events as they happen.
///
/// # Errors
/// Returns an error if the planning time is negative or not less than the time between plans, or the first plan is not accepted.
/// Also returns an error if a horizon or a step of the simulation has no solution.
pub fn steer(
    robot: &Robot,
    horizon: Horizon,
    commands: &[Command],
    options: &Options,
    on_event: &mut dyn FnMut(SteeredEvent),
) -> Result<SteeredOutcome, SteeredError> {
    let replan_s = options.replan_samples as f64 * horizon.interval_s();
    let planning_s = options.planning_s;
    if !(0.0..replan_s).contains(&planning_s) {
        return Err(SteeredError::Late { planning_s, replan_s });
    }
    let steps = (horizon.interval_s() * f64::from(options.rate_hz)).round().max(1.0) as usize;
    let step_s = horizon.interval_s() / steps as f64;
    let between = steps * options.replan_samples;
    let ahead = (planning_s / step_s).round() as usize;

    let level = || -> Arc<dyn Ground> { Arc::new(Plane::level()) };
    let ground = options.ground.as_ref().map_or_else(level, |of| of.terrain.solid());
    let mut world = World::standing(robot, &ground, &Parameters::new(robot));
    let mut fall_watch = FallWatch::new(&world, &ground);
    let obstacle_watch = ObstacleWatch::new(robot, ground.as_ref());
    let tree = horizon.tree().clone();
    let mut tracker = Tracker::new(tree.clone(), Weights::default(), step_s);
    let servos: Vec<Law> = robot.channels().map(|channel| servo(&channel)).collect();
    let (steering, iterations, plans) = (Steering::default(), options.iterations, Vec::new());
    let mut planner = Planner { horizon, steering, iterations, steps, step_s, plans };
    let mut sensor = None;
    if let Some(SteeredGround { terrain, sensing }) = &options.ground {
        sensor = sensing.map(|sensing| ElevationSensor::new(terrain.clone(), sensing));
        planner.horizon.change_ground(HorizonGround::Terrain(terrain.clone()))?;
    }
    let mut commands = commands.iter().peekable();
    let standing = vec![true; robot.end_effectors.len()];
    let state = world.state(&tree);
    if let Some(sensor) = &mut sensor {
        planner.horizon.change_ground(sensor.first(&state.base_position_m.xy()))?;
    }
    let first = planner.plan(MeasuredState { state: &state, touches: &standing }, 0)?;
    let mut tracked = first.ok_or(SteeredError::CannotStand)?;
    let mut next = None;
    let (mut untracked, mut fell_at_s, mut velocities) = (0, None, Vec::new());
    let mut collision = None;
    for step in 0..(options.duration_s / step_s).round() as usize {
        let time_s = step as f64 * step_s;
        let state = world.state(&tree);
        let touching: Vec<bool> = world.switches().collect();
        let then = step + ahead;
        if then.is_multiple_of(between) && then > 0 {
            while let Some(command) = commands.next_if(|command| command.at_s <= time_s) {
                planner.steering = command.steering;
                if let Some(gait) = &command.gait {
                    planner.horizon.change_gait(gait.clone(), (then / steps) as u64)?;
                }
            }
            on_event(SteeredEvent::PlanBegins);
            if let Some(sensor) = &mut sensor
                && let Some(map) = sensor.sample(time_s, &state.base_position_m.xy())
            {
                planner.horizon.change_ground(map)?;
            }
            let measured = MeasuredState { state: &state, touches: &touching };
            next = planner.plan_ahead(&mut tracked, measured, [step, then])?;
            on_event(SteeredEvent::PlanEnds);
        }
        if step.is_multiple_of(between)
            && let Some(next) = next.take()
        {
            tracked = next;
        }
        match tracker.tick(&tracked.reference(time_s), &state, &touching) {
            Ok(setpoints) => {
                for (channel, (servo, setpoint)) in servos.iter().zip(setpoints).enumerate() {
                    world.set_law(channel, law(servo, setpoint));
                }
            }
            Err(_) => untracked += 1,
        }
        let heading = heading_rad(&world.base().1);
        world.push(mean_force(&options.shoves, world.system().time_s(), step_s, heading));
        world.step(step_s)?;
        velocities.push(in_heading(&world.state(&tree)));
        on_event(SteeredEvent::Step);
        if let Some(watch) = obstacle_watch.as_ref().filter(|_| collision.is_none()) {
            collision = watch.check(&world);
        }
        if fall_watch.check(&world).is_some() {
            fell_at_s = Some(world.system().time_s());
            break;
        }
    }
    let (time_s, plans, rate_hz) = (world.system().time_s(), planner.plans, 1.0 / step_s);
    let end_m = world.base().0.into();
    Ok(SteeredOutcome {
        fell_at_s,
        collision,
        time_s,
        plans,
        untracked,
        rate_hz,
        velocities,
        end_m,
    })
}

/// Velocity of the body: forward and left in its heading frame, m/s, and rate of the heading, rad/s.
fn in_heading(state: &State) -> [f64; 3] {
    let (sin, cos) = heading_rad(&state.world_from_body).sin_cos();
    let [x, y] = [state.velocity[0], state.velocity[1]];
    [cos * x + sin * y, cos * y - sin * x, state.velocity[5]]
}

/// Fraction of the velocity error that is left when a plan takes over. The controller reduces the error meanwhile.
const KEPT: f64 = 0.5;

/// State that is predicted for the time at which the planned state is `then`.
///
/// The deviation of `measured` from `planned` is added to `then`, except for a fraction of the velocity error.
fn expected(measured: &State, planned: &State, mut then: State) -> State {
    let add = |to: &mut [f64], part: f64, measured: &[f64], planned: &[f64]| {
        for (to, (here, there)) in to.iter_mut().zip(measured.iter().zip(planned)) {
            *to += part * (here - there);
        }
    };
    let turned = measured.world_from_body * planned.world_from_body.transpose();
    then.base_position_m += measured.base_position_m - planned.base_position_m;
    then.world_from_body = turned * then.world_from_body;
    add(&mut then.joint_rad, 1.0, &measured.joint_rad, &planned.joint_rad);
    add(&mut then.velocity, KEPT, &measured.velocity, &planned.velocity);
    then
}
