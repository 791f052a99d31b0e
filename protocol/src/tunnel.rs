//! Tunnel for time and the frames of every bus over one serial line, with which a host operates a board without CAN.
//!
//! An emulated board has no CAN controller, and its clock is not exact enough for tests. The host therefore simulates the time
//! and both ends of every bus. It sends each event with its time to the board ([`Request::Step`]), and receives the frames that
//! the controller sends on the buses. Every request has one answer, and the board sends nothing unsolicited. Equal requests
//! have equal answers, byte by byte.
//!
//! The body of a [`packet`] begins with kind and sequence number; the answer repeats both.

use crate::can::Frame;
use crate::packet::{self, Reader, line_len};
use heapless::Vec;

/// Maximum number of actuator buses.
pub const MAX_ACTUATOR_BUSES: u8 = 8;
/// Maximum size of a packet before stuffing, bytes. An answer with a frame for every bus has 122 bytes.
const MAX_PACKET: usize = 128;

const KIND_HELLO: u8 = 1;
const KIND_STEP: u8 = 2;
const KIND_FIGURES: u8 = 3;

/// Bytes for the line, including the final zero.
pub type Line = Vec<u8, { line_len(MAX_PACKET) }>;
/// Deframer of packets between host and board under test.
pub type Deframer = packet::Deframer<MAX_PACKET>;
type Writer = packet::Writer<MAX_PACKET>;

/// Request of the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Requests the identity of the board.
    Hello,
    /// Passes an event, or allows the controller to send on free buses.
    Step(Step),
    /// Requests the run time and stack used so far.
    Figures,
}

/// Point in time, with an event and the buses that can accept a frame after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Time of the controller, µs; never decreases.
    pub now_us: u64,
    /// Event at the time of the step; `None` if there is no event.
    pub input: Option<Input>,
    /// Buses that can accept a frame.
    pub free: Buses,
}

/// Event passed to a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// A control period has passed.
    Tick,
    /// Frame from the host.
    Link(Frame),
    /// Frame of an actuator bus, whose number is below [`MAX_ACTUATOR_BUSES`].
    Actuator(u8, Frame),
}

/// Set of buses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Buses(u16);

impl Buses {
    /// Adds the link to the set.
    pub fn with_link(self) -> Self {
        Self(self.0 | 1)
    }

    /// Adds an actuator bus to the set; numbers from [`MAX_ACTUATOR_BUSES`] on are ignored.
    pub fn with_actuator(self, bus: u8) -> Self {
        if bus < MAX_ACTUATOR_BUSES { Self(self.0 | 2 << bus) } else { self }
    }

    /// Buses of `self` that are not in `other`.
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// True if the link is in the set.
    pub fn link(self) -> bool {
        self.0 & 1 != 0
    }

    /// True if the actuator bus is in the set.
    pub fn actuator(self, bus: u8) -> bool {
        bus < MAX_ACTUATOR_BUSES && self.0 & (2 << bus) != 0
    }

    /// True if the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// Answer of the board.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Identity of the board.
    Hello(Hello),
    /// Frames that the controller sends.
    Stepped(StepResult),
    /// Run time and stack.
    Figures(Figures),
}

/// Identity of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hello {
    /// Hash of the robot that the image was built for ([`crate::config::RobotConfig::hash`]).
    pub config_hash: u32,
    /// Number of steps since power-on; 0 at the start of a repeatable run.
    pub steps: u32,
}

/// Result of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepResult {
    /// Frame for the link.
    pub link: Option<Frame>,
    /// Frame for each actuator bus.
    pub actuators: [Option<Frame>; MAX_ACTUATOR_BUSES as usize],
    /// Clip, frame and phase of the current playback.
    pub playing: Option<(u8, u16, f32)>,
}

/// Run time of control periods, in counts of the board's timer, and stack usage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Figures {
    /// Number of control periods.
    pub periods: u32,
    /// Duration of the longest tick alone.
    pub worst_tick: u32,
    /// Total duration of all ticks.
    pub all_ticks: u64,
    /// Duration of the longest period: the tick, every actuator's feedback and every frame for a bus.
    pub worst_period: u32,
    /// Total duration of all periods.
    pub all_periods: u64,
    /// Largest stack depth while the board started, bytes.
    pub start_stack_bytes: u32,
    /// Largest stack depth after the start, bytes.
    pub stack_bytes: u32,
}

