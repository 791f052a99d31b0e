//! Start state of a run: the recorded state with small fitted changes.

use super::quantity::SimulationModel;
use super::recording::{Recording, rotation};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_multibody::rotation::log;
use rollwalk_physics::sensitivity::gauss_newton::Penalty;
use rollwalk_physics::sensitivity::parameter::Parameter;
use rollwalk_physics::sensitivity::{Column, SolvedStep, Start as Starts, Variation};
use rollwalk_physics::world::RobotState;
use rollwalk_physics::{System, World};
use rollwalk_robot::Robot;
use std::sync::Arc;

/// Duration of the window after the start from which the state is estimated, s.
const WINDOW_S: f64 = 0.1;
/// Interval of the finite difference for a spin, s.
const INSTANT_S: f64 = 1e-3;
/// Distance from the ground within which the robot is assumed to stand, m.
const NEAR_M: f64 = 0.015;
/// Penetration depth of the contacts of a standing robot, m.
const DEPTH_M: f64 = 3e-4;

/// State at the beginning of a recording.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Start {
    pub state: RobotState,
    /// Measured wheel angles at the start, by channel. Simulated wheels start at 0.
    pub wheel_rad: Vec<f64>,
    freedoms: Vec<(StartCoordinate, Deviation)>,
}

/// Free coordinate of the start state.
#[derive(Clone, Copy, Debug, PartialEq)]
enum StartCoordinate {
    Position(Vector3<f64>),
    Rotation(Vector3<f64>),
    Velocity(Vector3<f64>),
    Spin(Vector3<f64>),
    /// Angle of a joint. While the feet stick, the legs keep the strain that they have at the start.
    Joint(usize),
}

/// Unit and expected size of a change of the start.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Deviation {
    /// Change for a parameter of 1. Large, because the step limit of the search applies to the parameter.
    unit: f64,
    /// Expected standard deviation of the change.
    expected: f64,
}

impl Start {
    /// Estimates the start state from the first measurements. Without measurements the robot is level, at the origin and at
    /// rest.
    pub fn of(recording: &Recording, model: &SimulationModel) -> Self {
        let robot = &model.robot;
        let [begin_s, _] = recording.span_s;
        let window = [begin_s, begin_s + WINDOW_S];
        let mut state = RobotState::nominal(robot, Vector3::zeros());
        if let Some(position) = &recording.position_m {
            let found = position.each_ref().map(|part| part.beginning(window).unwrap_or_default());
            state.base_position_m = found.map(|[value, _]| value).into();
            state.base_velocity_m_s = found.map(|[_, slope]| slope).into();
        }
        if let Some(parts) = &recording.orientation {
            let found = parts.each_ref().map(|part| part.beginning(window).unwrap_or_default());
            let ahead = found.map(|[value, slope]| value + INSTANT_S * slope);
            state.world_from_body = rotation(found.map(|[value, _]| value));
            let turned = rotation(ahead) * state.world_from_body.transpose();
            state.base_spin_rad_s = log(&turned) / INSTANT_S;
        }
        if let Some(gyro) = &recording.gyro_rad_s {
            let found = gyro.each_ref().map(|part| part.beginning(window).unwrap_or_default()[0]);
            state.base_spin_rad_s = state.world_from_body * Vector3::from(found);
        }
        let joints = robot.joints.len();
        let mut shafts = Vec::new();
        for (number, drive) in recording.drives.iter().enumerate() {
            let angle = drive.rad.beginning(window);
            // If only speeds are measured, joints begin at their commanded angles.
            let commanded = || if number < joints { drive.target_rad.at(begin_s)[0] } else { 0.0 };
            // A servo reaches its speed faster than a parabola can follow.
            let slope = match drive.rad_s.is_empty() {
                true => angle.map_or(0.0, |[_, slope]| slope),
                false => drive.rad_s.at(begin_s)[0],
            };
            shafts.push([angle.map_or_else(commanded, |[value, _]| value), slope]);
        }
        for (number, shaft) in shafts.iter().take(joints).enumerate() {
            [state.joint_rad[number], state.joint_rad_s[number]] = *shaft;
        }
        let driven = robot.end_effectors.iter().enumerate();
        let driven = driven.filter(|(_, of)| of.contact.actuator().is_some());
        // A wheel reaches its speed faster than a parabola can follow.
        for ((number, _), drive) in driven.zip(&recording.drives[joints..]) {
            let first = if drive.rad_s.is_empty() { &drive.target_rad_s } else { &drive.rad_s };
            state.wheel_rad_s[number] = first.at(begin_s)[0];
        }
        roll(robot, &mut state);
        let wheel_rad = shafts.iter().map(|[angle, _]| *angle).collect();
        let stands = stand(&mut state, model, recording.position_m.is_some());
        let freedoms = freedoms(recording, stands, joints);
        Self { state, wheel_rad, freedoms }
    }

