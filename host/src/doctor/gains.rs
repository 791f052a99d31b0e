//! Observations about gains, torque limits and feed-forward that differ from the robot file.

use super::{Finding, Gravity, Observations, finding};
use crate::session::{Session, SessionError};
use rollwalk_bus::link::LinkBus;
use rollwalk_protocol::config::{Channel, RobotConfig};
use rollwalk_protocol::wire::{Parameter, ParameterOrigin, ParameterResult};

/// Relative difference up to which two values count as equal.
const SAME: f32 = 1e-4;
/// Number of values that a finding lists.
const LISTED: usize = 3;

/// Values in force on a controller.
#[derive(Clone, Debug, PartialEq)]
pub struct Gains {
    /// Source of the values after power-on.
    pub origin: ParameterOrigin,
    /// Fraction of the library's torques that is fed forward.
    pub feed_forward: f32,
    /// Values by channel; parameters that an actuator does not have are missing.
    pub values: Vec<(u8, Parameter, f32)>,
}

impl Gains {
    /// Reads the values of all channels.
    ///
    /// # Errors
    /// Returns an error of the session.
    pub fn read<B: LinkBus>(session: &mut Session<B>) -> Result<Self, SessionError> {
        let origin = session.parameter_origin()?;
        let feed_forward = session.parameter(Parameter::FeedForward, 0)?;
        let mut values = Vec::new();
        for channel in 0..session.hello().channels {
            for parameter in [Parameter::Kp, Parameter::Kd, Parameter::MaxTorque] {
                match session.parameter(parameter, channel) {
                    Ok(value) => values.push((channel, parameter, value)),
                    Err(SessionError::ParameterRefused {
                        result: ParameterResult::NotSupported,
                        ..
                    }) => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(Self { origin, feed_forward, values })
    }
}

/// Value of the robot file, and name with unit.
fn of_file(channel: &Channel, parameter: Parameter) -> Option<(f32, &'static str, &'static str)> {
    Some(match parameter {
        Parameter::Kp => (channel.kp_nm_rad, "kp", "N·m/rad"),
        Parameter::Kd => (channel.kd_nm_s_rad, "kd", "N·m·s/rad"),
        Parameter::MaxTorque => (channel.max_torque_nm, "torque limit", "N·m"),
        Parameter::FeedForward => return None,
    })
}

impl Observations<'_> {
    /// Findings about values that differ from the robot file.
    pub(super) fn gains(&self) -> Vec<Finding> {
        let unread = self.gains_unread.map(|why| {
            let help = format!("list the values: rollwalk gains show --bus {}", self.bus);
            finding(Gravity::Note, format!("gains and limits could not be read: {why}"), help)
        });
        let Some(gains) = self.gains else { return unread.into_iter().collect() };
        let mut found = Vec::new();
        if gains.feed_forward < 1.0 {
            let what = format!(
                "torque feed-forward is {}: on the ground, the legs sag under the robot's weight",
                gains.feed_forward
            );
            let help = format!(
                "on a stand this is right; on the ground type rollwalk gains feed-forward 1 --bus {}",
                self.bus
            );
            found.push(finding(Gravity::Note, what, help));
        }
        let differing = self.config.map(|config| self.differing(gains, config)).unwrap_or_default();
        if !differing.is_empty() {
            let listed = differing.iter().take(LISTED).cloned().collect::<Vec<_>>().join("; ");
            let more = match differing.len().saturating_sub(LISTED) {
                0 => String::new(),
                more => format!("; and {more} more"),
            };
            let help = format!(
                "list the values: rollwalk gains show --bus {bus}; return to the robot file: rollwalk \
                 gains reset --bus {bus}",
                bus = self.bus
            );
            let what = format!("gains or limits differ from the robot file: {listed}{more}");
            found.push(finding(Gravity::Note, what, help));
        }
        if gains.origin == ParameterOrigin::Saved {
            let what = "after power-on, the controller uses the values of the latest rollwalk gains \
                save";
            found.push(finding(Gravity::Note, what.into(), String::new()));
        }
        found
    }

    /// Descriptions of the values that differ from those of the robot file.
    fn differing(&self, gains: &Gains, config: &RobotConfig) -> Vec<String> {
        let each = |&(number, parameter, value): &(u8, Parameter, f32)| {
            let (file, name, unit) = of_file(config.channels.get(usize::from(number))?, parameter)?;
            let differs = (value - file).abs() > SAME * file.abs();
            let channel = self.channel(number);
            differs.then(|| format!("{channel}: {name} {value} instead of {file} {unit}"))
        };
        gains.values.iter().filter_map(each).collect()
    }
}
