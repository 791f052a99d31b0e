//! Observations about actuators: silent, irregular, faulty, or outside the range of their joint.

use super::{Finding, Gravity, Observations, finding};
use crate::actuators::{ActuatorBus, BusKind, ReadingWarning, conditions};
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::config::ChannelKind;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_protocol::wire::{ActuatorReadings, JointTelemetry, State, Status};

/// Fraction of unanswered reports above which two servos probably have the same ID. It is low because some of their colliding
/// answers are still readable.
const COLLIDES: f64 = 0.05;

/// Distance outside its range above which a joint prevents arming, rad: `out_of_range_rad` of a controller's default settings.
const OUT_OF_RANGE_RAD: f32 = 0.2;

impl Observations<'_> {
    /// Silent channels: one finding for each bus, or a single one if the robot is unknown.
    pub(super) fn silent_channels(&self, hello: &Hello, status: &Status) -> Vec<Finding> {
        let gravity = if status.state == State::Boot { Gravity::Note } else { Gravity::Wrong };
        let all: Vec<u8> = (0..hello.channels).collect();
        let actuators = self.actuators();
        if actuators.channels.len() != all.len() {
            return self.silent_on(gravity, None, &all).into_iter().collect();
        }
        let on_bus = |bus: u8| {
            let channels: Vec<_> = actuators.on_bus(bus).collect();
            self.silent_on(gravity, Some(bus), &channels)
        };
        (0..actuators.buses.len() as u8).filter_map(on_bus).collect()
    }

    /// True if a channel has never reported a position, or has stopped answering.
    fn is_silent(&self, channel: u8) -> bool {
        !self.heard.joints.contains_key(&channel)
            || self.heard.answers.get(&channel).is_some_and(|answers| answers.is_silent())
    }

    /// Finding about the silent channels among `channels`, which are all channels of a bus or of the robot.
    fn silent_on(&self, gravity: Gravity, bus: Option<u8>, channels: &[u8]) -> Option<Finding> {
        let silent: Vec<u8> =
            channels.iter().copied().filter(|&channel| self.is_silent(channel)).collect();
        let first = *silent.first()?;
        let all = silent.len() == channels.len();
        let of = bus.and_then(|bus| Some((bus, self.actuators().buses.get(usize::from(bus))?)));
        let waits = |&&channel: &&u8| {
            let ahead = self.actuators().waits_for(channel, |channel| self.is_silent(channel));
            ahead == Some(first)
        };
        let waiting = channels.iter().filter(waits).count();
        let who = match of {
            Some((bus, of)) if all => format!("any actuator on bus {bus} ({})", of.protocol),
            _ if all => "any actuator".to_owned(),
            _ if waiting > 0 && silent.len() == waiting + 1 => {
                let after = if waiting == 1 { "the servo" } else { "the servos" };
                format!(
                    "{}, and therefore none from {after} behind it on the line",
                    self.addressed(first)
                )
            }
            _ => {
                silent.iter().map(|&channel| self.addressed(channel)).collect::<Vec<_>>().join(", ")
            }
        };
        let known = silent.iter().any(|channel| self.heard.joints.contains_key(channel));
        let missing = if known { "answer" } else { "position" };
        let what = format!("no {missing} from {who}: the robot cannot be armed");
        let help = match of {
            Some((_, of)) => self.help_on(of, channels, all),
            None if all => {
                "switch motor power on, and check the cables of the actuator buses".to_owned()
            }
            None => CHECK_ADDRESS.to_owned(),
        };
        Some(finding(gravity, what, help))
    }

    /// Remedy for silent channels on a bus; `all` is true if all `channels` of the bus are silent.
    fn help_on(&self, of: &ActuatorBus, channels: &[u8], all: bool) -> String {
        match (of.kind, all) {
            (BusKind::ServoLine, true) => {
                let first = channels.first().map(|&first| self.addressed(first));
                format!(
                    "switch the servo supply on, connect the data wire, and set the servos to {} \
                     bit/s, because new servos have another rate; switch off the echo of the \
                     adapter, which hides answers; if only {} is silent, the servos after it wait \
                     for its answer",
                    of.bit_rate,
                    first.unwrap_or_default()
                )
            }
            (BusKind::ServoLine, false) => match self.twin(channels) {
                Some(twin) => format!(
                    "{} misses answers, as if two servos had the same ID: switch power off, unplug one \
                     servo, switch power on, and set the ID of the other",
                    self.addressed(twin)
                ),
                None => "switch power off and check the plug; set the servo to the ID and baud rate of \
                         the robot file (new servos have ID 1); all servos behind a break in the chain are \
                         silent"
                    .to_owned(),
            },
            (BusKind::PulseBoard, _) => format!(
                "check power and cable of the servo board, and set its serial mode to UART at {} \
                 bit/s",
                of.bit_rate
            ),
            (BusKind::Can, true) => format!(
                "switch motor power on, and check the cable of the CAN bus, its termination at \
                 both ends, and its bitrate of {} bit/s",
                of.bit_rate
            ),
            (BusKind::Can, false) => CHECK_ADDRESS.to_owned(),
        }
    }

    /// Single channel among `channels` that occasionally misses answers, as if two servos had the same ID.
    fn twin(&self, channels: &[u8]) -> Option<u8> {
        let missed = |channel: &u8| {
            let share =
                self.heard.answers.get(channel).map_or(0.0, |answers| answers.missed_share());
            share > COLLIDES && !self.is_silent(*channel)
        };
        let mut all = channels.iter().copied().filter(missed);
        let one = all.next()?;
        all.next().is_none().then_some(one)
    }

    /// Name of a channel, with its bus and address if known.
    fn addressed(&self, channel: u8) -> String {
        let name = self.channel(channel);
        match self.actuators().channels.get(usize::from(channel)) {
            Some(of) => format!("{name} (bus {}, ID {})", of.bus, of.id),
            None => name,
        }
    }

    /// Actuators that are too hot, have a bad supply voltage, or lost torque for another reason.
    pub(super) fn conditions(&self) -> Vec<Finding> {
        let all = self.heard.joints.values().filter(|joint| joint.status.faulty());
        let each = |joint: &JointTelemetry| {
            let status = ActuatorStatus(joint.status.0 & ActuatorStatus::FAULTS);
            let limits = self.actuators().limits(joint.channel);
            let words = conditions(status, limits).join(", ");
            let has = |bit| status.0 & bit != 0;
            let help = if has(ActuatorStatus::BAD_VOLTAGE) {
                "measure the supply voltage at the servo under load; check the battery and replace \
                 thin or long wires"
            } else if has(ActuatorStatus::OVERHEATED) {
                "let the actuator cool; joints that carry the robot in a bent pose heat most"
            } else if has(ActuatorStatus::TIMED_OUT) {
                "no setpoint arrived in time: check the load of its bus; with power off, check plugs and \
                 cable"
            } else {
                "switch the actuator off and on; if it fails again, read its error with the \
                 manufacturer's tool"
            };
            finding(
                Gravity::Wrong,
                format!("{}: {words}", self.addressed(joint.channel)),
                help.into(),
            )
        };
        all.map(each).collect()
    }

    /// Ranges of the temperatures and supply voltages, and servos close to their limits.
    pub(super) fn readings(&self) -> Vec<Finding> {
        let all: Vec<_> = self.heard.readings.values().collect();
        let range = |name, unit, digits: usize, value: fn(&ActuatorReadings) -> Option<f32>| {
            let mut known: Vec<_> =
                all.iter().filter_map(|of| Some((value(of)?, of.channel))).collect();
            known.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (&(least, low), &(most, high)) = (known.first()?, known.last()?);
            Some(format!(
                "{name} {least:.digits$} {unit} ({}) to {most:.digits$} {unit} ({})",
                self.channel(low),
                self.channel(high)
            ))
        };
        let temperature = range("temperatures", "°C", 0, |of| of.temperature_c);
        let voltage = range("supply voltages", "V", 1, |of| of.voltage_v);
        let ranges: Vec<_> = temperature.into_iter().chain(voltage).collect();
        let mut found = Vec::new();
        if all.is_empty() && !self.heard.joints.is_empty() {
            let what = "the actuators report no temperatures and supply voltages".to_owned();
            found.push(finding(Gravity::Fine, what, String::new()));
        }
        if !ranges.is_empty() {
            found.push(finding(Gravity::Fine, ranges.join("; "), String::new()));
        }
        for readings in all {
            let Some(limits) = self.actuators().limits(readings.channel) else { continue };
            for warning in ReadingWarning::all(readings, limits) {
                let words = warning.words(readings, limits);
                let what = format!("{}: {words}", self.addressed(readings.channel));
                found.push(finding(Gravity::Note, what, warning.help().into()));
            }
        }
        found
    }

    /// Joints so far outside their ranges that the controller refuses to arm.
    pub(super) fn out_of_range(&self) -> Vec<Finding> {
        let channels = self.config.map_or(&[][..], |config| &config.channels);
        let each = |(number, channel): (u8, &rollwalk_protocol::config::Channel)| {
            let position_rad = self.heard.joints.get(&number)?.position_rad;
            let range = channel.min - OUT_OF_RANGE_RAD..=channel.max + OUT_OF_RANGE_RAD;
            let outside =
                channel.kind == ChannelKind::JointPosition && !range.contains(&position_rad);
            outside.then(|| {
                let what = format!(
                    "{} is at {:.0}°, outside its range of {:.0}° to {:.0}°: the robot cannot be armed",
                    self.addressed(number),
                    position_rad.to_degrees(),
                    channel.min.to_degrees(),
                    channel.max.to_degrees()
                );
                let help = "turn the joint into its range by hand; if its angle is wrong, \
                            calibrate its zero (docs/faults.md, 6 OutOfLimits)";
                finding(Gravity::Wrong, what, help.into())
            })
        };
        (0..).zip(channels).filter_map(each).collect()
    }

    /// Actuators that occasionally do not answer, which is the first symptom of a disturbed line.
    pub(super) fn unanswered(&self) -> Option<Finding> {
        let missed = || {
            let all = self.heard.answers.iter();
            all.filter(|(channel, answers)| answers.missed > 0 && !self.is_silent(**channel))
        };
        let who = missed().map(|(&channel, answers)| {
            format!(
                "{} in {} of {} reports",
                self.channel(channel),
                answers.missed,
                answers.reports
            )
        });
        let who: Vec<_> = who.collect();
        let what = match who.len() {
            0 => return None,
            1..=3 => format!("servos did not answer: {}", who.join(", ")),
            count => {
                let worst = missed().max_by_key(|(_, answers)| answers.missed);
                let worst = worst.map_or(0, |(&channel, _)| channel);
                format!(
                    "{count} servos did not always answer; {} missed most answers",
                    self.channel(worst)
                )
            }
        };
        let help = "check the data wire, its pull-up, the servo supply and the return delay; after \
                    0.1 s without any answer the robot sinks damped";
        // A degraded robot still works, so this is a note.
        Some(finding(Gravity::Note, what, help.into()))
    }
}

/// Remedy for a single silent actuator.
const CHECK_ADDRESS: &str =
    "check power and cable of the actuator, and set its address to that in the robot file";
