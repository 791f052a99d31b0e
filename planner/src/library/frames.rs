//! Frames of a plan in a library: one value per channel, within the channel's limits and rate limit.

use super::{LibraryError, frames};
use crate::families::{Family, PlayedTolerance};
use crate::plan::Plan;
use crate::sample::Setpoints;
use crate::torque::InverseDynamics;
use rollwalk_protocol::config::{Channel, ChannelKind, RobotConfig};
use rollwalk_protocol::library::RATE_HZ;
use rollwalk_robot::Robot;

/// Channels of a robot.
pub struct Channels<'a> {
    /// Robot, for the names in messages.
    pub robot: &'a Robot,
    /// Configuration with the limits in channel order.
    pub config: &'a RobotConfig,
}

/// Plan sampled at 60 Hz.
pub struct Clip {
    /// Name for messages.
    pub name: String,
    /// Set-points of the plan.
    pub setpoints: Vec<Setpoints>,
    /// Stored values: frame after frame, one value per channel, within limits.
    pub values: Vec<f32>,
    /// Torques of the channels at the same frames, N·m, within limits. Empty if the library contains no torques.
    pub torques_nm: Vec<f32>,
    /// Largest excess that was clamped to a limit, as a fraction of the tolerance.
    pub clamped: f64,
}

impl Channels<'_> {
    /// Samples a plan and checks it against the limits. Adds motor torques if `torques` is true.
    pub fn clip(&self, name: &str, plan: &Plan, torques: bool) -> Result<Clip, LibraryError> {
        if plan.robot.without_body_points() != *self.robot {
            return Err(LibraryError::OtherRobot {
                motion: name.to_owned(),
                found: plan.robot.name.clone(),
                expected: self.robot.name.clone(),
            });
        }
        let setpoints = frames(plan)?;
        let mut values = Vec::with_capacity(setpoints.len() * self.config.channels.len());
        let mut clamped: f64 = 0.0;
        // Planned and stored values of the previous frame.
        let mut previous: Option<(Vec<f64>, Vec<f32>)> = None;
        for (frame, at) in setpoints.iter().enumerate() {
            let planned: Vec<f64> = at.channels(self.robot).collect();
            for (c, channel) in self.config.channels.iter().enumerate() {
                let place = ValueLocation { name, frame, channel: c };
                let (mut value, part) = self.within(&place, channel, planned[c])?;
                if let Some((before, stored)) = &previous {
                    self.check_rate(&place, channel, planned[c] - before[c])?;
                    let step = channel.max_rate / RATE_HZ as f32 + QUANTUM as f32;
                    value = value.clamp(stored[c] - step, stored[c] + step);
                }
                clamped = clamped.max(part);
                values.push(value);
            }
            let stored = values[values.len() - planned.len()..].to_vec();
            previous = Some((planned, stored));
        }
        let torques_nm = if torques { self.torques_nm(plan, setpoints.len()) } else { Vec::new() };
        Ok(Clip { name: name.to_owned(), setpoints, values, torques_nm, clamped })
    }

    /// Motor torques at the frames of a plan.
    fn torques_nm(&self, plan: &Plan, frames: usize) -> Vec<f32> {
        let mut inverse = InverseDynamics::new(plan);
        let at = |frame: usize| inverse.at(frame as f64 / f64::from(RATE_HZ));
        let clamped = |(channel, torque_nm): (&Channel, f64)| {
            (torque_nm as f32).clamp(-channel.max_torque_nm, channel.max_torque_nm)
        };
        (0..frames)
            .map(at)
            .flat_map(|actuation| {
                let channels = self.config.channels.iter();
                channels.zip(actuation.channels_nm(self.robot)).map(clamped).collect::<Vec<_>>()
            })
            .collect()
    }

    /// Clamps a value to the channel's limits. Returns the value, and the excess as a fraction of the tolerance.
    fn within(
        &self,
        place: &ValueLocation,
        channel: &Channel,
        value: f64,
    ) -> Result<(f32, f64), LibraryError> {
        let (min, max) = (f64::from(channel.min), f64::from(channel.max));
        let family = match channel.kind {
            ChannelKind::JointPosition => Family::JointLimit,
            ChannelKind::WheelSpeed => Family::WheelMotorSpeed,
        };
        let part = (value - max).max(min - value).max(0.0) / tolerance(family, max);
        // Written so that a NaN is refused.
        if part <= 1.0 && value.is_finite() {
            return Ok(((value as f32).clamp(channel.min, channel.max), part));
        }
        Err(LibraryError::OutOfLimits {
            motion: place.name.to_owned(),
            channel: self.name(place.channel),
            time_s: place.time_s(),
            value,
            min,
            max,
            unit: unit(channel),
        })
    }

    /// Checks that a channel changes no faster than its rate limit. The tolerance of joint speeds and a margin for rounding are
    /// added to the limit.
    fn check_rate(
        &self,
        place: &ValueLocation,
        channel: &Channel,
        change: f64,
    ) -> Result<(), LibraryError> {
        let limit = f64::from(channel.max_rate);
        let accepted = match channel.kind {
            ChannelKind::JointPosition => limit + tolerance(Family::JointSpeed, limit),
            ChannelKind::WheelSpeed => limit,
        };
        if change.abs() <= accepted / f64::from(RATE_HZ) + QUANTUM {
            return Ok(());
        }
        Err(LibraryError::TooFast {
            motion: place.name.to_owned(),
            channel: self.name(place.channel),
            time_s: place.time_s(),
            rate: change.abs() * f64::from(RATE_HZ),
            limit,
            unit: unit(channel),
            cause: match channel.kind {
                ChannelKind::JointPosition => "",
                ChannelKind::WheelSpeed => {
                    ", the smaller of friction_coefficient * g / radius_m and torque_max_nm / \
                     armature_kg_m2 in the robot file"
                }
            },
        })
    }

    fn name(&self, channel: usize) -> String {
        self.robot.channels().nth(channel).map_or_else(String::new, |c| c.name().to_owned())
    }
}

/// Largest quantum of a joint or of a wheel of ordinary speed: 2⁻¹⁰.
const QUANTUM: f64 = 1.0 / 1024.0;

/// Largest excess over a limit that is clamped: the tolerance of played motions.
fn tolerance(family: Family, limit: f64) -> f64 {
    match family.as_played() {
        PlayedTolerance::TimesLevel(times) => times * family.level().at(limit),
        _ => 0.0,
    }
}

/// Frame and channel of a value, for messages.
struct ValueLocation<'a> {
    name: &'a str,
    frame: usize,
    channel: usize,
}

impl ValueLocation<'_> {
    fn time_s(&self) -> f64 {
        self.frame as f64 / f64::from(RATE_HZ)
    }
}

fn unit(channel: &Channel) -> &'static str {
    match channel.kind {
        ChannelKind::JointPosition => "rad",
        ChannelKind::WheelSpeed => "rad/s",
    }
}
