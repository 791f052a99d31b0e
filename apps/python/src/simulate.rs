//! Simulation of plans on the ground.

use crate::arrays::{matrix, vector, vectors};
use crate::documents::Source;
use crate::error::refused;
use crate::plan::Plan;
use crate::robot::wxyz;
use crate::watch::watched;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use rollwalk_multibody::rotation::nearer_quaternion;
use rollwalk_robot::Robot;
use rollwalk_simulate::{Control, Feedback, Mismatch, Moment, Options, RunOutcome, play};
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// Range of the simulation rate, steps per second.
const RATES_HZ: RangeInclusive<u32> = 30..=10_000;
/// Range of the number of periods.
const CYCLES: RangeInclusive<u32> = 1..=10_000;
/// Range of the mass ratio and of the coefficient of friction.
const RATIOS: RangeInclusive<f64> = 0.01..=10.0;

/// Simulation of a plan on the ground: N steps of a robot with J joints and E end effectors. World frame, z up; the robot
/// begins at the origin.
#[pyclass(frozen, module = "rollwalk")]
pub struct Simulation {
    outcome: RunOutcome,
    /// Simulated time at the end of each step, s, shape (N,).
    #[pyo3(get)]
    time_s: Py<PyArray1<f64>>,
    /// Time of the motion at the end of each step, s, shape (N,): 0 before the motion, its duration afterwards.
    #[pyo3(get)]
    motion_time_s: Py<PyArray1<f64>>,
    /// Origin of the body, m, shape (N, 3).
    #[pyo3(get)]
    base_position_m: Py<PyArray2<f64>>,
    /// World-from-body rotation, quaternions with w first, shape (N, 4).
    #[pyo3(get)]
    base_orientation_wxyz: Py<PyArray2<f64>>,
    /// Centre of mass, m, shape (N, 3).
    #[pyo3(get)]
    com_m: Py<PyArray2<f64>>,
    /// Joint angles, rad, shape (N, J).
    #[pyo3(get)]
    joint_rad: Py<PyArray2<f64>>,
    /// Joint speeds, rad/s, shape (N, J).
    #[pyo3(get)]
    joint_speed_rad_s: Py<PyArray2<f64>>,
    /// Torques of the joints' motors, N·m, shape (N, J).
    #[pyo3(get)]
    joint_torque_nm: Py<PyArray2<f64>>,
    /// Ground force on each end effector, N, shape (N, E, 3).
    #[pyo3(get)]
    contact_force_n: Py<PyArray3<f64>>,
}

/// State at the end of a step.
struct Step {
    time_s: f64,
    motion_s: f64,
    base_m: [f64; 3],
    turned: [f64; 4],
    com_m: [f64; 3],
    /// Angle and speed of each joint, and torque of its motor.
    joints: Vec<[f64; 3]>,
    force_n: Vec<[f64; 3]>,
}

impl Step {
    fn of(moment: &Moment<'_>, robot: &Robot, before: Option<&Self>) -> Self {
        let world = moment.world;
        let mut torque_nm = vec![0.0; robot.joints.len()];
        // Channels are motors of joints first, then of wheels.
        let shafts = robot.driven_joints().enumerate();
        shafts.for_each(|(channel, joint)| torque_nm[joint] = world.shaft(channel)[2]);
        let (base, rotation) = world.base();
        let turned = wxyz(&rotation);
        Self {
            time_s: moment.done_s,
            motion_s: moment.motion_s,
            base_m: base.into(),
            turned: before.map_or(turned, |before| nearer_quaternion(turned, &before.turned)),
            com_m: world.com().0.into(),
            joints: (torque_nm.into_iter().enumerate())
                .map(|(joint, torque_nm)| {
                    let [angle_rad, speed_rad_s] = world.joint(joint);
                    [angle_rad, speed_rad_s, torque_nm]
                })
                .collect(),
            force_n: world.touches().map(|touch| touch.force.into()).collect(),
        }
    }
}

#[pymethods]
impl Simulation {
    /// True if the robot did not fall, touched no obstacle, and reached 95 % to 105 % of every goal in the mean of the periods
    /// after the first one. Without goals the displacement may differ by 5 mm and 0.02 rad. The final periods are also checked
    /// alone.
    #[getter]
    fn holds(&self) -> bool {
        self.outcome.holds()
    }

    /// Time of the fall, s; `None` without a fall.
    #[getter]
    fn fell_at_s(&self) -> Option<f64> {
        self.outcome.fell_at_s
    }

    /// Planned displacement of the motion, or of one period: forward (m), left (m) and turn to the left (rad), shape (3,).
    #[getter]
    fn planned_way(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        vector(py, self.outcome.planned.way.values().to_vec())
    }

    /// Simulated displacement of the motion, or of each of its C periods, with the components of `planned_way`, shape (C, 3).
    #[getter]
    fn ways(&self, py: Python<'_>) -> Py<PyArray2<f64>> {
        let ways: Vec<_> = self.outcome.cycles.iter().map(|way| way.values()).collect();
        matrix(py, [ways.len(), 3], |cycle, of| ways[cycle][of])
    }

    /// Difference of each displacement from the planned one, m, m, rad, shape (C, 3).
    #[getter]
    fn drift(&self, py: Python<'_>) -> Py<PyArray2<f64>> {
        let planned = self.outcome.planned.way.values();
        let ways: Vec<_> = self.outcome.cycles.iter().map(|way| way.values()).collect();
        matrix(py, [ways.len(), 3], |cycle, of| ways[cycle][of] - planned[of])
    }

