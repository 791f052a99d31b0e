//! Set-points that a host streams, sent ahead of the controller by a fixed number of frames.
//!
//! This module is part of the [operator](crate::operator). The controller plays the frames by its own clock, and reports in
//! STATUS the number of frames that it has taken. Other frames are kept here or wait in its ring buffer
//! (`docs/formats/wire-format.md`, SETPOINT).

use rollwalk_protocol::can::Frame as CanFrame;
use rollwalk_protocol::wire::{Node, Setpoint};
use std::collections::VecDeque;

/// Number of frames sent ahead of the controller's latest known frame. That frame is up to 3 frames old, so the lead is 0.12 to
/// 0.17 s. The controller has room for 16 frames.
const LEAD: u64 = 10;

/// Set-point of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Target {
    /// Angle of a joint, rad, or speed of a wheel, rad/s.
    pub value: f32,
    /// Feed-forward torque, N·m.
    pub torque_nm: f32,
}

/// Stream of set-points, beginning with its first frame.
#[derive(Clone, Debug, Default)]
pub struct Stream {
    /// Frames that the controller has not taken yet.
    frames: VecDeque<Vec<Target>>,
    /// Number of the first frame in `frames`.
    first: u64,
    /// Frame number and channel of the next message.
    next: (u64, usize),
    /// Number of frames that the controller has taken.
    taken: u64,
}

impl Stream {
    /// Adds a frame: set-points of all channels, 1/60 s after the previous frame.
    pub fn push(&mut self, frame: Vec<Target>) {
        self.frames.push_back(frame);
    }

    /// Number of frames that the controller has not taken yet, both here and in its ring buffer.
    pub fn ahead(&self) -> usize {
        let end = self.first + self.frames.len() as u64;
        end.saturating_sub(self.taken) as usize
    }

    /// Number of frames that the controller has taken.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Processes the number of frames in a STATUS of the state Streaming, modulo 4096.
    pub fn on_status(&mut self, frame: u16) {
        let more = u64::from(frame).wrapping_sub(self.taken) & 0xFFF;
        // An older STATUS does not decrease the count.
        if more < 0x800 {
            self.taken += more;
        }
        while self.first < self.taken && self.frames.pop_front().is_some() {
            self.first += 1;
        }
    }

    /// Returns the next message; `None` if the stream is already far enough ahead.
    pub fn poll(&mut self, to: Node) -> Option<CanFrame> {
        let (mut number, mut channel) = self.next.max((self.first, 0));
        let mut frame = self.frames.get((number - self.first) as usize)?;
        if channel >= frame.len() {
            (number, channel) = (number + 1, 0);
            frame = self.frames.get((number - self.first) as usize)?;
        }
        if number >= self.taken + LEAD {
            return None;
        }
        let Target { value, torque_nm } = *frame.get(channel)?;
        self.next = (number, channel + 1);
        let channel = u8::try_from(channel).ok()?;
        let (frame, stiff) = (number as u8, false);
        Some(Setpoint { frame, channel, stiff, value, torque_nm }.encode(to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node() -> Node {
        Node::new(1).unwrap()
    }

    fn frame(number: u16) -> Vec<Target> {
        (0..3u8)
            .map(|c| Target { value: f32::from(number) + f32::from(c), torque_nm: 0.5 })
            .collect()
    }

    fn sent(stream: &mut Stream) -> Vec<(u8, u8)> {
        let mut sent = Vec::new();
        while let Some(message) = stream.poll(node()) {
            let (_, setpoint) = Setpoint::decode(&message).unwrap();
            sent.push((setpoint.frame, setpoint.channel));
        }
        sent
    }

    #[test]
    fn frames_go_out_in_order_and_no_further_ahead_than_they_should() {
        let mut stream = Stream::default();
        (0..600).for_each(|number| stream.push(frame(number)));
        assert_eq!(stream.ahead(), 600);
        let first = sent(&mut stream);
        let expected: Vec<_> = (0..LEAD as u8).flat_map(|f| (0..3).map(move |c| (f, c))).collect();
        assert_eq!(first, expected);
        assert!(sent(&mut stream).is_empty());
        // The controller's count wraps, as does the number on the wire.
        let mut all = LEAD as usize;
        for taken in (3..=590).step_by(3) {
            stream.on_status(taken & 0xFFF);
            let more = sent(&mut stream);
            assert_eq!(more.first(), Some(&(all as u8, 0)), "{taken}");
            all += more.len() / 3;
            assert_eq!(all, (usize::from(taken) + LEAD as usize).min(600));
            assert_eq!(stream.ahead(), 600 - usize::from(taken));
        }
    }

    #[test]
    fn counts_wrap_and_do_not_go_back() {
        let mut stream = Stream { taken: 4090, first: 4090, ..Stream::default() };
        (0..40).for_each(|number| stream.push(frame(number)));
        stream.on_status(2);
        assert_eq!(stream.taken(), 4098);
        stream.on_status(4095);
        assert_eq!(stream.taken(), 4098);
        assert_eq!(sent(&mut stream).first(), Some(&(4098u16 as u8, 0)));
    }

    #[test]
    fn what_was_pushed_too_late_goes_out_at_once() {
        let mut stream = Stream::default();
        (0..4).for_each(|number| stream.push(frame(number)));
        assert_eq!(sent(&mut stream).len(), 12);
        stream.on_status(4);
        assert_eq!((stream.ahead(), sent(&mut stream).len()), (0, 0));
        stream.push(frame(4));
        assert_eq!(sent(&mut stream), [(4, 0), (4, 1), (4, 2)]);
    }
}
