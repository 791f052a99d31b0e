//! A robot that is steered in the simulated world: horizons from its measured state, planned again and again and tracked.
//!
//! Time is virtual, planning takes a part of it: a plan is made from what was measured, for the moment at which it takes over,
//! [`Options::planning_s`] later. Until then the plan before goes on, and the measured state is expected to keep its distance
//! to it. A plan that is not accepted does not take over.

use crate::script::servo;
use crate::sensors::touches;
use nalgebra::Isometry3;
use rollwalk_multibody::State;
use rollwalk_physics::ground::{Ground, Plane};
use rollwalk_physics::motor::Law;
use rollwalk_physics::push::{Shove, mean_force};
use rollwalk_physics::world::{FallWatch, Parameters, heading_rad};
use rollwalk_physics::{StepError, World};
use rollwalk_planner::receding::{Gait, Horizon, HorizonError, Measured, Steering};
use rollwalk_planner::whole_body::{Instant, WholeBody};
use rollwalk_robot::Robot;
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Reference, Tracker};
use serde::Serialize;
use std::ops::ControlFlow;
use std::sync::Arc;
use thiserror::Error;

/// A command of an operator.
#[derive(Clone, Debug)]
pub struct Command {
    /// Time at which it is given, s.
    pub at_s: f64,
    /// What is wanted from then on.
    pub steering: Steering,
    /// Another gait from then on.
    pub gait: Option<Gait>,
}

/// How a robot is steered.
#[derive(Clone, Debug)]
pub struct Options {
    /// Duration of the run, s.
    pub duration_s: f64,
    /// Samples of a horizon after which the next one takes over.
    pub replan_samples: usize,
    /// Time between a measurement and the moment at which the plan from it takes over, s.
    pub planning_s: f64,
    /// Most iterations of a plan.
    pub iterations: usize,
    /// Steps of the world and of the controller per second, about: a sample of the horizon is a whole number of them.
    pub rate_hz: u32,
    /// Pushes.
    pub shoves: Vec<Shove>,
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
        }
    }
}

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// When the robot fell, s.
    pub fell_at_s: Option<f64>,
    /// Simulated time, s.
    pub time_s: f64,
    /// Iterations of each plan, and whether it was accepted.
    pub plans: Vec<(usize, bool)>,
    /// Ticks in which the tracker had no solution, and the motors kept their setpoints.
    pub untracked: u32,
    /// Steps of the world a second.
    pub rate_hz: f64,
    /// Velocity of the body after each step: along and to the left of its heading, m/s, and rate of the heading, rad/s.
    pub velocities: Vec<[f64; 3]>,
}

impl Outcome {
    /// Plans that were not accepted.
    pub fn rejected(&self) -> usize {
        self.plans.iter().filter(|(_, accepted)| !accepted).count()
    }

    /// Mean velocity between two times, as [`velocities`](Self::velocities).
    pub fn mean(&self, from_s: f64, to_s: f64) -> [f64; 3] {
        let index = |time_s: f64| {
            ((time_s * self.rate_hz).round().max(0.0) as usize).min(self.velocities.len())
        };
        let span = &self.velocities[index(from_s)..index(to_s)];
        [0, 1, 2].map(|c| span.iter().map(|v| v[c]).sum::<f64>() / span.len().max(1) as f64)
    }

    /// Time after a command until component `c` of the velocity has made 63 % of its change, s. Velocities are means over a
    /// period of the gait, around each time, without its sway. `None` if it has not until the end of the run.
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

/// Reason for which a run ends without an outcome.
#[derive(Debug, Error)]
pub enum SteeredError {
    /// A step of the world has no solution.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The horizon cannot be planned.
    #[error(transparent)]
    Horizon(#[from] HorizonError),
    /// The world and the controller do not see the first plan in time.
    #[error(
        "planning_s is {planning_s} s: it must be less than the {replan_s} s after which the next plan takes over"
    )]
    Late {
        /// Time of planning, s.
        planning_s: f64,
        /// Time between plans, s.
        replan_s: f64,
    },
}

/// The plan that is tracked.
struct Tracked {
    body: WholeBody,
    world_from_plan: Isometry3<f64>,
    /// When it took over, s.
    from_s: f64,
}

impl Tracked {
    fn at(&mut self, time_s: f64) -> Instant {
        self.body.at(time_s - self.from_s, &self.world_from_plan)
    }
}

