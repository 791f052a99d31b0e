//! CAN interfaces of this computer: lists them, and opens one for use.

use crate::error::OpenError;
use socketcan::nl::CanState;
use socketcan::{CanInterface, CanSocket, Socket};
use std::fs;
use std::io;
use std::path::Path;

/// Value `ARPHRD_CAN` of the file `type` of a CAN interface.
const TYPE_CAN: &str = "280";
/// Flag `IFF_UP` in the file `flags` of a network interface.
const UP: u32 = 1;
/// Default bitrate of the link, bit/s.
pub const DEFAULT_BITRATE: u32 = 1_000_000;

/// Names of all CAN interfaces, sorted.
pub fn list() -> Vec<String> {
    let Ok(folder) = fs::read_dir("/sys/class/net") else { return Vec::new() };
    let names = folder.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<_> = names.filter(|name| attribute(name, "type") == TYPE_CAN).collect();
    names.sort();
    names
}

/// Description of an interface by the kernel, without opening it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Interface {
    /// Name, as in `can:NAME`.
    pub name: String,
    /// True if the interface is up.
    pub is_up: bool,
    /// True for `vcan` and `slcan`, which have no network hardware.
    pub is_virtual: bool,
    /// Bitrate, bit/s; `None` for virtual interfaces and some drivers.
    pub bitrate: Option<u32>,
    /// True if the controller is bus-off, after too many errors.
    pub is_bus_off: bool,
}

impl Interface {
    /// Reads the kernel's description of the interface `name`.
    pub fn describe(name: &str) -> Self {
        let netlink = CanInterface::open(name).ok();
        let netlink = netlink.as_ref();
        let state = netlink.and_then(|interface| interface.state().ok().flatten());
        Self {
            name: name.to_owned(),
            is_up: is_up(name),
            is_virtual: is_virtual(name),
            bitrate: netlink.and_then(|interface| interface.bit_rate().ok().flatten()),
            is_bus_off: matches!(state, Some(CanState::BusOff)),
        }
    }

    /// Command that brings the interface up at the given bitrate.
    pub fn set_up(&self, bitrate: u32) -> String {
        set_up(&self.name, self.is_virtual, bitrate)
    }
}

/// Checks that this kernel has SocketCAN and that this process may use it.
///
/// # Errors
/// Returns an error if SocketCAN is missing or access is denied. The error contains the command that helps.
pub fn check_support() -> Result<(), OpenError> {
    // All interfaces at once: succeeds if the kernel supports CAN.
    let Err(error) = CanSocket::open_iface(0) else { return Ok(()) };
    Err(match error.raw_os_error() {
        Some(UNKNOWN_FAMILY | UNKNOWN_PROTOCOL) => OpenError {
            what: "this kernel lacks SocketCAN".into(),
            help: "load the module with sudo modprobe can_raw; if the kernel does not have this \
                   module, use a serial: or slcan: bus, or sim"
                .into(),
        },
        _ => refused("SocketCAN", &error),
    })
}

/// Opens an interface, which must be up at the right bitrate. Also returns the bitrate, if the driver reports it.
pub fn open(name: &str, bitrate: Option<u32>) -> Result<(CanSocket, Option<u32>), OpenError> {
    let problem = |what: String, help: String| OpenError { what, help };
    let kind = attribute(name, "type");
    if kind.is_empty() {
        return Err(missing(name));
    }
    if kind != TYPE_CAN {
        return Err(problem(
            format!("`{name}` is a network interface, but not a CAN interface"),
            choices(),
        ));
    }
    let set_up = set_up(name, is_virtual(name), bitrate.unwrap_or(DEFAULT_BITRATE));
    if !is_up(name) {
        return Err(problem(format!("the CAN interface `{name}` is down"), set_up));
    }
    // Virtual interfaces and some drivers report no bit rate.
    let actual = CanInterface::open(name).and_then(|interface| interface.bit_rate()).ok().flatten();
    if let (Some(wanted), Some(actual)) = (bitrate, actual)
        && wanted != actual
    {
        let what = format!("`{name}` runs at {actual} bit/s, not at {wanted} bit/s");
        return Err(problem(what, format!("sudo ip link set {name} down; {set_up}")));
    }
    let socket = CanSocket::open(name).map_err(|error| refused(name, &error))?;
    Ok((socket, actual))
}

fn attribute(interface: &str, attribute: &str) -> String {
    let path = Path::new("/sys/class/net").join(interface).join(attribute);
    fs::read_to_string(path).map(|text| text.trim().to_owned()).unwrap_or_default()
}

fn is_up(name: &str) -> bool {
    let flags = attribute(name, "flags");
    let flags = u32::from_str_radix(flags.trim_start_matches("0x"), 16).unwrap_or(UP);
    flags & UP != 0
}

fn set_up(name: &str, is_virtual: bool, bitrate: u32) -> String {
    if is_virtual {
        format!("sudo ip link set {name} up")
    } else {
        format!("sudo ip link set {name} up type can bitrate {bitrate}")
    }
}

fn is_virtual(name: &str) -> bool {
    // Only hardware has a device file; `vcan` and `slcan` do not.
    !Path::new("/sys/class/net").join(name).join("device").exists()
}

fn missing(name: &str) -> OpenError {
    let what = format!("there is no network interface `{name}`");
    if let Err(OpenError { what: why, help }) = check_support() {
        return OpenError { what: format!("{what}, and {why}"), help };
    }
    let help = if name.starts_with("vcan") { create_virtual(name) } else { choices() };
    OpenError { what, help }
}

/// Command that creates a virtual interface and brings it up.
pub fn create_virtual(name: &str) -> String {
    format!("sudo modprobe vcan; sudo ip link add {name} type vcan; sudo ip link set {name} up")
}

/// Error number `EAFNOSUPPORT` of Linux.
const UNKNOWN_FAMILY: i32 = 97;
/// Error number `EPROTONOSUPPORT` of Linux.
const UNKNOWN_PROTOCOL: i32 = 93;

fn choices() -> String {
    match list() {
        names if names.is_empty() => {
            "this computer has no CAN interface: plug in an adapter; `ip link` lists interfaces, \
                                      and `sudo dmesg` prints the messages of the driver"
                .into()
        }
        names => format!("give a CAN interface of this computer: {}", names.join(", ")),
    }
}

fn refused(name: &str, error: &io::Error) -> OpenError {
    let help = if error.kind() == io::ErrorKind::PermissionDenied {
        "run this process outside of its container or sandbox, or give it the capability NET_RAW, \
         which CAN sockets require"
            .into()
    } else {
        format!("check the interface: ip -details link show {name}")
    };
    OpenError { what: format!("`{name}` cannot be opened: {error}"), help }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_that_is_none_for_can_is_told_apart() {
        // Every Linux has a loopback interface.
        let error = open("lo", None).unwrap_err();
        assert!(
            error.what.contains("`lo` is a network interface, but not a CAN interface"),
            "{error}"
        );
        let error = open("nosuchcan7", None).unwrap_err();
        assert!(error.what.contains("no network interface `nosuchcan7`"), "{error}");
        assert!(!error.help.is_empty());
    }
}
