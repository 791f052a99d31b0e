//! `rollwalk-sim`: a robot without hardware on a bus of this computer, in real time.

use crate::cmd::buses::BusLoads;
use crate::files::Output;
use crate::inputs::Source;
use crate::link::cannot_open;
use crate::{Exit, end, exit, files, interrupt, output};
use clap::{CommandFactory, FromArgMatches, Parser, ValueEnum};
use miette::{IntoDiagnostic, miette};
use rollwalk_bus::link::LinkError;
use rollwalk_bus::name::BusName;
use rollwalk_bus::open::{self, OpenError};
use rollwalk_bus::port::Port;
use rollwalk_bus::sim;
use rollwalk_firmware::Settings;
use rollwalk_host::describe::{fault_names, state_name};
use rollwalk_protocol::faults::FaultBits;
use rollwalk_protocol::wire::{FromController, State};
use rollwalk_robot::Robot;
use rollwalk_sim_host::body::Body;
use rollwalk_sim_host::core::Local;
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::interface::LogEntry;
use rollwalk_sim_host::live::{Reopen, controller, motors, whole};
use rollwalk_sim_host::rig::{CannotSimulate, Rig};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Frames of ours that may be on their way on the link.
const LINK_DEPTH: usize = 3;
/// The same on an actuator bus, where the newest value should not wait behind others.
const ACTUATOR_DEPTH: usize = 2;

/// A robot without hardware: the controller's firmware, and motors with inertia and limits.
///
/// By itself it is a whole robot with only its link on a bus of this computer; the rollwalk tools find it
/// there as they find a real one. With --actuators its motors are on buses of this computer, too, one for
/// each actuator bus of the robot file; --only leaves out the motors or the controller, so that real ones
/// can take their place. Motors speak what the file's [[bus]] says. The robot hangs on a stand: there is
/// no ground under it.
///
/// Runs until Ctrl-C.
#[derive(Parser)]
#[command(name = "rollwalk-sim", version, max_term_width = 100)]
#[command(after_long_help = "\
Examples:
  rollwalk-sim robots/agilebot.toml --bus sim
  rollwalk-sim robots/agilebot.toml --bus can:vcan0 --log robot.log
  rollwalk-sim robots/agilebot.toml --bus can:vcan0 --actuators can:vcan1 --actuators can:vcan2
  rollwalk-sim robots/agilebot.toml --only controller --bus can:can0 \\
      --actuators can:can1 --actuators can:can2      # the firmware on this computer, real motors

Then, in another terminal:
  rollwalk flash agilebot.rwl --bus sim
  rollwalk console --bus sim

A virtual CAN interface is made by
  sudo modprobe vcan; sudo ip link add vcan0 type vcan; sudo ip link set vcan0 up")]
struct Cli {
    /// Robot file (TOML).
    #[arg(value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// The link, where the host is.
    #[arg(long, value_name = "BUS", required_unless_present = "only")]
    bus: Option<BusName>,
    /// An actuator bus, in the order of their numbers; once for each bus of the robot.
    #[arg(long, value_name = "BUS")]
    actuators: Vec<BusName>,
    /// Run this part of the robot only.
    #[arg(long, value_name = "PART", requires = "actuators")]
    only: Option<Part>,
    /// Write every frame of every simulated bus, as candump does.
    #[arg(long, value_name = "FILE", conflicts_with = "actuators")]
    log: Option<PathBuf>,
}

/// A part of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// The firmware, on link and actuator buses.
    Controller,
    /// The motors, on actuator buses.
    Motors,
}

/// The command line; its long help ends with the exit codes.
pub(crate) fn command_line() -> clap::Command {
    let long_help = Cli::command().get_after_long_help().map(ToString::to_string);
    Cli::command().after_long_help(format!("{}\n\n{}", long_help.unwrap_or_default(), exit::HELP))
}

/// Parses the command line and runs the robot.
pub fn main() -> ExitCode {
    let cli = Cli::from_arg_matches(&command_line().get_matches());
    end(run(&cli.unwrap_or_else(|error| error.exit())))
}

