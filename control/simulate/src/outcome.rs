//! Outcome of a simulated plan, compared with the plan.

use crate::control::Controller;
use crate::judgement::{BAND, ComponentDeviation, PlannedDisplacement};
use crate::script::{REST_S, Script};
use nalgebra::Rotation3;
use rollwalk_multibody::ground::Ground;
use rollwalk_physics::world::{
    FallWatch, NetDisplacement, ObstacleContact, ObstacleWatch, Odometer, Totals,
};
use rollwalk_physics::{StepReport, World};
use serde::Serialize;
use std::fmt;
use std::sync::Arc;

/// Number of final periods that are judged separately. Their mean shows growing errors, and averages errors that alternate
/// between periods.
const LAST: usize = 3;
/// Ratio of the change between periods to the allowed deviation, below which a motion has settled.
const SETTLED: f64 = 0.02;
/// Number of further periods whose changes may add up without a change of the verdict.
const AHEAD: f64 = 5.0;

/// Smallest number of periods in which changes between periods are checked. If periods still differ, their mean does not
/// predict the displacement.
const SHOWS_CHANGE: usize = 7;
/// Largest ratio of the change between periods to the allowed deviation: 2 % of a goal.
const CHANGES: f64 = 0.4;

/// Outcome of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunOutcome {
    /// Planned displacement of the motion, or of a period.
    #[serde(flatten)]
    pub planned: PlannedDisplacement,
    /// Displacement of the motion, or of each period.
    pub cycles: Vec<NetDisplacement>,
    /// Ratio of the final height of the centre of mass to the planned one; `None` unless the robot lies on its body during the
    /// motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<f64>,
    /// Ratio of the largest height of the centre of mass to the largest planned one; `None` for motions that stay on their feet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height_max: Option<f64>,
    /// Time at which the robot fell, s; `None` if it did not fall.
    pub fell_at_s: Option<f64>,
    /// Time at which the motion ends, s; `None` for a periodic motion.
    #[serde(skip)]
    pub(crate) ended_at_s: Option<f64>,
    /// First contact with an obstacle; `None` if there was none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub collision: Option<ObstacleContact>,
    /// Simulated time, s.
    pub time_s: f64,
    /// Tilt, slip, forces and work.
    #[serde(flatten)]
    pub totals: Totals,
    /// Mean number of Newton iterations of a step.
    pub iterations: f64,
    /// Largest number of Newton iterations of a step.
    pub iterations_max: u32,
    /// Number of steps that were subdivided because they did not converge.
    pub subdivided: u32,
    /// Number of steps without tracking, in which the servos got the set-points of the plan or of its stop.
    pub untracked: u32,
    /// Time at which the robot was stopped because it could not be tracked, s; `None` if it was not stopped.
    pub stopped_at_s: Option<f64>,
}

impl RunOutcome {
    /// Ratio of achieved to planned value of component `of`; `None` if the component is not a goal.
    ///
    /// The achieved value is the mean of the periods after the first one.
    pub fn ratio(&self, of: usize) -> Option<f64> {
        self.planned.ratio(&mean(self.settled())?, of)
    }

    /// Periods after the first one, which contains the start; the first one if there are no others.
    fn settled(&self) -> &[NetDisplacement] {
        self.cycles.get(1..).filter(|rest| !rest.is_empty()).unwrap_or(&self.cycles)
    }

