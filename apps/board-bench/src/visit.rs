//! Visit to a flashed NUCLEO-G474RE at its serial port: prints its report and transfers a library. Torque stays off.

use rollwalk_bus::{port::LiveLink, serial};
use rollwalk_host::session::Session;
use rollwalk_protocol::serial::{BoardReport, BusState, Reset};
use rollwalk_protocol::wire::Node;
use rollwalk_robot::Robot;
use std::path::Path;
use std::time::Duration;

/// Baud rate of the firmware's serial port.
const BAUD: u32 = 1_000_000;
/// The firmware's address on the link (`Settings::default`).
const NODE: u8 = 1;
/// Longest wait for the report.
const TIMEOUT: Duration = Duration::from_secs(1);
/// Lowest brown-out reset level that suits a supply of 3.3 V.
const BROWN_OUT_LEVEL: u8 = 4;

/// Checks the report of the board at `port` and transfers a library.
///
/// # Errors
/// Returns an error if a value of the report is not acceptable, or if the line or the transfer fails.
pub fn run(robot: &Robot, port: &Path, library: &[u8]) -> Result<(), String> {
    let name = port.display();
    let mut link = LiveLink::new(serial::open(port, BAUD).map_err(|error| error.to_string())?);
    let report = link.report(TIMEOUT).map_err(|error| format!("{name}: {error}"))?;
    let report = report.ok_or_else(|| {
        format!(
            "{name}: no report within {TIMEOUT:?}; check that the image is on the board and that \
             this is the board's port"
        )
    })?;
    print(&report);

    let config = robot.controller_config().map_err(|error| error.to_string())?;
    if report.config_hash != config.hash() {
        return Err(format!(
            "the image is for robot {:08x}; expected robot {:08x}: flash the image again",
            report.config_hash,
            config.hash()
        ));
    }
    if report.brown_out_level < BROWN_OUT_LEVEL {
        return Err(format!(
            "the brown-out reset level is {}; set level {BROWN_OUT_LEVEL} as \
             firmware/boards/nucleo-g474re/README.md describes under first run",
            report.brown_out_level
        ));
    }

    let node = Node::new(NODE).ok_or("the firmware's node number is invalid")?;
    let mut session = Session::connect(link, node).map_err(|error| error.to_string())?;
    println!("connected; {:?}", session.status().map(|status| status.state));
    session.flash(library, |_| {}).map_err(|error| error.to_string())?;
    println!("library of {} bytes: transferred, checked and activated", library.len());
    Ok(())
}

fn print(report: &BoardReport) {
    let reset = match report.reset {
        Reset::Other => "something else",
        Reset::PowerOn => "power",
        Reset::Pin => "the button",
        Reset::Watchdog => "the watchdog",
        Reset::Software => "software",
    };
    println!("robot          {:08x}", report.config_hash);
    println!("reset by       {reset}, {:.1} s ago", f64::from(report.uptime_ms) * 1e-3);
    println!("brown-out      level {}", report.brown_out_level);
    println!("missed periods {:>7}", report.missed_periods);
    println!("longest tick   {:>7} µs", report.longest_tick_us);
    println!("broken words   {:>7}", report.broken_words);
    for (name, bus) in ["link", "actuators 0", "actuators 1"].iter().zip(report.buses) {
        let state = match bus.state {
            BusState::Active => "active",
            BusState::NotAcknowledged => "not acknowledged",
            BusState::Passive => "error-passive",
            BusState::Off => "off",
        };
        let (transmit, receive) = (bus.transmit_errors, bus.receive_errors);
        println!("{name:<14} {state}, errors {transmit} and {receive}, {} lost", bus.lost);
    }
}
