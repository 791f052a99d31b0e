//! Diagnosis of a robot and remedies for its faults, from the traffic on the link and the controller's answers.
//!
//! The diagnosis is a pure function of [`Observations`], which the caller collects from a bus.

use crate::actuators::{Actuators, BusKind, conditions, fault_words};
use crate::catalog::{Catalog, channel_name};
use crate::describe::{entry_sentence, fault_report_on, report_details, state_name, state_words};
use crate::session::History;
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_protocol::wire::{
    FaultReport, FromController, JointTelemetry, LogEntry, State, Status, Torque,
};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Bus load above which frames are delayed, percent.
const FULL_PERCENT: f64 = 70.0;

/// Tilt beyond that of the motion that an operator would still call level, rad: 3 degrees. Controllers stop at 0.35 rad.
const LEVEL_RAD: f32 = 0.05;

/// Fraction of unanswered reports above which two servos probably have the same ID. It is low because some of their colliding
/// answers are still readable.
const COLLIDES: f64 = 0.05;

/// Actuators of an unknown robot.
static UNKNOWN: Actuators = Actuators { buses: Vec::new(), channels: Vec::new() };

/// Traffic on the link during a time span.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    /// Number of frames and of bits, by identifier.
    pub by_id: BTreeMap<u16, (u64, u64)>,
    /// Latest status.
    pub status: Option<Status>,
    /// Latest report of each fault, by code.
    pub faults: BTreeMap<u8, FaultReport>,
    /// Addresses of other controllers on the link.
    pub others: BTreeSet<u8>,
    /// Latest telemetry of each channel.
    pub joints: BTreeMap<u8, JointTelemetry>,
    /// Number of telemetry frames that report an unanswered servo, and of all telemetry frames, by channel.
    pub unanswered: BTreeMap<u8, (u32, u32)>,
    /// Duration of the time span, µs.
    pub span_us: u64,
}

impl Traffic {
    /// Processes a frame of the link with controller `node`.
    pub fn take(&mut self, node: u8, frame: &Frame) {
        let Some(id) = frame.standard_id() else { return };
        let (frames, bits) = self.by_id.entry(id).or_default();
        *frames += 1;
        *bits += u64::from(frame.exact_bits());
        match FromController::decode(frame) {
            Ok((from, message)) if from.number() == node => match message {
                FromController::Status(status) => self.status = Some(status),
                FromController::FaultReport(report) => {
                    self.faults.insert(report.fault.code(), report);
                }
                FromController::JointTelemetry(joint) => {
                    let (missed, all) = self.unanswered.entry(joint.channel).or_default();
                    *missed += u32::from(joint.status.is_unanswered());
                    *all += 1;
                    self.joints.insert(joint.channel, joint);
                }
                _ => {}
            },
            Ok((from, FromController::Status(_))) => {
                self.others.insert(from.number());
            }
            _ => {}
        }
    }

    /// Bus load, percent.
    pub fn load_percent(&self, bitrate: u32) -> f64 {
        let bits: u64 = self.by_id.values().map(|(_, bits)| bits).sum();
        100.0 * bits as f64 / (f64::from(bitrate) * self.span_us.max(1) as f64 * 1e-6)
    }
}

/// Input of a diagnosis.
pub struct Observations<'a> {
    /// Traffic on the link.
    pub heard: &'a Traffic,
    /// True if the controller has a host: [`Listener::has_host`](crate::listener::Listener::has_host).
    pub has_host: bool,
    /// Identity of the controller; `None` if it does not answer.
    pub hello: Option<&'a Hello>,
    /// True if another program is transferring data with the controller. No request was sent in that case.
    pub transferring: bool,
    /// Log of the controller.
    pub history: Option<&'a History>,
    /// Known fault of the bus and its remedy.
    pub complaint: Option<&'a str>,
    /// Bitrate of the link, bit/s.
    pub bitrate: u32,
    /// Hash of the configuration in the robot file.
    pub expected_config: Option<u32>,
    /// Names of motions and channels.
    pub catalog: Option<&'a Catalog>,
    /// Bus as written on the command line.
    pub bus: &'a str,
}

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Gravity {
    /// Finding without a fault.
    Fine,
    /// Information.
    Note,
    /// Fault.
    Wrong,
}

