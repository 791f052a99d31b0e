//! What is to be said on the link, and when.
//!
//! Answers wait here until the bus takes them, the most urgent first. All but the answers to
//! commands are latest values or flags, and those are a few at most: whoever floods the controller
//! with requests gets the latest answers, and nothing grows.

use heapless::Deque;
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::wire::isotp::{Event, Output, Timing};
use rollwalk_protocol::wire::transport::{Endpoint, Response, frame_to_host};
use rollwalk_protocol::wire::{
    CommandAck, FaultBits, Heartbeat, HeartbeatReply, LOG_ENTRY_BYTES, MAX_LOG_ENTRIES, Node,
    ParameterAck, STATUS_PERIOD_MS, Status,
};

/// Telemetry messages of each 60 Hz frame: 240 a second, 6 % of a 500 kbit/s bus.
const TELEMETRY_PER_FRAME: u8 = 4;
const STATUS_PERIOD_US: u64 = STATUS_PERIOD_MS as u64 * 1000;
/// A fault that lasts is reported again after so long, µs.
const REPORT_PERIOD_US: u64 = 1_000_000;
/// Longest answer, bytes: a LOG with all that it may have.
const MAX_RESPONSE: usize = 13 + LOG_ENTRY_BYTES * MAX_LOG_ENTRIES;
/// A heartbeat is newer than another one if its number is ahead by so many at most, modulo 256.
const MOST_AHEAD: u8 = 127;
/// A message takes a few calls to move through the transport; after so many something is wrong.
const MAX_POLLS: usize = 4;

/// Something to say that depends on how the controller is when it is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Say {
    EstopAck,
    HeartbeatReply(HeartbeatReply),
    FaultReport { bit: u8, counter: u8 },
    Status { counter: u8 },
    CommandAck(CommandAck),
    ParameterAck(ParameterAck),
    Telemetry { channel: u8 },
    Frame(CanFrame),
    Discovered,
}

/// The controller's end of the link.
pub(crate) struct Link {
    /// Our address; `None` when the settings have no usable one.
    pub node: Option<Node>,
    /// Frames whose identifier is one of ours but whose content is not.
    pub damaged_frames: u32,
    endpoint: Endpoint,
    estop_ack: bool,
    heartbeat: Option<HeartbeatReply>,
    /// Number of the last heartbeat that was a sign of life, and when it came, µs.
    last_heartbeat: Option<(u8, u64)>,
    acks: Deque<CommandAck, 4>,
    parameter: Option<ParameterAck>,
    discovered: bool,
    last_status: Option<Status>,
    status_us: u64,
    status_due: bool,
    status_counter: u8,
    known_faults: FaultBits,
    reports: FaultBits,
    report_us: u64,
    report_counter: u8,
    telemetry_left: u8,
    telemetry_next: u8,
}

impl Link {
    pub fn new(node: u8) -> Self {
        Self {
            node: Node::new(node),
            damaged_frames: 0,
            endpoint: Endpoint::new(Timing::default()),
            estop_ack: false,
            heartbeat: None,
            last_heartbeat: None,
            acks: Deque::new(),
            parameter: None,
            discovered: false,
            last_status: None,
            status_us: 0,
            status_due: false,
            status_counter: 0,
            known_faults: FaultBits::default(),
            reports: FaultBits::default(),
            report_us: 0,
            report_counter: 0,
            telemetry_left: 0,
            telemetry_next: 0,
        }
    }

    /// Whether a message to `to` is for us. With an unusable address we still hear what is for all.
    pub fn is_for_us(&self, to: Node) -> bool {
        to == Node::BROADCAST || self.node == Some(to)
    }

    pub fn acknowledge_estop(&mut self) {
        self.estop_ack = true;
    }

    pub fn discover(&mut self) {
        self.discovered = true;
    }

    /// Takes a heartbeat. One that is not ahead of the last one is answered but is no sign of life: whatever
    /// repeats frames, one or its last few over and over, is no host. After `timeout_us` without a sign of life
    /// the count begins anew: a robot with torque has gone home by then, and a host that was started again is heard.
    pub fn on_heartbeat(&mut self, now_us: u64, heartbeat: Heartbeat, timeout_us: u32) {
        let feeds = self.last_heartbeat.is_none_or(|(seq, at_us)| {
            let ahead = heartbeat.seq.wrapping_sub(seq);
            (1..=MOST_AHEAD).contains(&ahead)
                || now_us.saturating_sub(at_us) > u64::from(timeout_us)
        });
        if feeds {
            self.last_heartbeat = Some((heartbeat.seq, now_us));
        }
        let controller_ms = (now_us / 1000) as u32;
        self.heartbeat = Some(HeartbeatReply { seq: heartbeat.seq, controller_ms });
    }

