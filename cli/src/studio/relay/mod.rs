//! Relay between the page and a bus of this computer: a WebSocket at one end, frames at the other ([`traffic`]).
//!
//! The page is the robot's host, and the relay adds nothing to its frames. If the page closes, its heartbeats end, and the
//! robot returns to SAFE by its own timeouts. The bus is open only while a page uses it, and only one page can use it at a
//! time.

mod traffic;

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::name::BusName;
use rollwalk_bus::open::{self, OpenError};
use rollwalk_bus::port::LiveLink;
use rollwalk_terminal::link::{DEPTH, cannot_open, live};
use rollwalk_terminal::output;
use std::convert::Infallible;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::sync::{Mutex, TryLockError};
use std::thread;
use std::time::{Duration, Instant};
use traffic::Traffic;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

/// Maximum size of a message of the page, bytes.
const MESSAGE_MAX: usize = 64 * 1024;
/// Maximum total size of messages queued for the page, bytes. If more are queued, the page counts as hung.
const UNREAD_MAX: usize = 1024 * 1024;
/// Maximum wait for a frame of the bus before messages of the page are read, µs.
const LOOK_US: u64 = 2_000;
/// Maximum wait for a frame of the bus while frames wait for a busy bus, µs.
const BUSY_US: u64 = 200;
/// Maximum number of bus frames in one message, so that a busy bus does not delay the page.
const FRAMES_MAX: usize = 64;
/// Maximum time for which a closed port stays in use, until its receiving thread ends.
const CLOSING: Duration = Duration::from_millis(200);
/// Timeout for a page's answer to a close frame.
const FAREWELL: Duration = Duration::from_secs(1);
/// Maximum length of the reason in a close frame, bytes (RFC 6455, 5.5).
const REASON_MAX: usize = 123;

/// Relay of one bus, which serves one page of the studio at a time.
pub struct Relay {
    bus: BusName,
    taken: Mutex<()>,
}

/// Reason why a page no longer has the bus.
enum RelayEnd {
    Gone,
    /// Refusal with its message; the page never had the bus.
    Refused(String),
    /// Failure with its message.
    Trouble(String),
}

impl Relay {
    /// Creates a relay to a bus, after checking that it can be opened. Sends nothing.
    ///
    /// # Errors
    /// Returns an error if the bus does not exist or cannot be used. The error contains the command to type.
    pub fn new(bus: BusName) -> miette::Result<Self> {
        // This thread continues as server, so it gets no real-time priority.
        open::open(&bus, DEPTH).map_err(cannot_open)?;
        Ok(Self { bus, taken: Mutex::new(()) })
    }

    /// Bus, as the user names it.
    pub fn bus(&self) -> &BusName {
        &self.bus
    }

    /// Serves a page until it closes. `rest` contains bytes that were received with its request.
    pub fn serve(&self, stream: TcpStream, rest: Vec<u8>) {
        let config = WebSocketConfig::default()
            .max_message_size(Some(MESSAGE_MAX))
            .max_frame_size(Some(MESSAGE_MAX))
            .max_write_buffer_size(UNREAD_MAX);
        let mut socket = WebSocket::from_partially_read(stream, rest, Role::Server, Some(config));
        let Self { bus, .. } = self;
        match self.relay(&mut socket) {
            RelayEnd::Gone => output::print_line(format_args!(
                "the page has left {bus}: without its heartbeats the robot returns to SAFE \
                 automatically"
            )),
            RelayEnd::Refused(why) => close_with_reason(&mut socket, &why),
            RelayEnd::Trouble(why) => {
                output::print_line(format_args!("{bus}: {why}"));
                close_with_reason(&mut socket, &why);
            }
        }
    }

