//! Snapshot of the operator's state that a console shows.

use super::log::Message;
use crate::transfer::Progress;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_protocol::wire::{ActuatorReadings, JointTelemetry, Status};
use std::collections::{BTreeMap, VecDeque};

/// Snapshot for a console.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Time of the snapshot, µs.
    pub now_us: u64,
    /// Address of the controller.
    pub node: u8,
    /// Quality of the link.
    pub link: LinkView,
    /// Cause of the loss of the bus; `None` if the bus is not lost.
    pub bus_lost: Option<String>,
    /// Known fault of the bus and its remedy.
    pub complaint: Option<String>,
    /// Identity of the controller.
    pub hello: Option<Hello>,
    /// Reason why this host must not arm the controller.
    pub mismatch: Option<String>,
    /// Latest status of the controller.
    pub status: Option<Status>,
    /// Description of the robot's state with its faults, to follow "the robot is"; `None` without a status.
    pub condition: Option<String>,
    /// Faults that are present, or have recently caused a refusal of ARM.
    pub faults: Vec<FaultView>,
    /// Advice on the next step, without names of keys.
    pub advice: &'static str,
    /// Joints and wheels by channel.
    pub joints: BTreeMap<u8, JointView>,
    /// Commanded playback speed, in 64ths of the planned speed.
    pub speed_64ths: i8,
    /// Code and speed, in 64ths, of the latest accepted motion command.
    pub asked: Option<(u8, i8)>,
    /// Description of the command in flight, or otherwise of the waiting one.
    pub asking: Option<String>,
    /// True if an emergency stop was sent and is not acknowledged yet.
    pub stopping: bool,
    /// True while the deadman is held; `None` without a deadman.
    pub deadman_held: Option<bool>,
    /// Stage of the operator's exit.
    pub leaving: ExitStage,
    /// Progress of a library transfer.
    pub transfer: Option<Progress>,
    /// Messages, oldest first.
    pub messages: VecDeque<Message>,
}

/// Quality of the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkView {
    /// True if the latest status is recent.
    pub contact: bool,
    /// Time from a heartbeat to its answer, µs.
    pub round_trip_us: Option<u64>,
    /// Age of the latest status, µs.
    pub status_age_us: Option<u64>,
    /// Number of received status frames.
    pub received: u64,
    /// Number of lost status frames, according to their counter.
    pub lost: u64,
}

/// Fault to show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultView {
    /// The fault.
    pub fault: Fault,
    /// True if STATUS reports the fault; false if ARM was refused because of it.
    pub present: bool,
    /// Channel of the fault's report.
    pub channel: Option<u8>,
    /// Value of the fault's report; `None` before a report.
    pub value: Option<f32>,
}

/// State of a joint or wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointView {
    /// Latest telemetry.
    pub telemetry: JointTelemetry,
    /// Age of the telemetry, µs.
    pub age_us: u64,
    /// Latest temperature and supply voltage; `None` if the actuator does not report them.
    pub readings: Option<ActuatorReadings>,
}

/// Stage of the operator's exit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExitStage {
    /// The operator is not leaving.
    No,
    /// The operator ends the session when the robot has reached SAFE and torque is off.
    WhenHome,
    /// The operator ends the session at once, because torque is off or the operator has requested the end twice.
    Now,
}
