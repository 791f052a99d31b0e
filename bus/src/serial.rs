//! The link to a board with a clock of its own over a serial line, in real time.

use crate::link::{LinkBus, LinkError};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::serial::{Packet, Report};
use rollwalk_protocol::tunnel::Deframer;
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// A board at the other end of a line.
pub struct SerialLink<W> {
    writer: W,
    packets: Receiver<io::Result<Packet>>,
    /// Frames that came while something else was waited for.
    frames: VecDeque<CanFrame>,
    started: Instant,
}

impl<W: Write> SerialLink<W> {
    /// Both ends of a line. A thread reads it, until it ends or this is dropped and one more packet comes.
    pub fn new(reader: impl Read + Send + 'static, writer: W) -> Self {
        let (sender, packets) = channel();
        thread::spawn(move || read(reader, &sender));
        Self { writer, packets, frames: VecDeque::new(), started: Instant::now() }
    }

    /// Asks the board how it is; `None` if it does not say within `timeout`.
    ///
    /// # Errors
    /// The line failed.
    pub fn report(&mut self, timeout: Duration) -> Result<Option<Report>, LinkError> {
        self.write(&Packet::Ask)?;
        let deadline = Instant::now() + timeout;
        while let Some(packet) = self.packet(deadline)? {
            match packet {
                Packet::Report(report) => return Ok(Some(report)),
                Packet::Link(frame) => self.frames.push_back(frame),
                Packet::Ask => {}
            }
        }
        Ok(None)
    }

    fn write(&mut self, packet: &Packet) -> Result<(), LinkError> {
        let line = packet.encode();
        let line = line.ok_or_else(|| LinkError::Down(format!("no line for {packet:?}")))?;
        self.writer.write_all(&line).and_then(|()| self.writer.flush()).map_err(|e| down(&e))
    }

    fn packet(&self, deadline: Instant) -> Result<Option<Packet>, LinkError> {
        let left = deadline.saturating_duration_since(Instant::now());
        match self.packets.recv_timeout(left) {
            Ok(Ok(packet)) => Ok(Some(packet)),
            Ok(Err(error)) => Err(down(&error)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                Err(LinkError::Down("serial line: the board hung up".into()))
            }
        }
    }
}

impl<W: Write> LinkBus for SerialLink<W> {
    fn now_us(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), LinkError> {
        self.write(&Packet::Link(*frame))
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<CanFrame>, LinkError> {
        if let Some(frame) = self.frames.pop_front() {
            return Ok(Some(frame));
        }
        let deadline = self.started + Duration::from_micros(deadline_us);
        while let Some(packet) = self.packet(deadline)? {
            if let Packet::Link(frame) = packet {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }
}

fn down(error: &io::Error) -> LinkError {
    LinkError::Down(format!("serial line: {error}"))
}

/// Reads packets until the line ends or nobody wants them any more.
fn read(mut reader: impl Read, packets: &Sender<io::Result<Packet>>) {
    let mut deframer = Deframer::default();
    let mut bytes = [0; 256];
    loop {
        let count = match reader.read(&mut bytes) {
            Ok(0) => return,
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => {
                // Nobody may be there to hear it.
                let _ = packets.send(Err(error));
                return;
            }
        };
        for &byte in &bytes[..count] {
            let packet = deframer.push(byte).and_then(Packet::decode);
            if packet.is_some_and(|packet| packets.send(Ok(packet)).is_err()) {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::serial::Reset;
    use std::net::{TcpListener, TcpStream};

    /// Far longer than anything takes.
    const LONG: Duration = Duration::from_secs(60);

    fn line() -> (TcpStream, TcpStream) {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let host = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        (host, listener.accept().unwrap().0)
    }

    /// Says frames again with the next identifier, and something before every report; then hangs up.
    fn board(line: &TcpStream, packets: usize) {
        let mut writer = line;
        let (sender, received) = channel();
        let reader = line.try_clone().unwrap();
        thread::spawn(move || read(reader, &sender));
        for packet in received.iter().take(packets) {
            let answers = match packet.unwrap() {
                Packet::Link(frame) => vec![Packet::Link(next(&frame))],
                Packet::Ask => {
                    let report = Report { reset: Reset::Pin, uptime_ms: 7, ..Report::default() };
                    let frame = CanFrame::new(0x123, &[1]).unwrap();
                    vec![Packet::Link(frame), Packet::Report(report)]
                }
                Packet::Report(_) => panic!("the host has nothing to report"),
            };
            // Noise, up to the zero that ends it.
            writer.write_all(&[1, 2, 3, 0]).unwrap();
            answers.iter().for_each(|a| writer.write_all(&a.encode().unwrap()).unwrap());
        }
        line.shutdown(std::net::Shutdown::Both).unwrap();
    }

    fn next(frame: &CanFrame) -> CanFrame {
        CanFrame::new(frame.id() + 1, frame.data()).unwrap()
    }

    #[test]
    fn frames_and_reports_cross_the_line() {
        let (host, far) = line();
        let board = thread::spawn(move || board(&far, 3));
        let mut link = SerialLink::new(host.try_clone().unwrap(), host);
        let soon = LONG.as_micros() as u64;

        let frame = CanFrame::new(0x40, &[1, 0, 3]).unwrap();
        link.send(&frame).unwrap();
        assert_eq!(link.receive(soon), Ok(Some(next(&frame))));
        assert_eq!(link.receive(link.now_us()), Ok(None));

        let report = link.report(LONG).unwrap().unwrap();
        assert_eq!((report.reset, report.uptime_ms), (Reset::Pin, 7));
        // What came before the report is still there.
        assert_eq!(link.receive(0).unwrap().unwrap().id(), 0x123);

        link.send(&frame).unwrap();
        board.join().unwrap();
        assert_eq!(link.receive(soon), Ok(Some(next(&frame))));
        assert!(matches!(link.receive(soon), Err(LinkError::Down(_))));
    }
}