impl Request {
    /// Encodes the request for the line; `None` if it contains an invalid bus or a 29-bit identifier.
    pub fn encode(&self, sequence: u8) -> Option<Line> {
        let mut packet = Writer::default();
        match self {
            Self::Hello => packet.put(&[KIND_HELLO, sequence])?,
            Self::Figures => packet.put(&[KIND_FIGURES, sequence])?,
            Self::Step(Step { now_us, input, free }) => {
                packet.put(&[KIND_STEP, sequence])?;
                packet.put(&now_us.to_le_bytes())?;
                packet.put(&free.0.to_le_bytes())?;
                match input {
                    None => packet.put(&[0])?,
                    Some(Input::Tick) => packet.put(&[1])?,
                    Some(Input::Link(frame)) => bus_frame(&mut packet, 2, frame)?,
                    Some(Input::Actuator(bus, frame)) if *bus < MAX_ACTUATOR_BUSES => {
                        bus_frame(&mut packet, 3 + bus, frame)?;
                    }
                    Some(Input::Actuator(..)) => return None,
                }
            }
        }
        packet.finish()
    }

    /// Decodes a packet of a [`Deframer`], with its sequence number.
    pub fn decode(packet: &[u8]) -> Option<(u8, Self)> {
        let mut rest = Reader(packet);
        let [kind, sequence] = rest.take()?;
        let request = match kind {
            KIND_HELLO => Self::Hello,
            KIND_FIGURES => Self::Figures,
            KIND_STEP => {
                let now_us = u64::from_le_bytes(rest.take()?);
                let free = Buses(u16::from_le_bytes(rest.take()?));
                let [input] = rest.take()?;
                let input = match input {
                    0 => None,
                    1 => Some(Input::Tick),
                    2 => Some(Input::Link(rest.frame()?)),
                    bus => {
                        let bus = bus.checked_sub(3).filter(|bus| *bus < MAX_ACTUATOR_BUSES)?;
                        Some(Input::Actuator(bus, rest.frame()?))
                    }
                };
                Self::Step(Step { now_us, input, free })
            }
            _ => return None,
        };
        rest.0.is_empty().then_some((sequence, request))
    }
}

impl Answer {
    /// Encodes the answer for the line; `None` if it contains a 29-bit identifier.
    pub fn encode(&self, sequence: u8) -> Option<Line> {
        let mut packet = Writer::default();
        match self {
            Self::Hello(Hello { config_hash, steps }) => {
                packet.put(&[KIND_HELLO, sequence])?;
                packet.put(&config_hash.to_le_bytes())?;
                packet.put(&steps.to_le_bytes())?;
            }
            Self::Figures(figures) => {
                packet.put(&[KIND_FIGURES, sequence])?;
                packet.put(&figures.periods.to_le_bytes())?;
                packet.put(&figures.worst_tick.to_le_bytes())?;
                packet.put(&figures.all_ticks.to_le_bytes())?;
                packet.put(&figures.worst_period.to_le_bytes())?;
                packet.put(&figures.all_periods.to_le_bytes())?;
                packet.put(&figures.start_stack_bytes.to_le_bytes())?;
                packet.put(&figures.stack_bytes.to_le_bytes())?;
            }
            Self::Stepped(StepResult { link, actuators, playing }) => {
                packet.put(&[KIND_STEP, sequence, u8::from(playing.is_some())])?;
                if let Some((clip, frame, phase)) = playing {
                    packet.put(&[*clip])?;
                    packet.put(&frame.to_le_bytes())?;
                    packet.put(&phase.to_le_bytes())?;
                }
                if let Some(frame) = link {
                    bus_frame(&mut packet, 0, frame)?;
                }
                for (bus, frame) in (1..=MAX_ACTUATOR_BUSES).zip(actuators) {
                    if let Some(frame) = frame {
                        bus_frame(&mut packet, bus, frame)?;
                    }
                }
            }
        }
        packet.finish()
    }

    /// Decodes a packet of a [`Deframer`], with its sequence number.
    pub fn decode(packet: &[u8]) -> Option<(u8, Self)> {
        let mut rest = Reader(packet);
        let [kind, sequence] = rest.take()?;
        let answer = match kind {
            KIND_HELLO => Self::Hello(Hello { config_hash: rest.u32()?, steps: rest.u32()? }),
            KIND_FIGURES => Self::Figures(Figures {
                periods: rest.u32()?,
                worst_tick: rest.u32()?,
                all_ticks: u64::from_le_bytes(rest.take()?),
                worst_period: rest.u32()?,
                all_periods: u64::from_le_bytes(rest.take()?),
                start_stack_bytes: rest.u32()?,
                stack_bytes: rest.u32()?,
            }),
            KIND_STEP => {
                let playing = match rest.take()? {
                    [0] => None,
                    [1] => {
                        let [clip] = rest.take()?;
                        let frame = u16::from_le_bytes(rest.take()?);
                        Some((clip, frame, f32::from_le_bytes(rest.take()?)))
                    }
                    _ => return None,
                };
                let mut stepped = StepResult { playing, ..StepResult::default() };
                while let Some([bus]) = rest.take() {
                    let slot = match usize::from(bus).checked_sub(1) {
                        None => &mut stepped.link,
                        Some(bus) => stepped.actuators.get_mut(bus)?,
                    };
                    *slot = Some(rest.frame()?);
                }
                Self::Stepped(stepped)
            }
            _ => return None,
        };
        rest.0.is_empty().then_some((sequence, answer))
    }
}

