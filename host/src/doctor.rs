//! Diagnosis of a robot and remedies for its faults, from the traffic on the link and the controller's answers.
//!
//! The diagnosis is a pure function of [`Observations`], which the caller collects from a bus.

mod actuators;
mod gains;
mod link_key;
mod traffic;
mod verdict;

pub use gains::Gains;
pub use link_key::LinkKeyCheck;
pub use traffic::{Answers, Traffic};

use crate::actuators::{Actuators, UNKNOWN, fault_words};
use crate::catalog::{Catalog, channel_name};
use crate::describe::{entry_sentence, fault_report_on, report_details, state_name};
use crate::session::History;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_protocol::wire::{FaultReport, LogEntry};
use serde::Serialize;

/// Bus load above which frames are delayed, percent.
const FULL_PERCENT: f64 = 70.0;

/// Tilt beyond that of the motion that an operator would still call level, rad: 3 degrees. Controllers stop at 0.35 rad.
const LEVEL_RAD: f32 = 0.05;

/// Input of a diagnosis.
pub struct Observations<'a> {
    /// Traffic on the link.
    pub heard: &'a Traffic,
    /// True if the controller has a host: [`Listener::has_host`](crate::listener::Listener::has_host).
    pub has_host: bool,
    /// Identity of the controller; `None` if it does not answer.
    pub hello: Option<&'a Hello>,
    /// Reason why the controller's identity cannot be used, such as another protocol version.
    pub refused: Option<&'a str>,
    /// Result of the check of the link key.
    pub key: LinkKeyCheck,
    /// True if another program is transferring data with the controller. No request was sent in that case.
    pub transferring: bool,
    /// Gains, limits and feed-forward of the controller; `None` if they are unknown.
    pub gains: Option<&'a Gains>,
    /// Reason why they could not be read.
    pub gains_unread: Option<&'a str>,
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
    /// Configuration of the robot, with the ranges of its joints; `None` if the robot is unknown.
    pub config: Option<&'a RobotConfig>,
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
        if let Some(refused) = self.refused {
            found.push(finding(Gravity::Wrong, refused.to_owned(), String::new()));
            return found;
        }
        let (Some(hello), Some(status)) = (self.hello, self.heard.status) else {
            found.push(self.no_controller());
            return found;
        };
        found.push(self.header(hello));
        found.extend(self.identity(hello));
        found.extend(self.link_key());
        let mut below: Vec<_> = status.faults.iter().map(|fault| self.fault(fault)).collect();
        below.extend(self.silent_channels(hello, &status));
        below.extend(self.conditions());
        below.extend(self.readings());
        below.extend(self.out_of_range());
        below.extend(self.unanswered());
        below.extend(self.gains());
        below.extend(self.last_stop());
        below.extend(self.host(&status));
        below.push(self.load());
        let is_blocked =
            found.iter().chain(&below).any(|finding| finding.gravity == Gravity::Wrong);
        found.push(self.state(&status, hello, is_blocked));
        found.extend(below);
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
        if self.heard.status.is_some() {
            let what = "the controller sends its status, but does not answer a request";
            let help = "check the cable and the adapter: frames of this computer are lost";
            return finding(Gravity::Wrong, what.into(), help.into());
        }
        let others = match self.heard.by_id.len() {
            0 => "there are no frames on the bus".to_owned(),
            count => format!(
                "none of the frames on the bus ({count} identifiers) are from the controller"
            ),
        };
        let help = if bus == "sim" || bus.starts_with("sim:") {
            format!("start rollwalk-sim ROBOT.toml --bus {bus}")
        } else {
            format!(
                "check the controller's power, cable and bitrate ({} bit/s); rollwalk discover --bus \
                 {bus} lists controllers with other addresses",
                self.bitrate
            )
        };
        finding(Gravity::Wrong, format!("the controller does not answer, and {others}"), help)
    }

    /// Robot and library of the controller.
    fn header(&self, hello: &Hello) -> Finding {
        let robot = self.catalog.map_or("unknown robot", |catalog| &catalog.robot);
        let library = match hello.library {
            Some(library) => format!("library {library:08x}"),
            None => "no library".to_owned(),
        };
        let what = format!("{robot}, configuration {:08x}, {library}", hello.config_hash);
        finding(Gravity::Fine, what, String::new())
    }

    fn identity(&self, hello: &Hello) -> Option<Finding> {
        let expected = self.expected_config?;
        if expected == hello.config_hash {
            let what = format!("the robot file fits the firmware: configuration {expected:08x}");
            return Some(finding(Gravity::Fine, what, String::new()));
        }
        let what = format!(
            "the robot file does not fit: the firmware has configuration {:08x}, the robot file {expected:08x}",
            hello.config_hash
        );
        let help =
            "build the firmware from this robot file, or give the robot file of the firmware";
        Some(finding(Gravity::Wrong, what, help.into()))
    }

    fn fault(&self, fault: Fault) -> Finding {
        let (code, report) = (fault.code(), self.heard.faults.get(&fault.code()));
        let channel = report.and_then(|report| self.channel_of(report.channel));
        let number = report.and_then(|report| report.channel);
        let value = report.map(|report| report.value);
        let actuators = self.actuators();
        let mut described = fault_report_on(fault, number, channel, value, actuators);
        // The report contains the present tilt; the fault is latched since an earlier tilt.
        let is_level = |report: &FaultReport| (0.0..LEVEL_RAD).contains(&report.value);
        if fault == Fault::Tilt && report.is_some_and(is_level) {
            described = "the body was tilted, and is level again".to_owned();
        }
        let advice = fault_words(fault, actuators.kind_for(fault, number, value)).advice;
        let help = format!("{advice} (docs/faults.md, {code} {fault:?})");
        finding(Gravity::Wrong, format!("fault {code}: {described}"), help)
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

    /// Channel and value of a log entry, or its motion, in parentheses.
    pub fn entry_detail(&self, entry: &LogEntry) -> String {
        match (entry.fault, entry.motion()) {
            (Some(fault), _) => {
                report_details(fault, self.channel_of(entry.channel), Some(entry.value))
            }
            (None, Some(motion)) => format!(" ({})", self.clip(motion.0)),
            (None, None) => String::new(),
        }
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
mod tests;
