//! The controller's log: recent changes of state and faults, for a diagnosis after the event.

use super::State;
use crate::faults::Fault;

/// Most entries of a [`Log`] message.
pub const MAX_LOG_ENTRIES: usize = 16;
/// Bytes of an entry.
pub const LOG_ENTRY_BYTES: usize = 12;

/// Code for no fault and for no channel.
const NONE: u8 = 0xFF;

/// A change of state, or a fault that appeared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogEntry {
    /// Controller's clock, low 32 bits of ms.
    pub at_ms: u32,
    /// [`Event::code`](crate::faults::Event::code); a later version may have more of them.
    pub event: u8,
    /// State before the event.
    pub before: State,
    /// State after the event.
    pub after: State,
    /// Fault that the event raised.
    pub fault: Option<Fault>,
    /// Channel concerned, see [`super::FaultReport`].
    pub channel: Option<u8>,
    /// Offending value, see [`super::FaultReport`].
    pub value: f32,
}

impl LogEntry {
    /// `[at u32 ms][event u8][before 4 low bits, after 4 high bits][fault u8, 255 none]`
    /// `[channel u8, 255 none][value f32]`
    pub fn encode(&self) -> [u8; LOG_ENTRY_BYTES] {
        let [t0, t1, t2, t3] = self.at_ms.to_le_bytes();
        let [v0, v1, v2, v3] = self.value.to_le_bytes();
        let states = self.before.code() | self.after.code() << 4;
        let fault = self.fault.map_or(NONE, Fault::code);
        let channel = self.channel.unwrap_or(NONE);
        [t0, t1, t2, t3, self.event, states, fault, channel, v0, v1, v2, v3]
    }

    /// Decodes an entry; `None` for a state or fault that this version does not define.
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

/// A part of the log, oldest first.
///
/// Entries are numbered from 0 at power-on. A controller keeps the latest: entries before
/// [`first`](Self::first) are lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Log {
    /// Controller's clock when it answered, low 32 bits of ms.
    pub now_ms: u32,
    /// Number of the first entry contained, or of the next one when none is.
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

    /// Adds an entry; returns whether there was room for it.
    pub fn push(&mut self, entry: [u8; LOG_ENTRY_BYTES]) -> bool {
        let Some(slot) = self.entries.get_mut(usize::from(self.len)) else { return false };
        *slot = entry;
        self.len = self.len.saturating_add(1);
        true
    }

    /// The entries as they are on the wire.
    pub fn encoded(&self) -> &[[u8; LOG_ENTRY_BYTES]] {
        self.entries.get(..usize::from(self.len)).unwrap_or(&self.entries)
    }

    /// Number and content of each entry that this version can decode.
    pub fn entries(&self) -> impl Iterator<Item = (u32, LogEntry)> {
        let numbers = (0..).map(|i| self.first.wrapping_add(i));
        numbers.zip(self.encoded()).filter_map(|(n, bytes)| Some((n, LogEntry::decode(bytes)?)))
    }
}
