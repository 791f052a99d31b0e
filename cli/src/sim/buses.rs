//! Buses of a simulated robot: their kinds and rates, and lost buses that are reopened.

use miette::miette;
use rollwalk_bus::link::LinkError;
use rollwalk_bus::name::BusName;
use rollwalk_bus::open::{self, OpenError};
use rollwalk_bus::port::Port;
use rollwalk_bus::sim;
use rollwalk_robot::Robot;
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::live::Reopen;
use rollwalk_terminal::link::cannot_open;
use rollwalk_terminal::output;

/// Maximum number of our frames in flight on the link.
const LINK_DEPTH: usize = 3;
/// Maximum number of our frames in flight on an actuator bus, where the newest value should not wait behind others.
const ACTUATOR_DEPTH: usize = 2;

/// Refuses a CAN bus where the robot has a serial line of servos, and the reverse.
pub fn check_kinds(robot: &Robot, names: &[BusName]) -> miette::Result<()> {
    for (number, name) in (0..).zip(names) {
        let bus = robot.buses.get(&number).copied().unwrap_or_default();
        let speaks = bus.protocol.name();
        if bus.protocol.is_serial() != name.carries_bytes() {
            let (is, right) = match (bus.protocol.is_serial(), name) {
                (true, BusName::Serial { device, .. } | BusName::Slcan { device, .. }) => {
                    ("a serial line", format!("tty:{}", device.display()))
                }
                (true, _) => (
                    "a serial line",
                    "tty:/dev/ttyUSB0, or pty:/tmp/servos for simulated motors".to_owned(),
                ),
                (false, BusName::Tty { device, .. }) => {
                    ("a CAN bus", format!("can:can0, or slcan:{}", device.display()))
                }
                (false, _) => ("a CAN bus", "can:can0".to_owned()),
            };
            return Err(miette!(
                help = format!("give {is} with --actuators, such as {right}"),
                "bus {number} of {} is {is} ({speaks}), but {name} carries {}",
                robot.name,
                if name.carries_bytes() { "bytes of servos" } else { "CAN frames" }
            ));
        }
    }
    Ok(())
}

/// Actuator buses with the bit rate of the robot file, unless their name contains one. A CAN interface with another rate is
/// refused; a serial line is opened at this rate.
pub fn at_rates(robot: &Robot, names: &[BusName]) -> Vec<BusName> {
    let mut names = names.to_vec();
    for (number, name) in (0..).zip(&mut names) {
        if let BusName::Can { bitrate: rate @ None, .. } | BusName::Tty { baud: rate @ None, .. } =
            name
        {
            *rate = robot.buses.get(&number).map(|bus| bus.bit_rate);
        }
    }
    names
}

/// Opens the robot's end of the link.
pub fn port(bus: &BusName) -> miette::Result<Port> {
    open_link(bus).map_err(cannot_open)
}

fn open_link(bus: &BusName) -> Result<Port, OpenError> {
    match bus {
        BusName::Sim { socket } => sim::serve(socket.as_deref()),
        _ => open::open(bus, LINK_DEPTH),
    }
}

/// Buses that are reopened when they are lost.
pub struct LostBuses<'a> {
    pub link: Option<&'a BusName>,
    pub actuators: &'a [BusName],
    /// True if lost buses are reported. If controller and motors share a process, only one of them reports.
    pub says: bool,
}

impl LostBuses<'_> {
    fn name(&self, bus: Interface) -> Option<&BusName> {
        match bus {
            Interface::Link => self.link,
            Interface::Actuator(number) => self.actuators.get(usize::from(number)),
        }
    }

    fn print_event(&self, bus: Interface, what: &str) {
        if let (true, Some(name)) = (self.says, self.name(bus)) {
            output::print_line(format_args!("{name} {what}"));
        }
    }
}

impl Reopen for LostBuses<'_> {
    fn lost(&mut self, bus: Interface, why: &LinkError) {
        self.print_event(bus, &format!("is lost: {why}"));
    }

    fn reopen(&mut self, bus: Interface) -> Option<Port> {
        let name = self.name(bus)?;
        let port = match bus {
            Interface::Link => open_link(name),
            Interface::Actuator(_) => open::actuators(name, ACTUATOR_DEPTH),
        };
        let port = port.ok()?;
        self.print_event(bus, "is back");
        Some(port)
    }
}

pub fn ports(names: &[BusName]) -> miette::Result<Vec<Port>> {
    let open = |name| {
        let port = open::actuators(name, ACTUATOR_DEPTH).map_err(cannot_open)?;
        if let Some(complaint) = port.outlet.fault_and_remedy() {
            output::print_line(format_args!("{name}: {complaint}"));
        }
        Ok(port)
    };
    names.iter().map(open).collect()
}