fn run(cli: &Cli) -> miette::Result<Exit> {
    let robot = Source::Disk.robot(&cli.robot)?;
    BusLoads::new(&robot).into_diagnostic()?.check(&cli.robot)?;
    CannotSimulate::check(&robot).into_diagnostic()?;
    let buses = Body::new(&robot).addresses().iter().map(|&(bus, _)| usize::from(bus) + 1).max();
    let buses = buses.unwrap_or(0);
    if !cli.actuators.is_empty() && cli.actuators.len() != buses {
        return Err(miette!(
            help = "give --actuators once for each, in the order of their numbers",
            "{} has {buses} actuator buses, and --actuators names {}",
            robot.name,
            cli.actuators.len()
        ));
    }
    let actuators = at_rates(&robot, &cli.actuators);
    interrupt::listen();
    match (cli.only, &cli.bus) {
        (Some(Part::Motors), _) => run_motors(&robot, &actuators)?,
        (_, None) => {
            return Err(miette!(help = "add --bus BUS", "the controller needs a link"));
        }
        (Some(Part::Controller), Some(bus)) => run_controller(&robot, bus, &actuators)?,
        (None, Some(bus)) if actuators.is_empty() => {
            run_whole(&robot, bus, cli.log.as_deref())?;
        }
        (None, Some(bus)) => {
            // Two members of every bus, as the real ones are.
            let ports = ports(&actuators)?;
            let (robot_of_motors, names) = (robot.clone(), actuators.clone());
            std::thread::spawn(move || {
                let mut body = Body::new(&robot_of_motors);
                let mut lost = Lost { link: None, actuators: &names, says: false };
                motors::run(&mut body, ports, &mut lost, || !interrupt::requested());
            });
            run_controller(&robot, bus, &actuators)?;
        }
    }
    Ok(Exit::Ok)
}

fn run_whole(robot: &Robot, bus: &BusName, log: Option<&Path>) -> miette::Result<()> {
    let mut log = log.map(Log::create).transpose()?;
    let mut rig = Rig::new(robot).map_err(|error| miette!("{error}"))?;
    let port = port(bus)?;
    ready(robot, bus);
    let mut printer = StatusPrinter::new();
    let mut failed = None;
    let outcome = whole::run(
        &mut rig,
        port,
        &mut Lost { link: Some(bus), actuators: &[], says: true },
        |_, entries| {
            for status in entries.iter().filter_map(status) {
                printer.print(status.0, status.1);
            }
            if let Some(log) = &mut log
                && let Err(error) = log.write(entries)
            {
                failed = Some(error);
            }
            failed.is_none() && !interrupt::requested()
        },
    );
    outcome.map_err(|error| miette!("{error}"))?;
    match (failed, log) {
        (Some(error), _) => Err(error),
        (None, Some(log)) => log.finish(),
        (None, None) => Ok(()),
    }
}

fn run_controller(robot: &Robot, bus: &BusName, actuators: &[BusName]) -> miette::Result<()> {
    let settings = Settings::default();
    let config = robot.controller_config().map_err(|error| miette!("{error}"))?;
    let mut core = Local::new(config, robot.controller_buses(), settings);
    let period = Duration::from_secs(1) / u32::from(settings.control_hz);
    let (port, ports) = (port(bus)?, ports(actuators)?);
    ready(robot, bus);
    let mut printer = StatusPrinter::new();
    let mut lost = Lost { link: Some(bus), actuators, says: true };
    let outcome = controller::run(&mut core, period, port, &mut lost, ports, |core| {
        let controller = core.controller_mut();
        printer.print(controller.state(), controller.faults());
        !interrupt::requested()
    });
    outcome.map_err(|error| miette!("{error}"))
}

fn run_motors(robot: &Robot, actuators: &[BusName]) -> miette::Result<()> {
    let ports = ports(actuators)?;
    let names: Vec<_> = actuators.iter().map(ToString::to_string).collect();
    output::say(format_args!(
        "the motors of {} are on {}; Ctrl-C ends them",
        robot.name,
        names.join(", ")
    ));
    let mut lost = Lost { link: None, actuators, says: true };
    motors::run(&mut Body::new(robot), ports, &mut lost, || !interrupt::requested());
    Ok(())
}

fn ready(robot: &Robot, bus: &BusName) {
    output::say(format_args!("{} is on {bus}; Ctrl-C switches it off", robot.name));
}

/// The robot's end of the link.
fn port(bus: &BusName) -> miette::Result<Port> {
    open_link(bus).map_err(cannot_open)
}

