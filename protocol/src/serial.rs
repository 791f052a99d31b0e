//! Link over a serial line, from a host without CAN to a board with its own buses and clock.
//!
//! Frames of the link are sent in [`packet`]s without delay, in both directions. Transport messages, which CAN requires in
//! segments, cross the line whole: a [`Gateway`] at each end does the segmentation. The host can also request a [`BoardReport`]
//! of the board. It contains reset cause and error counters, which the controller's own messages lack.

use crate::can::Frame;
use crate::packet::{self, CRC_LEN, Reader, line_len};
use crate::wire::transport::MAX_MESSAGE;
use heapless::Vec;

mod gateway;

pub use gateway::Gateway;

/// Maximum size of a packet before stuffing, bytes: kind, identifier, message and checksum.
const MAX_PACKET: usize = 3 + MAX_MESSAGE + CRC_LEN;

/// Bytes for the line, including the final zero.
pub type Line = Vec<u8, { line_len(MAX_PACKET) }>;
/// Deframer of packets on the link's serial line.
pub type Deframer = packet::Deframer<MAX_PACKET>;
type Writer = packet::Writer<MAX_PACKET>;

// Distinct from the kinds of `tunnel`, so that a board ignores the other protocol's host.
const KIND_LINK: u8 = 16;
const KIND_ASK: u8 = 17;
const KIND_REPORT: u8 = 18;
const KIND_MESSAGE: u8 = 19;

/// Number of buses in a [`BoardReport`]: the link and two actuator buses.
pub const BUSES: usize = 3;

/// Packet on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packet<'a> {
    /// Frame of the link, in either direction, except those of the transport.
    Link(Frame),
    /// Whole message of the transport.
    Message {
        /// Identifier of the CAN frames that would contain the message.
        id: u16,
        /// Content, 1 to [`MAX_MESSAGE`] bytes.
        bytes: &'a [u8],
    },
    /// Request of the host for a report.
    Ask,
    /// Report of the board.
    Report(BoardReport),
}

/// Status report of a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BoardReport {
    /// Hash of the robot that the image was built for ([`crate::config::RobotConfig::hash`]).
    pub config_hash: u32,
    /// Cause of the latest reset.
    pub reset: Reset,
    /// Brown-out reset level, as numbered by the chip.
    pub brown_out_level: u8,
    /// Time since the reset, ms.
    pub uptime_ms: u32,
    /// Number of control periods without a tick.
    pub missed_periods: u32,
    /// Duration of the longest tick, µs.
    pub longest_tick_us: u32,
    /// Number of flash reads with uncorrectable ECC errors.
    pub broken_words: u32,
    /// Status of the link, then of the actuator buses.
    pub buses: [BusReport; BUSES],
}

/// Cause of a board's reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reset {
    /// Another cause.
    #[default]
    Other,
    /// Power-on or brown-out.
    PowerOn,
    /// Reset button.
    Pin,
    /// Independent watchdog: the control loop had stopped.
    Watchdog,
    /// Software, such as a debugger.
    Software,
}

/// Status of a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusReport {
    /// Error state of the bus.
    pub state: BusState,
    /// Transmit error counter.
    pub transmit_errors: u8,
    /// Receive error counter.
    pub receive_errors: u8,
    /// Number of frames lost because earlier ones had not been read.
    pub lost: u16,
}

/// Error state of a CAN controller, as reported by a board or a driver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BusState {
    /// Error active: no fault.
    #[default]
    Active,
    /// Missing acknowledgements: no other node with power is on the bus.
    NotAcknowledged,
    /// Error passive: 128 errors or more.
    Passive,
    /// Bus-off: disconnected from the bus until a restart.
    Off,
}

impl<'a> Packet<'a> {
    /// Encodes the packet for the line; `None` if it does not fit.
    pub fn encode(&self) -> Option<Line> {
        let mut packet = Writer::default();
        match self {
            Self::Link(frame) => {
                packet.put(&[KIND_LINK])?;
                packet.frame(frame)?;
            }
            Self::Message { id, bytes } => {
                let [low, high] = id.to_le_bytes();
                packet.put(&[KIND_MESSAGE, low, high])?;
                packet.put(bytes)?;
            }
            Self::Ask => packet.put(&[KIND_ASK])?,
            Self::Report(report) => {
                packet.put(&[KIND_REPORT, report.reset as u8, report.brown_out_level])?;
                let BoardReport { config_hash, uptime_ms, missed_periods, .. } = *report;
                let BoardReport { longest_tick_us, broken_words, .. } = *report;
                for word in [config_hash, uptime_ms, missed_periods, longest_tick_us, broken_words]
                {
                    packet.put(&word.to_le_bytes())?;
                }
                for bus in report.buses {
                    packet.put(&[bus.state as u8, bus.transmit_errors, bus.receive_errors])?;
                    packet.put(&bus.lost.to_le_bytes())?;
                }
            }
        }
        packet.finish()
    }

    /// Decodes a packet of a [`Deframer`]; `None` for any other packet.
    pub fn decode(packet: &'a [u8]) -> Option<Self> {
        let mut rest = Reader(packet);
        let [kind] = rest.take()?;
        let packet = match kind {
            KIND_LINK => Self::Link(rest.frame()?),
            KIND_MESSAGE => {
                let id = u16::from_le_bytes(rest.take()?);
                let bytes = core::mem::take(&mut rest.0);
                let sound = id < 0x800 && (1..=MAX_MESSAGE).contains(&bytes.len());
                sound.then_some(Self::Message { id, bytes })?
            }
            KIND_ASK => Self::Ask,
            KIND_REPORT => {
                let [reset, brown_out_level] = rest.take()?;
                let mut report = BoardReport {
                    reset: Reset::from_byte(reset)?,
                    brown_out_level,
                    config_hash: rest.u32()?,
                    uptime_ms: rest.u32()?,
                    missed_periods: rest.u32()?,
                    longest_tick_us: rest.u32()?,
                    broken_words: rest.u32()?,
                    ..BoardReport::default()
                };
                for bus in &mut report.buses {
                    let [state, transmit_errors, receive_errors] = rest.take()?;
                    let state = BusState::from_byte(state)?;
                    let lost = u16::from_le_bytes(rest.take()?);
                    *bus = BusReport { state, transmit_errors, receive_errors, lost };
                }
                Self::Report(report)
            }
            _ => return None,
        };
        rest.0.is_empty().then_some(packet)
    }
}