    /// Reason why the motion does not pass; `None` if it passes.
    ///
    /// A motion passes if the robot does not fall, touches no obstacle, covers the planned displacement, and does not change too
    /// much between periods. The displacement is checked for the mean of all periods after the first one, and for the mean of
    /// the final periods.
    pub fn miss(&self) -> Option<MotionFailure> {
        // A robot that falls over an obstacle touches it first.
        if let Some(collision) = &self.collision
            && self.fell_at_s.is_none_or(|at_s| collision.at_s <= at_s)
        {
            return Some(MotionFailure::Collides(collision.clone()));
        }
        if let Some(at_s) = self.fell_at_s {
            let after_end_s = self.ended_at_s.map(|end_s| at_s - end_s).filter(|of| *of > 0.0);
            return Some(MotionFailure::Falls { at_s, after_end_s });
        }
        let is_off = |ratio: &f64| !(BAND[0]..=BAND[1]).contains(ratio);
        if let Some(ratio) = self.height.filter(is_off) {
            return Some(MotionFailure::Height { ratio });
        }
        // A motion that begins and ends on the body ends at the planned height even if the robot never rises.
        if let Some(ratio) = self.height_max.filter(is_off) {
            return Some(MotionFailure::HeightMax { ratio });
        }
        let settled = self.settled();
        let last = settled.len().saturating_sub(LAST);
        let (Some(all), Some(late)) = (mean(settled), mean(&settled[last..])) else {
            return Some(MotionFailure::Unfinished);
        };
        let first = |from: usize| self.cycles.len() - settled.len() + from + 1;
        let on = |way: &NetDisplacement, from| {
            self.planned.worst_deviation(way).map(|astray| (astray, first(from)))
        };
        if let Some((astray, from_period)) = on(&all, 0).or_else(|| on(&late, last)) {
            return Some(MotionFailure::Astray { astray, from_period });
        }
        let before = self.cycles.len().saturating_sub(LAST + 1);
        let steps = self.cycles[before..].windows(2);
        let change =
            steps.map(|of| self.planned.deviation_of_goals(&of[0], &of[1])).fold(0.0, f64::max);
        let changes = self.cycles.len() >= SHOWS_CHANGE && change > CHANGES;
        changes.then(|| MotionFailure::Changes { part: change * (BAND[1] - 1.0) })
    }

    /// True if the motion passes: [`miss`](Self::miss) is `None`.
    pub fn holds(&self) -> bool {
        self.miss().is_none()
    }
}

/// Mean displacement of some periods; `None` without periods.
fn mean(periods: &[NetDisplacement]) -> Option<NetDisplacement> {
    let count = periods.len() as f64;
    let sum = |of: usize| periods.iter().map(|way| way.values()[of]).sum::<f64>();
    (count > 0.0).then(|| [0, 1, 2].map(|of| sum(of) / count).into())
}

/// Reason why a motion does not pass.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "miss")]
pub enum MotionFailure {
    /// Fall of the robot.
    Falls {
        /// Simulated time, s.
        at_s: f64,
        /// Time since the end of the motion, s; `None` for a fall during the motion.
        #[serde(skip_serializing_if = "Option::is_none")]
        after_end_s: Option<f64>,
    },
    /// Final height that differs from the plan, without a fall.
    Height {
        /// Ratio of the height to the planned one.
        ratio: f64,
    },
    /// Largest height that differs from the plan, without a fall.
    HeightMax {
        /// Ratio of the height to the planned one.
        ratio: f64,
    },
    /// Contact with an obstacle, before any fall.
    Collides(ObstacleContact),
    /// Run without a complete period.
    Unfinished,
    /// Displacement that changes between periods, without a fall.
    Changes {
        /// Change as a fraction of the goal.
        part: f64,
    },
    /// Displacement that deviates from the plan, without a fall.
    Astray {
        /// Component that deviates.
        #[serde(flatten)]
        astray: ComponentDeviation,
        /// First of the averaged periods, counted from 1.
        from_period: usize,
    },
}

impl fmt::Display for MotionFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Falls { at_s, after_end_s: None } => {
                write!(f, "the robot falls after {at_s:.2} s")
            }
            Self::Falls { at_s, after_end_s: Some(after_s) } => write!(
                f,
                "the robot falls after {at_s:.2} s, {after_s:.2} s after the motion has ended, while it holds the last pose"
            ),
            Self::Collides(contact) => write!(f, "{contact}"),
            Self::Height { ratio } => {
                write!(f, "the robot ends at {ratio:.3} of the planned height")
            }
            Self::HeightMax { ratio } => {
                write!(f, "the robot rises to {ratio:.3} of the largest planned height")
            }
            Self::Changes { part } => {
                write!(
                    f,
                    "the distance per period still changes by {:.1} % of the goal from period to \
                     period",
                    100.0 * part
                )
            }
            Self::Unfinished => f.write_str("the run was stopped before its end"),
            Self::Astray { astray, from_period } if *from_period > 2 => {
                write!(f, "{astray}, averaged over period {from_period} and later")
            }
            Self::Astray { astray, .. } => write!(f, "{astray}"),
        }
    }
}

