//! What became of a plan in the world, against the plan.

use crate::script::Script;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_physics::{StepReport, World};
use serde::Serialize;
use std::f64::consts::PI;

/// Tilt against the start beyond which a robot has fallen, rad.
const FALLEN_RAD: f64 = 1.0;
/// Height beneath which a robot has fallen, as a share of that at the start.
const FALLEN_HEIGHT: f64 = 0.4;
/// Achieved by planned: what counts as played.
pub const BAND: [f64; 2] = [0.95, 1.05];
/// What a motion may miss where it has no goal, over the whole motion or a period: m ahead and to the left, rad.
const STAYS: [f64; 3] = [0.005, 0.005, 0.02];

/// Way of the centre of mass ahead and to the left, as the robot faced at the beginning, m, and turn, rad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Way {
    /// m.
    pub forward_m: f64,
    /// m.
    pub left_m: f64,
    /// rad.
    pub turn_rad: f64,
}

impl Way {
    /// In the order of the fields.
    pub fn values(&self) -> [f64; 3] {
        [self.forward_m, self.left_m, self.turn_rad]
    }
}

impl From<[f64; 3]> for Way {
    fn from([forward_m, left_m, turn_rad]: [f64; 3]) -> Self {
        Self { forward_m, left_m, turn_rad }
    }
}

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// Planned way of the motion, or of a period.
    pub planned: Way,
    /// Which of its values are goals.
    pub goals: [bool; 3],
    /// Way of the motion, or of each period.
    pub cycles: Vec<Way>,
    /// When the robot fell, s.
    pub fell_at_s: Option<f64>,
    /// Simulated time, s.
    pub time_s: f64,
    /// Way that end effectors in contact slid, m, all together.
    pub slid_m: f64,
    /// Greatest force of the ground on one end effector, N.
    pub force_max_n: f64,
    /// Mechanical work of the motors, J.
    pub work_j: f64,
    /// Newton iterations of a step, the mean.
    pub iterations: f64,
    /// The most of a step.
    pub iterations_max: u32,
    /// Steps that were taken in parts because they did not converge in one.
    pub subdivided: u32,
}

impl Outcome {
    /// Achieved by planned of a goal, on the mean of the periods; `None` where it is no goal.
    pub fn ratio(&self, of: usize) -> Option<f64> {
        let mean = self.mean()?[of];
        self.goals[of].then(|| mean / self.planned.values()[of])
    }

    /// Mean way of a period.
    fn mean(&self) -> Option<[f64; 3]> {
        let count = self.cycles.len() as f64;
        let sum = |of: usize| self.cycles.iter().map(|way| way.values()[of]).sum::<f64>();
        (count > 0.0).then(|| [0, 1, 2].map(|of| sum(of) / count))
    }

    /// Whether the robot stayed on its feet and came, on the mean of its periods, to 0.95 to 1.05 of every goal; where it
    /// has none, to within 5 mm and 0.02 rad of the plan.
    pub fn holds(&self) -> bool {
        let Some(mean) = self.mean() else { return false };
        let goal_less = !self.goals.contains(&true);
        let good = (0..3).all(|of| match self.ratio(of) {
            Some(ratio) => (BAND[0]..=BAND[1]).contains(&ratio),
            None => !goal_less || (mean[of] - self.planned.values()[of]).abs() <= STAYS[of],
        });
        self.fell_at_s.is_none() && good
    }
}

/// Measures a run.
pub(crate) struct Tracker {
    /// Way is measured along the ground.
    plan_from_world: Rotation3<f64>,
    planned: Way,
    goals: [bool; 3],
    channels: usize,
    end_effectors: usize,
    start_rotation: Matrix3<f64>,
    start_height_m: f64,
    mark: (Vector3<f64>, Matrix3<f64>),
    cycles: Vec<Way>,
    fell_at_s: Option<f64>,
    slid_m: f64,
    force_max_n: f64,
    work_j: f64,
    steps: u64,
    iterations: u64,
    iterations_max: u32,
    subdivided: u32,
    heading_rad: f64,
    turn_rad: f64,
}

