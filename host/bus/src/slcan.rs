//! CAN adapter on a serial line with the SLCAN protocol (Lawicel).

use crate::error::OpenError;
use crate::line::{LineWriter, read};
use crate::link::LinkError;
use crate::port::{Event, Inlet, Outlet, Port};
use crate::serial::open_device;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::slcan::{Message, Reader, bitrate_digit};
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Rate of the serial line, bit/s. USB adapters accept any rate.
const BAUD: u32 = 1_000_000;

/// Opens the adapter at `device` on a CAN bus of `bitrate` bit/s.
///
/// # Errors
/// Returns an error if the device does not exist, access is denied, or the protocol does not support this bitrate.
pub fn open(device: &Path, bitrate: u32) -> Result<Port, OpenError> {
    let digit = bitrate_digit(bitrate).ok_or_else(|| OpenError {
        what: format!("SLCAN adapters do not support {bitrate} bit/s"),
        help: "give 10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 or 1000000 bit/s; \
               robots use 1000000 by default"
            .into(),
    })?;
    let (reader, writer) = open_device(device, BAUD)?;
    let name = device.display().to_string();
    port(&name, reader, writer, digit, bitrate).map_err(|error| OpenError {
        what: format!("`{name}` does not accept commands: {error}"),
        help:
            "check that the device is a CAN adapter with SLCAN firmware, then unplug it and plug \
            it in again"
                .into(),
    })
}

/// Opens the CAN channel of an adapter at `bitrate` bit/s (Lawicel's `digit`), and returns both ends of its line.
///
/// # Errors
/// Returns an error if the line is down.
pub fn port(
    name: &str,
    reader: impl Read + Send + 'static,
    writer: impl Write + Send + 'static,
    digit: u8,
    bitrate: u32,
) -> Result<Port, LinkError> {
    let mut writer = LineWriter::new(name, writer);
    // The first terminator ends a partial line of an earlier program.
    let orders = [Message::Ok, Message::Close, Message::Bitrate(digit), Message::Open];
    let orders: Vec<u8> =
        orders.iter().flat_map(|message| message.encode().unwrap_or_default()).collect();
    writer.put(&orders)?;
    let (answers, refuses) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let outlet = SlcanOutlet {
        writer,
        bitrate,
        answers: Arc::clone(&answers),
        refuses: Arc::clone(&refuses),
    };
    let inlet = SlcanInlet {
        name: name.to_owned(),
        reader,
        text: Reader::default(),
        events: VecDeque::new(),
        answers,
        refuses,
    };
    Ok(Port { outlet: Box::new(outlet), inlet: Box::new(inlet) })
}

struct SlcanOutlet {
    writer: LineWriter,
    bitrate: u32,
    /// True if the device has sent a valid SLCAN line. Some adapters do not confirm commands.
    answers: Arc<AtomicBool>,
    /// True if the adapter has refused a command and has not confirmed one since.
    refuses: Arc<AtomicBool>,
}

impl Outlet for SlcanOutlet {
    fn is_free(&self) -> bool {
        self.writer.is_free()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.writer.put(&Message::Frame(*frame).encode().unwrap_or_default())
    }

    fn bitrate(&self) -> Option<u32> {
        Some(self.bitrate)
    }

    fn fault_and_remedy(&self) -> Option<String> {
        let name = self.writer.name();
        if !self.answers.load(Ordering::Relaxed) {
            return Some(format!(
                "no SLCAN message from {name}: check that it is a CAN adapter with SLCAN firmware, \
                 and that the robot is on its bus"
            ));
        }
        self.refuses.load(Ordering::Relaxed).then(|| {
            format!(
                "the adapter {name} refuses frames: check that another node is on the bus, and \
                 give the bitrate of the bus (slcan:{name}@BITRATE)"
            )
        })
    }
}

impl Drop for SlcanOutlet {
    fn drop(&mut self) {
        // With an open channel, received frames would wait in the line for the next program.
        self.writer.last(&Message::Close.encode().unwrap_or_default());
    }
}

struct SlcanInlet<R> {
    name: String,
    reader: R,
    text: Reader,
    events: VecDeque<Event>,
    answers: Arc<AtomicBool>,
    refuses: Arc<AtomicBool>,
}

impl<R: Read + Send> Inlet for SlcanInlet<R> {
    fn next_event(&mut self) -> Result<Option<Event>, LinkError> {
        if self.events.is_empty() {
            let mut bytes = [0; 256];
            let count = read(&self.name, &mut self.reader, &mut bytes)?;
            for &byte in &bytes[..count] {
                let message = self.text.push(byte);
                if message.is_some() {
                    self.answers.store(true, Ordering::Relaxed);
                }
                match message {
                    Some(Message::Frame(frame)) => self.events.push_back(Event::Frame(frame)),
                    Some(Message::Ok) => self.refuses.store(false, Ordering::Relaxed),
                    Some(Message::Error) => self.refuses.store(true, Ordering::Relaxed),
                    _ => {}
                }
            }
        }
        Ok(self.events.pop_front())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::LinkBus;
    use crate::port::LiveLink;
    use rollwalk_protocol::can::Frame;
    use std::os::unix::net::UnixStream;

    #[test]
    fn an_adapter_is_set_up_and_carries_frames() {
        let (host, mut adapter) = UnixStream::pair().unwrap();
        let port = port("the adapter", host.try_clone().unwrap(), host, 8, 1_000_000);
        let mut link = LiveLink::new(port.unwrap());
        assert!(link.fault_and_remedy().unwrap().contains("no SLCAN message"));
        link.send(&Frame::standard(0x123, &[0xAB]).unwrap()).unwrap();
        let expected = b"\rC\rS8\rO\rt1231AB\r";
        let mut received = vec![0; expected.len()];
        adapter.read_exact(&mut received).unwrap();
        assert_eq!(received, expected);

        adapter.write_all(b"\r\r\x07t3212").unwrap();
        adapter.write_all(b"0102\r").unwrap();
        let frame = link.receive(u64::MAX >> 1).unwrap().unwrap();
        assert_eq!(frame, Frame::standard(0x321, &[1, 2]).unwrap());
        assert!(link.fault_and_remedy().unwrap().contains("the adapter refuses frames"));

        drop(link);
        let mut received = [0; 2];
        adapter.read_exact(&mut received).unwrap();
        assert_eq!(&received, b"C\r");
    }

    #[test]
    fn only_bitrates_of_the_protocol_are_taken() {
        let error = open(Path::new("/dev/null"), 123_456).err().unwrap();
        assert!(error.what.contains("123456 bit/s"), "{error}");
    }
}
