//! Sensors of a simulated robot: an IMU at the origin of the root link, encoders, and contact switches.

use fastrand::Rng;
use nalgebra::Vector3;
use rollwalk_multibody::{JOINTS, Tree};
use rollwalk_physics::World;
use rollwalk_physics::world::Imu;
use rollwalk_tracking::Sensors;
use std::f64::consts::TAU;

/// Errors of sensors: standard deviations of white noise in each sample, and a gyro bias. The default is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Standard deviation of the gyro, rad/s.
    pub gyro_rad_s: f64,
    /// Bias of the gyro in body axes, rad/s.
    pub gyro_bias_rad_s: Vector3<f64>,
    /// Standard deviation of the accelerometer, m/s².
    pub accelerometer_m_s2: f64,
    /// Standard deviation of the speeds of joints and wheels, rad/s.
    pub speed_rad_s: f64,
}

/// Sensor fault that begins during a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorFault {
    /// Start of the fault, s since the start of the run.
    pub from_s: f64,
    /// Kind of fault.
    pub kind: SensorFaultKind,
}

/// Kind of sensor fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SensorFaultKind {
    /// Loss of the IMU.
    NoImu,
    /// Gyro bias about every axis, rad/s.
    GyroBias(f64),
    /// Accelerometer bias along every axis, m/s².
    AccelerometerBias(f64),
    /// Gyro that measures NaN.
    GyroNan,
    /// Error of a single gyro sample about every axis, rad/s.
    GyroSpike(f64),
    /// Error of a single accelerometer sample along every axis, m/s².
    AccelerometerSpike(f64),
    /// Encoder of a joint that measures NaN.
    EncoderNan(usize),
    /// Encoder of a joint with an offset, rad, as after a lost turn. The simulated drive still uses the true angle.
    EncoderOff(usize, f64),
    /// Encoder of a joint whose reading is frozen. The simulated drive still uses the true angle.
    EncoderStuck(usize),
    /// Contact switch of an end effector that is stuck closed, `true`, or open.
    SwitchStuck(usize, bool),
    /// Contact switches of all end effectors that are stuck closed, `true`, or open.
    AllSwitchesStuck(bool),
}

/// Simulated sensors of a robot, with the samples of a step.
#[derive(Clone, Debug)]
pub struct SimulatedSensors {
    tree: Tree,
    noise: Noise,
    random: Rng,
    fault: Option<SensorFault>,
    /// Time since the first sample, s.
    time_s: f64,
    imu: Imu,
    joint_rad: Vec<f64>,
    speed_rad_s: Vec<f64>,
    touches: Vec<bool>,
}

impl Noise {
    /// Noise of an IMU that costs a few euros, and of magnetic encoders.
    pub const USUAL: Self = Self {
        gyro_rad_s: 0.02,
        gyro_bias_rad_s: Vector3::new(0.005, -0.005, 0.005),
        accelerometer_m_s2: 0.1,
        speed_rad_s: 0.05,
    };
}

impl SimulatedSensors {
    /// Creates the sensors of a robot whose model `tree` has turning wheels. Equal seeds yield equal noise.
    pub fn new(tree: Tree, noise: Noise, seed: u64) -> Self {
        Self {
            tree,
            noise,
            random: Rng::with_seed(seed),
            fault: None,
            time_s: 0.0,
            imu: Imu::default(),
            joint_rad: Vec::new(),
            speed_rad_s: Vec::new(),
            touches: Vec::new(),
        }
    }

    /// Sets the fault of the sensors.
    pub fn with_fault(mut self, fault: Option<SensorFault>) -> Self {
        self.fault = fault;
        self
    }

    /// Samples the sensors at the end of a step of `step_s`.
    ///
    /// The specific force is the mean over the step; the first sample contains no specific force.
    pub fn sample(&mut self, world: &World, step_s: f64) -> Sensors<'_> {
        let state = world.state(&self.tree);
        let Noise { gyro_rad_s, gyro_bias_rad_s, accelerometer_m_s2, speed_rad_s } = self.noise;
        let exact = self.imu.sample(world, step_s);
        let mut force = exact.force_m_s2;
        let mut noise = |deviation: f64| deviation * normal(&mut self.random);
        let turning = exact.gyro_rad_s + gyro_bias_rad_s;
        let mut gyro_rad_s = Some(turning.map(|rate| rate + noise(gyro_rad_s)));
        force = force.map(|force| force.map(|along| along + noise(accelerometer_m_s2)));
        let stuck_rad = std::mem::replace(&mut self.joint_rad, state.joint_rad);
        self.speed_rad_s.clear();
        let speeds = state.velocity[JOINTS..].iter();
        self.speed_rad_s.extend(speeds.map(|speed| speed + noise(speed_rad_s)));
        self.touches.clear();
        self.touches.extend(world.switches());
        let fault = self.fault.filter(|fault| self.time_s >= fault.from_s);
        let is_first = fault.is_some_and(|fault| self.time_s - step_s < fault.from_s);
        let broken = fault.map(|fault| fault.kind);
        self.time_s += step_s;
        match broken {
            None => {}
            Some(SensorFaultKind::NoImu) => (gyro_rad_s, force) = (None, None),
            Some(SensorFaultKind::GyroBias(bias)) => {
                gyro_rad_s = gyro_rad_s.map(|rate| rate.add_scalar(bias));
            }
            Some(SensorFaultKind::AccelerometerBias(bias)) => {
                force = force.map(|force| force.add_scalar(bias));
            }
            Some(SensorFaultKind::GyroSpike(off)) => {
                gyro_rad_s =
                    gyro_rad_s.map(|rate| if is_first { rate.add_scalar(off) } else { rate });
            }
            Some(SensorFaultKind::AccelerometerSpike(off)) => {
                force = force.map(|force| if is_first { force.add_scalar(off) } else { force });
            }
            Some(SensorFaultKind::GyroNan) => gyro_rad_s = Some(Vector3::repeat(f64::NAN)),
            Some(SensorFaultKind::EncoderNan(joint)) => self.joint_rad[joint] = f64::NAN,
            Some(SensorFaultKind::EncoderOff(joint, off_rad)) => self.joint_rad[joint] += off_rad,
            Some(SensorFaultKind::EncoderStuck(joint)) => {
                if let Some(&rad) = stuck_rad.get(joint) {
                    self.joint_rad[joint] = rad;
                }
                self.speed_rad_s[joint] = 0.0;
            }
            Some(SensorFaultKind::SwitchStuck(switch, value)) => self.touches[switch] = value,
            Some(SensorFaultKind::AllSwitchesStuck(value)) => self.touches.fill(value),
        }
        Sensors {
            gyro_rad_s,
            accelerometer_m_s2: force,
            joint_rad: &self.joint_rad,
            speed_rad_s: &self.speed_rad_s,
            touches: &self.touches,
        }
    }
}

/// Draws from the standard normal distribution (Box–Muller).
pub(crate) fn normal(random: &mut Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (TAU * random.f64()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_normal() {
        let mut random = Rng::with_seed(1);
        let samples: Vec<f64> = (0..100_000).map(|_| normal(&mut random)).collect();
        let moment = |power: i32| samples.iter().map(|x| x.powi(power)).sum::<f64>() / 1e5;
        // Standard deviations of the moments with this number of samples: 0.003, 0.0045, 0.03.
        assert!(moment(1).abs() < 0.01 && (moment(2) - 1.0).abs() < 0.02, "{}", moment(2));
        assert!((moment(4) - 3.0).abs() < 0.1, "{}", moment(4));
    }
}
