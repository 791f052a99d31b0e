//! Half-duplex serial line in virtual time. Controller and servos take turns, and every byte takes ten bits.
//!
//! Like [`crate::bus::CanBus`], the line is pulled. [`SerialLine::next_event`] is the time of the next event.
//! [`SerialLine::advance`] handles the event and returns a packet that has ended, which the caller passes to the other side.
//! Servos that answer the same query send one after the other, each after its return delay ([`rollwalk_drives::Answer`]). If a
//! servo stays silent, those after it stay silent, too. A new packet of the controller cancels pending answers.
//!
//! No node listens before it sends. If two nodes send at once, every byte that overlaps another is damaged.

use crate::clock::SimTime;
use rollwalk_drives::Answer;
use std::collections::BTreeMap;

/// Number of bits per byte: start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

/// Sender on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineSender {
    /// The controller.
    Controller,
    /// The servo of a channel.
    Servo(usize),
}

/// Packet that has crossed the line, as received at the other ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CrossedPacket {
    /// Time at which the packet's last stop bit ended.
    pub at: SimTime,
    /// Sender of the packet.
    pub from: LineSender,
    /// Bytes of the packet, possibly damaged.
    pub bytes: Vec<u8>,
}

/// Statistics of a line since it was built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineStatistics {
    /// Number of completed packets.
    pub packets: u64,
    /// Time during which the line carried bits.
    pub busy: SimTime,
    /// Number of packets that were damaged because they overlapped others.
    pub collisions: u64,
}

/// Packet in transmission.
#[derive(Clone, Debug)]
struct Transmission {
    from: LineSender,
    start: SimTime,
    bytes: Vec<u8>,
    is_damaged: bool,
}

/// Pending answers of servos to a query.
#[derive(Clone, Debug, Default)]
struct AnswerTurns {
    /// Turn of the next answer.
    next: usize,
    /// Start time of the delay before the next answer.
    since: SimTime,
    /// Bytes of the answers so far.
    said: Vec<u8>,
    /// Answers by their turn, each with the channel of its servo.
    answers: BTreeMap<usize, (usize, Answer)>,
}

impl AnswerTurns {
    /// Time at which the next servo begins its answer; `None` while a servo sends, or if no answer is pending.
    fn next_start(&self) -> Option<SimTime> {
        let (_, answer) = self.answers.get(&self.next)?;
        Some(self.since + SimTime::from_us(answer.delay_us))
    }
}

/// Half-duplex serial line.
#[derive(Clone, Debug)]
pub struct SerialLine {
    baud: u64,
    talks: Vec<Transmission>,
    turns: AnswerTurns,
    statistics: LineStatistics,
}

impl SerialLine {
    /// Creates a silent line at `baud` bit/s.
    ///
    /// # Panics
    /// Panics if `baud` is 0.
    pub fn new(baud: u32) -> Self {
        assert!(baud > 0, "a line needs a rate above 0 bit/s");
        Self {
            baud: baud.into(),
            talks: Vec::new(),
            turns: AnswerTurns::default(),
            statistics: LineStatistics::default(),
        }
    }

    /// Statistics since the line was built.
    pub fn statistics(&self) -> LineStatistics {
        self.statistics
    }

    /// True if the controller is not sending a packet.
    pub fn is_free(&self) -> bool {
        self.talks.iter().all(|talk| talk.from != LineSender::Controller)
    }

    /// Begins a packet of the controller. The previous one must have ended, and all events before `now` must have been handled.
    pub fn send(&mut self, now: SimTime, packet: &[u8]) {
        self.transmit(now, LineSender::Controller, packet.to_vec());
    }

    /// Sets the answers of servos, by channel, to a packet that has just crossed the line. Earlier answers that are still
    /// pending are dropped. Of the answers of drives behind one adapter, only one is sent.
    pub fn answer(&mut self, now: SimTime, answers: impl IntoIterator<Item = (usize, Answer)>) {
        let answers = answers.into_iter().map(|(channel, said)| (said.turn, (channel, said)));
        self.turns =
            AnswerTurns { since: now, answers: answers.collect(), ..AnswerTurns::default() };
    }

    /// Silences a servo that loses its power or is cut off. A packet that it is sending is dropped.
    pub fn silence(&mut self, channel: usize) {
        self.talks.retain(|talk| talk.from != LineSender::Servo(channel));
        self.turns.answers.retain(|_, (of, _)| *of != channel);
    }

    /// Time of the next event; `None` while the line is silent and no servo is about to send.
    pub fn next_event(&self) -> Option<SimTime> {
        let ends = self.talks.iter().map(|talk| self.end(talk));
        ends.chain(self.turns.next_start()).min()
    }

    /// Handles the next event if it is due by `now`: a servo begins to send, or a packet ends. Returns the packet that has
    /// ended.
    pub fn advance(&mut self, now: SimTime) -> Option<CrossedPacket> {
        let at = self.next_event().filter(|&at| at <= now)?;
        if let Some(index) = self.talks.iter().position(|talk| self.end(talk) <= at) {
            let Transmission { from, bytes, is_damaged, start } = self.talks.remove(index);
            self.statistics.packets += 1;
            self.statistics.busy = self.statistics.busy + (at - start);
            self.statistics.collisions += u64::from(is_damaged);
            // A servo that waits for a damaged packet does not detect its end.
            if !is_damaged && from != LineSender::Controller {
                self.turns.since = at;
                self.turns.next += 1;
                self.turns.said.extend(&bytes);
            }
            return Some(CrossedPacket { at, from, bytes });
        }
        if let Some((channel, answer)) = self.turns.answers.remove(&self.turns.next) {
            let said = answer.line_answer(&self.turns.said);
            self.transmit(at, LineSender::Servo(channel), said);
        }
        None
    }