    /// Ratios of achieved to planned displacement, in the mean of the periods after the first one: forward, left and turn; `None`
    /// without a goal.
    #[getter]
    fn ratios(&self) -> [Option<f64>; 3] {
        [0, 1, 2].map(|of| self.outcome.ratio(of))
    }

    /// Total sliding distance of end effectors in contact, m.
    #[getter]
    fn slid_m(&self) -> f64 {
        self.outcome.totals.slid_m
    }

    /// Mechanical work of all motors, J.
    #[getter]
    fn work_j(&self) -> f64 {
        self.outcome.totals.work_j
    }

    /// Number of steps in which the robot was not tracked and the servos received set-points of the plan in open loop; 0
    /// without `tracking`.
    #[getter]
    fn untracked_steps(&self) -> u32 {
        self.outcome.untracked
    }

    fn __repr__(&self) -> String {
        let how = match self.outcome.fell_at_s {
            Some(time_s) => format!("fell after {time_s:.2} s"),
            None if self.outcome.holds() => "holds".to_owned(),
            None => "misses the goals of the plan".to_owned(),
        };
        format!("<Simulation of {:.2} s: {how}>", self.outcome.time_s)
    }
}

/// Play a plan on the simulated ground, as `rollwalk simulate` does.
///
/// In open loop the servos of the robot file play the plan, with the planned torques as feed-forward. Other threads of the
/// program continue to run.
///
/// :param plan: plan to play.
/// :param cycles: number of periods of a periodic motion, 1 to 10,000.
/// :param feed_forward: feed the planned torques forward; otherwise the servos apply only their own.
/// :param tracking: track the plan with a whole-body controller, which reads the state of the robot at each step.
/// :param rate_hz: simulation steps per second, 30 to 10,000; 480 if it is `None`, 500 with `tracking`.
/// :param mass_ratio: ratio of the masses of the simulated robot to those of the plan's robot, 0.01 to 10.
/// :param friction: friction coefficient of all feet, wheels and blades, 0.01 to 10; `None` keeps those of the plan's robot.
/// :param terrain: path of a terrain file (TOML); level ground if it is `None`.
/// :param progress: called with the completed fraction, 0 to 1, at most ten times a second. Its exceptions end the run.
/// :raises RollwalkError: a value is out of range, the terrain file is wrong, or a step of the world has no solution.
/// :raises KeyboardInterrupt: Ctrl-C was pressed; takes effect within a step.
#[pyfunction]
#[pyo3(signature = (
    plan, *, cycles = 5, feed_forward = true, tracking = false, rate_hz = None,
    mass_ratio = 1.0, friction = None, terrain = None, progress = None
))]
pub fn simulate(
    py: Python<'_>,
    plan: &Bound<'_, Plan>,
    cycles: u32,
    feed_forward: bool,
    tracking: bool,
    rate_hz: Option<u32>,
    mass_ratio: f64,
    friction: Option<f64>,
    terrain: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Simulation> {
    let plan = &plan.get().inner;
    let control = match (tracking, feed_forward) {
        (true, _) => Control::Tracking(Feedback::Gains),
        (false, false) => Control::Servos,
        (false, true) => Control::FeedForward,
    };
    let rate_hz = rate_hz.unwrap_or(control.usual_rate_hz());
    within("rate_hz", rate_hz, &RATES_HZ)?;
    within("cycles", cycles, &CYCLES)?;
    within("mass_ratio", mass_ratio, &RATIOS)?;
    friction.map_or(Ok(()), |friction| within("friction", friction, &RATIOS))?;
    let mut options = Options {
        cycles: cycles as usize,
        mismatch: Mismatch { mass: mass_ratio, friction, ..Mismatch::default() },
        ..Options::new(control, rate_hz)
    };
    if let Some(terrain) = terrain {
        options.ground = Some(Source::Disk.terrain(&terrain)?.solid());
    }
    let joints = plan.robot.joints.len();
    let mut steps = Vec::new();
    let played = watched(py, progress.as_ref(), |watch| {
        play(plan, &options, |moment| {
            steps.push(Step::of(moment, &plan.robot, steps.last()));
            watch.at(moment.done_s / moment.all_s).is_continue()
        })
    })?;
    let outcome = played.map_err(refused)?;
    let count = steps.len();
    let of_joint = |what: usize| matrix(py, [count, joints], |at, k| steps[at].joints[k][what]);
    Ok(Simulation {
        outcome,
        time_s: vector(py, steps.iter().map(|step| step.time_s).collect()),
        motion_time_s: vector(py, steps.iter().map(|step| step.motion_s).collect()),
        base_position_m: matrix(py, [count, 3], |at, axis| steps[at].base_m[axis]),
        base_orientation_wxyz: matrix(py, [count, 4], |at, of| steps[at].turned[of]),
        com_m: matrix(py, [count, 3], |at, axis| steps[at].com_m[axis]),
        joint_rad: of_joint(0),
        joint_speed_rad_s: of_joint(1),
        joint_torque_nm: of_joint(2),
        contact_force_n: vectors(py, [count, plan.robot.end_effectors.len()], |at, foot, axis| {
            steps[at].force_n[foot][axis]
        }),
    })
}

/// Refuses a value outside its range.
fn within<T: PartialOrd + Display>(
    name: &str,
    value: T,
    range: &RangeInclusive<T>,
) -> PyResult<()> {
    let (least, most) = (range.start(), range.end());
    match range.contains(&value) {
        true => Ok(()),
        false => Err(refused(format!("{name} is {value}; expected {least} to {most}"))),
    }
}