fn bus_frame(packet: &mut Writer, bus: u8, frame: &Frame) -> Option<()> {
    packet.put(&[bus])?;
    packet.frame(frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crc::crc32c;
    use proptest::prelude::*;

    fn packets(deframer: &mut Deframer, bytes: &[u8]) -> std::vec::Vec<std::vec::Vec<u8>> {
        bytes.iter().filter_map(|&byte| deframer.push(byte).map(<[u8]>::to_vec)).collect()
    }

    fn frame() -> impl Strategy<Value = Frame> {
        (0u16..0x800, prop::collection::vec(any::<u8>(), 0..=8))
            .prop_map(|(id, data)| Frame::standard(id, &data).unwrap())
    }

    fn request() -> impl Strategy<Value = Request> {
        let input = prop_oneof![
            Just(None),
            Just(Some(Input::Tick)),
            frame().prop_map(|frame| Some(Input::Link(frame))),
            (0..MAX_ACTUATOR_BUSES, frame()).prop_map(|(bus, f)| Some(Input::Actuator(bus, f))),
        ];
        let step = (any::<u64>(), input, any::<u16>()).prop_map(|(now_us, input, free)| {
            Request::Step(Step { now_us, input, free: Buses(free) })
        });
        prop_oneof![Just(Request::Hello), Just(Request::Figures), step]
    }

    fn answer() -> impl Strategy<Value = Answer> {
        let slot = || prop::option::of(frame());
        let playing = prop::option::of((any::<u8>(), any::<u16>(), 0f32..1.0));
        let stepped = (slot(), prop::array::uniform8(slot()), playing)
            .prop_map(|(link, actuators, playing)| StepResult { link, actuators, playing });
        let hello = (any::<u32>(), any::<u32>())
            .prop_map(|(config_hash, steps)| Answer::Hello(Hello { config_hash, steps }));
        let figures = (any::<[u32; 4]>(), any::<[u64; 2]>()).prop_map(
            |([periods, worst_tick, worst_period, stack_bytes], [all_ticks, all_periods])| {
                let start_stack_bytes = periods ^ stack_bytes;
                Figures {
                    periods,
                    worst_tick,
                    all_ticks,
                    worst_period,
                    all_periods,
                    start_stack_bytes,
                    stack_bytes,
                }
            },
        );
        prop_oneof![stepped.prop_map(Answer::Stepped), hello, figures.prop_map(Answer::Figures)]
    }

    /// Checks bytes that were counted by hand from the description above. The CRC of `01 07` is computed separately.
    #[test]
    fn a_question_on_the_line() {
        let line = Request::Hello.encode(7).unwrap();
        let crc = crc32c(&[1, 7]).to_le_bytes();
        assert!(!crc.contains(&0));
        assert_eq!(line.as_slice(), [[7, 1, 7].as_slice(), &crc, &[0]].concat());
        // A zero in the body is replaced by the distance to the next one.
        let line = Request::Hello.encode(0).unwrap();
        assert_eq!(line.get(..3), Some([2, 1, 5].as_slice()));
    }

    proptest! {
        #[test]
        fn what_is_asked_and_answered_arrives(
            request in request(), answer in answer(), sequence: u8,
            noise in prop::collection::vec(any::<u8>(), 0..300),
        ) {
            let mut deframer = Deframer::default();
            packets(&mut deframer, &noise);
            packets(&mut deframer, &[0]);
            let line = request.encode(sequence).unwrap();
            let [packet] = &packets(&mut deframer, &line)[..] else { panic!("one packet") };
            prop_assert_eq!(Request::decode(packet), Some((sequence, request)));
            let line = answer.encode(sequence).unwrap();
            let [packet] = &packets(&mut deframer, &line)[..] else { panic!("one packet") };
            prop_assert_eq!(Answer::decode(packet), Some((sequence, answer)));
        }

        #[test]
        fn a_damaged_packet_is_dropped(
            answer in answer(), at: prop::sample::Index, flip in 1u8..,
        ) {
            let mut line = answer.encode(1).unwrap();
            let at = at.index(line.len());
            line[at] ^= flip;
            let mut deframer = Deframer::default();
            let good = packets(&mut deframer, &line);
            prop_assert!(good.is_empty(), "{:?}", good);
        }

        #[test]
        fn nothing_makes_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
            let _ = (Request::decode(&bytes), Answer::decode(&bytes));
            packets(&mut Deframer::default(), &bytes);
        }
    }
}
