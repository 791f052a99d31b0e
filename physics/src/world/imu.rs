//! Sensors on a robot: an IMU at the origin of its root link, and contact switches.

use super::World;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_multibody::rotation;
use rollwalk_robot::GRAVITY_M_S2;

/// Normal force that closes a contact switch, as a fraction of the weight.
const TOUCHES: f64 = 0.005;

/// Ideal IMU.
#[derive(Clone, Copy, Debug, Default)]
pub struct Imu {
    /// Velocity of the IMU, m/s, and its rotation to world axes, both at the previous sample.
    last: Option<(Vector3<f64>, Matrix3<f64>)>,
}

/// Sample of an IMU, in the axes of the root link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Angular velocity, rad/s.
    pub gyro_rad_s: Vector3<f64>,
    /// Specific force (acceleration minus gravity), averaged since the previous sample, m/s²; `None` at the first sample.
    pub force_m_s2: Option<Vector3<f64>>,
}

impl Imu {
    /// Samples the IMU at the end of a step. `step_s` is the time since the previous sample.
    pub fn sample(&mut self, world: &World, step_s: f64) -> ImuSample {
        let (velocity_m_s, spin_rad_s) = world.base_velocity();
        let (_, world_from_body) = world.base();
        let now = (velocity_m_s, world_from_body);
        let force_m_s2 = self.last.replace(now).map(|(before_m_s, before)| {
            let turn = before.tr_mul(&world_from_body);
            let midway = before * Rotation3::new(rotation::log(&turn) / 2.0).matrix();
            let acceleration = (velocity_m_s - before_m_s) / step_s;
            midway.tr_mul(&(acceleration + Vector3::z() * GRAVITY_M_S2))
        });
        ImuSample { gyro_rad_s: world_from_body.tr_mul(&spin_rad_s), force_m_s2 }
    }
}

impl World {
    /// Contact switches of the end effectors: true if closed.
    pub fn switches(&self) -> impl Iterator<Item = bool> {
        let mass_kg: f64 = self.system.bodies().iter().map(|body| body.mass_kg()).sum();
        let least_n = TOUCHES * mass_kg * GRAVITY_M_S2;
        self.touches().map(move |touch| touch.normal_n > least_n)
    }
}
