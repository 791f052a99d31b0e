//! SocketCAN: a real CAN interface of Linux, or a virtual one.
//!
//! `interface` finds and opens the interface, `flight` keeps the kernel's queue short, and `health` interprets the errors that
//! drivers report.

mod flight;
mod health;
mod interface;

pub use interface::{DEFAULT_BITRATE, Interface, check_support, create_virtual, list};

use crate::error::OpenError;
use crate::link::LinkError;
use crate::port::{Event, Inlet, Outlet, Port, since_us};
use flight::Flight;
use health::Health;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::BusState;
use socketcan::{CanDataFrame, EmbeddedFrame, ShouldRetry, Socket, SocketOptions};
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time without a transmission after which the bus is reported as not acknowledged, µs, for drivers that do not report this.
///
/// On a working bus, a frame takes a fraction of a millisecond. The interface stays open.
const DEAD_US: u64 = 100_000;
/// Longest wait for a frame before the state of the interface is checked.
const WAIT: Duration = Duration::from_millis(50);

/// Interface shared by its inlet and its outlet.
struct Shared {
    name: String,
    bitrate: Option<u32>,
    socket: socketcan::CanSocket,
    started: Instant,
    condition: Mutex<Condition>,
}

struct Condition {
    flight: Flight,
    health: Health,
    /// State last reported to the listeners.
    reported: BusState,
}

impl Condition {
    /// True if another frame may be passed to the kernel. False during bus-off: the interface reports its recovery.
    fn takes(&self, now_us: u64) -> bool {
        let may_try = self.health.state() != BusState::Off && self.flight.may_try(now_us);
        self.flight.has_room() || may_try
    }
}

/// Opens an interface with at most `depth` frames in flight.
///
/// # Errors
/// Returns an error if the interface does not exist, is down, or has another bitrate.
pub fn open(name: &str, bitrate: Option<u32>, depth: usize) -> Result<Port, OpenError> {
    let (socket, bitrate) = interface::open(name, bitrate)?;
    let condition = Condition {
        flight: Flight::new(depth),
        health: Health::default(),
        reported: BusState::Active,
    };
    let interface = Shared {
        name: name.to_owned(),
        bitrate,
        socket,
        started: Instant::now(),
        condition: Mutex::new(condition),
    };
    interface.set_up().map_err(|error| OpenError {
        what: format!("`{name}` cannot be set up: {error}"),
        help: format!("check the interface: ip -details link show {name}"),
    })?;
    let interface = Arc::new(interface);
    let outlet = Box::new(CanOutlet(Arc::clone(&interface)));
    Ok(Port { outlet, inlet: Box::new(CanInlet(interface)) })
}

impl Shared {
    fn set_up(&self) -> io::Result<()> {
        self.socket.set_nonblocking(true)?;
        // The kernel echoes our frames once they are transmitted.
        self.socket.set_recv_own_msgs(true)?;
        self.socket.set_error_filter_accept_all()
    }

    fn now_us(&self) -> u64 {
        since_us(self.started)
    }

    fn condition(&self) -> MutexGuard<'_, Condition> {
        // A panic cannot leave an invalid condition: every field is valid on its own.
        self.condition.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Creates the error for a call on the socket that has failed permanently.
    fn gone(&self, error: &io::Error) -> LinkError {
        let name = &self.name;
        let why = match error.kind() {
            io::ErrorKind::NetworkDown => {
                format!(
                    "{name} went down. Bring the interface up again: sudo ip link set {name} up"
                )
            }
            _ if error.raw_os_error().is_some_and(|code| NO_DEVICE.contains(&code)) => {
                format!(
                    "{name} no longer exists: plug its adapter in again; `ip link` lists \
                    interfaces"
                )
            }
            _ => format!("{name}: {error}"),
        };
        LinkError::Down(why)
    }
}

/// Error numbers `ENXIO` and `ENODEV` of Linux.
const NO_DEVICE: [i32; 2] = [6, 19];
/// Error number `ENOBUFS` of Linux: the interface's queue is full.
const NO_BUFFERS: i32 = 105;

struct CanOutlet(Arc<Shared>);

impl Outlet for CanOutlet {
    fn is_free(&self) -> bool {
        self.0.condition().takes(self.0.now_us())
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        let now_us = self.0.now_us();
        let mut condition = self.0.condition();
        if !condition.takes(now_us) {
            return Err(LinkError::Busy);
        }
        match self.0.socket.write_frame(&to_socket(frame)) {
            Ok(()) => {
                condition.flight.took_off(now_us, *frame);
                Ok(())
            }
            // Other programs have filled the queue, or an adapter has stalled, as on a busy bus. `DEAD_US` detects a dead
            // adapter.
            Err(error) if error.should_retry() || error.raw_os_error() == Some(NO_BUFFERS) => {
                Err(LinkError::Busy)
            }
            Err(error) => Err(self.0.gone(&error)),
        }
    }

    fn bitrate(&self) -> Option<u32> {
        self.0.bitrate
    }

    fn fault_and_remedy(&self) -> Option<String> {
        self.0.condition().health.fault_and_remedy(&self.0.name, self.0.bitrate)
    }
}

struct CanInlet(Arc<Shared>);

impl Inlet for CanInlet {
    fn next_event(&mut self) -> Result<Option<Event>, LinkError> {
        let received = match self.0.socket.read_frame_timeout(WAIT) {
            Ok(frame) => Some(frame),
            Err(error) if error.should_retry() || error.kind() == io::ErrorKind::TimedOut => None,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => None,
            Err(error) => return Err(self.0.gone(&error)),
        };
        let now_us = self.0.now_us();
        let mut condition = self.0.condition();
        let condition = &mut *condition;
        let mut event = None;
        match received {
            Some(socketcan::CanFrame::Data(frame)) => {
                condition.health.works();
                event = from_socket(&frame).map(|frame| {
                    if condition.flight.landed(now_us, &frame) {
                        Event::Sent
                    } else {
                        Event::Frame(frame)
                    }
                });
            }
            Some(socketcan::CanFrame::Error(frame)) => {
                let emptied = condition.health.report(&frame.into_error());
                if emptied {
                    condition.flight.clear();
                }
            }
            Some(socketcan::CanFrame::Remote(_)) => {}
            None if condition.flight.stuck_us(now_us) > DEAD_US => condition.health.stuck(),
            None => {}
        }
        let state = condition.health.state();
        if event.is_none() && state != condition.reported {
            condition.reported = state;
            event = Some(Event::State(state));
        }
        Ok(event)
    }
}

fn to_socket(frame: &Frame) -> CanDataFrame {
    CanDataFrame::new(frame.id(), frame.data()).expect("a frame has at most 8 bytes")
}

fn from_socket(frame: &CanDataFrame) -> Option<Frame> {
    Frame::new(frame.id(), frame.data())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_the_same_on_both_sides_of_the_socket() {
        let standard = Frame::standard(0x7FF, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
        let extended = Frame::extended(0x1FFF_FFFF, &[]).unwrap();
        // Another frame with the same number.
        let short = Frame::extended(0x7FF, &[9]).unwrap();
        for frame in [standard, extended, short] {
            assert_eq!(from_socket(&to_socket(&frame)), Some(frame));
        }
    }
}