/// Finding of a diagnosis, with its remedy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Severity.
    pub gravity: Gravity,
    /// Description of the finding.
    pub what: String,
    /// Remedy or command to type; empty if there is none.
    pub help: String,
}

impl Observations<'_> {
    /// Returns all findings, in the order in which an operator should check them.
    pub fn diagnose(&self) -> Vec<Finding> {
        let mut found = Vec::new();
        if let Some(complaint) = self.complaint {
            found.push(finding(Gravity::Wrong, complaint.to_owned(), String::new()));
        }
        if self.transferring {
            found.push(self.not_asked());
            found.push(self.load());
            return found;
        }
        let (Some(hello), Some(status)) = (self.hello, self.heard.status) else {
            found.push(self.no_controller());
            return found;
        };
        found.extend(self.identity(hello));
        found.push(self.state(&status, hello));
        found.extend(status.faults.iter().map(|fault| self.fault(fault)));
        found.extend(self.silent_channels(hello, &status));
        found.extend(self.conditions());
        found.extend(self.unanswered());
        found.extend(self.last_stop());
        found.extend(self.host(&status));
        found.push(self.load());
        found
    }

    fn not_asked(&self) -> Finding {
        let what = "another program is transferring data to the controller, and a request would \
            interrupt the transfer";
        let help = format!("after the transfer, type rollwalk doctor --bus {}", self.bus);
        finding(Gravity::Wrong, what.into(), help)
    }

    fn no_controller(&self) -> Finding {
        let bus = self.bus;
        if !self.heard.others.is_empty() {
            let others: Vec<_> = self.heard.others.iter().map(u8::to_string).collect();
            let [controllers, are] =
                if others.len() == 1 { ["controller", "is"] } else { ["controllers", "are"] };
            let what = format!(
                "the controller does not answer; {controllers} {} {are} on the bus",
                others.join(", ")
            );
            let help =
                format!("give the address: rollwalk doctor --node {} --bus {bus}", others[0]);
            return finding(Gravity::Wrong, what, help);
        }
        let others = match self.heard.by_id.len() {
            0 => "there are no frames on the bus".to_owned(),
            count => format!(
                "none of the frames on the bus ({count} identifiers) are from the controller"
            ),
        };
        let help = format!(
            "check the controller's power, cable and bitrate ({} bit/s); rollwalk discover --bus \
             {bus} lists controllers with other addresses",
            self.bitrate
        );
        finding(Gravity::Wrong, format!("the controller does not answer, and {others}"), help)
    }

    fn identity(&self, hello: &Hello) -> Option<Finding> {
        let expected = self.expected_config.filter(|&expected| expected != hello.config_hash)?;
        let what = format!(
            "this is another robot: its firmware has configuration {:08x}, the robot file \
             describes {expected:08x}",
            hello.config_hash
        );
        let help =
            "build the firmware from this robot file, or give the robot file of the firmware";
        Some(finding(Gravity::Wrong, what, help.into()))
    }

    fn state(&self, status: &Status, hello: &Hello) -> Finding {
        let bus = self.bus;
        let clip = status.clip.map(|clip| self.clip(clip)).unwrap_or_default();
        let clip = if clip.is_empty() { clip } else { format!(" ({clip})") };
        // Faults have findings of their own, unless one is what stopped the robot.
        let words = state_words(status, self.actuators());
        let what = format!("the robot is {words}{clip}");
        let faulty = !status.faults.is_empty();
        let (gravity, help) = match status.state {
            State::Disarmed if hello.library.is_none() => (
                Gravity::Wrong,
                format!("flash a library: rollwalk flash LIB.rwl --robot ROBOT.toml --bus {bus}"),
            ),
            State::Disarmed if faulty => (Gravity::Note, String::new()),
            State::Disarmed => {
                (Gravity::Fine, format!("arm the robot: rollwalk send --arm MOTION --bus {bus}"))
            }
            State::EStopped => {
                let help = "remove the cause, then type rollwalk clear --bus";
                (Gravity::Wrong, format!("{help} {bus}"))
            }
            State::TorqueOff if faulty => (
                Gravity::Wrong,
                format!("remove the causes below, then type rollwalk clear --bus {bus}"),
            ),
            State::Damped | State::TorqueOff => (
                Gravity::Note,
                "run doctor again in a few seconds: the robot will be disarmed then".into(),
            ),
            State::Boot | State::SelfTest if faulty => (
                Gravity::Wrong,
                "correct the configuration of the firmware: rollwalk robot check".into(),
            ),
            _ => (Gravity::Fine, String::new()),
        };
        finding(gravity, what, help)
    }

    fn fault(&self, fault: Fault) -> Finding {
        let (code, report) = (fault.code(), self.heard.faults.get(&fault.code()));
        let channel = report.and_then(|report| self.channel_of(report.channel));
        let number = report.and_then(|report| report.channel);
        let value = report.map(|report| report.value);
        let actuators = self.actuators();
        let mut described = fault_report_on(fault, number, channel, value, actuators);
        // What is reported is the tilt of now; the fault is latched since that of then.
        let is_level = |report: &FaultReport| (0.0..LEVEL_RAD).contains(&report.value);
        if fault == Fault::Tilt && report.is_some_and(is_level) {
            described = "the body was tilted, and is level again".to_owned();
        }
        let advice = fault_words(fault, actuators.kind_for(fault, number, value)).advice;
        let help = format!("{advice} (docs/faults.md, {code} {fault:?})");
        finding(Gravity::Wrong, format!("fault {code}: {described}"), help)
    }

    /// Channels without telemetry, whose position is unknown: one finding for each bus, or a single one if the robot is
    /// unknown.
    fn silent_channels(&self, hello: &Hello, status: &Status) -> Vec<Finding> {
        let is_silent = |channel: &u8| !self.heard.joints.contains_key(channel);
        let gravity = if status.state == State::Boot { Gravity::Note } else { Gravity::Wrong };
        let all: Vec<u8> = (0..hello.channels).collect();
        let actuators = self.actuators();
        if actuators.channels.len() != all.len() {
            return self.silent_on(gravity, None, &all, is_silent).into_iter().collect();
        }
        let on_bus = |bus: u8| {
            let channels: Vec<_> = actuators.on_bus(bus).collect();
            self.silent_on(gravity, Some(bus), &channels, is_silent)
        };
        (0..actuators.buses.len() as u8).filter_map(on_bus).collect()
    }

    /// Finding about the silent channels among `channels`, which are all channels of a bus or of the robot.
    fn silent_on(
        &self,
        gravity: Gravity,
        bus: Option<u8>,
        channels: &[u8],
        is_silent: impl Fn(&u8) -> bool,
    ) -> Option<Finding> {
        let silent: Vec<u8> = channels.iter().copied().filter(is_silent).collect();
        if silent.is_empty() {
            return None;
        }
        let all = silent.len() == channels.len();
        let of = bus.and_then(|bus| Some((bus, self.actuators().buses.get(usize::from(bus))?)));
        let who = match of {
            Some((bus, of)) if all => format!("any actuator on bus {bus} ({})", of.protocol),
            _ if all => "any actuator".to_owned(),
            _ => {
                silent.iter().map(|&channel| self.addressed(channel)).collect::<Vec<_>>().join(", ")
            }
        };
        let what = format!("no position from {who}: the robot cannot be armed");
        let help = match of {
            Some((_, of)) if of.kind == BusKind::ServoLine => match (all, self.twin(channels)) {
                (true, _) => format!(
                    "switch the servo supply on, connect the data wire, and set the servos to {} \
                     bit/s, because new servos have another rate; switch off the echo of the \
                     adapter, which hides answers",
                    of.bit_rate
                ),
                (false, Some(twin)) => format!(
                    "{} misses answers, as two servos with the same ID do: unplug one of them, and \
                     set the ID of the other",
                    self.addressed(twin)
                ),
                (false, None) => {
                    "check the plug, and set the servo to the ID and baud rate of the \
                                  robot file (new servos have ID 1); all servos behind a break in \
                                  the chain are silent"
                        .to_owned()
                }
            },
            Some((_, of)) if of.kind == BusKind::PulseBoard => format!(
                "check power and cable of the servo board, and set its serial mode to UART at {} \
                 bit/s",
                of.bit_rate
            ),
            Some((_, of)) if all => format!(
                "switch motor power on, and check the cable of the CAN bus, its termination at \
                 both ends, and its bitrate of {} bit/s",
                of.bit_rate
            ),
            None if all => {
                "switch motor power on, and check the cables of the actuator buses".to_owned()
            }
            _ => "check power and cable of the actuator, and set its address to that in the robot \
                file"
                .to_owned(),
        };
        Some(finding(gravity, what, help))
    }

    /// Single channel among `channels` that occasionally misses answers, as two servos with the same ID do.
    fn twin(&self, channels: &[u8]) -> Option<u8> {
        let missed = |channel: &u8| {
            let (missed, all) = self.heard.unanswered.get(channel).copied().unwrap_or_default();
            f64::from(missed) > COLLIDES * f64::from(all)
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

    /// Actuators that are too hot, have a bad supply voltage, or lost torque for another reason. Telemetry has no temperatures
    /// and voltages, but flags for these conditions.
    fn conditions(&self) -> Vec<Finding> {
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
                "no setpoint arrived in time: check the load of its bus, the plugs and the cable"
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

    /// Servos on serial lines that occasionally do not answer, which is the first symptom of a disturbed line.
    fn unanswered(&self) -> Option<Finding> {
        let missed = self.heard.unanswered.iter().filter(|(_, (missed, _))| *missed > 0);
        let who = missed.clone().map(|(&channel, (missed, all))| {
            format!("{} in {missed} of {all} reports", self.channel(channel))
        });
        let who: Vec<_> = who.collect();
        let what = match who.len() {
            0 => return None,
            1..=3 => format!("servos did not answer: {}", who.join(", ")),
            count => {
                let worst = missed.max_by_key(|(_, (missed, _))| *missed);
                let worst = worst.map_or(0, |(&channel, _)| channel);
                format!(
                    "{count} servos did not always answer; {} missed most answers",
                    self.channel(worst)
                )
            }
        };
        let help = "check the data wire, its pull-up, the servo supply and the return delay; after \
                    0.1 s without any answer the controller lets the robot down";
        // A robot that gets by is not one that does not work.
        Some(finding(Gravity::Note, what, help.into()))
    }

    fn last_stop(&self) -> Option<Finding> {
        let history = self.history?;
        let stop = history.last_stop()?;
        let seconds = f64::from(history.age_ms(stop)) * 1e-3;
        let what = format!(
            "the robot last stopped {seconds:.1} s ago while it was {}: {}{}",
            state_name(stop.before),
            entry_sentence(stop, self.actuators()),
            self.entry_detail(stop)
        );
        Some(finding(Gravity::Note, what, String::new()))
    }

    /// Channel and value of a log entry in parentheses.
    pub fn entry_detail(&self, entry: &LogEntry) -> String {
        entry.fault.map_or_else(String::new, |fault| {
            report_details(fault, self.channel_of(entry.channel), Some(entry.value))
        })
    }

    fn host(&self, status: &Status) -> Option<Finding> {
        (status.state.torque() == Torque::Driven && !self.has_host).then(|| {
            let what =
                "no host sends heartbeats: the robot will return to SAFE and switch torque off";
            finding(
                Gravity::Wrong,
                what.into(),
                "start rollwalk console, which keeps the robot armed".into(),
            )
        })
    }

    fn load(&self) -> Finding {
        let percent = self.heard.load_percent(self.bitrate);
        let what = format!("link frames use {percent:.1} % of {} bit/s", self.bitrate);
        if percent > FULL_PERCENT {
            let help = "reduce the traffic, because frames arrive late; the list below shows the \
                identifiers with the most bits";
            return finding(Gravity::Wrong, what, help.into());
        }
        finding(Gravity::Fine, what, String::new())
    }

    fn clip(&self, clip: u8) -> String {
        let name = self.catalog.and_then(|catalog| catalog.clip(clip));
        name.unwrap_or_else(|| format!("clip {clip}"))
    }

    fn actuators(&self) -> &Actuators {
        self.catalog.map_or(&UNKNOWN, |catalog| &catalog.actuators)
    }

    /// Description of a log entry's event, adapted to the robot's buses.
    pub fn entry_sentence(&self, entry: &LogEntry) -> String {
        entry_sentence(entry, self.actuators())
    }

    fn channel_of(&self, channel: Option<u8>) -> Option<String> {
        channel.map(|channel| self.channel(channel))
    }

    fn channel(&self, channel: u8) -> String {
        channel_name(self.catalog.map_or(&[], |catalog| &catalog.channels), channel)
    }
}

fn finding(gravity: Gravity, what: String, help: String) -> Finding {
    Finding { gravity, what, help }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actuators::{ActuatorBus, ChannelActuator};
    use rollwalk_protocol::faults::{FaultBits, Severity};
    use rollwalk_protocol::wire::Node;

    fn hello() -> Hello {
        Hello {
            major: 1,
            minor: 0,
            schema_hash: 0,
            config_hash: 7,
            format_major: 1,
            format_minor: 1,
            library: Some(5),
            max_block: 512,
            channels: 2,
        }
    }

    fn traffic_in(state: State, faults: FaultBits, joints: u8) -> Traffic {
        let node = Node::new(1).unwrap();
        let mut heard = Traffic { span_us: 1_000_000, ..Traffic::default() };
        let severity = Severity::None;
        let status =
            Status { state, severity, faults, clip: None, frame: 0, counter: 0, library: 5 };
        heard.take(1, &status.encode(node));
        for channel in 0..joints {
            let joint = JointTelemetry {
                channel,
                position_rad: 0.0,
                velocity_rad_s: 0.0,
                torque_nm: 0.0,
                status: Default::default(),
            };
            heard.take(1, &joint.encode(node));
        }
        heard
    }

    fn findings<'a>(heard: &'a Traffic, hello: Option<&'a Hello>) -> Observations<'a> {
        Observations {
            heard,
            has_host: false,
            hello,
            transferring: false,
            history: None,
            complaint: None,
            bitrate: 1_000_000,
            expected_config: Some(7),
            catalog: None,
            bus: "can:can0",
        }
    }

    fn diagnose(heard: &Traffic, hello: Option<&Hello>) -> String {
        text(&findings(heard, hello))
    }

    fn text(findings: &Observations<'_>) -> String {
        let found = findings.diagnose();
        found.iter().map(|f| format!("{:?}: {} -> {}\n", f.gravity, f.what, f.help)).collect()
    }

    #[test]
    fn a_robot_that_is_well_is_told_so() {
        let text = diagnose(&traffic_in(State::Disarmed, FaultBits::default(), 2), Some(&hello()));
        assert!(text.contains("arm the robot: rollwalk send --arm"), "{text}");
        assert!(!text.contains("Wrong"), "{text}");
    }

    #[test]
    fn a_controller_that_was_not_asked_is_not_called_silent() {
        let heard = traffic_in(State::Disarmed, FaultBits::default(), 2);
        let found = Observations { transferring: true, ..findings(&heard, None) }.diagnose();
        assert!(found[0].what.contains("another program is transferring data"), "{found:?}");
        assert!(!found.iter().any(|f| f.what.contains("does not answer")), "{found:?}");
    }

    #[test]
    fn every_fault_has_a_cause_and_a_cure() {
        for &fault in Fault::ALL {
            let faults = FaultBits::default().with(fault);
            let text = diagnose(&traffic_in(State::TorqueOff, faults, 2), Some(&hello()));
            assert!(
                text.contains(&format!("docs/faults.md, {} {fault:?}", fault.code())),
                "{text}"
            );
            assert!(text.contains("rollwalk clear --bus can:can0"), "{text}");
        }
    }

    /// A fault report contains the current tilt. A body that was set upright again, with a tilt of 0.001 rad, must not be
    /// called tilted.
    #[test]
    fn a_body_that_was_set_up_again_is_not_called_tilted() {
        let node = Node::new(1).unwrap();
        let told = |value| {
            let fault = Fault::Tilt;
            let mut heard = traffic_in(State::TorqueOff, FaultBits::default().with(fault), 2);
            let report = FaultReport { counter: 0, fault, channel: None, value };
            heard.take(1, &report.encode(node));
            diagnose(&heard, Some(&hello()))
        };
        let text = told(0.001);
        assert!(text.contains("fault 7: the body was tilted, and is level again ->"), "{text}");
        let text = told(0.5);
        assert!(text.contains("the body is tilted (0.500 rad beyond"), "{text}");
        let text = told(-1.0);
        assert!(text.contains("the IMU is silent"), "{text}");
    }

    #[test]
    fn servos_that_do_not_always_answer_are_named() {
        let node = Node::new(1).unwrap();
        let told = |missed: u8| {
            let mut heard = traffic_in(State::Disarmed, FaultBits::default(), 2);
            for n in 0..39 {
                let status = if n < missed { ActuatorStatus::UNANSWERED } else { 0 };
                let joint = JointTelemetry {
                    channel: 1,
                    position_rad: 0.0,
                    velocity_rad_s: 0.0,
                    torque_nm: 0.0,
                    status: ActuatorStatus(status),
                };
                heard.take(1, &joint.encode(node));
            }
            diagnose(&heard, Some(&hello()))
        };
        assert!(!told(0).contains("did not answer"), "{}", told(0));
        let text = told(3);
        let expected = "Note: servos did not answer: channel 1 in 3 of 40 reports -> check";
        assert!(text.contains(expected), "{text}");
    }

    #[test]
    fn who_is_silent_is_named() {
        let text = diagnose(&traffic_in(State::Disarmed, FaultBits::default(), 1), Some(&hello()));
        assert!(text.contains("no position from channel 1:"), "{text}");
        let text = diagnose(&traffic_in(State::Disarmed, FaultBits::default(), 0), Some(&hello()));
        assert!(text.contains("no position from any actuator:"), "{text}");
        let text = diagnose(&Traffic::default(), None);
        assert!(text.contains("there are no frames on the bus"), "{text}");
    }

    fn of_pup() -> Catalog {
        let bus = ActuatorBus {
            kind: BusKind::ServoLine,
            protocol: "Dynamixel".into(),
            bit_rate: 1_000_000,
        };
        let of = |id| ChannelActuator { bus: 0, id, model: "XL330-M288-T".into() };
        let actuators = Actuators { buses: vec![bus], channels: vec![of(1), of(3)] };
        let channels = vec!["hip".into(), "knee".into()];
        Catalog::of_robot("pup", 7, channels).with_actuators(actuators)
    }

    fn of_servos(heard: &Traffic) -> String {
        let (hello, catalog) = (hello(), of_pup());
        let findings = Observations { catalog: Some(&catalog), ..findings(heard, Some(&hello)) };
        text(&findings)
    }

    /// Diagnosis of a robot on a serial line contains no CAN terms: lost adapter, all servos silent, one silent, two with the
    /// same ID, low supply, overheated.
    #[test]
    fn a_serial_line_is_diagnosed_in_its_own_words() {
        let node = Node::new(1).unwrap();
        let mut gone = traffic_in(State::EStopped, FaultBits::default().with(Fault::BusOff), 2);
        let report = FaultReport { counter: 0, fault: Fault::BusOff, channel: None, value: 0.0 };
        gone.take(1, &report.encode(node));
        let all_silent = traffic_in(State::Disarmed, FaultBits::default(), 0);
        let one_silent = traffic_in(State::Disarmed, FaultBits::default(), 1);
        let joint = |channel, bits| JointTelemetry {
            channel,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            torque_nm: 0.0,
            status: ActuatorStatus(bits),
        };
        let mut same_id = traffic_in(State::Disarmed, FaultBits::default(), 1);
        for n in 0..40 {
            let bits = if n % 4 == 0 { ActuatorStatus::UNANSWERED } else { 0 };
            same_id.take(1, &joint(0, bits).encode(node));
        }
        let mut brown_out = traffic_in(State::Disarmed, FaultBits::default(), 2);
        brown_out.take(1, &joint(1, ActuatorStatus::BAD_VOLTAGE).encode(node));
        let mut hot = traffic_in(State::Disarmed, FaultBits::default(), 2);
        hot.take(1, &joint(1, ActuatorStatus::OVERHEATED).encode(node));
        for (heard, expected) in [
            (
                gone,
                &[
                    "stopped: the serial adapter of the servos is gone",
                    "fault 11: the serial adapter",
                    "plug the adapter in",
                ][..],
            ),
            (all_silent, &["any actuator on bus 0 (Dynamixel)", "1000000 bit/s", "echo"]),
            (one_silent, &["no position from knee (bus 0, ID 3)", "new servos have ID 1"]),
            (
                same_id,
                &[
                    "no position from knee (bus 0, ID 3)",
                    "hip (bus 0, ID 1) misses answers, as two servos with the same ID do",
                ],
            ),
            (brown_out, &["Wrong: knee (bus 0, ID 3): supply voltage outside 3.7 to 6 V"]),
            (hot, &["Wrong: knee (bus 0, ID 3): hotter than 70 °C"]),
        ] {
            let text = of_servos(&heard);
            for words in expected {
                assert!(text.contains(words), "{words}: {text}");
            }
            // The link of these robots is on CAN, and says so in its line.
            for word in ["CAN_H", "terminat", "candump", "emergency stop", "a bus is off"] {
                assert!(!text.contains(word), "{word}: {text}");
            }
        }
    }

    #[test]
    fn another_controller_on_the_bus_is_named() {
        let mut traffic = Traffic { span_us: 1_000_000, ..Traffic::default() };
        let of_one = traffic_in(State::Disarmed, FaultBits::default(), 0);
        let status = of_one.status.unwrap();
        traffic.take(3, &status.encode(Node::new(1).unwrap()));
        let text = diagnose(&traffic, None);
        assert!(text.contains("controller 1 is on the bus"), "{text}");
        assert!(text.contains("rollwalk doctor --node 1 --bus can:can0"), "{text}");
    }

    #[test]
    fn a_robot_that_nobody_holds_and_another_robot_are_noticed() {
        let (heard_ready, ours) = (traffic_in(State::Ready, FaultBits::default(), 2), hello());
        let nobody = findings(&heard_ready, Some(&ours));
        let told = text(&nobody);
        assert!(told.contains("no host sends heartbeats"), "{told}");
        let told = text(&Observations { has_host: true, ..nobody });
        assert!(!told.contains("no host"), "{told}");
        let other = Hello { config_hash: 8, ..hello() };
        let text = diagnose(&traffic_in(State::Disarmed, FaultBits::default(), 2), Some(&other));
        assert!(text.contains("this is another robot"), "{text}");
    }
}