fn open_link(bus: &BusName) -> Result<Port, OpenError> {
    match bus {
        BusName::Sim { socket } => sim::serve(socket.as_deref()),
        _ => open::open(bus, LINK_DEPTH),
    }
}

/// Buses, when they go.
struct Lost<'a> {
    link: Option<&'a BusName>,
    actuators: &'a [BusName],
    /// Whether it reports lost buses; of controller and motors in one process only one does.
    says: bool,
}

impl Lost<'_> {
    fn name(&self, bus: Interface) -> Option<&BusName> {
        match bus {
            Interface::Link => self.link,
            Interface::Actuator(number) => self.actuators.get(usize::from(number)),
        }
    }

    fn say(&self, bus: Interface, what: &str) {
        if let (true, Some(name)) = (self.says, self.name(bus)) {
            output::say(format_args!("{name} {what}"));
        }
    }
}

impl Reopen for Lost<'_> {
    fn lost(&mut self, bus: Interface, why: &LinkError) {
        self.say(bus, &format!("is lost: {why}"));
    }

    fn reopen(&mut self, bus: Interface) -> Option<Port> {
        let name = self.name(bus)?;
        let port = match bus {
            Interface::Link => open_link(name),
            Interface::Actuator(_) => open::open(name, ACTUATOR_DEPTH),
        };
        let port = port.ok()?;
        self.say(bus, "is back");
        Some(port)
    }
}

/// The actuator buses. A CAN interface that is set up for another bit rate than the robot file has is no bus
/// of this robot, unless its name says so.
fn at_rates(robot: &Robot, names: &[BusName]) -> Vec<BusName> {
    let mut names = names.to_vec();
    for (number, name) in (0..).zip(&mut names) {
        if let BusName::Can { bitrate: bitrate @ None, .. } = name {
            *bitrate = robot.buses.get(&number).map(|bus| bus.bit_rate);
        }
    }
    names
}

fn ports(names: &[BusName]) -> miette::Result<Vec<Port>> {
    let open = |name| open::open(name, ACTUATOR_DEPTH).map_err(cannot_open);
    names.iter().map(open).collect()
}

/// Prints the controller's state and faults to stderr when they have changed.
struct StatusPrinter {
    start: Instant,
    last: Option<(State, FaultBits)>,
}

impl StatusPrinter {
    fn new() -> Self {
        Self { start: Instant::now(), last: None }
    }

    fn print(&mut self, state: State, faults: FaultBits) {
        if self.last.replace((state, faults)) == Some((state, faults)) {
            return;
        }
        let at = self.start.elapsed().as_secs_f64();
        let faults =
            if faults.is_empty() { String::new() } else { format!(" ({})", fault_names(faults)) };
        output::say(format_args!("{at:9.3} s  {}{faults}", state_name(state)));
    }
}

/// State and faults, when the frame is a status.
fn status(entry: &LogEntry) -> Option<(State, FaultBits)> {
    let frame = &entry.frame;
    match FromController::decode(frame) {
        Ok((_, FromController::Status(status))) => Some((status.state, status.faults)),
        _ => None,
    }
}

/// A log of frames that grows while the robot runs.
struct Log {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Log {
    fn create(path: &Path) -> miette::Result<Self> {
        Ok(Self { path: path.to_owned(), file: Output::at(path)?.create()? })
    }

    fn write(&mut self, entries: &[LogEntry]) -> miette::Result<()> {
        let write = |entry: &LogEntry| writeln!(self.file, "{entry}");
        let written = entries.iter().try_for_each(write);
        written.map_err(|error| files::cannot_write(&self.path, error))
    }

    /// Writes what waits still.
    fn finish(mut self) -> miette::Result<()> {
        self.file.flush().map_err(|error| files::cannot_write(&self.path, error))
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use rollwalk_protocol::can::Frame;

    #[test]
    fn a_log_whose_end_the_disk_does_not_take_says_so() {
        let mut log = Log::create(Path::new("/dev/full")).unwrap();
        let frame = Frame::standard(0x310, &[1]).unwrap();
        // It waits for more.
        log.write(&[LogEntry { at_us: 0, interface: Interface::Link, frame }]).unwrap();
        let error = log.finish().unwrap_err().to_string();
        assert!(error.starts_with("cannot write /dev/full: No space left"), "{error}");
    }
}
