//! Direction of up while a clip plays, as an IMU would measure it.

use super::records::AttitudeRecord;

/// Quantum of a direction's components.
const DIRECTION_LSB: f32 = 1.0 / 16384.0;
/// Quantum of the spread, rad.
const SPREAD_LSB_RAD: f32 = 1e-3;
/// Limit of the tilt of the body in a clip, rad. Tilt is the angle between the direction of up and the robot's z axis, plus the
/// spread of that direction. A larger limit would make tilt protection useless, since a robot that leans further lies on the
/// ground.
pub const MAX_TILT_RAD: f32 = core::f32::consts::FRAC_PI_3;

/// Direction of up during a clip, with its spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// Direction of up, a unit vector in the body frame: x forward, y to the left, z to the robot's top.
    pub up_body: [f32; 3],
    /// Largest angle between `up_body` and up in any frame of the clip, rad.
    pub spread_rad: f32,
}

impl Attitude {
    /// Attitude of a level body.
    pub const LEVEL: Self = Self { up_body: [0.0, 0.0, 1.0], spread_rad: 0.0 };

    /// Nearest record. `None` unless `up_body` is a unit vector, `spread_rad` is an angle from 0 up, and the tilt is within
    /// [`MAX_TILT_RAD`].
    pub(super) fn record(&self) -> Option<AttitudeRecord> {
        let nearest = |x: f32| (x / DIRECTION_LSB + if x < 0.0 { -0.5 } else { 0.5 }) as i16;
        let [up_x, up_y, up_z] = self.up_body.map(nearest);
        let spread = self.spread_rad / SPREAD_LSB_RAD + 0.5;
        // Casts saturate and turn NaN into 0. The sign of the spread is checked here.
        let record = AttitudeRecord { up_x, up_y, up_z, spread: spread as u16 };
        (spread >= 0.5 && Self::of(&record).is_some()).then_some(record)
    }

    /// Attitude of a record; `None` if its direction is not a unit vector, or if its tilt is beyond [`MAX_TILT_RAD`].
    pub(super) fn of(record: &AttitudeRecord) -> Option<Self> {
        let up_body = [record.up_x, record.up_y, record.up_z].map(|x| f32::from(x) * DIRECTION_LSB);
        let length_squared = up_body.iter().map(|x| x * x).sum::<f32>();
        let spread_rad = f32::from(record.spread) * SPREAD_LSB_RAD;
        let sound = (length_squared - 1.0).abs() < 0.01
            && spread_rad <= MAX_TILT_RAD
            && up_body[2] >= cosine(MAX_TILT_RAD - spread_rad);
        sound.then_some(Self { up_body, spread_rad })
    }
}

/// Cosine of an angle from 0 to [`MAX_TILT_RAD`], at most 0.002 too large.
fn cosine(angle_rad: f32) -> f32 {
    let square = angle_rad * angle_rad;
    1.0 - square / 2.0 + square * square / 24.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Tests a tilt and a spread of any size: [`MAX_TILT_RAD`] limits their sum.
        #[test]
        fn what_tilts_further_than_a_robot_stands_is_no_attitude(
            tilt in 0.0..3.1_f32, spread in 0.0..3.1_f32, about in 0.0..6.3_f32,
        ) {
            let up_body = [tilt.sin() * about.cos(), tilt.sin() * about.sin(), tilt.cos()];
            let attitude = Attitude { up_body, spread_rad: spread };
            // Quanta of both, and the cosine.
            let margin_rad = 0.004;
            match attitude.record() {
                Some(record) => {
                    prop_assert!(tilt + spread < MAX_TILT_RAD + margin_rad);
                    prop_assert!(Attitude::of(&record).is_some());
                }
                None => prop_assert!(tilt + spread > MAX_TILT_RAD - margin_rad),
            }
        }
    }
}
