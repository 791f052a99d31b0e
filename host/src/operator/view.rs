//! What there is to show: a value, made from the operator's state at an instant.

use super::log::Message;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_protocol::wire::{JointTelemetry, Status};
use std::collections::{BTreeMap, VecDeque};

/// All there is to show.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The instant, µs.
    pub now_us: u64,
    /// The controller's address.
    pub node: u8,
    /// How well the link carries.
    pub link: LinkView,
    /// Why the bus is lost, if it is.
    pub bus_lost: Option<String>,
    /// What is wrong with the bus and what would help, if something is known to be.
    pub complaint: Option<String>,
    /// Who the controller says it is.
    pub hello: Option<Hello>,
    /// Why this host must not arm it, if so.
    pub stranger: Option<String>,
    /// Its last status.
    pub status: Option<Status>,
    /// Faults that are present or were told a moment ago.
    pub faults: Vec<FaultView>,
    /// What to do next, without naming keys.
    pub advice: &'static str,
    /// Joints and wheels by channel.
    pub joints: BTreeMap<u8, JointView>,
    /// Part of the planned speed that motions are asked for at, in 64ths.
    pub speed_64ths: i8,
    /// Code of the motion that was asked for last, and its speed in 64ths.
    pub asked: Option<(u8, i8)>,
    /// What is being asked for right now.
    pub asking: Option<String>,
    /// An emergency stop was sent and is not acknowledged yet.
    pub stopping: bool,
    /// Whether the deadman is held; `None` without one.
    pub deadman_held: Option<bool>,
    /// Whether the operator is leaving.
    pub leaving: Leaving,
    /// What was said, oldest first.
    pub messages: VecDeque<Message>,
}

/// How well the link carries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkView {
    /// The controller was heard within half a second.
    pub contact: bool,
    /// From a heartbeat to its answer, µs.
    pub round_trip_us: Option<u64>,
    /// Since the last status, µs.
    pub status_age_us: Option<u64>,
    /// Status frames that arrived.
    pub received: u64,
    /// Status frames that did not, by their counter.
    pub lost: u64,
}

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultView {
    /// Which.
    pub fault: Fault,
    /// Whether the status word has it; if not it was told because arming was refused.
    pub present: bool,
    /// Channel that it is about.
    pub channel: Option<u8>,
    /// The offending value, SI units; `None` before its details are known.
    pub value: Option<f32>,
}

/// A joint or wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointView {
    /// What was told last.
    pub told: JointTelemetry,
    /// Since then, µs.
    pub age_us: u64,
}

/// Whether the operator is leaving.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leaving {
    /// No.
    No,
    /// As soon as the robot is home, without torque.
    WhenHome,
    /// Torque is off: nothing keeps the operator any more.
    Now,
}
