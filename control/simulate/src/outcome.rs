//! What became of a plan in the world, against the plan.

use crate::control::Controller;
use crate::judgement::PlannedWay;
use crate::script::Script;
use nalgebra::Rotation3;
use rollwalk_multibody::ground::Ground;
use rollwalk_physics::world::{FallWatch, Odometer, Totals, Way};
use rollwalk_physics::{StepReport, World};
use serde::Serialize;
use std::sync::Arc;

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// Planned way of the motion, or of a period.
    #[serde(flatten)]
    pub planned: PlannedWay,
    /// Way of the motion, or of each period.
    pub cycles: Vec<Way>,
    /// When the robot fell, s.
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
    /// When it was brought to a stop because it could not be tracked, s.
    pub stopped_at_s: Option<f64>,
}

impl Outcome {
    /// Achieved by planned of a goal, on the mean of the periods; `None` where it is no goal.
    pub fn ratio(&self, of: usize) -> Option<f64> {
        self.planned.ratio(&self.mean()?, of)
    }

    /// Mean way of a period.
    fn mean(&self) -> Option<Way> {
        let count = self.cycles.len() as f64;
        let sum = |of: usize| self.cycles.iter().map(|way| way.values()[of]).sum::<f64>();
        (count > 0.0).then(|| [0, 1, 2].map(|of| sum(of) / count).into())
    }

    /// Whether the robot stayed on its feet and came, on the mean of its periods, where the plan says.
    pub fn holds(&self) -> bool {
        self.fell_at_s.is_none() && self.mean().is_some_and(|mean| self.planned.is_reached(&mean))
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
