//! Readings of a robot's sensors at a tick.

use nalgebra::Vector3;

/// Readings of a tick.
#[derive(Clone, Copy, Debug)]
pub struct Sensors<'a> {
    /// Angular velocity of the root link in its own axes, rad/s; `None` if the IMU gave none.
    pub gyro_rad_s: Option<Vector3<f64>>,
    /// Specific force at the origin of the root link in its axes (acceleration minus gravity: at rest 9.81 m/s² upwards), mean
    /// since the last tick, m/s²; `None` if the IMU gave none.
    pub accelerometer_m_s2: Option<Vector3<f64>>,
    /// Angles in joint order, rad.
    pub joint_rad: &'a [f64],
    /// Speeds of the joints, then of all spinning wheels relative to their links, rad/s: ν without the base.
    pub speed_rad_s: &'a [f64],
    /// Contact of each end effector: true if it touches the ground.
    pub touches: &'a [bool],
}
