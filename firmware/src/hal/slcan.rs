//! SLCAN adapter on the controller's side: the host link over a serial line, for `slcand` and other hosts that use Lawicel's
//! protocol.
//!
//! The host sees an adapter on a bus with one other node, the controller. [`Adapter::push`] turns bytes into frames and
//! answers. [`Adapter::line`] turns a frame for the host into a line while the channel is open.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::slcan::{Line, Message, Reader};

/// Hardware and software version in the format of Lawicel's adapters.
const VERSION: &[u8] = b"V1010\r";
/// Serial number in the format of Lawicel's adapters.
const SERIAL_NUMBER: &[u8] = b"N0001\r";
/// Answer to a request for the status flags, with no flag set.
const ALL_WELL: &[u8] = b"F00\r";
/// Answer to a request for the status flags, with bit 3 set: data overrun.
const OVERRUN: &[u8] = b"F08\r";

/// SLCAN adapter.
#[derive(Clone, Debug, Default)]
pub struct Adapter {
    reader: Reader,
    open: bool,
    lost: bool,
}

/// Result of a line from the host.
#[derive(Clone, Debug, PartialEq)]
pub struct LineResult {
    /// Frame for the controller.
    pub frame: Option<Frame>,
    /// Answer to the host.
    pub answer: Line,
}

impl Adapter {
    /// Processes a byte from the host. Returns the result if the byte completes a line.
    pub fn push(&mut self, byte: u8) -> Option<LineResult> {
        let ends = byte == b'\r';
        let message = self.reader.push(byte);
        // An overlong line was skipped up to its end and is refused.
        let (frame, answer) = match (message, ends) {
            (Some(message), _) => self.execute(message),
            (None, true) => (None, error()),
            (None, false) => return None,
        };
        Some(LineResult { frame, answer })
    }

    fn execute(&mut self, message: Message) -> (Option<Frame>, Line) {
        let done = match message {
            // The link has no node for frames with 29-bit identifiers.
            Message::Frame(frame) if self.open => {
                return (frame.standard_id().map(|_| frame), ok());
            }
            Message::Frame(_) => false,
            Message::Bitrate(_) => !self.open,
            Message::Open => !core::mem::replace(&mut self.open, true),
            Message::Close => core::mem::take(&mut self.open),
            // An empty line.
            Message::Ok => true,
            Message::Other(b'V') => return (None, line(VERSION)),
            Message::Other(b'N') => return (None, line(SERIAL_NUMBER)),
            Message::Other(b'F') => {
                let lost = core::mem::take(&mut self.lost);
                return (None, line(if lost { OVERRUN } else { ALL_WELL }));
            }
            Message::Error | Message::Other(_) => false,
        };
        (None, if done { ok() } else { error() })
    }

    /// Encodes a frame of the controller as a line; `None` while the channel is closed.
    pub fn line(&self, frame: &Frame) -> Option<Line> {
        if self.open { Message::Frame(*frame).encode() } else { None }
    }

    /// Records that bytes from the host were lost, which the status flags then report.
    pub fn lost(&mut self) {
        self.lost = true;
    }
}

fn ok() -> Line {
    Message::Ok.encode().unwrap_or_default()
}

fn error() -> Line {
    Message::Error.encode().unwrap_or_default()
}

fn line(text: &[u8]) -> Line {
    Line::from_slice(text).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::vec;
    use std::vec::Vec;

    /// Received frames, and the answers as bytes.
    fn exchange(adapter: &mut Adapter, bytes: &[u8]) -> (Vec<Frame>, Vec<u8>) {
        let received: Vec<_> = bytes.iter().filter_map(|&byte| adapter.push(byte)).collect();
        let answers = received.iter().flat_map(|received| received.answer.clone()).collect();
        (received.iter().filter_map(|received| received.frame).collect(), answers)
    }

    fn frame() -> Frame {
        Frame::standard(0x123, &[0xAA, 0xBB]).unwrap()
    }

    /// Sends the commands of `slcand -o -c -s8` to a closed adapter, and again after closing it.
    #[test]
    fn a_host_opens_and_closes_the_channel() {
        let mut adapter = Adapter::default();
        assert_eq!(adapter.line(&frame()), None);
        assert_eq!(exchange(&mut adapter, b"C\rS8\rO\r"), (Vec::new(), b"\x07\r\r".to_vec()));
        assert_eq!(adapter.line(&frame()).unwrap(), b"t1232AABB\r");
        assert_eq!(exchange(&mut adapter, b"O\rS6\rC\r"), (Vec::new(), b"\x07\x07\r".to_vec()));
        assert_eq!(adapter.line(&frame()), None);
        assert_eq!(exchange(&mut adapter, b"C\rS8\rO\r"), (Vec::new(), b"\x07\r\r".to_vec()));
    }

    #[test]
    fn frames_are_taken_while_the_channel_is_open() {
        let mut adapter = Adapter::default();
        assert_eq!(exchange(&mut adapter, b"t1232AABB\rO\r"), (Vec::new(), b"\x07\r".to_vec()));
        assert_eq!(exchange(&mut adapter, b"t1232AABB\r"), (vec![frame()], b"\r".to_vec()));
        // The link has no frames with 29-bit identifiers; half a line is no frame.
        let other = b"T000001232AABB\rt1232AAB\r";
        assert_eq!(exchange(&mut adapter, other), (Vec::new(), b"\r\x07".to_vec()));
        assert_eq!(exchange(&mut adapter, b"C\rt1232AABB\r"), (Vec::new(), b"\r\x07".to_vec()));
    }

    #[test]
    fn a_host_may_ask_who_it_is_and_whether_bytes_were_lost() {
        let mut adapter = Adapter::default();
        assert_eq!(exchange(&mut adapter, b"\rV\rN\rF\r").1, b"\rV1010\rN0001\rF00\r");
        adapter.lost();
        assert_eq!(exchange(&mut adapter, b"F\rF\r").1, b"F08\rF00\r");
        assert_eq!(exchange(&mut adapter, b"M00000000\rX1\r\x07").1, b"\x07\x07\x07");
    }
}
