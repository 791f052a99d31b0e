//! Link over a serial line: frames and messages in packets with a checksum, and the board's own report.
//!
//! The byte format is that of [`rollwalk_protocol::serial`]. [`port`] accepts any pair of ends of a line; [`open`] opens a
//! device.

use crate::error::OpenError;
use crate::line::{LineWriter, WAIT, read};
use crate::link::LinkError;
use crate::port::{Event, Inlet, Outlet, Port, since_us};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{Deframer, Gateway, Packet};
use std::collections::VecDeque;
use std::fs;
use std::io::{self, Read, Write};
use std::path::Path;
use std::time::Instant;

/// User group that may access serial devices.
pub const GROUP: &str = "dialout";

/// Returns the command that adds the user to a group.
pub fn join(group: &str) -> String {
    format!("sudo usermod -aG {group} $USER, then log in again")
}

/// Opens a device.
///
/// # Errors
/// Returns an error if the device does not exist, access is denied, or it does not support this rate.
pub fn open(device: &Path, baud: u32) -> Result<Port, OpenError> {
    let (reader, writer) = open_device(device, baud)?;
    Ok(port(&device.display().to_string(), reader, writer))
}

/// Opens a serial device at `baud` bit/s with 8 data bits, no parity, one stop bit and no flow control. Returns its receiving
/// and transmitting ends.
pub(crate) fn open_device(
    device: &Path,
    baud: u32,
) -> Result<(impl Read + Send + use<>, impl Write + Send + use<>), OpenError> {
    let name = device.to_string_lossy();
    let failed = |error: &serialport::Error| refused(device, baud, error);
    let reader = serialport::new(name, baud).timeout(WAIT).open_native();
    let reader = reader.map_err(|error| failed(&error))?;
    let writer = reader.try_clone_native().map_err(|error| failed(&error))?;
    Ok((reader, writer))
}

fn refused(device: &Path, baud: u32, error: &serialport::Error) -> OpenError {
    use serialport::ErrorKind;
    let shown = device.display();
    match error.kind {
        ErrorKind::Io(io::ErrorKind::NotFound) => {
            OpenError { what: format!("there is no device `{shown}`"), help: devices() }
        }
        // The crate reports a device locked by another program in this way.
        ErrorKind::NoDevice => OpenError {
            what: format!("another program uses `{shown}`"),
            help: format!("end the other program; `fuser {shown}` prints its process id"),
        },
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
            OpenError { what: format!("this user may not open `{shown}`"), help: join(GROUP) }
        }
        ErrorKind::InvalidInput => OpenError {
            what: format!("`{shown}` cannot run at {baud} bit/s ({error})"),
            help: format!(
                "give another rate, such as serial:{shown}@115200, and set the same rate on the \
                 board"
            ),
        },
        _ => OpenError {
            what: format!("`{shown}` cannot be opened: {error}"),
            help: format!(
                "give a serial port that no other program uses; `fuser {shown}` prints \
                the users of this one"
            ),
        },
    }
}

/// Serial ports that appear to be adapters or boards, sorted, such as `/dev/ttyUSB0`.
pub fn list() -> Vec<String> {
    let names = fs::read_dir("/dev").into_iter().flatten().flatten();
    let names = names.filter_map(|entry| entry.file_name().into_string().ok());
    let is_adapter = |name: &String| name.starts_with("ttyUSB") || name.starts_with("ttyACM");
    let mut names: Vec<_> = names.filter(is_adapter).map(|name| format!("/dev/{name}")).collect();
    names.sort();
    names
}

fn devices() -> String {
    let names = list();
    if names.is_empty() {
        return "plug in an adapter; `sudo dmesg` lists the devices that the kernel detected"
            .into();
    }
    format!("give a device that is plugged in: {}", names.join(", "))
}

/// Creates the port of a line that carries [`Packet`]s. `name` is used in messages.
pub fn port(
    name: &str,
    reader: impl Read + Send + 'static,
    writer: impl Write + Send + 'static,
) -> Port {
    both_ends(name, reader, writer, Some(Gateway::default()))
}

/// Creates the port of a line with more than two ends, like [`port`]. It has no gateway: every packet is a frame for all ends.
pub(crate) fn shared_port(
    name: &str,
    reader: impl Read + Send + 'static,
    writer: impl Write + Send + 'static,
) -> Port {
    both_ends(name, reader, writer, None)
}

