//! Opens a bus by its name.

pub use crate::error::OpenError;
use crate::name::{BusName, DEFAULT_BAUD};
use crate::port::Port;
use crate::{serial, tty};

/// Opens a bus that carries frames, with at most `depth` frames in flight.
///
/// # Errors
/// Returns an error if the bus does not exist, cannot be used in its current state, or is a line of servos.
pub fn open(name: &BusName, depth: usize) -> Result<Port, OpenError> {
    match name {
        BusName::Can { interface, bitrate } => open_can(interface, *bitrate, depth),
        BusName::Serial { device, baud } => serial::open(device, *baud),
        BusName::Slcan { device, bitrate } => crate::slcan::open(device, *bitrate),
        BusName::Sim { socket } => crate::sim::connect(socket.as_deref()),
        BusName::Tty { .. } | BusName::Pty { .. } => Err(OpenError {
            what: format!("`{name}` is a serial line of servos, which does not carry frames"),
            help: "for a controller on a serial line, give serial:DEVICE".into(),
        }),
    }
}

/// Opens an actuator bus, either one that carries frames, with at most `depth` frames in flight, or a serial line.
///
/// # Errors
/// Returns an error if the bus does not exist or cannot be used in its current state.
pub fn actuators(name: &BusName, depth: usize) -> Result<Port, OpenError> {
    match name {
        BusName::Tty { device, baud } => tty::open(device, baud.unwrap_or(DEFAULT_BAUD)),
        BusName::Pty { link } => tty::serve(link),
        _ => open(name, depth),
    }
}

#[cfg(target_os = "linux")]
fn open_can(interface: &str, bitrate: Option<u32>, depth: usize) -> Result<Port, OpenError> {
    crate::can::open(interface, bitrate, depth)
}

#[cfg(not(target_os = "linux"))]
fn open_can(interface: &str, _bitrate: Option<u32>, _depth: usize) -> Result<Port, OpenError> {
    Err(OpenError {
        what: format!("`can:{interface}` requires SocketCAN, which only Linux provides"),
        help: "use a CAN adapter on a serial line (slcan:), a serial line (serial:), or sim".into(),
    })
}
