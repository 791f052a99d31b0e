//! Log of the controller: recent changes of state and faults, for later diagnosis.

use super::State;
use crate::faults::{Event, Fault};
use crate::library::NodeId;

/// Maximum number of entries of a [`Log`] message.
pub const MAX_LOG_ENTRIES: usize = 16;
/// Length of an entry, bytes.
pub const LOG_ENTRY_BYTES: usize = 12;

/// Code for a missing fault or channel.
const NONE: u8 = 0xFF;

/// Log entry: a change of state, or a fault that appeared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogEntry {
    /// Clock of the controller, low 32 bits of ms.
    pub at_ms: u32,
    /// Code of the event ([`Event::code`](crate::faults::Event::code)). A later version may have further codes.
    pub event: u8,
    /// State before the event.
    pub before: State,
    /// State after the event.
    pub after: State,
    /// Fault that the event raised.
    pub fault: Option<Fault>,
    /// Channel concerned; see [`super::FaultReport`].
    pub channel: Option<u8>,
    /// Offending value; see [`super::FaultReport`]. For a command for a motion, the number of the motion, or [`OTHER_LIBRARY`].
    pub value: f32,
}

/// Value of an entry about a motion of a library that the controller has no more.
pub const OTHER_LIBRARY: f32 = -1.0;

impl LogEntry {
    /// Number of the motion of a command for a motion of the present library.
    pub fn motion(&self) -> Option<NodeId> {
        let is_command = self.event == Event::MotionStarted.code() && self.value >= 0.0;
        // The cast saturates.
        is_command.then_some(NodeId(self.value as u8))
    }

    /// Encodes
    /// `[at u32 ms][event u8][before 4 low bits, after 4 high bits][fault u8, 255 none][channel u8, 255 none][value f32]`.
    pub fn encode(&self) -> [u8; LOG_ENTRY_BYTES] {
        let [t0, t1, t2, t3] = self.at_ms.to_le_bytes();
        let [v0, v1, v2, v3] = self.value.to_le_bytes();
        let states = self.before.code() | self.after.code() << 4;
        let fault = self.fault.map_or(NONE, Fault::code);
        let channel = self.channel.unwrap_or(NONE);
        [t0, t1, t2, t3, self.event, states, fault, channel, v0, v1, v2, v3]
    }

    /// Decodes an entry; `None` if this version does not define its state or fault.
    pub fn decode(bytes: &[u8; LOG_ENTRY_BYTES]) -> Option<Self> {
        let [t0, t1, t2, t3, event, states, fault, channel, v0, v1, v2, v3] = *bytes;
        Some(Self {
            at_ms: u32::from_le_bytes([t0, t1, t2, t3]),
            event,
            before: State::from_code(states & 0xF)?,
            after: State::from_code(states >> 4)?,
            fault: if fault == NONE { None } else { Some(Fault::from_code(fault)?) },
            channel: (channel != NONE).then_some(channel),
            value: f32::from_le_bytes([v0, v1, v2, v3]),
        })
    }
}

/// Section of the log, oldest entry first.
///
/// Entries are numbered from 0 at power-on. A controller stores only the latest ones: entries before [`first`](Self::first) are
/// lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Log {
    /// Clock of the controller when it answered, low 32 bits of ms.
    pub now_ms: u32,
    /// Number of the first entry contained; of the next entry if there are none.
    pub first: u32,
    /// Number that the next entry will get.
    pub next: u32,
    len: u8,
    entries: [[u8; LOG_ENTRY_BYTES]; MAX_LOG_ENTRIES],
}

impl Log {
    /// Log without entries.
    pub fn new(now_ms: u32, first: u32, next: u32) -> Self {
        let entries = [[0; LOG_ENTRY_BYTES]; MAX_LOG_ENTRIES];
        Self { now_ms, first, next, len: 0, entries }
    }

    /// Adds an entry. Returns true if there was room for it.
    pub fn push(&mut self, entry: [u8; LOG_ENTRY_BYTES]) -> bool {
        let Some(slot) = self.entries.get_mut(usize::from(self.len)) else { return false };
        *slot = entry;
        self.len = self.len.saturating_add(1);
        true
    }

    /// Encoded entries.
    pub fn encoded(&self) -> &[[u8; LOG_ENTRY_BYTES]] {
        self.entries.get(..usize::from(self.len)).unwrap_or(&self.entries)
    }

    /// Number and content of each entry that this version can decode.
    pub fn entries(&self) -> impl Iterator<Item = (u32, LogEntry)> {
        let numbers = (0..).map(|i| self.first.wrapping_add(i));
        numbers.zip(self.encoded()).filter_map(|(n, bytes)| Some((n, LogEntry::decode(bytes)?)))
    }
}
