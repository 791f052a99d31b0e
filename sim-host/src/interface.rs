//! Buses of a simulated robot and their names in its logs.

use rollwalk_bus::candump;
use std::fmt;
use std::str::FromStr;

/// Bus of the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Interface {
    /// `link0`: host and controller.
    Link,
    /// `act0`, `act1`, ...: controller and actuators.
    Actuator(u8),
}

/// Frame on a bus of the simulation.
pub type LogEntry = candump::LogEntry<Interface>;

/// Packet on a serial line of the simulation, which prints as a line of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PacketEntry {
    /// Time at which the packet ended, µs.
    pub at_us: u64,
    /// Serial line.
    pub interface: Interface,
    /// True if the controller sent the packet.
    pub from_controller: bool,
    /// Bytes of the packet.
    pub bytes: Vec<u8>,
}

impl fmt::Display for PacketEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (s, fraction) = (self.at_us / 1_000_000, self.at_us % 1_000_000);
        let arrow = if self.from_controller { '>' } else { '<' };
        write!(f, "({s:010}.{fraction:06}) {} {arrow}", self.interface)?;
        self.bytes.iter().try_for_each(|byte| write!(f, " {byte:02X}"))
    }
}

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Link => write!(f, "link0"),
            Self::Actuator(bus) => write!(f, "act{bus}"),
        }
    }
}

impl FromStr for Interface {
    type Err = &'static str;
    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let actuator = || name.strip_prefix("act")?.parse().ok().map(Self::Actuator);
        if name == "link0" { Some(Self::Link) } else { actuator() }
            .ok_or("an interface that is not link0, act0, act1, ...")
    }
}