    /// Number of free coordinates.
    pub fn count(&self) -> usize {
        self.freedoms.len()
    }

    /// Penalties that keep changes near their expected standard deviation. `first` is the index of the first parameter.
    pub fn penalties(&self, first: usize) -> Vec<Penalty> {
        let of = |(number, (_, deviation)): (usize, &(StartCoordinate, Deviation))| {
            let factors = vec![(first + number, deviation.unit / deviation.expected)];
            Penalty { factors, target: 0.0 }
        };
        self.freedoms.iter().enumerate().map(of).collect()
    }

    /// Creates the world in the changed start state.
    pub fn world(
        &self,
        model: &SimulationModel,
        changes: &[f64],
        ground: &Arc<dyn Ground>,
    ) -> World {
        World::new(&model.robot, ground, &model.parameters, &self.changed(changes))
    }

    /// Free coordinates as parameters of a rollout, with derivatives from finite differences.
    ///
    /// The differences are accurate because they involve no simulation step. They include the rotation of the changed state,
    /// unlike derivatives along fixed axes.
    pub fn parameters(
        &self,
        model: &SimulationModel,
        changes: &[f64],
        ground: &Arc<dyn Ground>,
    ) -> Vec<Box<dyn Parameter>> {
        let moved = |number: usize, by: f64| {
            let mut changes = changes.to_vec();
            changes[number] += by;
            self.world(model, &changes, ground).system().motions().to_vec()
        };
        let per = 0.5 / DIFFERENCE;
        let of = |number: usize| -> Box<dyn Parameter> {
            let pairs = moved(number, DIFFERENCE).into_iter().zip(moved(number, -DIFFERENCE));
            let by = pairs.map(|(more, less)| {
                let turned = more.rotation * less.rotation.transpose();
                Variation {
                    shift: (more.position - less.position) * per,
                    turn: log(&turned) * per,
                    velocity: (more.velocity - less.velocity) * per,
                    spin: (more.spin - less.spin) * per,
                }
            });
            Box::new(StartDerivative { by: by.collect() })
        };
        (0..changes.len()).map(of).collect()
    }

    fn changed(&self, changes: &[f64]) -> RobotState {
        let mut state = self.state.clone();
        let mut turned = Vector3::zeros();
        for ((freedom, deviation), change) in self.freedoms.iter().zip(changes) {
            let by = change * deviation.unit;
            match freedom {
                StartCoordinate::Position(axis) => state.base_position_m += axis * by,
                StartCoordinate::Rotation(axis) => turned += axis * by,
                StartCoordinate::Velocity(axis) => state.base_velocity_m_s += axis * by,
                StartCoordinate::Spin(axis) => state.base_spin_rad_s += axis * by,
                StartCoordinate::Joint(joint) => state.joint_rad[*joint] += by,
            }
        }
        state.world_from_body = Rotation3::new(turned).matrix() * state.world_from_body;
        state
    }
}

/// Step of the finite differences.
const DIFFERENCE: f64 = 1e-5;

/// Derivative of the start motions with respect to a free coordinate.
#[derive(Clone, Debug)]
struct StartDerivative {
    by: Vec<Variation>,
}

