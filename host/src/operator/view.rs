//! Snapshot of the operator's state with everything that a console shows.

use super::log::Message;
use crate::transfer::Progress;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_protocol::wire::{JointTelemetry, Status};
use std::collections::{BTreeMap, VecDeque};

/// A snapshot for the console.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Time of the snapshot, µs.
    pub now_us: u64,
    /// The controller's address.
    pub node: u8,
    /// Quality of the link.
    pub link: LinkView,
    /// Cause of the loss of the bus, if it is lost.
    pub bus_lost: Option<String>,
    /// A known fault of the bus and its remedy.
    pub complaint: Option<String>,
    /// The controller's identity.
    pub hello: Option<Hello>,
    /// Reason for which this host must not arm the controller.
    pub mismatch: Option<String>,
    /// Last status of the controller.
    pub status: Option<Status>,
    /// Faults that are present, or because of which ARM was refused recently.
    pub faults: Vec<FaultView>,
    /// Advice on the next step, without naming keys.
    pub advice: &'static str,
    /// Joints and wheels by channel.
    pub joints: BTreeMap<u8, JointView>,
    /// Commanded playback speed, in 64ths of the planned speed.
    pub speed_64ths: i8,
    /// Code and speed, in 64ths, of the last accepted motion command.
    pub asked: Option<(u8, i8)>,
    /// The command that is in flight or waits to be sent.
    pub asking: Option<String>,
    /// An emergency stop was sent and is not acknowledged yet.
    pub stopping: bool,
    /// True while the deadman is held; `None` without a deadman.
    pub deadman_held: Option<bool>,
    /// Stage of the operator's exit.
    pub leaving: Leaving,
    /// Progress of the transfer of a library that is under way.
    pub transfer: Option<Progress>,
    /// Messages, oldest first.
    pub messages: VecDeque<Message>,
}

/// Quality of the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkView {
    /// True if the last status is recent.
    pub contact: bool,
    /// Time from a heartbeat to its answer, µs.
    pub round_trip_us: Option<u64>,
    /// Age of the last status, µs.
    pub status_age_us: Option<u64>,
    /// Status frames received.
    pub received: u64,
    /// Status frames lost, by their counter.
    pub lost: u64,
}

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultView {
    /// The fault.
    pub fault: Fault,
    /// True if STATUS reports the fault, false if ARM was refused because of it.
    pub present: bool,
    /// Channel of its report.
    pub channel: Option<u8>,
    /// Value of its report; `None` before a report.
    pub value: Option<f32>,
}

/// A joint or wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointView {
    /// Last telemetry.
    pub telemetry: JointTelemetry,
    /// Age of the telemetry, µs.
    pub age_us: u64,
}

/// Stage of the operator's exit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leaving {
    /// The operator is not leaving.
    No,
    /// The operator leaves once the robot has reached SAFE and torque is off.
    WhenHome,
    /// The operator leaves at once: torque is off, or the operator insists.
    Now,
}
