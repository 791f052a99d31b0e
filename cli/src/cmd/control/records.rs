//! Lines exchanged with another simulator: validated JSON records (docs/tracking.md, "In your simulator").

use miette::{Context, IntoDiagnostic, miette};
use nalgebra::{Isometry3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use rollwalk_multibody::{ANGULAR, JOINTS, LINEAR, State, Tree};
use rollwalk_physics::motor::Law;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_simulate::closed_loop::TrackingError;
use rollwalk_tracking::Sensors;
use serde::{Deserialize, Serialize};

/// Maximum deviation of a quaternion's norm from 1.
const UNIT: f64 = 1e-3;

/// Maximum distance of a plan's origin from the origin of the world, m.
const FAR_M: f64 = 1e4;
/// Cosine of the maximum slope of a plan's ground, 45°.
const STEEP_COS: f64 = 0.7;

/// First line that the program writes.
#[derive(Serialize)]
pub struct Hello {
    format: &'static str,
    version: u32,
    robot: String,
    motion: String,
    tick_s: f64,
    /// Duration, s; the period of a periodic motion.
    duration_s: f64,
    repeats: bool,
    joints: Vec<String>,
    wheels: Vec<String>,
    end_effectors: Vec<String>,
    channels: Vec<String>,
    start: Start,
}

/// Planned state at time 0, in the axes of the plan.
#[derive(Serialize)]
struct Start {
    base: Base,
    #[serde(flatten)]
    encoders: Encoders,
}

impl Hello {
    /// Creates the first line for a validated plan.
    pub fn new(plan: &Plan, tick_s: f64) -> Self {
        let mut body = WholeBody::new(plan);
        let start = body.at(0.0, &Isometry3::identity()).state;
        let (robot, tree) = (&plan.robot, body.tree());
        let end_effectors: Vec<String> =
            robot.end_effectors.iter().map(|of| of.name.clone()).collect();
        let wheels = tree.wheels().iter().map(|wheel| end_effectors[wheel.end_effector].clone());
        Self {
            format: "rollwalk-control",
            version: 1,
            robot: robot.name.clone(),
            motion: plan.motion.name.clone(),
            tick_s,
            duration_s: plan.motion.duration_s,
            repeats: plan.motion.ends == Ends::Periodic,
            joints: robot.joints.iter().map(|joint| joint.name.clone()).collect(),
            wheels: wheels.collect(),
            channels: robot.channels().map(|channel| channel.name().to_owned()).collect(),
            start: Start { base: Base::of(&start), encoders: Encoders::of(&start, tree) },
            end_effectors,
        }
    }
}

/// Line from the simulator: measurements at the beginning of a tick.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Time of the motion, s. Later periods of a periodic motion continue the count.
    pub time_s: f64,
    /// True for each end effector on the ground.
    pub touches: Vec<bool>,
    /// Joint angles. An encoder without a valid reading sends `null`, because JSON has no NaN.
    joint_rad: Vec<Option<f64>>,
    joint_speed_rad_s: Vec<Option<f64>>,
    wheel_speed_rad_s: Vec<Option<f64>>,
    base: Option<Base>,
    imu: Option<Imu>,
    world_from_plan: Option<Pose>,
}

/// Angles and speeds of the joints, and speeds of the wheels.
#[derive(Serialize)]
struct Encoders {
    joint_rad: Vec<f64>,
    joint_speed_rad_s: Vec<f64>,
    /// Speeds of the spinning wheels, relative to their links.
    wheel_speed_rad_s: Vec<f64>,
}

/// Pose and velocity of the origin of the root link, in world axes with z up.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Base {
    position_m: [f64; 3],
    orientation_wxyz: [f64; 4],
    velocity_m_s: [f64; 3],
    angular_velocity_rad_s: [f64; 3],
}