impl Parameter for StartDerivative {
    fn residual(&self, _: &SolvedStep<'_>, _: &mut Column) {}

    fn start(&self, _: &System, start: &mut Starts) {
        self.by.iter().enumerate().for_each(|(body, by)| start.add(body, by));
    }
}

/// Sets the speed of free wheels to rolling without slip, even if their speed was measured.
fn roll(robot: &Robot, state: &mut RobotState) {
    for (number, of) in robot.end_effectors.iter().enumerate() {
        if of.contact.actuator().is_none() && of.contact.freewheels() {
            let ahead: Matrix3<f64> = state.world_from_body.transpose();
            state.wheel_rad_s[number] = (ahead * state.base_velocity_m_s).x / of.radius_m;
        }
    }
}

/// Places a robot on the ground if it is near the ground or its height was not measured. Returns true if it was placed.
fn stand(state: &mut RobotState, model: &SimulationModel, is_known: bool) -> bool {
    let level: Arc<dyn Ground> = Arc::new(Plane::level());
    let clearance_m = |state: &RobotState| {
        World::new(&model.robot, &level, &model.parameters, state).clearance_m()
    };
    let stands = !is_known || clearance_m(state).abs() < NEAR_M;
    if stands {
        for _ in 0..2 {
            state.base_position_m.z -= clearance_m(state) + DEPTH_M;
        }
    }
    stands
}

/// Free coordinates of the start state. Horizontal position and heading are free only if they were measured.
fn freedoms(
    recording: &Recording,
    stands: bool,
    joints: usize,
) -> Vec<(StartCoordinate, Deviation)> {
    let height_m = if stands { 1e-3 } else { 1e-2 };
    let has_place = recording.position_m.is_some();
    let has_heading = recording.orientation.is_some();
    let mut freedoms = Vec::new();
    let mut add = |freedom, unit, expected| freedoms.push((freedom, Deviation { unit, expected }));
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        let is_vertical = axis.z == 1.0;
        if has_place || is_vertical {
            add(StartCoordinate::Position(axis), 0.1, if is_vertical { height_m } else { 1e-2 });
        }
        if has_heading || !is_vertical {
            add(StartCoordinate::Rotation(axis), 0.1, 3e-2);
        }
        add(StartCoordinate::Velocity(axis), 1.0, 0.3);
        add(StartCoordinate::Spin(axis), 3.0, 1.0);
    }
    for joint in 0..joints {
        add(StartCoordinate::Joint(joint), 0.05, 3e-3);
    }
    freedoms
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::{DriveSeries, Series};

    /// Duration of the recordings, s.
    const LONG_S: f64 = 1.0;
    /// Height at which the body is far above the ground, m.
    const HIGH_M: f64 = 2.0;

    fn robot(name: &str) -> Robot {
        let path = format!("{}/../../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
    }

    /// Samples a function at 100 Hz for 1 s.
    fn series(of: impl Fn(f64) -> f64) -> Series {
        Series::new((0..=100).map(|k| f64::from(k) * 0.01).map(|time_s| (time_s, of(time_s))))
    }

    /// Recording of motors at their nominal angles, without other measurements.
    fn recording(robot: &Robot) -> Recording {
        let drive = |nominal_rad: f64| DriveSeries {
            target_rad: Series::constant(nominal_rad),
            target_rad_s: Series::constant(0.0),
            rad: series(|_| nominal_rad),
            ..DriveSeries::default()
        };
        let nominal = robot.joints.iter().map(|joint| joint.nominal_rad);
        let all = nominal.chain(std::iter::repeat(0.0)).take(robot.channels().count());
        let drives = all.map(drive).collect();
        let run = Recording::new(robot, drives, None, None, None);
        run.cut(&[[0.0, LONG_S]], [None; 2]).unwrap()
    }

    fn near(found: f64, expected: f64, most: f64) {
        assert!((found - expected).abs() < most, "{found}, {expected}");
    }

    #[test]
    fn a_run_begins_as_it_was_measured() {
        let model = SimulationModel::new(&robot("agilebot"));
        let mut run = recording(&model.robot);
        // The body moves, turns to the left at 0.4 rad/s, and has a joint and a wheel that turn.
        let place =
            [series(|t| 0.2 + 0.5 * t + t * t), series(|t| -0.1 * t), series(|t| HIGH_M - 0.3 * t)];
        run.position_m = Some(place);
        let half = |t: f64| 0.5 * (0.3 + 0.4 * t);
        run.orientation = Some([
            series(|t| half(t).cos()),
            series(|_| 0.0),
            series(|_| 0.0),
            series(|t| half(t).sin()),
        ]);
        run.drives[1].rad = series(|t| 0.25 - 0.6 * t);
        let wheel = model.robot.joints.len();
        run.drives[wheel].rad = series(|t| 3.0 + 5.0 * t);
        run.drives[wheel].target_rad_s = Series::constant(5.5);
        let start = Start::of(&run, &model);
        let Start { state, wheel_rad, .. } = &start;
        for (found, expected) in state.base_position_m.iter().zip([0.2, 0.0, HIGH_M]) {
            near(*found, expected, 1e-9);
        }
        for (found, expected) in state.base_velocity_m_s.iter().zip([0.5, -0.1, -0.3]) {
            near(*found, expected, 1e-9);
        }
        for (found, expected) in state.base_spin_rad_s.iter().zip([0.0, 0.0, 0.4]) {
            // Error of a parabola through a tenth of a second of a circle.
            near(*found, expected, 1e-4);
        }
        let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.3);
        assert!((state.world_from_body - turned.matrix()).norm() < 1e-6);
        near(state.joint_rad[1], 0.25, 1e-9);
        near(state.joint_rad_s[1], -0.6, 1e-9);
        near(state.joint_rad[0], model.robot.joints[0].nominal_rad, 1e-9);
        // The speed of a wheel is the commanded speed. Its measured angle is the origin of the simulated angle.
        near(state.wheel_rad_s[0], 5.5, 1e-9);
        near(wheel_rad[wheel], 3.0, 1e-9);
    }