    fn transmit(&mut self, start: SimTime, from: LineSender, bytes: Vec<u8>) {
        let mut new = Transmission { from, start, bytes, is_damaged: false };
        let mut talks = std::mem::take(&mut self.talks);
        for other in &mut talks {
            self.collide(other, &mut new);
        }
        talks.push(new);
        self.talks = talks;
    }

    /// Damages the overlapping bytes of two packets.
    fn collide(&self, a: &mut Transmission, b: &mut Transmission) {
        let span = |talk: &Transmission| (talk.start, self.end(talk));
        let ((from_a, until_a), (from_b, until_b)) = (span(a), span(b));
        let (from, until) = (from_a.max(from_b), until_a.min(until_b));
        if from >= until {
            return;
        }
        for talk in [a, b] {
            talk.is_damaged = true;
            for index in 0..talk.bytes.len() {
                let begins = talk.start + self.duration(index);
                let ends = talk.start + self.duration(index + 1);
                if begins < until && ends > from {
                    talk.bytes[index] = !talk.bytes[index];
                }
            }
        }
    }

    fn end(&self, talk: &Transmission) -> SimTime {
        talk.start + self.duration(talk.bytes.len())
    }

    /// Duration of `bytes` bytes on the line.
    fn duration(&self, bytes: usize) -> SimTime {
        SimTime::from_ns(bytes as u64 * BITS_PER_BYTE * 1_000_000_000 / self.baud)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn us(us: u64) -> SimTime {
        SimTime::from_us(us)
    }

    fn answer(turn: usize, bytes: &[u8], delay_us: u64) -> Answer {
        Answer { bytes: bytes.to_vec(), turn, delay_us, is_part: false }
    }

    /// Packets until silence: end in µs, sender, bytes.
    fn received(line: &mut SerialLine) -> Vec<(u64, LineSender, Vec<u8>)> {
        let mut all = Vec::new();
        while let Some(at) = line.next_event() {
            all.extend(line.advance(at).map(|heard| (heard.at.as_us(), heard.from, heard.bytes)));
        }
        all
    }

    #[test]
    fn servos_answer_in_turn_each_after_its_delay() {
        let mut line = SerialLine::new(1_000_000);
        line.send(us(100), &[1, 2, 3]);
        assert!(!line.is_free());
        assert_eq!(line.next_event(), Some(us(130)));
        assert_eq!(line.advance(us(129)), None);
        let asked = line.advance(us(130)).unwrap();
        assert_eq!((asked.from, &asked.bytes[..]), (LineSender::Controller, &[1, 2, 3][..]));
        assert!(line.is_free());
        line.answer(us(130), [(7, answer(1, &[6; 4], 50)), (3, answer(0, &[5; 2], 20))]);
        // 130 + 20 + 20, then 50 + 40.
        let expected =
            [(170, LineSender::Servo(3), vec![5; 2]), (260, LineSender::Servo(7), vec![6; 4])];
        assert_eq!(received(&mut line), expected);
        let statistics = LineStatistics { packets: 3, busy: us(90), collisions: 0 };
        assert_eq!(line.statistics(), statistics);
    }

    #[test]
    fn behind_a_servo_that_says_nothing_nobody_speaks() {
        let mut line = SerialLine::new(1_000_000);
        let three = || (0..3).map(|turn| (turn, answer(turn, &[turn as u8], 0)));
        line.answer(us(0), three().filter(|(turn, _)| *turn != 1));
        assert_eq!(received(&mut line).len(), 1);
        line.answer(us(100), three());
        line.silence(1);
        assert_eq!(received(&mut line).len(), 1);
    }

    #[test]
    fn an_adapter_answers_once_for_all_behind_it() {
        let mut line = SerialLine::new(500_000);
        line.answer(us(0), (0..4).map(|channel| (channel, answer(0, &[0, 0], 0))));
        assert_eq!(received(&mut line).len(), 1);
    }

    #[test]
    fn who_is_told_something_new_forgets_the_old_answer() {
        let mut line = SerialLine::new(1_000_000);
        line.answer(us(0), [(0, answer(0, &[1], 500))]);
        line.send(us(10), &[2]);
        assert_eq!(line.advance(us(20)).unwrap().from, LineSender::Controller);
        line.answer(us(20), []);
        assert_eq!(line.next_event(), None);
    }

    #[test]
    fn bytes_that_overlap_are_damaged_and_the_rest_is_not() {
        let mut line = SerialLine::new(1_000_000);
        line.answer(us(0), [(0, answer(0, &[0x11; 4], 0)), (1, answer(1, &[0x22], 0))]);
        assert_eq!(line.advance(us(0)), None);
        // The servo has 0 to 40 µs. A stop is sent in its third byte.
        line.send(us(25), &[0x77; 4]);
        let first = (40, LineSender::Servo(0), vec![0x11, 0x11, !0x11, !0x11]);
        let second = (65, LineSender::Controller, vec![!0x77, !0x77, 0x77, 0x77]);
        assert_eq!(received(&mut line), [first, second], "and the next servo has heard no end");
        assert_eq!(line.statistics().collisions, 2);
    }

    proptest! {
        /// Packets have the right duration even if a bit is not a whole number of nanoseconds.
        #[test]
        fn a_packet_takes_its_bits(baud in 9_600u32..4_500_000, bytes in 1usize..300) {
            let mut line = SerialLine::new(baud);
            line.send(us(5), &vec![0; bytes]);
            let at = line.next_event().unwrap();
            let expected_s = bytes as f64 * 10.0 / f64::from(baud);
            prop_assert!(((at - us(5)).as_s() - expected_s).abs() <= 1e-9);
        }
    }
}
