//! Outcome of a plan in the world, against the plan.

use crate::control::Controller;
use crate::judgement::{Astray, BAND, PlannedWay};
use crate::script::Script;
use nalgebra::Rotation3;
use rollwalk_multibody::ground::Ground;
use rollwalk_physics::world::{FallWatch, Odometer, Totals, Way};
use rollwalk_physics::{StepReport, World};
use serde::Serialize;
use std::fmt;
use std::sync::Arc;

/// Periods at the end of a run that count by themselves: what grows shows there, and what alternates from period to period does
/// not.
const LAST: usize = 3;
/// Deviation from one period to the next, over the one that is allowed from the plan, of a motion that has settled.
const SETTLED: f64 = 0.02;
/// Periods for which such deviations might add up without a change of the verdict.
const AHEAD: f64 = 5.0;

/// Periods from which on a run shows whether its way still changes from period to period, and the change that is too much, over
/// the deviation that is allowed: 2 % of a goal. Where it does, no mean says where the robot comes.
const SHOWS_CHANGE: usize = 7;
const CHANGES: f64 = 0.4;

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// Planned way of the motion, or of a period.
    #[serde(flatten)]
    pub planned: PlannedWay,
    /// Way of the motion, or of each period.
    pub cycles: Vec<Way>,
    /// Time at which the robot fell, s.
    pub fell_at_s: Option<f64>,
    /// Simulated time, s.
    pub time_s: f64,
    /// Tilt, slip, forces and work.
    #[serde(flatten)]
    pub totals: Totals,
    /// Newton iterations of a step, the mean.
    pub iterations: f64,
    /// The most of a step.
    pub iterations_max: u32,
    /// Steps that were taken in parts because they did not converge in one.
    pub subdivided: u32,
    /// Steps in which the robot was not tracked: the servos got the setpoints of the plan, or of its stop.
    pub untracked: u32,
    /// Time at which the robot was brought to a stop because it could not be tracked, s.
    pub stopped_at_s: Option<f64>,
}

impl Outcome {
    /// Achieved by planned of a goal, on the mean of the periods after the first one; `None` where it is no goal.
    pub fn ratio(&self, of: usize) -> Option<f64> {
        self.planned.ratio(&mean(self.settled())?, of)
    }

    /// The periods without that in which the motion begins, if there are more.
    fn settled(&self) -> &[Way] {
        self.cycles.get(1..).filter(|rest| !rest.is_empty()).unwrap_or(&self.cycles)
    }

    /// Reason why the motion does not hold. `None` if the robot stayed on its feet and its way was the planned one, on the mean
    /// of the periods after the first one and of the last ones.
    pub fn miss(&self) -> Option<Miss> {
        if let Some(at_s) = self.fell_at_s {
            return Some(Miss::Falls { at_s });
        }
        let settled = self.settled();
        let last = settled.len().saturating_sub(LAST);
        let (Some(all), Some(late)) = (mean(settled), mean(&settled[last..])) else {
            return Some(Miss::Unfinished);
        };
        let first = |from: usize| self.cycles.len() - settled.len() + from + 1;
        let on = |way: &Way, from| self.planned.astray(way).map(|astray| (astray, first(from)));
        if let Some((astray, from_period)) = on(&all, 0).or_else(|| on(&late, last)) {
            return Some(Miss::Astray { astray, from_period });
        }
        let before = self.cycles.len().saturating_sub(LAST + 1);
        let steps = self.cycles[before..].windows(2);
        let change =
            steps.map(|of| self.planned.deviation_of_goals(&of[0], &of[1])).fold(0.0, f64::max);
        let changes = self.cycles.len() >= SHOWS_CHANGE && change > CHANGES;
        changes.then(|| Miss::Changes { part: change * (BAND[1] - 1.0) })
    }

    /// True if the robot stayed on its feet and its way was the planned one.
    pub fn holds(&self) -> bool {
        self.miss().is_none()
    }
}

/// Mean way of some periods.
fn mean(periods: &[Way]) -> Option<Way> {
    let count = periods.len() as f64;
    let sum = |of: usize| periods.iter().map(|way| way.values()[of]).sum::<f64>();
    (count > 0.0).then(|| [0, 1, 2].map(|of| sum(of) / count).into())
}

/// Reason why a motion does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "miss")]
pub enum Miss {
    /// The robot falls.
    Falls {
        /// Simulated time, s.
        at_s: f64,
    },
    /// Run without a complete period.
    Unfinished,
    /// Way that changes from period to period, without a fall.
    Changes {
        /// Change over the goal.
        part: f64,
    },
    /// Way that leads somewhere else, without a fall.
    Astray {
        /// Component that deviates.
        #[serde(flatten)]
        astray: Astray,
        /// First period, from 1, of those whose mean deviates.
        from_period: usize,
    },
}

impl fmt::Display for Miss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Falls { at_s } => write!(f, "the robot falls after {at_s:.2} s"),
            Self::Changes { part } => {
                write!(
                    f,
                    "its way still changes by {:.1} % of its goal from period to period",
                    100.0 * part
                )
            }
            Self::Unfinished => f.write_str("it was stopped before its end"),
            Self::Astray { astray, from_period } if *from_period > 2 => {
                write!(f, "{astray} from period {from_period} on")
            }
            Self::Astray { astray, .. } => write!(f, "{astray}"),
        }
    }
}

pub(crate) struct Tracker {
    planned: PlannedWay,
    odometer: Odometer,
    fall_watch: FallWatch,
    cycles: Vec<Way>,
    fell_at_s: Option<f64>,
    steps: u64,
    iterations: u64,
    iterations_max: u32,
    subdivided: u32,
}

impl Tracker {
    /// Begins where the world is. Ways are along the ground, as the plan's are.
    pub fn new(
        script: &Script<'_>,
        world: &World,
        ground: &Arc<dyn Ground>,
        plan_from_world: Rotation3<f64>,
    ) -> Self {
        Self {
            planned: PlannedWay::new(script.plan()),
            odometer: Odometer::new(world, plan_from_world),
            fall_watch: FallWatch::new(world, ground),
            cycles: Vec::new(),
            fell_at_s: None,
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

    /// Takes in a step.
    pub fn add(&mut self, world: &World, step_s: f64, report: &StepReport) {
        self.odometer.add(world, step_s);
        self.steps += 1;
        self.iterations += u64::from(report.iterations);
        self.iterations_max = self.iterations_max.max(report.iterations);
        self.subdivided += u32::from(report.subdivisions > 0);
        if self.fall_watch.look(world).is_some() {
            self.fell_at_s = Some(world.system().time_s());
        }
    }

    pub fn has_fallen(&self) -> bool {
        self.fell_at_s.is_some()
    }

    /// True if the last periods are alike, and five more periods with their drift would not change the verdict on them.
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
        self.cycles.push(self.odometer.way());
        self.odometer.begin_again();
    }

    pub fn finish(self, world: &World, controller: &Controller<'_, '_>) -> Outcome {
        Outcome {
            planned: self.planned,
            cycles: self.cycles,
            fell_at_s: self.fell_at_s,
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
