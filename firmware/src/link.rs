//! Transmit scheduler of the host link: status, faults, answers and telemetry, the most urgent first.
//!
//! Messages wait here until the bus accepts them. Acknowledgements of commands have a short queue. Each other message has a
//! single slot for its latest value, or a flag. A host that floods the controller with requests therefore receives the latest
//! answers, and memory use stays bounded.

use heapless::Deque;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::FaultBits;
use rollwalk_protocol::time::wrapping_ms;
use rollwalk_protocol::wire::isotp::{Event, Output, Timing};
use rollwalk_protocol::wire::transport::{Endpoint, Response, frame_to_host};
use rollwalk_protocol::wire::{
    CommandAck, HEARTBEAT_PERIOD_MS, Heartbeat, HeartbeatReply, LOG_ENTRY_BYTES, MAX_LOG_ENTRIES,
    Node, ParameterAck, STATUS_PERIOD_MS, Status,
};

/// Number of telemetry messages in each 60 Hz frame: 240 a second, 6 % of a 500 kbit/s bus.
const TELEMETRY_PER_FRAME: u8 = 4;
const STATUS_PERIOD_US: u64 = STATUS_PERIOD_MS as u64 * 1000;
/// Interval between readings of actuators, µs. On a robot with ten channels, each is reported once a second.
const READINGS_PERIOD_US: u64 = 100_000;
/// Interval at which a lasting fault is reported again, µs.
const REPORT_PERIOD_US: u64 = 1_000_000;
/// Longest answer, bytes: a LOG with the maximum number of entries.
const MAX_RESPONSE: usize = 13 + LOG_ENTRY_BYTES * MAX_LOG_ENTRIES;
/// Largest immediate lead of a heartbeat's number over the previous one, modulo 256.
const AHEAD: u32 = 2;
/// Time after which the lead may be larger by one, µs: half the heartbeat period. Numbers that rise faster are repetitions of
/// old heartbeats, such as 0, 100, 200 over and over.
const AHEAD_US: u32 = HEARTBEAT_PERIOD_MS * 1000 / 2;
/// Maximum number of polls of the transport for its next frame. Some polls only report that a message failed.
const MAX_POLLS: usize = 4;

/// Message whose content is sampled at the time of transmission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outgoing {
    EstopAck,
    HeartbeatReply(HeartbeatReply),
    FaultReport { bit: u8, counter: u8 },
    Status { counter: u8 },
    CommandAck(CommandAck),
    ParameterAck(ParameterAck),
    Telemetry { channel: u8 },
    Readings { channel: u8 },
    Gyro,
    Accelerometer,
    Sample { number: u8 },
    Frame(Frame),
    Discovered,
}

/// Controller's end of the link.
pub(crate) struct Link {
    /// Address of this controller; `None` if the settings contain an invalid one.
    pub node: Option<Node>,
    /// Number of frames with an identifier of this node but invalid content.
    pub damaged_frames: u32,
    endpoint: Endpoint,
    estop_ack: bool,
    heartbeat: Option<HeartbeatReply>,
    /// Number and time, µs, of the latest heartbeat that fed the watchdog.
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
    readings_us: u64,
    readings_due: bool,
    readings_next: u8,
    batch: Option<Batch>,
}