    #[test]
    fn measured_speeds_and_a_gyro_come_before_slopes() {
        let model = SimulationModel::new(&robot("agilebot"));
        let mut run = recording(&model.robot);
        run.drives[0].rad_s = series(|_| 1.5);
        let wheel = model.robot.joints.len();
        run.drives[wheel].rad_s = series(|_| 4.0);
        run.drives[wheel].target_rad_s = Series::constant(9.0);
        // After a quarter turn to the left, a rotation about the body's x axis is a rotation about the world's y axis.
        let (half, none) = (std::f64::consts::FRAC_1_SQRT_2, || series(|_| 0.0));
        run.orientation = Some([series(|_| half), none(), none(), series(|_| half)]);
        run.gyro_rad_s = Some([series(|_| 0.7), none(), none()]);
        let state = Start::of(&run, &model).state;
        near(state.joint_rad_s[0], 1.5, 1e-9);
        near(state.wheel_rad_s[0], 4.0, 1e-9);
        assert!((state.base_spin_rad_s - Vector3::new(0.0, 0.7, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn where_only_speeds_of_joints_are_measured_they_begin_as_commanded() {
        let model = SimulationModel::new(&robot("agilebot"));
        let mut run = recording(&model.robot);
        run.drives[2].rad = Series::default();
        run.drives[2].target_rad = series(|t| 0.4 + t);
        assert_eq!(Start::of(&run, &model).state.joint_rad[2], 0.4);
    }

    #[test]
    fn a_robot_near_the_ground_stands_on_it_and_one_in_the_air_does_not() {
        let model = SimulationModel::new(&robot("agilebot"));
        let level: Arc<dyn Ground> = Arc::new(Plane::level());
        let clearance_m = |start: &Start| {
            World::new(&model.robot, &level, &model.parameters, &start.state).clearance_m()
        };
        let mut run = recording(&model.robot);
        // The height of the robot was not measured.
        let standing = Start::of(&run, &model);
        near(clearance_m(&standing), -DEPTH_M, 1e-9);
        assert_eq!(standing.state.world_from_body, Matrix3::identity());
        assert_eq!(standing.state.base_velocity_m_s, Vector3::zeros());
        let stands_m = standing.state.base_position_m.z;
        let mut at = |height_m: f64| {
            run.position_m = Some([series(|_| 0.0), series(|_| 0.0), series(|_| height_m)]);
            Start::of(&run, &model)
        };
        for off_m in [0.6 * NEAR_M, -0.6 * NEAR_M] {
            near(clearance_m(&at(stands_m + off_m)), -DEPTH_M, 1e-9);
        }
        let off_m = 2.0 * NEAR_M;
        near(at(stands_m + off_m).state.base_position_m.z, stands_m + off_m, 1e-9);
    }

    #[test]
    fn free_wheels_begin_as_they_roll() {
        let model = SimulationModel::new(&robot("swizzlebot2"));
        let mut run = recording(&model.robot);
        // The robot moves along its own x axis, which is the world's y axis.
        let (half, none) = (std::f64::consts::FRAC_1_SQRT_2, || series(|_| 0.0));
        run.orientation = Some([series(|_| half), none(), none(), series(|_| half)]);
        run.position_m = Some([none(), series(|t| 0.6 * t), series(|_| HIGH_M)]);
        let state = Start::of(&run, &model).state;
        let wheels = model.robot.end_effectors.iter().zip(&state.wheel_rad_s);
        let free = wheels.filter(|(of, _)| of.contact.freewheels());
        assert!(free.clone().count() > 0);
        free.for_each(|(of, rad_s)| near(*rad_s, 0.6 / of.radius_m, 1e-6));
    }

    #[test]
    fn what_was_not_measured_does_not_change_but_where_the_ground_tells_it() {
        let model = SimulationModel::new(&robot("agilebot"));
        let joints = model.robot.joints.len();
        let mut run = recording(&model.robot);
        // With motor data alone, the start has height, tilt, velocities and joints, but no position on the ground and no
        // heading.
        assert_eq!(Start::of(&run, &model).count(), 1 + 2 + 6 + joints);
        run.position_m = Some([series(|_| 0.0), series(|_| 0.0), series(|_| HIGH_M)]);
        assert_eq!(Start::of(&run, &model).count(), 3 + 2 + 6 + joints);
        let none = || series(|_| 0.0);
        run.orientation = Some([series(|_| 1.0), none(), none(), none()]);
        let start = Start::of(&run, &model);
        assert_eq!(start.count(), 3 + 3 + 6 + joints);
        // Each quantity is expected to change by its standard deviation. Such a change has a penalty of 1. The indices continue
        // after the quantities.
        let penalties = start.penalties(4);
        assert_eq!(penalties.len(), start.count());
        for (number, (of, (_, deviation))) in penalties.iter().zip(&start.freedoms).enumerate() {
            let [(place, factor)] = of.factors[..] else { panic!("{of:?}") };
            assert_eq!((place, of.target), (4 + number, 0.0));
            near(factor * deviation.expected / deviation.unit, 1.0, 1e-12);
        }
    }

    #[test]
    fn changes_move_the_start_along_their_freedoms() {
        let model = SimulationModel::new(&robot("agilebot"));
        let mut run = recording(&model.robot);
        run.position_m = Some([series(|_| 1.0), series(|_| 0.0), series(|_| HIGH_M)]);
        let start = Start::of(&run, &model);
        let none = vec![0.0; start.count()];
        assert_eq!(start.changed(&none), start.state);
        for (number, (freedom, deviation)) in start.freedoms.iter().enumerate() {
            let mut changes = none.clone();
            changes[number] = 0.1;
            let by = 0.1 * deviation.unit;
            let (from, to) = (&start.state, start.changed(&changes));
            let turned = to.world_from_body * from.world_from_body.transpose();
            let turned = log(&turned);
            let (found, expected) = match *freedom {
                StartCoordinate::Position(axis) => {
                    (to.base_position_m - from.base_position_m, axis)
                }
                StartCoordinate::Velocity(axis) => {
                    (to.base_velocity_m_s - from.base_velocity_m_s, axis)
                }
                StartCoordinate::Spin(axis) => (to.base_spin_rad_s - from.base_spin_rad_s, axis),
                StartCoordinate::Rotation(axis) => (turned, axis),
                StartCoordinate::Joint(joint) => {
                    (Vector3::x() * (to.joint_rad[joint] - from.joint_rad[joint]), Vector3::x())
                }
            };
            assert!((found - expected * by).norm() < 1e-9, "{freedom:?}: {found}");
        }
    }
}
