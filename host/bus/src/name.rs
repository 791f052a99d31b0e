//! Names of buses as typed by the user.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Default rate of a serial line, bit/s.
pub const DEFAULT_BAUD: u32 = 1_000_000;
/// Default bitrate of an SLCAN adapter's bus, bit/s.
pub const DEFAULT_BITRATE: u32 = 1_000_000;

/// Name of a bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusName {
    /// Simulated robot on this computer, reached through a socket: `sim` or `sim:PATH`.
    Sim {
        /// Path of the socket; `None` for the default path.
        socket: Option<PathBuf>,
    },
    /// SocketCAN interface: `can:INTERFACE[@BITRATE]`.
    Can {
        /// Name of the network interface, such as `can0`.
        interface: String,
        /// Required bitrate, bit/s; `None` accepts that of the interface.
        bitrate: Option<u32>,
    },
    /// Serial line to the controller: `serial:DEVICE[@BAUD]`.
    Serial {
        /// Path of the device, such as `/dev/ttyUSB0`.
        device: PathBuf,
        /// Rate of the line, bit/s.
        baud: u32,
    },
    /// CAN adapter on a serial line with Lawicel's protocol: `slcan:DEVICE[@BITRATE]`.
    Slcan {
        /// Path of the device, such as `/dev/ttyACM0`.
        device: PathBuf,
        /// Bitrate of the CAN bus, bit/s.
        bitrate: u32,
    },
    /// Serial line of actuators: `tty:DEVICE[@BAUD]`.
    Tty {
        /// Path of the device, such as `/dev/ttyUSB0`.
        device: PathBuf,
        /// Rate of the line, bit/s; `None` selects that of the robot file.
        baud: Option<u32>,
    },
    /// Serial line of simulated actuators, on a pseudo-terminal that this program creates: `pty:PATH`.
    Pty {
        /// Path of the symbolic link to the pseudo-terminal.
        link: PathBuf,
    },
}

impl BusName {
    /// True for a serial line of actuators, which carries bytes instead of frames.
    pub fn carries_bytes(&self) -> bool {
        matches!(self, Self::Tty { .. } | Self::Pty { .. })
    }
}

/// Defect of a bus name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{name}` is not a bus: {what}. Give sim[:SOCKET], can:INTERFACE[@BITRATE], \
     serial:DEVICE[@BAUD] or slcan:DEVICE[@BITRATE], for actuators also tty:DEVICE[@BAUD] or \
     pty:PATH, such as {example}"
)]
pub struct InvalidBusName {
    name: String,
    what: String,
    example: &'static str,
}

/// Longest name of a network interface, bytes (`IFNAMSIZ` without the final zero).
const INTERFACE_LEN: usize = 15;

impl FromStr for BusName {
    type Err = InvalidBusName;

    fn from_str(name: &str) -> Result<Self, InvalidBusName> {
        let bad = |what: String, example| InvalidBusName { name: name.to_owned(), what, example };
        let (kind, rest) = match name.split_once(':') {
            Some((kind, rest)) => (kind, Some(rest)),
            None => (name, None),
        };
        let example = match kind {
            "sim" => "sim",
            "can" => "can:can0",
            "serial" => "serial:/dev/ttyUSB0",
            "slcan" => "slcan:/dev/ttyACM0",
            "tty" => "tty:/dev/ttyUSB0",
            "pty" => "pty:/tmp/servos",
            _ if name.starts_with("/dev/") => {
                return Err(bad(
                    "the protocol before the device is missing".into(),
                    "serial:/dev/ttyUSB0",
                ));
            }
            _ if rest.is_none() => {
                return Err(bad("the kind of bus is missing".into(), "can:can0"));
            }
            _ => return Err(bad(format!("there is no bus of kind `{kind}`"), "can:can0")),
        };
        let bad = |what: String| bad(what, example);
        if kind == "sim" {
            let socket = rest.map(PathBuf::from);
            return match &socket {
                Some(path) if path.as_os_str().is_empty() => {
                    Err(bad("the text after the colon is missing".into()))
                }
                _ => Ok(Self::Sim { socket }),
            };
        }
        let rest = rest.ok_or_else(|| bad(format!("the text after `{kind}` is missing")))?;
        if kind == "pty" {
            return match rest {
                "" => Err(bad("the text after the colon is missing".into())),
                link => Ok(Self::Pty { link: link.into() }),
            };
        }
        let (place, rate) = match rest.rsplit_once('@') {
            Some((place, rate)) => (place, Some(rate)),
            None => (rest, None),
        };
        if place.is_empty() {
            return Err(bad("the text after the colon is missing".into()));
        }
        let rate = rate
            .map(|rate| match rate.parse() {
                Ok(0) | Err(_) => Err(bad(format!("`{rate}` is not a bitrate in bit/s"))),
                Ok(rate) => Ok(rate),
            })
            .transpose()?;
        match kind {
            "can" => {
                if place.len() > INTERFACE_LEN || place.contains(['/', ' ']) {
                    return Err(bad(format!(
                        "`{place}` cannot be the name of a network interface"
                    )));
                }
                Ok(Self::Can { interface: place.into(), bitrate: rate })
            }
            "serial" => {
                Ok(Self::Serial { device: place.into(), baud: rate.unwrap_or(DEFAULT_BAUD) })
            }
            "tty" => Ok(Self::Tty { device: place.into(), baud: rate }),
            _ => Ok(Self::Slcan { device: place.into(), bitrate: rate.unwrap_or(DEFAULT_BITRATE) }),
        }
    }
}