    /// Relays frames while a page has the bus.
    fn relay(&self, socket: &mut WebSocket<TcpStream>) -> RelayEnd {
        let Self { bus, taken } = self;
        let _taken = match taken.try_lock() {
            Ok(taken) => taken,
            // If the thread of a page panicked, it has closed its bus.
            Err(TryLockError::Poisoned(taken)) => taken.into_inner(),
            Err(TryLockError::WouldBlock) => {
                return RelayEnd::Refused(format!("another page uses {bus}: disconnect that page"));
            }
        };
        match self.open() {
            Ok(mut live) => {
                output::print_line(format_args!("a page uses {bus}"));
                let Err(end) = pass_on(socket, &mut live, bus);
                end
            }
            Err(OpenError { what, help }) => RelayEnd::Trouble(format!("{what}: {help}")),
        }
    }

    /// Opens the bus, with a second attempt if another page has just released it.
    fn open(&self) -> Result<LiveLink, OpenError> {
        live(&self.bus).or_else(|_| {
            thread::sleep(CLOSING);
            live(&self.bus)
        })
    }
}

/// Passes frames in both directions, and prints problems of the bus on the terminal; ends only with an error.
fn pass_on(
    socket: &mut WebSocket<TcpStream>,
    bus: &mut LiveLink,
    name: &BusName,
) -> Result<Infallible, RelayEnd> {
    let gone = |_| RelayEnd::Gone;
    let lost = |error: LinkError| RelayEnd::Trouble(error.to_string());
    let (mut traffic, mut complains) = (Traffic::default(), false);
    socket.get_ref().set_nonblocking(true).map_err(gone)?;
    loop {
        while let Some(message) = would_block(socket.read())? {
            match message {
                Message::Binary(bytes) => traffic
                    .page_sent(bus.now_us(), &bytes)
                    .map_err(|misuse| RelayEnd::Trouble(misuse.to_string()))?,
                Message::Ping(_) | Message::Pong(_) => {}
                Message::Close(_) => return Err(RelayEnd::Gone),
                Message::Text(_) | Message::Frame(_) => {
                    return Err(RelayEnd::Trouble(traffic::Misuse::NoFrames.to_string()));
                }
            }
        }
        let mut wait_us = LOOK_US;
        while let Some(frame) = traffic.for_bus(bus.now_us()) {
            match bus.send(&frame) {
                Ok(()) => traffic.sent(),
                Err(LinkError::Busy) => {
                    wait_us = BUSY_US;
                    break;
                }
                Err(error) => return Err(lost(error)),
            }
        }
        let complaint = bus.fault_and_remedy();
        if complaint.is_some() != complains {
            complains = complaint.is_some();
            output::print_line(complaint.unwrap_or_else(|| format!("{name}: the bus works again")));
        }
        let mut until_us = bus.now_us() + wait_us;
        for _ in 0..FRAMES_MAX {
            let Some(frame) = bus.receive(until_us).map_err(lost)? else { break };
            traffic.bus_sent(&frame);
            until_us = 0;
        }
        let sent = match traffic.for_page() {
            Some(packets) => socket.send(Message::binary(packets)),
            None => socket.flush(),
        };
        would_block(sent)?;
    }
}

/// Result of a socket operation; `None` if it would block.
fn would_block<T>(outcome: tungstenite::Result<T>) -> Result<Option<T>, RelayEnd> {
    match outcome {
        Ok(done) => Ok(Some(done)),
        Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => Ok(None),
        Err(_) => Err(RelayEnd::Gone),
    }
}

/// Closes a socket with a reason, shortened to the maximum of a close frame.
fn close_with_reason(socket: &mut WebSocket<TcpStream>, why: &str) {
    let reason = why[..why.floor_char_boundary(REASON_MAX)].to_owned();
    let frame = CloseFrame { code: CloseCode::Policy, reason: reason.into() };
    let stream = socket.get_ref();
    let waits = stream.set_nonblocking(false).and(stream.set_read_timeout(Some(FAREWELL)));
    if waits.is_err() || socket.close(Some(frame)).is_err() {
        return;
    }
    // The server waits until the browser has read the reason, because closing a connection with unread bytes discards it.
    let end = Instant::now() + FAREWELL;
    while Instant::now() < end && socket.read().is_ok() {}
}