/// IMU at the origin of the root link, in the axes of that link. Missing measurements are left out.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Imu {
    gyro_rad_s: Option<[f64; 3]>,
    /// Mean specific force since the previous tick: 9.81 m/s² upwards at rest.
    accelerometer_m_s2: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Pose {
    position_m: [f64; 3],
    orientation_wxyz: [f64; 4],
}

/// Sensor readings of a request, in the order of the tree.
pub struct SensorReadings<'a> {
    request: &'a Request,
    imu: &'a Imu,
    joint_rad: Vec<f64>,
    speed_rad_s: Vec<f64>,
}

impl SensorReadings<'_> {
    pub fn sensors(&self) -> Sensors<'_> {
        Sensors {
            gyro_rad_s: self.imu.gyro_rad_s.map(Vector3::from),
            accelerometer_m_s2: self.imu.accelerometer_m_s2.map(Vector3::from),
            joint_rad: &self.joint_rad,
            speed_rad_s: &self.speed_rad_s,
            touches: &self.request.touches,
        }
    }
}

impl Request {
    /// Parses a line.
    ///
    /// # Errors
    /// Returns an error if the line is not a valid record; the message contains the field.
    pub fn from_line(line: &str) -> miette::Result<Self> {
        let mut reader = serde_json::Deserializer::from_str(line);
        let request = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
            let path = error.path().to_string();
            let at = if path == "." { String::new() } else { format!("field {path}: ") };
            miette!(help = HELP, "{at}{}", error.inner())
        })?;
        reader.end().into_diagnostic().wrap_err("unexpected text after the record")?;
        Ok(request)
    }

    /// Transform from plan to world; `None` if the record has none.
    ///
    /// # Errors
    /// Returns an error if the orientation is not a unit quaternion, if the ground is steeper than 45°, or if the position is
    /// too far from the origin.
    pub fn world_from_plan(&self) -> miette::Result<Option<Isometry3<f64>>> {
        let Some(pose) = &self.world_from_plan else { return Ok(None) };
        let turn = rotation("world_from_plan.orientation_wxyz", pose.orientation_wxyz)?;
        let position_m = Vector3::from(pose.position_m);
        if position_m.norm() > FAR_M {
            return Err(miette!(
                "field world_from_plan.position_m is {:?}; expected at most {FAR_M} m from the origin",
                pose.position_m
            ));
        }
        if (turn * Vector3::z()).z < STEEP_COS {
            return Err(miette!(
                "field world_from_plan.orientation_wxyz is {:?}: the ground is steeper than 45°",
                pose.orientation_wxyz
            ));
        }
        Ok(Some(Isometry3::from_parts(Translation3::from(position_m), turn)))
    }

    /// Measured state; `None` if the record has no base.
    ///
    /// # Errors
    /// Returns an error if the record does not match the robot, or if the orientation is not a unit quaternion.
    pub fn state(&self, tree: &Tree) -> miette::Result<Option<State>> {
        let speed_rad_s = self.speeds(tree)?;
        let Some(base) = &self.base else { return Ok(None) };
        let turn = rotation("base.orientation_wxyz", base.orientation_wxyz)?;
        let mut velocity = [base.velocity_m_s, base.angular_velocity_rad_s].concat();
        velocity.extend(speed_rad_s);
        Ok(Some(State {
            base_position_m: base.position_m.into(),
            world_from_body: turn.to_rotation_matrix().into_inner(),
            joint_rad: readings(&self.joint_rad).collect(),
            velocity,
        }))
    }

    /// True if the record has an IMU.
    pub fn has_imu(&self) -> bool {
        self.imu.is_some()
    }

    /// Sensor readings. A record without an IMU gives no IMU readings.
    ///
    /// # Errors
    /// Returns an error if the record does not match the robot.
    pub fn sensors(&self, tree: &Tree) -> miette::Result<SensorReadings<'_>> {
        let imu = self.imu.as_ref().unwrap_or(&Imu { gyro_rad_s: None, accelerometer_m_s2: None });
        let speed_rad_s = self.speeds(tree)?;
        let joint_rad = readings(&self.joint_rad).collect();
        Ok(SensorReadings { request: self, imu, joint_rad, speed_rad_s })
    }

    /// Speeds of the joints and wheels, checked against the robot.
    fn speeds(&self, tree: &Tree) -> miette::Result<Vec<f64>> {
        let (robot, joints) = (tree.robot(), self.joint_rad.len());
        for (field, count, wanted, what) in [
            ("joint_rad", joints, robot.joints.len(), "joints"),
            ("joint_speed_rad_s", self.joint_speed_rad_s.len(), robot.joints.len(), "joints"),
            ("wheel_speed_rad_s", self.wheel_speed_rad_s.len(), tree.wheels().len(), "wheels"),
            ("touches", self.touches.len(), robot.end_effectors.len(), "end effectors"),
        ] {
            if count != wanted {
                return Err(miette!(
                    help = HELP,
                    "field {field} has {count} entries; {} has {wanted} {what}",
                    robot.name
                ));
            }
        }
        Ok(readings(&self.joint_speed_rad_s).chain(readings(&self.wheel_speed_rad_s)).collect())
    }
}

