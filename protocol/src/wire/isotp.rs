//! ISO 15765-2 (ISO-TP) with normal addressing: messages longer than a frame, as a state machine without clock or bus.
//!
//! An [`Endpoint`] serves both directions of a link, since data in one direction and flow control in the other have the same
//! identifier. Pass it the payload of every frame of the peer ([`Endpoint::on_frame`]), and send the frames that
//! [`Endpoint::poll`] returns. Time is an argument, in µs of any monotonic clock.
//!
//! Each direction transfers one message at a time. A lost, repeated or reordered frame ends the message with an [`IsoTpError`]
//! on the side that detects it, and with a timeout on the other side. The caller decides about retries. Frames are not padded.

use crate::can::Frame;
use thiserror::Error;

/// Maximum length of a message in ISO-TP over classic frames, bytes.
const MAX_LENGTH: usize = 4095;
/// Maximum number of consecutive wait frames of a receiver before the sender gives up (N_WFTmax).
const MAX_WAITS: u8 = 16;

/// Flow control that a receiver requests, and timeout of both ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Number of consecutive frames between two flow controls; 0 for no further flow control.
    pub block_size: u8,
    /// Minimum time between two consecutive frames, in the coding of the standard: 0 to 127 ms, or 0xF1 to 0xF9 for 100 to 900
    /// µs.
    pub st_min: u8,
    /// Longest wait for flow control or the next consecutive frame, µs (N_Bs and N_Cr).
    pub timeout_us: u64,
}

impl Default for Timing {
    /// Blocks of 16 frames without pauses, and a timeout of 1 s.
    fn default() -> Self {
        Self { block_size: 16, st_min: 0, timeout_us: 1_000_000 }
    }
}

/// Payload of a frame to send.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pdu {
    data: [u8; 8],
    len: u8,
}

impl Pdu {
    fn new(head: &[u8], body: &[u8]) -> Self {
        let mut pdu = Self::default();
        for (slot, byte) in pdu.data.iter_mut().zip(head.iter().chain(body)) {
            *slot = *byte;
            pdu.len = pdu.len.saturating_add(1);
        }
        pdu
    }

    /// Bytes of the payload.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }

    /// Frame with the given payload; excess bits of the identifier are dropped.
    pub fn frame(&self, id: u16) -> Frame {
        Frame::standard(id & 0x7FF, self.data()).unwrap_or(Frame::known(id, self.data))
    }
}

/// Reason why the transfer of a message failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum IsoTpError {
    /// A consecutive frame was lost, repeated or out of order.
    #[error("a frame of the message was lost, repeated or out of order")]
    Sequence,
    /// The peer stopped sending in the middle of a message (N_Cr).
    #[error("the rest of the message did not arrive in time")]
    ReceiveTimeout,
    /// The peer sent no flow control in time (N_Bs).
    #[error("the receiver did not request the rest of the message in time")]
    SendTimeout,
    /// The peer's receive buffer is too small for the message.
    #[error("the receiver has no room for the message")]
    PeerOverflow,
    /// The peer's message exceeds the receive buffer. An overflow frame was sent to the peer.
    #[error("the message is too long")]
    TooLong,
    /// The peer sends too many wait frames, or an invalid flow control.
    #[error("the receiver did not become ready")]
    BadFlowControl,
}

/// Reason why a message is refused for sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SendError {
    /// An earlier message is still being sent.
    #[error("the previous message is still being sent")]
    Busy,
    /// The message is empty, or longer than the endpoint's buffer.
    #[error("the message is empty or too long")]
    BadLength,
}

/// Effect of a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Message incomplete, or frame ignored.
    None,
    /// A message is complete; [`Endpoint::received`] returns it.
    Received,
    /// A message failed.
    Failed(IsoTpError),
}

