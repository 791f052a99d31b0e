//! Velocity that is commanded on `cmd_vel`: converts messages and time to steering. A command expires after a timeout, so that
//! the robot stops when commands cease.

use crate::messages::Twist;
use rollwalk_pilot::{Fastest, Steering};

/// Minimum interval between two reported refusals, µs; commands arrive many times a second.
const SAID_AGAIN_US: u64 = 5_000_000;

/// Velocity command with its age on arrival.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Velocity {
    pub twist: Twist,
    /// Age according to the stamp, ns; 0 without a stamp, negative if the sender's clock is ahead.
    pub age_ns: i64,
}

#[derive(Clone, Copy, Debug)]
pub struct Commanded {
    fastest: Fastest,
    timeout_us: u64,
    /// Current steering, and the time at which it expires, µs.
    last: Option<(Steering, u64)>,
    /// Time from which the next refusal is reported, µs.
    said_again_us: u64,
}

impl Commanded {
    /// Creates the state without a command.
    pub fn new(fastest: Fastest, timeout_s: f64) -> Self {
        Self { fastest, timeout_us: (timeout_s * 1e6) as u64, last: None, said_again_us: 0 }
    }

    /// Replaces the command. A command that cannot be followed stops the robot.
    ///
    /// # Errors
    /// Returns the reason for the log if the command cannot be followed.
    pub fn command(&mut self, now_us: u64, velocity: Velocity) -> Result<(), String> {
        let Velocity { twist, age_ns } = velocity;
        let parts = [twist.linear.x, twist.linear.y, twist.angular.z];
        let age_us = u64::try_from(age_ns / 1_000).unwrap_or(0);
        let why = if parts.iter().any(|part| !part.is_finite()) {
            "a component is not a finite number".to_owned()
        } else if age_us > self.timeout_us {
            format!(
                "its stamp is {:.1} s old; synchronise the clocks of both computers",
                age_us as f64 * 1e-6
            )
        } else {
            let [forward_m_s, left_m_s, turn_rad_s] = parts;
            let steering = Steering { forward_m_s, left_m_s, turn_rad_s };
            let until_us = now_us + self.timeout_us - age_us;
            self.last = Some((self.fastest.limit(steering), until_us));
            return Ok(());
        };
        self.last = None;
        if now_us < self.said_again_us {
            return Ok(());
        }
        self.said_again_us = now_us + SAID_AGAIN_US;
        Err(format!("a velocity is ignored, and the robot stops: {why}"))
    }

    /// Current steering; rest if the command has expired.
    pub fn steering(&self, now_us: u64) -> Steering {
        let last = self.last.filter(|(_, until_us)| now_us < *until_us);
        last.map(|(steering, _)| steering).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::Vector3;

    const MS: u64 = 1_000;
    const FASTEST: Fastest = Fastest { speed_m_s: 0.2, turn_rad_s: 0.4 };

    fn commanded() -> Commanded {
        Commanded::new(FASTEST, 0.5)
    }

    fn velocity(x: f64, y: f64, turn: f64) -> Velocity {
        let twist = Twist {
            linear: Vector3 { x, y, z: 9.0 },
            angular: Vector3 { x: 9.0, y: 9.0, z: turn },
        };
        Velocity { twist, age_ns: 0 }
    }

    fn steering(forward_m_s: f64, left_m_s: f64, turn_rad_s: f64) -> Steering {
        Steering { forward_m_s, left_m_s, turn_rad_s }
    }

    #[test]
    fn the_newest_command_counts_until_it_is_too_old() {
        let mut commanded = commanded();
        assert_eq!(commanded.steering(0), Steering::default());
        commanded.command(1_000 * MS, velocity(0.1, 0.0, 0.3)).unwrap();
        commanded.command(1_300 * MS, velocity(0.1, -0.05, 0.0)).unwrap();
        assert_eq!(commanded.steering(1_799 * MS), steering(0.1, -0.05, 0.0));
        assert_eq!(commanded.steering(1_800 * MS), Steering::default());
    }

    #[test]
    fn no_command_is_faster_than_the_robot_may_be() {
        let mut commanded = commanded();
        commanded.command(0, velocity(3.0, -3.0, -3.0)).unwrap();
        assert_eq!(commanded.steering(0), steering(0.2, -0.2, -0.4));
    }

    #[test]
    fn a_command_that_cannot_be_followed_stops_the_robot_and_is_said_now_and_then() {
        for broken in [
            velocity(f64::NAN, 0.0, 0.0),
            velocity(0.0, f64::INFINITY, 0.0),
            velocity(0.0, 0.0, f64::NEG_INFINITY),
            Velocity { age_ns: 501_000_000, ..velocity(0.1, 0.0, 0.0) },
        ] {
            let mut commanded = commanded();
            commanded.command(0, velocity(0.1, 0.0, 0.0)).unwrap();
            let why = commanded.command(MS, broken).unwrap_err();
            assert!(why.starts_with("a velocity is ignored, and the robot stops: "), "{why}");
            assert_eq!(commanded.steering(MS), Steering::default(), "{why}");
            assert_eq!(commanded.command(2 * MS, broken), Ok(()));
            assert!(commanded.command(6_000 * MS, broken).is_err());
        }
    }

    #[test]
    fn a_stamped_command_counts_from_its_stamp_on() {
        let mut commanded = commanded();
        let old = Velocity { age_ns: 400_000_000, ..velocity(0.1, 0.0, 0.0) };
        commanded.command(1_000 * MS, old).unwrap();
        assert_eq!(commanded.steering(1_099 * MS), steering(0.1, 0.0, 0.0));
        assert_eq!(commanded.steering(1_100 * MS), Steering::default());
        // A command with a time in the future is valid as long as a command that was just made.
        let ahead = Velocity { age_ns: -3_000_000_000, ..velocity(0.1, 0.0, 0.0) };
        commanded.command(2_000 * MS, ahead).unwrap();
        assert_eq!(commanded.steering(2_499 * MS), steering(0.1, 0.0, 0.0));
        assert_eq!(commanded.steering(2_500 * MS), Steering::default());
    }
}