pub(crate) struct Tracker {
    planned: PlannedDisplacement,
    odometer: Odometer,
    fall_watch: FallWatch,
    cycles: Vec<NetDisplacement>,
    fell_at_s: Option<f64>,
    /// Time at which the motion ends, s; `None` for a periodic motion.
    ended_at_s: Option<f64>,
    obstacle_watch: Option<ObstacleWatch>,
    collision: Option<ObstacleContact>,
    /// Planned final height of the centre of mass, m; `None` unless the robot lies on its body during the motion.
    planned_height_m: Option<f64>,
    /// Largest planned height of the centre of mass, m.
    planned_height_max_m: f64,
    /// Largest height of the centre of mass so far, m.
    height_max_m: f64,
    steps: u64,
    iterations: u64,
    iterations_max: u32,
    subdivided: u32,
}

impl Tracker {
    /// Creates a tracker that begins at the state of `world`. Displacements are measured along the ground, like those of the
    /// plan.
    pub fn new(
        script: &Script<'_>,
        world: &World,
        ground: &Arc<dyn Ground>,
        plan_from_world: Rotation3<f64>,
    ) -> Self {
        let plan = script.plan();
        Self {
            planned: PlannedDisplacement::new(plan),
            odometer: Odometer::new(world, plan_from_world),
            fall_watch: FallWatch::new(world, ground),
            cycles: Vec::new(),
            fell_at_s: None,
            ended_at_s: (!script.repeats()).then(|| REST_S + script.duration_s()),
            obstacle_watch: ObstacleWatch::new(&plan.robot, ground.as_ref()),
            collision: None,
            planned_height_m: plan.robot.has_body_points().then_some(plan.after.com_m[2]),
            planned_height_max_m: plan.samples.iter().fold(0.0, |max, at| max.max(at.com_m[2])),
            height_max_m: 0.0,
            steps: 0,
            iterations: 0,
            iterations_max: 0,
            subdivided: 0,
        }
    }

    /// Begins the first period.
    pub fn begin(&mut self) {
        self.odometer.begin_again();
    }

    /// Adds a step.
    pub fn add(&mut self, world: &World, step_s: f64, report: &StepReport) {
        self.odometer.add(world, step_s);
        let height_m = self.fall_watch.height_m(world);
        self.height_max_m = self.height_max_m.max(height_m);
        self.steps += 1;
        self.iterations += u64::from(report.iterations);
        self.iterations_max = self.iterations_max.max(report.iterations);
        self.subdivided += u32::from(report.subdivisions > 0);
        if self.fall_watch.check(world).is_some() {
            self.fell_at_s = Some(world.system().time_s());
        }
        if self.collision.is_none()
            && let Some(watch) = &self.obstacle_watch
        {
            self.collision = watch.check(world);
        }
    }

    pub fn has_fallen(&self) -> bool {
        self.fell_at_s.is_some()
    }

    /// True if the final periods are alike, and their drift over five more periods would not change the verdict.
    pub fn has_settled(&self) -> bool {
        let count = self.cycles.len();
        let Some(last) = count.checked_sub(LAST).filter(|first| *first > 0) else { return false };
        let last = &self.cycles[last..];
        let steps = last.windows(2).map(|of| self.planned.deviation(&of[0], &of[1]));
        let step = steps.fold(0.0, f64::max);
        let miss = last.iter().map(|way| self.planned.miss(way));
        let (least, most) =
            miss.fold((f64::INFINITY, 0.0_f64), |(a, b), miss| (a.min(miss), b.max(miss)));
        let drift = AHEAD * step;
        step < SETTLED && (most + drift < 1.0 || least - drift > 1.0)
    }

    /// Ends a period.
    pub fn end_cycle(&mut self) {
        self.cycles.push(self.odometer.displacement());
        self.odometer.begin_again();
    }

    pub fn finish(self, world: &World, controller: &Controller<'_, '_>) -> RunOutcome {
        RunOutcome {
            planned: self.planned,
            cycles: self.cycles,
            height: self
                .planned_height_m
                .map(|planned_m| self.fall_watch.height_m(world) / planned_m),
            height_max: self
                .planned_height_m
                .map(|_| self.height_max_m / self.planned_height_max_m),
            fell_at_s: self.fell_at_s,
            ended_at_s: self.ended_at_s,
            collision: self.collision,
            time_s: world.system().time_s(),
            totals: self.odometer.totals(),
            iterations: self.iterations as f64 / self.steps.max(1) as f64,
            iterations_max: self.iterations_max,
            subdivided: self.subdivided,
            untracked: controller.untracked,
            stopped_at_s: controller.stopped_at_s,
        }
    }
}
