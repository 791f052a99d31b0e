//! Which way is up while a clip plays: what an IMU should see.

use super::records::AttitudeRecord;

/// Quantum of a direction's components.
const DIRECTION_LSB: f32 = 1.0 / 16384.0;
/// Quantum of the spread, rad.
const SPREAD_LSB_RAD: f32 = 1e-3;
/// Half a turn, in quanta: there is no larger spread.
const MAX_SPREAD: u16 = 3142;

/// The direction of "up" during a clip, and how far it strays from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attitude {
    /// Up, a unit vector in the body frame: x forward, y to the left, z to the robot's own top.
    pub up_body: [f32; 3],
    /// Largest angle between that and up at any frame of the clip, rad.
    pub spread_rad: f32,
}

impl Attitude {
    /// A level body.
    pub const LEVEL: Self = Self { up_body: [0.0, 0.0, 1.0], spread_rad: 0.0 };

    /// The nearest record; `None` for what is no direction or no angle of at most half a turn.
    pub(super) fn record(&self) -> Option<AttitudeRecord> {
        let nearest = |x: f32| (x / DIRECTION_LSB + if x < 0.0 { -0.5 } else { 0.5 }) as i16;
        let [up_x, up_y, up_z] = self.up_body.map(nearest);
        let spread = self.spread_rad / SPREAD_LSB_RAD + 0.5;
        // Casts saturate, and make 0 of a NaN; the sign of the spread is looked at here.
        let record = AttitudeRecord { up_x, up_y, up_z, spread: spread as u16 };
        (spread >= 0.5 && Self::of(&record).is_some()).then_some(record)
    }

    /// What a record says; `None` when that is no direction or more than half a turn.
    pub(super) fn of(record: &AttitudeRecord) -> Option<Self> {
        let up_body = [record.up_x, record.up_y, record.up_z].map(|x| f32::from(x) * DIRECTION_LSB);
        let length_squared = up_body.iter().map(|x| x * x).sum::<f32>();
        let sound = (length_squared - 1.0).abs() < 0.01 && record.spread <= MAX_SPREAD;
        sound.then_some(Self { up_body, spread_rad: f32::from(record.spread) * SPREAD_LSB_RAD })
    }
}