    /// When the host gave its last sign of life, µs.
    pub fn host_seen_us(&self) -> Option<u64> {
        self.last_heartbeat.map(|(_, at)| at)
    }

    pub fn acknowledge(&mut self, ack: CommandAck) {
        if self.acks.is_full() {
            self.acks.pop_front();
        }
        // Room was just made.
        let _ = self.acks.push_back(ack);
    }

    /// A host that asks again before it took the answer gets the later one.
    pub fn acknowledge_parameter(&mut self, ack: ParameterAck) {
        self.parameter = Some(ack);
    }

    /// Takes a frame of the transport; whether a request is now complete.
    pub fn on_transport(&mut self, now_us: u64, data: &[u8]) -> bool {
        self.endpoint.on_frame(data, now_us) == Event::Received
    }

    /// The last complete request.
    pub fn request(&self) -> &[u8] {
        self.endpoint.received()
    }

    /// Answers a request. A host asks one thing at a time: when it asks again, it has not got the answer
    /// to what it asked before, and does not wait for it any more.
    #[inline(never)]
    pub fn respond(&mut self, response: &Response) {
        let mut bytes = [0; MAX_RESPONSE];
        if let Some(message) = response.encode(&mut bytes) {
            self.endpoint.reset();
            // Nothing else is on its way now, and answers are not too long.
            let _ = self.endpoint.send(message);
        }
    }

    /// Once per 60 Hz frame: room for telemetry.
    pub fn allow_telemetry(&mut self) {
        self.telemetry_left = TELEMETRY_PER_FRAME;
    }

    /// Reports a fault although it is no news, because something was refused for it.
    pub fn report(&mut self, faults: FaultBits) {
        self.reports.0 |= faults.0;
    }

    /// Once per control period: is a status message due, or a fault report?
    pub fn observe(&mut self, now_us: u64, status: Status) {
        // The frame counts on all the time; that alone is no change.
        let essence = |s: Status| (s.state, s.severity, s.faults, s.clip, s.library);
        let changed = self.last_status.map(essence) != Some(essence(status));
        self.last_status = Some(status);
        self.status_due |= changed | due(&mut self.status_us, now_us, STATUS_PERIOD_US);
        self.reports.0 |= status.faults.0 & !self.known_faults.0;
        self.known_faults = status.faults;
        if due(&mut self.report_us, now_us, REPORT_PERIOD_US) {
            self.reports.0 |= status.faults.0;
        }
    }

    /// What to say next, most urgent first.
    pub fn next(&mut self, now_us: u64, channels: u8) -> Option<Say> {
        let node = self.node?;
        if core::mem::take(&mut self.estop_ack) {
            return Some(Say::EstopAck);
        }
        if let Some(reply) = self.heartbeat.take() {
            return Some(Say::HeartbeatReply(reply));
        }
        if core::mem::take(&mut self.status_due) {
            self.status_counter = self.status_counter.wrapping_add(1);
            return Some(Say::Status { counter: self.status_counter & 0xF });
        }
        if !self.reports.is_empty() {
            let bit = self.reports.0.trailing_zeros() as u8;
            self.reports.0 &= self.reports.0.wrapping_sub(1);
            self.report_counter = self.report_counter.wrapping_add(1);
            return Some(Say::FaultReport { bit, counter: self.report_counter });
        }
        if let Some(ack) = self.acks.pop_front() {
            return Some(Say::CommandAck(ack));
        }
        if let Some(ack) = self.parameter.take() {
            return Some(Say::ParameterAck(ack));
        }
        if self.telemetry_left > 0 && channels > 0 {
            self.telemetry_left -= 1;
            let channel = self.telemetry_next % channels;
            self.telemetry_next = channel.wrapping_add(1);
            return Some(Say::Telemetry { channel });
        }
        for _ in 0..MAX_POLLS {
            match self.endpoint.poll(now_us) {
                Output::Send(pdu) => return Some(Say::Frame(frame_to_host(node, &pdu))),
                Output::Failed(_) => {}
                Output::Idle => break,
            }
        }
        core::mem::take(&mut self.discovered).then_some(Say::Discovered)
    }
}

/// Whether it is time again for something periodic. Keeps the average rate whatever the rate at
/// which it is asked, and makes up for nothing after a gap.
fn due(at_us: &mut u64, now_us: u64, period_us: u64) -> bool {
    let due = now_us >= *at_us;
    if due {
        let next = at_us.saturating_add(period_us);
        *at_us = if next > now_us { next } else { now_us.saturating_add(period_us) };
    }
    due
}
