//! Detection of a robot that stands still, from its sensors alone.

use crate::sensors::Sensors;
use nalgebra::Vector3;
use rollwalk_robot::GRAVITY_M_S2;

/// Time constant of the low-pass filters, s.
const MEAN_S: f64 = 0.1;
/// Largest mean speed of a joint or wheel at rest, rad/s: ten standard deviations of encoder noise after filtering.
const SPEED_RAD_S: f64 = 0.05;
/// Largest mean gyro reading at rest, and largest deviation of a sample from the mean, rad/s. The margin allows for bias and
/// noise.
const GYRO_RAD_S: f64 = 0.1;
/// Largest difference between the mean specific force at rest and gravity, m/s².
const FORCE_M_S2: f64 = 0.5;

/// Detector of a robot that stands still, with low-passed sensors.
#[derive(Clone, Debug)]
pub struct RestDetector {
    /// Mean gyro reading in body axes, rad/s.
    pub gyro_rad_s: Vector3<f64>,
    /// Mean specific force in body axes, m/s².
    pub force_m_s2: Vector3<f64>,
    /// Mean speeds of joints and wheels, rad/s.
    speed_rad_s: Vec<f64>,
    /// Time for which the robot has stood still, s.
    pub lasts_s: f64,
}

impl RestDetector {
    pub fn new(speeds: usize) -> Self {
        let zero = Vector3::zeros();
        Self { gyro_rad_s: zero, force_m_s2: zero, speed_rad_s: vec![0.0; speeds], lasts_s: 0.0 }
    }

    /// Adds a tick with an IMU sample. Ticks without a sample are not added.
    pub fn tick(
        &mut self,
        gyro_rad_s: &Vector3<f64>,
        force_m_s2: &Vector3<f64>,
        sensors: &Sensors<'_>,
        tick_s: f64,
    ) {
        let gain = (tick_s / MEAN_S).min(1.0);
        self.gyro_rad_s += (gyro_rad_s - self.gyro_rad_s) * gain;
        self.force_m_s2 += (force_m_s2 - self.force_m_s2) * gain;
        for (mean, speed) in self.speed_rad_s.iter_mut().zip(sensors.speed_rad_s) {
            *mean += (speed - *mean) * gain;
        }
        let is_still = sensors.touches.contains(&true)
            && self.speed_rad_s.iter().all(|mean| mean.abs() < SPEED_RAD_S)
            && self.gyro_rad_s.norm() < GYRO_RAD_S
            && (gyro_rad_s - self.gyro_rad_s).norm() < GYRO_RAD_S
            && (self.force_m_s2.norm() - GRAVITY_M_S2).abs() < FORCE_M_S2;
        self.lasts_s = if is_still { self.lasts_s + tick_s } else { 0.0 };
    }
}
