//! Sensors at a robot's body: an IMU at the origin of its root link, and contact switches.

use super::World;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_multibody::rotation;
use rollwalk_robot::GRAVITY_M_S2;

/// Part of the weight from which on an end effector counts as touching.
const TOUCHES: f64 = 0.005;

/// An IMU without errors.
#[derive(Clone, Copy, Debug, Default)]
pub struct Imu {
    /// Velocity of the IMU, m/s, and world from body at the last sample.
    last: Option<(Vector3<f64>, Matrix3<f64>)>,
}

/// Sample of an IMU, in the axes of the root link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Angular velocity, rad/s.
    pub gyro_rad_s: Vector3<f64>,
    /// Specific force, acceleration minus gravity, mean since the last sample, m/s²; none at the first.
    pub force_m_s2: Option<Vector3<f64>>,
}

impl Imu {
    /// Samples at the end of a step of `step_s` since the last sample.
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
    /// Contact switch of each end effector: true if closed.
    pub fn switches(&self) -> impl Iterator<Item = bool> {
        let mass_kg: f64 = self.system.bodies().iter().map(|body| body.mass_kg()).sum();
        let least_n = TOUCHES * mass_kg * GRAVITY_M_S2;
        self.touches().map(move |touch| touch.normal_n > least_n)
    }
}