/// Steers a robot on level ground, from its stand at the origin. Commands are in order of time; before the first the robot is to
/// stand still.
///
/// # Errors
/// [`SteeredError`].
pub fn steer(
    robot: &Robot,
    mut horizon: Horizon,
    commands: &[Command],
    options: &Options,
) -> Result<Outcome, SteeredError> {
    let replan_s = options.replan_samples as f64 * horizon.interval_s();
    let planning_s = options.planning_s;
    if !(0.0..replan_s).contains(&planning_s) {
        return Err(SteeredError::Late { planning_s, replan_s });
    }
    let steps = (horizon.interval_s() * f64::from(options.rate_hz)).round().max(1.0) as usize;
    let step_s = horizon.interval_s() / steps as f64;
    let between = steps * options.replan_samples;
    let ahead = (planning_s / step_s).round() as usize;

    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let mut world = World::standing(robot, &ground, &Parameters::new(robot));
    let fall_watch = FallWatch::new(&world, &ground);
    let tree = horizon.tree().clone();
    let mut tracker = Tracker::new(tree.clone(), Weights::default(), step_s);
    let servos: Vec<Law> = robot.channels().map(|channel| servo(&channel)).collect();
    let mut outcome = Outcome {
        fell_at_s: None,
        time_s: 0.0,
        plans: Vec::new(),
        untracked: 0,
        rate_hz: 1.0 / step_s,
        velocities: Vec::new(),
    };
    let mut steering = Steering::default();
    let mut commands = commands.iter().peekable();
    let plan =
        |horizon: &mut Horizon, state: &State, touches: &[bool], takes_over: usize, steering| {
            let mut iterations = 0;
            let limit = &mut |_: &_| {
                iterations += 1;
                if iterations < options.iterations {
                    ControlFlow::Continue(())
                } else {
                    ControlFlow::Break(())
                }
            };
            let at = (takes_over / steps) as u64;
            let found = horizon.plan(Measured { state, touches }, at, steering, limit)?;
            let from_s = takes_over as f64 * step_s;
            let tracked = Tracked {
                body: WholeBody::new(&found.plan),
                world_from_plan: found.world_from_plan,
                from_s,
            };
            Ok::<_, HorizonError>((tracked, found.plan.solve.iterations, found.is_accepted()))
        };
    let now: Vec<bool> = vec![true; robot.end_effectors.len()];
    let (mut tracked, iterations, accepted) =
        plan(&mut horizon, &world.state(&tree), &now, 0, steering)?;
    outcome.plans.push((iterations, accepted));
    let mut next: Option<Tracked> = None;
    for step in 0..(options.duration_s / step_s).round() as usize {
        let time_s = step as f64 * step_s;
        let state = world.state(&tree);
        let touching: Vec<bool> = touches(&world, &tree).collect();
        if step % between == 0
            && let Some(plan) = next.take()
        {
            tracked = plan;
        }
        if (step + ahead) % between == 0 && step + ahead > 0 {
            let takes_over = step + ahead;
            while let Some(command) = commands.next_if(|command| command.at_s <= time_s) {
                steering = command.steering;
                if let Some(gait) = &command.gait {
                    horizon.change_gait(gait.clone(), (takes_over / steps) as u64)?;
                }
            }
            let here = tracked.at(time_s);
            let there = tracked.at(takes_over as f64 * step_s);
            let expected = expected(&state, &here.state, there.state);
            let expected_touches: Vec<bool> =
                (0..touching.len())
                    .map(|j| {
                        if here.stands[j] == there.stands[j] {
                            touching[j]
                        } else {
                            there.stands[j]
                        }
                    })
                    .collect();
            let (found, iterations, accepted) =
                plan(&mut horizon, &expected, &expected_touches, takes_over, steering)?;
            outcome.plans.push((iterations, accepted));
            next = Some(found).filter(|_| accepted);
            if ahead == 0
                && let Some(plan) = next.take()
            {
                tracked = plan;
            }
        }
        let Instant { state: planned, acceleration, stands, force_n } = tracked.at(time_s);
        let reference = Reference {
            time_s,
            world_from_ground: Isometry3::identity(),
            state: planned,
            acceleration,
            stands,
            force_n,
        };
        match tracker.tick(&reference, &state, &touching) {
            Ok(setpoints) => {
                for (channel, (servo, setpoint)) in servos.iter().zip(setpoints).enumerate() {
                    let law = Law {
                        kp_nm_rad: setpoint.kp_nm_rad,
                        kd_nm_s_rad: setpoint.kd_nm_s_rad,
                        position_rad: setpoint.position_rad,
                        speed_rad_s: setpoint.speed_rad_s,
                        torque_nm: setpoint.torque_nm,
                        ..*servo
                    };
                    world.set_law(channel, law);
                }
            }
            Err(_) => outcome.untracked += 1,
        }
        let heading = heading_rad(&world.base().1);
        world.push(mean_force(&options.shoves, world.system().time_s(), step_s, heading));
        world.step(step_s)?;
        let after = world.state(&tree);
        outcome.velocities.push(in_heading(&after));
        outcome.time_s = world.system().time_s();
        if fall_watch.look(&world).is_some() {
            outcome.fell_at_s = Some(outcome.time_s);
            break;
        }
    }
    Ok(outcome)
}

/// Velocity of the body, along and to the left of its heading, m/s, and rate of the heading, rad/s.
fn in_heading(state: &State) -> [f64; 3] {
    let (sin, cos) = heading_rad(&state.world_from_body).sin_cos();
    let [x, y] = [state.velocity[0], state.velocity[1]];
    [cos * x + sin * y, cos * y - sin * x, state.velocity[5]]
}

/// The state in which a robot will be that is in one near its plan: as far from the plan, at its velocity there.
fn expected(measured: &State, planned: &State, mut then: State) -> State {
    let turned = measured.world_from_body * planned.world_from_body.transpose();
    then.base_position_m += measured.base_position_m - planned.base_position_m;
    then.world_from_body = turned * then.world_from_body;
    for (angle, (here, there)) in
        then.joint_rad.iter_mut().zip(measured.joint_rad.iter().zip(&planned.joint_rad))
    {
        *angle += here - there;
    }
    for (speed, (here, there)) in
        then.velocity.iter_mut().zip(measured.velocity.iter().zip(&planned.velocity))
    {
        *speed += KEPT * (here - there);
    }
    then
}

/// Part of the error of velocity that is left when a plan takes over: the controller brings it down meanwhile.
const KEPT: f64 = 0.5;
