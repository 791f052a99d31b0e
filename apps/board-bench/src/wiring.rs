//! Wiring of a robot's buses to a board. Robots for which the board has too few ports are refused.

use rollwalk_firmware::Settings;
use rollwalk_firmware::hal::ports::{Transport, assigned};
use rollwalk_firmware::load::examine;
use rollwalk_protocol::actuators::bus::{Bus, Protocol};
use rollwalk_robot::Robot;
use std::fmt::Write;
use std::ops::RangeInclusive;

/// Pins of a board for a bus.
#[derive(Debug)]
pub struct Port {
    /// Name of the peripheral.
    name: &'static str,
    /// Pins, and components between the pins and the bus.
    pins: &'static str,
}

/// Connections that a board offers to a robot.
#[derive(Debug)]
pub struct Board {
    /// Name on the command line.
    name: &'static str,
    /// Ports for actuator buses on CAN, in the order in which they are assigned.
    can: &'static [Port],
    /// Ports for actuator buses on serial lines, in the order in which they are assigned.
    serial: &'static [Port],
    /// Bit rates of the serial lines, bit/s.
    serial_rates: RangeInclusive<u32>,
    /// True if the CAN ports support 29-bit identifiers.
    long_identifiers: bool,
    /// True if the image contains simulated servos, which use the Rollwalk profile.
    own_servos: bool,
    /// Other pins: name and location of each.
    others: &'static [[&'static str; 2]],
}

/// Ports of the emulator, which connects all buses to its UART.
const UART: [Port; 4] = {
    const PORT: Port = Port { name: "UART 0", pins: "emulated" };
    [PORT; 4]
};

/// Boards for which images exist.
static BOARDS: [Board; 4] = [
    Board {
        name: "mps2-an386",
        can: &UART,
        serial: &[],
        serial_rates: 0..=0,
        long_identifiers: false,
        own_servos: false,
        others: &[],
    },
    Board {
        name: "mps2-an386-slcan",
        can: &UART,
        serial: &[],
        serial_rates: 0..=0,
        long_identifiers: false,
        own_servos: true,
        others: &[["link", "UART 0, as an SLCAN adapter"]],
    },
    Board {
        name: "nucleo-g474re",
        can: &[
            Port {
                name: "FDCAN2",
                pins: "RX PB12 (CN10 16), TX PB13 (CN10 30), to a CAN transceiver",
            },
            Port {
                name: "FDCAN3",
                pins: "RX PA8 (CN10 23), TX PA15 (CN7 17), to a CAN transceiver",
            },
        ],
        serial: &[Port { name: "USART3", pins: "data PB10 (CN10 25, Arduino D6), with a pull-up" }],
        serial_rates: 2_600..=10_600_000,
        long_identifiers: true,
        own_servos: false,
        others: &[
            ["link, CAN", "FDCAN1: RX PA11 (CN10 14), TX PA12 (CN10 12), to a CAN transceiver"],
            ["link, serial", "the debugger's serial port, 1 Mbaud"],
            ["emergency stop", "PA10 (CN10 33, Arduino D2), normally closed contact to ground"],
        ],
    },
    Board {
        name: "pico2",
        can: &[],
        serial: &[
            Port { name: "PIO 0", pins: "data GP2 (pin 4) with a pull-up, direction GP3 (pin 5)" },
            Port { name: "PIO 1", pins: "data GP4 (pin 6) with a pull-up, direction GP5 (pin 7)" },
        ],
        serial_rates: 300..=4_500_000,
        long_identifiers: false,
        own_servos: false,
        others: &[
            ["link", "USB; or UART0, 1 Mbaud: TX GP0 (pin 1), RX GP1 (pin 2)"],
            ["emergency stop", "GP22 (pin 29), normally closed contact to ground (pin 28)"],
        ],
    },
];

/// Finds a board by its name on the command line.
///
/// # Errors
/// Returns an error with the names of all boards if the name is unknown.
pub fn board(name: &str) -> Result<&'static Board, String> {
    let found = BOARDS.iter().find(|board| board.name == name);
    found.ok_or_else(|| {
        format!("give one of the boards {}", BOARDS.each_ref().map(|board| board.name).join(", "))
    })
}

impl Board {
    fn ports(&self, transport: Transport) -> &'static [Port] {
        match transport {
            Transport::Can => self.can,
            Transport::Serial => self.serial,
        }
    }
}

/// Describes the connections of the robot from the file `name` to a board, with a line for each bus and its motors.
///
/// # Errors
/// Returns an error for the first bus that has no port on the board, or that no controller can drive.
pub fn describe(name: &str, robot: &Robot, board: &Board) -> Result<String, String> {
    let config = robot.controller_config().map_err(|error| format!("{name}: {error}"))?;
    let buses = robot.controller_buses();
    let mut text = String::new();
    for transport in [Transport::Can, Transport::Serial] {
        let ports = board.ports(transport);
        for (place, (number, bus)) in assigned(&config, &buses, transport).into_iter().enumerate() {
            let of_bus = format!("{name}: bus {number} ({}): ", bus.protocol.name());
            let fits = check(board, &bus)
                .and_then(|()| ports.get(place).ok_or_else(|| no_port(board, transport)));
            let port = fits.map_err(|why| of_bus + &why)?;
            let line = writeln!(
                text,
                "bus {number}  {}, {} kbit/s  {}: {}",
                bus.protocol.name(),
                f64::from(bus.bit_rate) * 1e-3,
                port.name,
                port.pins
            );
            line.expect("a string takes everything");
            let motors = robot.channels().filter(|channel| channel.actuator().bus == number);
            for channel in motors {
                let line = writeln!(text, "  id {:>3}  {}", channel.actuator().id, channel.name());
                line.expect("a string takes everything");
            }
        }
    }
    for [what, place] in board.others {
        writeln!(text, "{what}  {place}").expect("a string takes everything");
    }
    if let Some(row) =
        examine(&config, &buses, Settings::default().control_hz).find(|row| row.problem.is_some())
    {
        return Err(format!(
            "{name}: bus {}: no controller can drive its actuators; `rollwalk robot check` reports \
             the reason",
            row.bus
        ));
    }
    Ok(text)
}

/// Returns the error for a missing port, with the ports of the board.
fn no_port(board: &Board, transport: Transport) -> String {
    let kind = match transport {
        Transport::Can => "on CAN",
        Transport::Serial => "on serial lines",
    };
    let names: Vec<_> = board.ports(transport).iter().map(|port| port.name).collect();
    let offered = if names.is_empty() { "none".into() } else { names.join(", ") };
    format!(
        "{} has no port left for this bus; its ports for actuators {kind} are: {offered}",
        board.name
    )
}

/// Checks that a port of the board supports a bus.
fn check(board: &Board, bus: &Bus) -> Result<(), String> {
    let name = board.name;
    let rates = &board.serial_rates;
    if bus.protocol.is_serial() && !board.serial.is_empty() && !rates.contains(&bus.bit_rate) {
        let (rate, least, most) = (bus.bit_rate, rates.start(), rates.end());
        return Err(format!(
            "the bit rate is {rate} bit/s, outside the {least} to {most} bit/s of \
            {name}"
        ));
    }
    if !board.long_identifiers && matches!(bus.protocol, Protocol::CyberGear(_)) {
        return Err(format!("{name} does not support 29-bit identifiers"));
    }
    if board.own_servos && *bus != Bus::default() {
        return Err(format!(
            "{name} supports only the simulated servos of the Rollwalk profile in its image"
        ));
    }
    Ok(())
}