impl fmt::Display for BusName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sim { socket: None } => write!(f, "sim"),
            Self::Sim { socket: Some(path) } => write!(f, "sim:{}", path.display()),
            Self::Can { interface, bitrate: None } => write!(f, "can:{interface}"),
            Self::Can { interface, bitrate: Some(rate) } => write!(f, "can:{interface}@{rate}"),
            Self::Serial { device, baud: DEFAULT_BAUD } => {
                write!(f, "serial:{}", device.display())
            }
            Self::Serial { device, baud } => write!(f, "serial:{}@{baud}", device.display()),
            Self::Slcan { device, bitrate: DEFAULT_BITRATE } => {
                write!(f, "slcan:{}", device.display())
            }
            Self::Slcan { device, bitrate } => write!(f, "slcan:{}@{bitrate}", device.display()),
            Self::Tty { device, baud: None } => write!(f, "tty:{}", device.display()),
            Self::Tty { device, baud: Some(baud) } => write!(f, "tty:{}@{baud}", device.display()),
            Self::Pty { link } => write!(f, "pty:{}", link.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_and_printed() {
        for name in [
            "sim",
            "sim:/run/user/1000/robot.sock",
            "can:can0",
            "can:vcan0@500000",
            "serial:/dev/ttyUSB0",
            "serial:/dev/serial/by-id/usb-FTDI_a@b@115200",
            "slcan:/dev/ttyACM0",
            "slcan:/dev/ttyACM0@250000",
            "tty:/dev/ttyUSB0",
            "tty:/dev/ttyUSB0@57600",
            "pty:/tmp/a@b",
        ] {
            assert_eq!(name.parse::<BusName>().unwrap().to_string(), name);
        }
        let device = "/dev/ttyUSB0".into();
        let usual = BusName::Serial { device, baud: DEFAULT_BAUD };
        assert_eq!("serial:/dev/ttyUSB0@1000000".parse(), Ok(usual));
    }

    #[test]
    fn what_is_wrong_with_a_name_is_said_with_one_that_is_right() {
        for (name, words, example) in [
            ("can0", "the kind of bus is missing", "can:can0"),
            ("", "the kind of bus is missing", "can:can0"),
            ("/dev/ttyUSB0", "the protocol before the device is missing", "serial:/dev/ttyUSB0"),
            ("usb:can0", "of kind `usb`", "can:can0"),
            ("can", "the text after `can` is missing", "can:can0"),
            ("can:", "the text after the colon is missing", "can:can0"),
            ("can:/dev/ttyACM0", "`/dev/ttyACM0` cannot be the name", "can:can0"),
            ("can:an-interface-too-long", "cannot be the name", "can:can0"),
            ("serial:/dev/ttyUSB0@fast", "`fast` is not a bitrate", "serial:/dev/ttyUSB0"),
            ("slcan:/dev/ttyACM0@0", "`0` is not a bitrate", "slcan:/dev/ttyACM0"),
            ("sim:", "the text after the colon is missing", "sim"),
            ("tty:/dev/ttyUSB0@3M", "`3M` is not a bitrate", "tty:/dev/ttyUSB0"),
            ("pty:", "the text after the colon is missing", "pty:/tmp/servos"),
        ] {
            let error = name.parse::<BusName>().unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
            assert!(error.ends_with(&format!("such as {example}")), "{error}");
            assert!(error.contains(&format!("`{name}` is not a bus")), "{error}");
        }
    }
}