fn both_ends(
    name: &str,
    reader: impl Read + Send + 'static,
    writer: impl Write + Send + 'static,
    gateway: Option<Gateway>,
) -> Port {
    let writer = LineWriter::new(name, writer);
    let outlet = SerialOutlet { writer, gateway, started: Instant::now() };
    Port { outlet: Box::new(outlet), inlet: Box::new(inlet(name, reader)) }
}

pub(crate) fn inlet<R: Read + Send + 'static>(name: &str, reader: R) -> impl Inlet + use<R> {
    let name = name.to_owned();
    SerialInlet { name, reader, deframer: Deframer::default(), events: VecDeque::new() }
}

struct SerialOutlet {
    writer: LineWriter,
    /// Gateway of a line that carries complete messages.
    gateway: Option<Gateway>,
    started: Instant,
}

fn write(writer: &mut LineWriter, packet: &Packet<'_>) -> Result<(), LinkError> {
    let line = packet.encode();
    let line =
        line.ok_or_else(|| LinkError::Down(format!("{packet:?} cannot be encoded as a line")))?;
    writer.put(&line)
}

impl Outlet for SerialOutlet {
    fn is_free(&self) -> bool {
        self.writer.is_free()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        if frame.standard_id().is_none() {
            let name = self.writer.name();
            return Err(LinkError::Down(format!(
                "{name} cannot carry frames with 29-bit identifiers"
            )));
        }
        // Fails before the gateway has recorded the frame.
        self.writer.ready()?;
        let packet = match &mut self.gateway {
            Some(gateway) => gateway.send(since_us(self.started), frame),
            None => Some(Packet::Link(*frame)),
        };
        packet.map_or(Ok(()), |packet| write(&mut self.writer, &packet))
    }

    fn ask_report(&mut self) -> Result<bool, LinkError> {
        write(&mut self.writer, &Packet::Ask).map(|()| true)
    }

    fn take_apart(&mut self, id: u16, message: &[u8]) {
        if let Some(gateway) = &mut self.gateway {
            gateway.receive(id, message);
        }
    }

    fn poll_inward(&mut self) -> Option<Frame> {
        self.gateway.as_mut()?.poll(since_us(self.started))
    }
}

struct SerialInlet<R> {
    name: String,
    reader: R,
    deframer: Deframer,
    events: VecDeque<Event>,
}

