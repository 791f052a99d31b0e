//! Measurements of an IMU and of contact switches, collected until the next [sample](crate::track).

use rollwalk_protocol::wire::{Accelerometer, Gyro, SampleAnswer};

/// Measurements since the latest sample.
#[derive(Clone, Debug, Default)]
pub(crate) struct Imu {
    gyro_rad_s: Option<[f32; 3]>,
    /// Sum of the specific forces, m/s².
    forces_m_s2: [f32; 3],
    /// Number of measurements in the sum.
    count: u16,
    contacts: Option<u32>,
    /// Content of the latest sample, which is being sent.
    sampled: SampleContent,
}

/// Content of a sample, without its joints.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SampleContent {
    pub gyro: Option<Gyro>,
    pub accelerometer: Option<Accelerometer>,
    /// Contacts of end effectors, a bit each.
    pub contacts: Option<u32>,
    /// Answer in force.
    pub answered: Option<SampleAnswer>,
}

impl Imu {
    /// Records angular velocity, rad/s, and specific force, m/s², in body axes. Ignores measurements with NaN or infinite
    /// values.
    pub fn observe(&mut self, gyro_rad_s: [f32; 3], force_m_s2: [f32; 3]) {
        if gyro_rad_s.iter().chain(&force_m_s2).all(|value| value.is_finite()) {
            self.gyro_rad_s = Some(gyro_rad_s);
            if self.count == u16::MAX {
                return;
            }
            for (sum, force) in self.forces_m_s2.iter_mut().zip(force_m_s2) {
                *sum += force;
            }
            self.count += 1;
        }
    }

    /// Records the end effectors in contact with the ground, a bit each.
    pub fn observe_contacts(&mut self, contacts: u32) {
        self.contacts = Some(contacts);
    }

    /// Moves the measurements and the answer in force into a new sample. The next sample contains only later measurements.
    pub fn sample(&mut self, answered: Option<SampleAnswer>) {
        let count = f32::from(self.count);
        let mean = (self.count > 0).then(|| self.forces_m_s2.map(|sum| sum / count));
        self.sampled = SampleContent {
            gyro: self.gyro_rad_s.take().map(|rad_s| Gyro { rad_s }),
            accelerometer: mean.map(|m_s2| Accelerometer { m_s2 }),
            contacts: self.contacts.take(),
            answered,
        };
        (self.forces_m_s2, self.count) = ([0.0; 3], 0);
    }

    /// Content of the latest sample, without its joints.
    pub fn sampled(&self) -> SampleContent {
        self.sampled
    }
}
