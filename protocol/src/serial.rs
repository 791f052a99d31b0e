//! The link over a serial line: for a host without CAN, to a board with buses and a clock of its own.
//!
//! Each frame of the link is sent in a [`packet`] as soon as there is one, in both directions. Messages of the
//! transport, which CAN needs segmented, cross the line whole: a [`Gateway`] at each end does the segmenting. The
//! host can also request a [`Report`] of the board, with reset cause and error counters, which the controller's own
//! messages do not have.

use crate::can::Frame;
use crate::packet::{self, CRC_LEN, Reader, line_len};
use crate::wire::transport::MAX_MESSAGE;
use heapless::Vec;

mod gateway;

pub use gateway::Gateway;

/// Longest packet before stuffing: kind, identifier and a message.
const MAX_PACKET: usize = 3 + MAX_MESSAGE + CRC_LEN;

/// Bytes for the line, the ending zero included.
pub type Line = Vec<u8, { line_len(MAX_PACKET) }>;
/// Finds these packets on the line.
pub type Deframer = packet::Deframer<MAX_PACKET>;
type Writer = packet::Writer<MAX_PACKET>;

// Distinct from the kinds of `tunnel`, so that a board ignores the other protocol's host.
const KIND_LINK: u8 = 16;
const KIND_ASK: u8 = 17;
const KIND_REPORT: u8 = 18;
const KIND_MESSAGE: u8 = 19;

/// Buses of a [`Report`]: the link, two for actuators.
pub const BUSES: usize = 3;

/// A packet on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packet<'a> {
    /// A frame of the link, in either direction; not one of the transport.
    Link(Frame),
    /// A whole message of the transport.
    Message {
        /// Identifier of the frames that would carry it on CAN.
        id: u16,
        /// 1 to [`MAX_MESSAGE`] bytes.
        bytes: &'a [u8],
    },
    /// Request of the host for a report.
    Ask,
    /// Report of the board.
    Report(Report),
}

/// Status report of a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// [`crate::config::RobotConfig::hash`] of the robot that the image was built for.
    pub config_hash: u32,
    /// Cause of the last reset.
    pub reset: Reset,
    /// Brown-out reset level, as the chip numbers them.
    pub brown_out_level: u8,
    /// Time since the reset, ms.
    pub uptime_ms: u32,
    /// Control periods without a tick.
    pub missed_periods: u32,
    /// The longest tick, µs.
    pub longest_tick_us: u32,
    /// Flash reads with uncorrectable ECC errors.
    pub broken_words: u32,
    /// The link, then the actuator buses.
    pub buses: [BusReport; BUSES],
}

/// Cause of a board's reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reset {
    /// Something else.
    #[default]
    Other,
    /// Power-on or brown-out.
    PowerOn,
    /// The reset button.
    Pin,
    /// The independent watchdog: the control loop had stopped.
    Watchdog,
    /// Reset by software: a debugger.
    Software,
}

/// Status of a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusReport {
    /// State.
    pub state: BusState,
    /// Transmit error counter.
    pub transmit_errors: u8,
    /// Receive error counter.
    pub receive_errors: u8,
    /// Receive overruns: frames that arrived before earlier ones were read.
    pub lost: u16,
}

/// Error state of a CAN controller, as a board or a driver reports it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BusState {
    /// Error active: no fault.
    #[default]
    Active,
    /// Missing acknowledgements: the controller is alone on the bus, or the other nodes have no power.
    NotAcknowledged,
    /// Error passive: 128 errors or more.
    Passive,
    /// Bus-off: takes no part in the bus until it is restarted.
    Off,
}

impl<'a> Packet<'a> {
    /// Encodes the packet as bytes for the line.
    pub fn encode(&self) -> Option<Line> {
        let mut packet = Writer::default();
        match self {
            Self::Link(frame) => {
                packet.put(&[KIND_LINK])?;
                packet.frame(frame)?;
            }
            Self::Message { id, bytes } => {
                // One that is too long does not fit.
                let [low, high] = id.to_le_bytes();
                packet.put(&[KIND_MESSAGE, low, high])?;
                packet.put(bytes)?;
            }
            Self::Ask => packet.put(&[KIND_ASK])?,
            Self::Report(report) => {
                packet.put(&[KIND_REPORT, report.reset as u8, report.brown_out_level])?;
                let Report { config_hash, uptime_ms, missed_periods, .. } = *report;
                let Report { longest_tick_us, broken_words, .. } = *report;
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

    /// Decodes a packet of a [`Deframer`].
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
                let mut report = Report {
                    reset: Reset::from_byte(reset)?,
                    brown_out_level,
                    config_hash: rest.u32()?,
                    uptime_ms: rest.u32()?,
                    missed_periods: rest.u32()?,
                    longest_tick_us: rest.u32()?,
                    broken_words: rest.u32()?,
                    ..Report::default()
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

    /// Bytes of messages: runs, steps and zeros.
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
                Packet::Report(Report {
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

    /// Counted by hand from the description. The one zero of the body is the identifier's upper byte:
    /// COBS begins with the distance to it, and puts the distance to the end in its place.
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