impl Tracker {
    pub fn new(script: &Script<'_>, world: &World, world_from_plan: Rotation3<f64>) -> Self {
        let robot = script.robot();
        let plan_from_world = world_from_plan.inverse();
        let Seen { origin, rotation, com } = Seen::new(world, &plan_from_world);
        Self {
            plan_from_world,
            planned: script.planned().into(),
            goals: script.goals(),
            channels: robot.channels().count(),
            end_effectors: robot.end_effectors.len(),
            start_rotation: rotation,
            start_height_m: origin.z,
            mark: (com, rotation),
            cycles: Vec::new(),
            fell_at_s: None,
            slid_m: 0.0,
            force_max_n: 0.0,
            work_j: 0.0,
            steps: 0,
            iterations: 0,
            iterations_max: 0,
            subdivided: 0,
            heading_rad: heading_rad(&rotation),
            turn_rad: 0.0,
        }
    }

    /// Begins the first period.
    pub fn begin(&mut self, world: &World) {
        let Seen { rotation, com, .. } = Seen::new(world, &self.plan_from_world);
        self.mark = (com, rotation);
        self.turn_rad = 0.0;
    }

    /// Takes in a step.
    pub fn add(&mut self, world: &World, step_s: f64, report: &StepReport) {
        let Seen { origin, rotation, .. } = Seen::new(world, &self.plan_from_world);
        let heading = heading_rad(&rotation);
        self.turn_rad += wrapped(heading - self.heading_rad);
        self.heading_rad = heading;
        for touch in (0..self.end_effectors).map(|number| world.touch(number)) {
            if touch.slips {
                self.slid_m += step_s * touch.sliding.norm();
            }
            self.force_max_n = self.force_max_n.max(touch.force.norm());
        }
        for [_, speed_rad_s, torque_nm] in (0..self.channels).map(|channel| world.shaft(channel)) {
            self.work_j += step_s * speed_rad_s * torque_nm;
        }
        self.steps += 1;
        self.iterations += u64::from(report.iterations);
        self.iterations_max = self.iterations_max.max(report.iterations);
        self.subdivided += u32::from(report.subdivisions > 0);
        // Against the start, because not every robot begins level.
        let cosine = rotation.column(2).dot(&self.start_rotation.column(2));
        let tilt_rad = cosine.clamp(-1.0, 1.0).acos();
        if tilt_rad > FALLEN_RAD || origin.z < FALLEN_HEIGHT * self.start_height_m {
            self.fell_at_s = Some(world.system().time_s());
        }
    }

    pub fn has_fallen(&self) -> bool {
        self.fell_at_s.is_some()
    }

    /// Ends a period.
    pub fn end_cycle(&mut self, world: &World) {
        let Seen { rotation, com, .. } = Seen::new(world, &self.plan_from_world);
        let (start, facing) = self.mark;
        let (sine, cosine) = heading_rad(&facing).sin_cos();
        let moved = com - start;
        self.cycles.push(Way {
            forward_m: cosine * moved.x + sine * moved.y,
            left_m: cosine * moved.y - sine * moved.x,
            turn_rad: self.turn_rad,
        });
        self.mark = (com, rotation);
        self.turn_rad = 0.0;
    }

    pub fn finish(self, world: &World) -> Outcome {
        Outcome {
            planned: self.planned,
            goals: self.goals,
            cycles: self.cycles,
            fell_at_s: self.fell_at_s,
            time_s: world.system().time_s(),
            slid_m: self.slid_m,
            force_max_n: self.force_max_n,
            work_j: self.work_j,
            iterations: self.iterations as f64 / self.steps.max(1) as f64,
            iterations_max: self.iterations_max,
            subdivided: self.subdivided,
        }
    }
}

/// Where the robot is, in the plan's frame.
struct Seen {
    origin: Vector3<f64>,
    rotation: Matrix3<f64>,
    com: Vector3<f64>,
}

impl Seen {
    fn new(world: &World, plan_from_world: &Rotation3<f64>) -> Self {
        let (origin, rotation) = world.base();
        Self {
            origin: plan_from_world * origin,
            rotation: plan_from_world.matrix() * rotation,
            com: plan_from_world * world.com().0,
        }
    }
}

/// Direction of the body's x axis about the vertical, rad.
fn heading_rad(world_from_body: &Matrix3<f64>) -> f64 {
    world_from_body[(1, 0)].atan2(world_from_body[(0, 0)])
}

/// An angle between −π and π that differs by whole turns.
fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(2.0 * PI) - PI
}