impl<R: Read + Send> Inlet for SerialInlet<R> {
    fn next_event(&mut self) -> Result<Option<Event>, LinkError> {
        if self.events.is_empty() {
            let mut bytes = [0; 256];
            let count = read(&self.name, &mut self.reader, &mut bytes)?;
            for &byte in &bytes[..count] {
                match self.deframer.push(byte).and_then(Packet::decode) {
                    Some(Packet::Link(frame)) => self.events.push_back(Event::Frame(frame)),
                    Some(Packet::Message { id, bytes }) => {
                        self.events.push_back(Event::Message(id, bytes.to_vec()));
                    }
                    Some(Packet::Report(report)) => self.events.push_back(Event::Report(report)),
                    // This end has no report to send.
                    Some(Packet::Ask) | None => {}
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
    use rollwalk_protocol::serial::{BoardReport, Reset};
    use rollwalk_protocol::wire::Node;
    use rollwalk_protocol::wire::isotp::{Event, Output, Timing};
    use rollwalk_protocol::wire::transport::{Endpoint, MAX_MESSAGE, frame_to_controller};
    use serialport::{SerialPort, TTYPort};
    use std::net::{TcpListener, TcpStream};
    use std::thread;
    use std::time::Duration;

    /// Timeout far longer than any operation of the tests.
    const LONG: Duration = Duration::from_secs(60);

    fn line() -> (TcpStream, TcpStream) {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let host = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        (host, listener.accept().unwrap().0)
    }

    /// Board that echoes frames under the next identifier, sends a frame before every report, and disconnects after `packets`.
    fn board(line: &TcpStream, packets: usize) {
        let mut writer = line;
        let mut deframer = Deframer::default();
        let mut answered = 0;
        for byte in io::BufReader::new(line).bytes() {
            let Some(packet) = deframer.push(byte.unwrap()).and_then(Packet::decode) else {
                continue;
            };
            let answers = match packet {
                Packet::Link(frame) => vec![Packet::Link(next(&frame))],
                Packet::Message { id, bytes } => vec![Packet::Message { id: id + 1, bytes }],
                Packet::Ask => {
                    let report =
                        BoardReport { reset: Reset::Pin, uptime_ms: 7, ..BoardReport::default() };
                    let frame = Frame::standard(0x123, &[1]).unwrap();
                    vec![Packet::Link(frame), Packet::Report(report)]
                }
                Packet::Report(_) => panic!("the host has nothing to report"),
            };
            // Noise up to the zero that terminates it.
            writer.write_all(&[1, 2, 3, 0]).unwrap();
            answers.iter().for_each(|a| writer.write_all(&a.encode().unwrap()).unwrap());
            answered += 1;
            if answered == packets {
                break;
            }
        }
        line.shutdown(std::net::Shutdown::Both).unwrap();
    }

    fn next(frame: &Frame) -> Frame {
        Frame::standard(frame.standard_id().unwrap() + 1, frame.data()).unwrap()
    }

    #[test]
    fn frames_and_reports_cross_the_line() {
        let (host, far) = line();
        let board = thread::spawn(move || board(&far, 3));
        let mut link = LiveLink::new(port("the line", host.try_clone().unwrap(), host));
        let soon = LONG.as_micros() as u64;

        let frame = Frame::standard(0x40, &[1, 0, 3]).unwrap();
        link.send(&frame).unwrap();
        assert_eq!(link.receive(soon), Ok(Some(next(&frame))));
        assert_eq!(link.receive(link.now_us()), Ok(None));

        let report = link.report(LONG).unwrap().unwrap();
        assert_eq!((report.reset, report.uptime_ms), (Reset::Pin, 7));
        // The frame that arrived before the report is kept.
        assert_eq!(link.receive(0).unwrap().unwrap().standard_id(), Some(0x123));

        link.send(&frame).unwrap();
        board.join().unwrap();
        assert_eq!(link.receive(soon), Ok(Some(next(&frame))));
        let hung_up = LinkError::Down("the line: the other end closed the connection".into());
        assert_eq!(link.receive(soon), Err(hung_up.clone()));
        assert_eq!(link.receive(soon), Err(hung_up), "and it stays so");
    }

    /// A CAN bus with ISO-TP, as seen from both ends, over a line that carries a single packet in each direction.
    #[test]
    fn messages_cross_the_line_whole() {
        let (host, far) = line();
        let board = thread::spawn(move || board(&far, 1));
        let mut link = LiveLink::new(port("the line", host.try_clone().unwrap(), host));
        let message: Vec<u8> = (0..MAX_MESSAGE).map(|k| k as u8).collect();
        let mut endpoint = Endpoint::new(Timing::default());
        endpoint.send(&message).unwrap();
        let node = Node::new(2).unwrap();
        loop {
            while let Output::Send(pdu) = endpoint.poll(0) {
                link.send(&frame_to_controller(node, &pdu)).unwrap();
            }
            let frame = link.receive(LONG.as_micros() as u64).unwrap().unwrap();
            assert_eq!(frame.standard_id(), Some(0x521));
            if endpoint.on_frame(frame.data(), 0) == Event::Received {
                break;
            }
        }
        assert_eq!(endpoint.received(), message);
        board.join().unwrap();
    }

    #[test]
    fn a_device_that_is_not_there_is_named() {
        let error = open(Path::new("/dev/ttyNOSUCH7"), 115_200).err().unwrap();
        assert_eq!(error.what, "there is no device `/dev/ttyNOSUCH7`");
        let error = open(Path::new("/dev/null"), 115_200).err().unwrap();
        assert!(error.what.starts_with("`/dev/null` cannot"), "{error}");
        let (_far, device) = TTYPort::pair().unwrap();
        let name = device.name().unwrap();
        drop(device);
        let _first = open(Path::new(&name), 115_200).unwrap();
        let error = open(Path::new(&name), 115_200).err().unwrap();
        assert_eq!(error.what, format!("another program uses `{name}`"));
    }
}