/// Batch of measurements that is being sent.
#[derive(Clone, Copy, Debug)]
struct Batch {
    /// Number of the batch's sample.
    number: u8,
    /// Next message: gyro, accelerometer, channels, sample.
    next: u8,
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
            readings_us: 0,
            readings_due: false,
            readings_next: 0,
            batch: None,
        }
    }

    /// True if a message to `to` is for this node. With an invalid address, only broadcasts are.
    pub fn is_for_us(&self, to: Node) -> bool {
        to == Node::BROADCAST || self.node == Some(to)
    }

    pub fn acknowledge_estop(&mut self) {
        self.estop_ack = true;
    }

    pub fn discover(&mut self) {
        self.discovered = true;
    }

    /// Processes a heartbeat.
    ///
    /// A heartbeat that is not ahead of the previous one is answered, but does not feed the watchdog. A bridge may repeat old
    /// frames without a host. After `timeout_us` without a valid heartbeat, any number is accepted. A robot with torque has then
    /// begun to return to SAFE, and a restarted host can connect.
    pub fn on_heartbeat(&mut self, now_us: u64, heartbeat: Heartbeat, timeout_us: u32) {
        let feeds = self.last_heartbeat.is_none_or(|(seq, at_us)| {
            let ahead = u32::from(heartbeat.seq.wrapping_sub(seq));
            // A 64-bit division takes a kilobyte of code.
            let silent_us = u32::try_from(now_us.saturating_sub(at_us)).unwrap_or(u32::MAX);
            (1..=AHEAD + silent_us / AHEAD_US).contains(&ahead) || silent_us > timeout_us
        });
        if feeds {
            self.last_heartbeat = Some((heartbeat.seq, now_us));
        }
        self.answer_heartbeat(now_us, heartbeat);
    }

    /// Answers a heartbeat without feeding the watchdog.
    pub fn answer_heartbeat(&mut self, now_us: u64, heartbeat: Heartbeat) {
        let controller_ms = wrapping_ms(now_us);
        self.heartbeat = Some(HeartbeatReply { seq: heartbeat.seq, controller_ms });
    }

    /// Time of the latest heartbeat that fed the watchdog, µs.
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

    /// Queues an answer to a parameter request. It replaces an answer that was not sent yet.
    pub fn acknowledge_parameter(&mut self, ack: ParameterAck) {
        self.parameter = Some(ack);
    }

    /// Processes a transport frame; returns true if it completed a request.
    pub fn on_transport(&mut self, now_us: u64, data: &[u8]) -> bool {
        self.endpoint.on_frame(data, now_us) == Event::Received
    }

    /// Latest complete request.
    pub fn request(&self) -> &[u8] {
        self.endpoint.received()
    }

    /// Answers a request.
    ///
    /// A host has only one request pending: a new one means that the host no longer waits for the answer to the previous one.
    #[inline(never)]
    pub fn respond(&mut self, response: &Response) {
        let mut bytes = [0; MAX_RESPONSE];
        if let Some(message) = response.encode(&mut bytes) {
            self.send_message(message);
        }
    }

    /// Sends an answer that is already encoded.
    pub fn send_message(&mut self, message: &[u8]) {
        self.endpoint.reset();
        // No other message is in transmission, and answers fit.
        let _ = self.endpoint.send(message);
    }

    /// Permits the telemetry messages of one 60 Hz frame.
    pub fn allow_telemetry(&mut self) {
        self.telemetry_left = TELEMETRY_PER_FRAME;
    }

    /// Sends the measurements of a sample next, in place of other telemetry.
    ///
    /// Returns false and sends nothing if measurements of the previous sample are still unsent.
    pub fn begin_batch(&mut self, number: u8) -> bool {
        let is_free = self.batch.is_none();
        if is_free {
            self.batch = Some(Batch { number, next: 0 });
        }
        self.telemetry_left = 0;
        is_free
    }

    /// Schedules another report of known faults, because a command was refused for them.
    pub fn report(&mut self, faults: FaultBits) {
        self.reports.0 |= faults.0;
    }

    /// Schedules status messages and fault reports. Call it once per control period.
    pub fn observe(&mut self, now_us: u64, status: Status) {
        // The frame number always advances; that alone is not a change of status.
        let essence = |s: Status| (s.state, s.severity, s.faults, s.clip, s.library);
        let changed = self.last_status.map(essence) != Some(essence(status));
        self.last_status = Some(status);
        self.status_due |= changed | due(&mut self.status_us, now_us, STATUS_PERIOD_US);
        self.readings_due |= due(&mut self.readings_us, now_us, READINGS_PERIOD_US);
        self.reports.0 |= status.faults.0 & !self.known_faults.0;
        self.known_faults = status.faults;
        if due(&mut self.report_us, now_us, REPORT_PERIOD_US) {
            self.reports.0 |= status.faults.0;
        }
    }

    /// Returns the next message to send, most urgent first.
    pub fn next(&mut self, now_us: u64, channels: u8) -> Option<Outgoing> {
        let node = self.node?;
        if core::mem::take(&mut self.estop_ack) {
            return Some(Outgoing::EstopAck);
        }
        if let Some(reply) = self.heartbeat.take() {
            return Some(Outgoing::HeartbeatReply(reply));
        }
        if core::mem::take(&mut self.status_due) {
            self.status_counter = self.status_counter.wrapping_add(1);
            return Some(Outgoing::Status { counter: self.status_counter & 0xF });
        }
        if !self.reports.is_empty() {
            let bit = self.reports.0.trailing_zeros() as u8;
            self.reports.0 &= self.reports.0.wrapping_sub(1);
            self.report_counter = self.report_counter.wrapping_add(1);
            return Some(Outgoing::FaultReport { bit, counter: self.report_counter });
        }
        if let Some(ack) = self.acks.pop_front() {
            return Some(Outgoing::CommandAck(ack));
        }
        if let Some(ack) = self.parameter.take() {
            return Some(Outgoing::ParameterAck(ack));
        }
        if let Some(Batch { number, next }) = self.batch {
            self.batch = Some(Batch { number, next: next.saturating_add(1) });
            return Some(match next {
                0 => Outgoing::Gyro,
                1 => Outgoing::Accelerometer,
                next if next - 2 < channels => Outgoing::Telemetry { channel: next - 2 },
                _ => {
                    self.batch = None;
                    Outgoing::Sample { number }
                }
            });
        }
        if core::mem::take(&mut self.readings_due) && channels > 0 {
            let channel = self.readings_next % channels;
            self.readings_next = channel.wrapping_add(1);
            return Some(Outgoing::Readings { channel });
        }
        if self.telemetry_left > 0 && channels > 0 {
            self.telemetry_left -= 1;
            let channel = self.telemetry_next % channels;
            self.telemetry_next = channel.wrapping_add(1);
            return Some(Outgoing::Telemetry { channel });
        }
        for _ in 0..MAX_POLLS {
            match self.endpoint.poll(now_us) {
                Output::Send(pdu) => return Some(Outgoing::Frame(frame_to_host(node, &pdu))),
                Output::Failed(_) => {}
                Output::Idle => break,
            }
        }
        core::mem::take(&mut self.discovered).then_some(Outgoing::Discovered)
    }
}

/// True if a periodic message is due.
///
/// Keeps the average rate at any polling rate. Periods missed in a gap are dropped.
fn due(at_us: &mut u64, now_us: u64, period_us: u64) -> bool {
    let due = now_us >= *at_us;
    if due {
        let next = at_us.saturating_add(period_us);
        *at_us = if next > now_us { next } else { now_us.saturating_add(period_us) };
    }
    due
}