fn readings(of: &[Option<f64>]) -> impl Iterator<Item = f64> {
    of.iter().map(|reading| reading.unwrap_or(f64::NAN))
}

const HELP: &str =
    "give the fields that docs/tracking.md lists, in the order of the first line of output";

/// Converts a unit quaternion to a rotation.
fn rotation(field: &str, wxyz: [f64; 4]) -> miette::Result<UnitQuaternion<f64>> {
    let [w, x, y, z] = wxyz;
    let quaternion = Quaternion::new(w, x, y, z);
    if (quaternion.norm() - 1.0).abs() > UNIT {
        let norm = quaternion.norm();
        return Err(miette!("field {field} has length {norm}; expected a quaternion of length 1"));
    }
    Ok(UnitQuaternion::from_quaternion(quaternion))
}

impl Base {
    fn of(state: &State) -> Self {
        let turn = Rotation3::from_matrix_unchecked(state.world_from_body);
        let turn = UnitQuaternion::from_rotation_matrix(&turn);
        let three = |from: usize| [0, 1, 2].map(|of| state.velocity[from + of]);
        Self {
            position_m: state.base_position_m.into(),
            orientation_wxyz: [turn.w, turn.i, turn.j, turn.k],
            velocity_m_s: three(LINEAR),
            angular_velocity_rad_s: three(ANGULAR),
        }
    }
}

impl Encoders {
    fn of(state: &State, tree: &Tree) -> Self {
        let (joints, wheels) = state.velocity[JOINTS..].split_at(tree.first_wheel_dof() - JOINTS);
        Self {
            joint_rad: state.joint_rad.clone(),
            joint_speed_rad_s: joints.to_vec(),
            wheel_speed_rad_s: wheels.to_vec(),
        }
    }
}

/// Answer to a line: set-points of all channels until the next tick.
#[derive(Serialize)]
pub struct Setpoints {
    time_s: f64,
    /// Reason why the set-points are those of the plan in open loop or of its stop; null while the robot is tracked.
    untracked: Option<String>,
    position_rad: Vec<f64>,
    speed_rad_s: Vec<f64>,
    torque_nm: Vec<f64>,
    kp_nm_rad: Vec<f64>,
    kd_nm_s_rad: Vec<f64>,
}

impl Setpoints {
    pub fn new(time_s: f64, laws: &[Law], untracked: Option<TrackingError>) -> Self {
        let each = |of: fn(&Law) -> f64| laws.iter().map(of).collect();
        Self {
            time_s,
            untracked: untracked.map(|why| why.to_string()),
            position_rad: each(|law| law.position_rad),
            speed_rad_s: each(|law| law.speed_rad_s),
            torque_nm: each(|law| law.torque_nm),
            kp_nm_rad: each(|law| law.kp_nm_rad),
            kd_nm_s_rad: each(|law| law.kd_nm_s_rad),
        }
    }
}