/// Next action of an endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// Wait: there is nothing to send now.
    Idle,
    /// Payload of the next frame to send.
    Send(Pdu),
    /// A message timed out.
    Failed(IsoTpError),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SendState {
    Idle,
    /// Single or first frame not sent yet.
    Start,
    /// Waiting for flow control.
    Waiting {
        since_us: u64,
        waits: u8,
    },
    /// Sending consecutive frames. If `bounded`, `left` of them remain until the next flow control.
    Streaming {
        left: u8,
        bounded: bool,
        st_min_us: u64,
        not_before_us: u64,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ReceiveState {
    Idle,
    /// Receiving a message of `len` bytes.
    Collecting {
        len: usize,
        sequence: u8,
        left: u8,
        since_us: u64,
    },
}

/// End of a link, with buffers for a message of `N` bytes in each direction.
#[derive(Clone, Debug)]
pub struct Endpoint<const N: usize> {
    timing: Timing,
    tx: [u8; N],
    tx_len: usize,
    tx_at: usize,
    tx_sequence: u8,
    sending: SendState,
    rx: [u8; N],
    rx_at: usize,
    receiving: ReceiveState,
    flow_control: Option<Pdu>,
}

impl<const N: usize> Endpoint<N> {
    /// Creates an idle endpoint.
    pub fn new(timing: Timing) -> Self {
        const { assert!(N > 0 && N <= MAX_LENGTH, "ISO-TP carries 1 to 4095 bytes") };
        Self {
            timing,
            tx: [0; N],
            tx_len: 0,
            tx_at: 0,
            tx_sequence: 0,
            sending: SendState::Idle,
            rx: [0; N],
            rx_at: 0,
            receiving: ReceiveState::Idle,
            flow_control: None,
        }
    }

    /// Accepts a message for sending; [`poll`](Self::poll) returns its frames.
    pub fn send(&mut self, message: &[u8]) -> Result<(), SendError> {
        if self.is_sending() {
            return Err(SendError::Busy);
        }
        let slot = self.tx.get_mut(..message.len()).filter(|slot| !slot.is_empty());
        slot.ok_or(SendError::BadLength)?.copy_from_slice(message);
        (self.tx_len, self.tx_at, self.tx_sequence) = (message.len(), 0, 0);
        self.sending = SendState::Start;
        Ok(())
    }

    /// True if frames of a message remain to be sent.
    pub fn is_sending(&self) -> bool {
        self.sending != SendState::Idle
    }

    /// Previous complete message, until a frame of the next one arrives.
    pub fn received(&self) -> &[u8] {
        match self.receiving {
            ReceiveState::Idle => self.rx.get(..self.rx_at).unwrap_or(&[]),
            ReceiveState::Collecting { .. } => &[],
        }
    }

    /// Drops the remaining frames of the message being sent.
    pub fn stop_sending(&mut self) {
        self.sending = SendState::Idle;
    }

    /// Drops the messages in both directions.
    pub fn reset(&mut self) {
        self.stop_sending();
        self.drop_reception();
        self.flow_control = None;
    }

    /// Processes the payload of a frame from the peer.
    pub fn on_frame(&mut self, data: &[u8], now_us: u64) -> Event {
        let Some((&head, rest)) = data.split_first() else { return Event::None };
        match head >> 4 {
            0 => self.on_single(head, rest),
            1 => self.on_first(head, rest, now_us),
            2 => self.on_consecutive(head & 0xF, rest, now_us),
            3 => self.on_flow_control(head & 0xF, rest, now_us),
            _ => Event::None,
        }
    }

    /// Returns the next action at `now_us`; call it until it returns [`Output::Idle`].
    pub fn poll(&mut self, now_us: u64) -> Output {
        if let Some(pdu) = self.flow_control.take() {
            return Output::Send(pdu);
        }
        let late = |since: u64| now_us.saturating_sub(since) > self.timing.timeout_us;
        if let ReceiveState::Collecting { since_us, .. } = self.receiving
            && late(since_us)
        {
            self.drop_reception();
            return Output::Failed(IsoTpError::ReceiveTimeout);
        }
        match self.sending {
            SendState::Idle => Output::Idle,
            SendState::Start => Output::Send(self.start(now_us)),
            SendState::Waiting { since_us, .. } if late(since_us) => {
                self.sending = SendState::Idle;
                Output::Failed(IsoTpError::SendTimeout)
            }
            SendState::Waiting { .. } => Output::Idle,
            SendState::Streaming { not_before_us, .. } if now_us < not_before_us => Output::Idle,
            SendState::Streaming { left, bounded, st_min_us, .. } => {
                Output::Send(self.consecutive(left, bounded, st_min_us, now_us))
            }
        }
    }

    fn start(&mut self, now_us: u64) -> Pdu {
        let message = self.tx.get(..self.tx_len).unwrap_or(&[]);
        if message.len() <= 7 {
            self.sending = SendState::Idle;
            return Pdu::new(&[message.len() as u8], message);
        }
        let head = [0x10 | (message.len() >> 8) as u8 & 0xF, message.len() as u8];
        self.tx_at = 6;
        self.tx_sequence = 1;
        self.sending = SendState::Waiting { since_us: now_us, waits: 0 };
        Pdu::new(&head, message)
    }

    fn consecutive(&mut self, left: u8, bounded: bool, st_min_us: u64, now_us: u64) -> Pdu {
        let rest = self.tx.get(self.tx_at..self.tx_len).unwrap_or(&[]);
        let count = rest.len().min(7);
        let pdu = Pdu::new(&[0x20 | self.tx_sequence], rest);
        self.sending = if count == rest.len() {
            SendState::Idle
        } else if bounded && left <= 1 {
            SendState::Waiting { since_us: now_us, waits: 0 }
        } else {
            let not_before_us = now_us.saturating_add(st_min_us);
            SendState::Streaming { left: left.saturating_sub(1), bounded, st_min_us, not_before_us }
        };
        self.tx_at = self.tx_at.saturating_add(count);
        self.tx_sequence = self.tx_sequence.wrapping_add(1) & 0xF;
        pdu
    }

    fn on_flow_control(&mut self, status: u8, rest: &[u8], now_us: u64) -> Event {
        let SendState::Waiting { waits, .. } = self.sending else { return Event::None };
        let mut fail = |error| {
            self.sending = SendState::Idle;
            Event::Failed(error)
        };
        match (status, rest) {
            (0, &[block_size, st_min, ..]) => {
                self.sending = SendState::Streaming {
                    left: block_size,
                    bounded: block_size > 0,
                    st_min_us: st_min_us(st_min),
                    not_before_us: now_us,
                };
                Event::None
            }
            (1, _) if waits < MAX_WAITS => {
                self.sending = SendState::Waiting { since_us: now_us, waits: waits + 1 };
                Event::None
            }
            (2, _) => fail(IsoTpError::PeerOverflow),
            _ => fail(IsoTpError::BadFlowControl),
        }
    }

    fn on_single(&mut self, head: u8, rest: &[u8]) -> Event {
        let len = usize::from(head & 0xF);
        let (Some(bytes), 1..=7) = (rest.get(..len), len) else { return Event::None };
        let Some(slot) = self.rx.get_mut(..len) else {
            return Event::Failed(IsoTpError::TooLong);
        };
        // A new message replaces an incomplete one.
        slot.copy_from_slice(bytes);
        self.rx_at = len;
        self.receiving = ReceiveState::Idle;
        Event::Received
    }

    fn on_first(&mut self, head: u8, rest: &[u8], now_us: u64) -> Event {
        let Some((&low, bytes)) = rest.split_first() else { return Event::None };
        let len = usize::from(head & 0xF) << 8 | usize::from(low);
        // Shorter messages use a single frame, so a first frame is always full.
        if len < 8 || bytes.len() != 6 {
            return Event::None;
        }
        self.drop_reception();
        let slot = self.rx.get_mut(..6).filter(|_| len <= N);
        let Some(slot) = slot else {
            self.flow_control = Some(Pdu::new(&[0x32, 0, 0], &[]));
            return Event::Failed(IsoTpError::TooLong);
        };
        slot.copy_from_slice(bytes);
        self.rx_at = 6;
        let left = self.timing.block_size;
        self.receiving = ReceiveState::Collecting { len, sequence: 1, left, since_us: now_us };
        self.ask_for_more();
        Event::None
    }

    fn on_consecutive(&mut self, number: u8, rest: &[u8], now_us: u64) -> Event {
        let ReceiveState::Collecting { len, sequence, left, .. } = self.receiving else {
            return Event::None;
        };
        let count = len.saturating_sub(self.rx_at).min(7);
        let end = self.rx_at.saturating_add(count);
        let (true, Some(bytes), Some(slot)) =
            (number == sequence, rest.get(..count), self.rx.get_mut(self.rx_at..end))
        else {
            self.drop_reception();
            return Event::Failed(IsoTpError::Sequence);
        };
        slot.iter_mut().zip(bytes).for_each(|(slot, byte)| *slot = *byte);
        self.rx_at = end;
        if end == len {
            self.receiving = ReceiveState::Idle;
            return Event::Received;
        }
        let block_done = self.timing.block_size > 0 && left <= 1;
        let left = if block_done { self.timing.block_size } else { left.saturating_sub(1) };
        let sequence = (sequence + 1) & 0xF;
        self.receiving = ReceiveState::Collecting { len, sequence, left, since_us: now_us };
        if block_done {
            self.ask_for_more();
        }
        Event::None
    }

    fn ask_for_more(&mut self) {
        let head = [0x30, self.timing.block_size, self.timing.st_min];
        self.flow_control = Some(Pdu::new(&head, &[]));
    }

    fn drop_reception(&mut self) {
        self.receiving = ReceiveState::Idle;
        self.rx_at = 0;
    }
}

/// Minimum separation time of a code, µs. As in the standard, reserved codes mean the longest time.
fn st_min_us(code: u8) -> u64 {
    match code {
        0..=0x7F => u64::from(code) * 1000,
        0xF1..=0xF9 => u64::from(code - 0xF0) * 100,
        _ => 127_000,
    }
}