impl Reset {
    fn from_byte(byte: u8) -> Option<Self> {
        [Self::Other, Self::PowerOn, Self::Pin, Self::Watchdog, Self::Software]
            .get(usize::from(byte))
            .copied()
    }
}

impl BusState {
    fn from_byte(byte: u8) -> Option<Self> {
        [Self::Active, Self::NotAcknowledged, Self::Passive, Self::Off]
            .get(usize::from(byte))
            .copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tunnel::Request;
    use proptest::prelude::*;

    fn bus() -> impl Strategy<Value = BusReport> {
        (0u8..4, any::<u8>(), any::<u8>(), any::<u16>()).prop_map(
            |(state, transmit_errors, receive_errors, lost)| {
                let state = BusState::from_byte(state).unwrap();
                BusReport { state, transmit_errors, receive_errors, lost }
            },
        )
    }

    /// Bytes for messages: runs, steps and zeros.
    static BYTES: [u8; 256 + MAX_MESSAGE] = {
        let mut bytes = [0; 256 + MAX_MESSAGE];
        let mut k = 0;
        while k < bytes.len() {
            bytes[k] = (k * k / 3) as u8;
            k += 1;
        }
        bytes
    };

    fn packet() -> impl Strategy<Value = Packet<'static>> {
        let link = (0u16..0x800, prop::collection::vec(any::<u8>(), 0..=8))
            .prop_map(|(id, data)| Packet::Link(Frame::standard(id, &data).unwrap()));
        let report = (0u8..5, any::<u8>(), any::<[u32; 5]>(), [bus(), bus(), bus()]).prop_map(
            |(reset, brown_out_level, words, buses)| {
                let [config_hash, uptime_ms, missed_periods, longest_tick_us, broken_words] = words;
                Packet::Report(BoardReport {
                    config_hash,
                    reset: Reset::from_byte(reset).unwrap(),
                    brown_out_level,
                    uptime_ms,
                    missed_periods,
                    longest_tick_us,
                    broken_words,
                    buses,
                })
            },
        );
        let message = (0u16..0x800, 0..256usize, 1..=MAX_MESSAGE).prop_map(|(id, from, len)| {
            let bytes = BYTES.get(from..from + len).unwrap();
            Packet::Message { id, bytes }
        });
        prop_oneof![link, message, Just(Packet::Ask), report]
    }

    fn received(bytes: &[u8]) -> std::vec::Vec<std::vec::Vec<u8>> {
        let mut deframer = Deframer::default();
        bytes.iter().filter_map(|&byte| deframer.push(byte).map(<[u8]>::to_vec)).collect()
    }

    /// Checks bytes that were counted by hand from the description. The only zero of the body is the upper byte of the
    /// identifier. COBS begins with the distance to it, and replaces it by the distance to the end.
    #[test]
    fn packets_on_the_line() {
        // The checksum by another program; firmware/boards/README.md shows these bytes.
        let line = Packet::Ask.encode().unwrap();
        assert_eq!(line.as_slice(), [0x06, 0x11, 0x3D, 0x17, 0x48, 0xB0, 0x00]);
        let frame = Frame::standard(0x0A5, &[7]).unwrap();
        let line = Packet::Link(frame).encode().unwrap();
        let crc = crate::crc::crc32c(&[16, 0xA5, 0, 1, 7]).to_le_bytes();
        assert!(!crc.contains(&0));
        assert_eq!(line.as_slice(), [[3, 16, 0xA5, 7, 1, 7].as_slice(), &crc, &[0]].concat());
        let line = Packet::Message { id: 0x510, bytes: &[0x13] }.encode().unwrap();
        let crc = crate::crc::crc32c(&[19, 0x10, 5, 0x13]).to_le_bytes();
        assert!(!crc.contains(&0));
        assert_eq!(line.as_slice(), [[9, 19, 0x10, 5, 0x13].as_slice(), &crc, &[0]].concat());
    }

    proptest! {
        #[test]
        fn what_is_sent_arrives(packet in packet()) {
            let [body] = &received(&packet.encode().unwrap())[..] else { panic!("one packet") };
            prop_assert_eq!(Packet::decode(body), Some(packet));
            // A board that speaks `tunnel` does not decode it as a request.
            prop_assert_eq!(Request::decode(body), None);
        }

        #[test]
        fn nothing_else_is_a_packet(
            packet in packet(), more: u8, bytes in prop::collection::vec(any::<u8>(), 0..2 * MAX_MESSAGE),
        ) {
            let [body] = &received(&packet.encode().unwrap())[..] else { panic!("one packet") };
            if !matches!(packet, Packet::Message { .. }) {
                prop_assert_eq!(Packet::decode(&body[..body.len() - 1]), None);
                let longer = [body.as_slice(), &[more]].concat();
                prop_assert_eq!(Packet::decode(&longer), None);
            }
            if let Some(packet) = Packet::decode(&bytes) {
                prop_assert_eq!(received(&packet.encode().unwrap()), [bytes]);
            }
        }
    }
}
