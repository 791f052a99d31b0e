//! Readings of a robot's sensors at a tick.

use nalgebra::Vector3;

/// Sensor readings of a tick.
#[derive(Clone, Copy, Debug)]
pub struct Sensors<'a> {
    /// Angular velocity of the root link in its own axes, rad/s; `None` without a sample of the IMU.
    pub gyro_rad_s: Option<Vector3<f64>>,
    /// Mean specific force at the origin of the root link since the previous tick, in its own axes, m/s²; `None` without a
    /// sample of the IMU.
    ///
    /// The specific force is acceleration minus gravity: at rest 9.81 m/s² upwards.
    pub accelerometer_m_s2: Option<Vector3<f64>>,
    /// Joint angles in joint order, rad.
    pub joint_rad: &'a [f64],
    /// Speeds of the joints, then of all spinning wheels relative to their links, rad/s: ν without the base.
    pub speed_rad_s: &'a [f64],
    /// Contact of each end effector: true if it touches the ground.
    pub touches: &'a [bool],
}
