//! `rollwalk-sim`: simulates a robot on a bus of this computer, in real time.

mod boots;
mod ground;
mod lag;
mod memory;

use crate::buses::BusLoads;
use crate::live::{self, LiveArgs};
use crate::signing;
use crate::terrain::{GroundArgs, Support};
use crate::world_log::{SharedLog, WorldLog, WorldLogArgs};
use clap::{CommandFactory, FromArgMatches, Parser, ValueEnum};
use lag::LagWatch;
use memory::Memory;
use miette::{IntoDiagnostic, miette};
use rollwalk_bus::link::LinkError;
use rollwalk_bus::name::BusName;
use rollwalk_bus::open::{self, OpenError};
use rollwalk_bus::port::Port;
use rollwalk_bus::priority;
use rollwalk_bus::sim;
use rollwalk_firmware::Settings;
use rollwalk_host::actuators::Actuators;
use rollwalk_host::describe::condition;
use rollwalk_multibody::ground::Ground;
use rollwalk_protocol::faults::FaultBits;
use rollwalk_protocol::wire::authentication::LinkKey;
use rollwalk_protocol::wire::{State, Status};
use rollwalk_robot::Robot;
use rollwalk_sim_host::body::Body;
use rollwalk_sim_host::core::LocalController;
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::live::{Reopen, controller, motors, whole};
use rollwalk_sim_host::rig::Rig;
use rollwalk_sim_host::store::VerifyingKey;
use rollwalk_terminal::files::{Lines, Output, RotationArgs};
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::link::cannot_open;
use rollwalk_terminal::validated_library::actuators;
use rollwalk_terminal::{Exit, end, interrupt, keys, output, with_common_help};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of our frames in flight on the link.
const LINK_DEPTH: usize = 3;
/// Maximum number of our frames in flight on an actuator bus, where the newest value should not wait behind others.
const ACTUATOR_DEPTH: usize = 2;

/// Simulated robot: the controller's firmware, and motors with inertia and limits.
///
/// The default is a whole robot whose link is on a bus of this computer, where the rollwalk tools find it like a real one.
/// With --actuators its motors are also on buses of this computer, one for each actuator bus of the robot file. With --only the
/// motors or the controller are left out, so that real ones can replace them. Motors use the protocol in the file's [[bus]].
///
/// The whole robot is on the ground: a hoist holds it until it plays, and lifts it again after 3 s without torque. The
/// simulator prints the displacement of each motion, and falls. With --on stand the robot hangs on a stand instead, its body
/// fixed and its wheels in the air. This is also the default for motors on buses of this computer (--actuators); with --on
/// ground they are on the ground, and the hoist releases the robot when all motors have torque and hold their targets still.
///
/// With --library FILE the simulated flash survives a restart: the simulator reads FILE at start, if it exists, and writes each
/// library that a host flashes to FILE. Before it overwrites a library for the first time, it copies that library to another
/// file (pup.2.rwl for pup.rwl).
///
/// The simulator runs until Ctrl-C.
#[derive(Parser)]
#[command(name = "rollwalk-sim", version, max_term_width = 100)]
#[command(after_long_help = "\
Examples:
  rollwalk-sim robots/agilebot.toml --bus sim
  rollwalk-sim robots/agilebot.toml --bus sim --library agilebot.rwl
  rollwalk-sim robots/agilebot.toml --bus sim --slope 3 --push 20:15,0,0:0.1
  rollwalk-sim robots/agilebot.toml --bus sim --terrain doorstep.toml
  rollwalk-sim robots/agilebot.toml --bus sim --on stand
  rollwalk-sim robots/agilebot.toml --bus sim --foxglove    # in 3D, at ws://localhost:8765
  rollwalk-sim robots/agilebot.toml --bus sim --link-key robot.key --library-key owner.pub.pem
  rollwalk-sim robots/agilebot.toml --bus can:vcan0 --log robot.log
  rollwalk-sim robots/agilebot.toml --bus can:vcan0 --actuators can:vcan1 --actuators can:vcan2
  rollwalk-sim robots/agilebot.toml --only controller --bus can:can0 \\
      --actuators can:can1 --actuators can:can2      # the firmware on this computer, real motors
  rollwalk-sim robots/pup.toml --only controller --bus sim --actuators tty:/dev/ttyUSB0    # servos at a U2D2
  rollwalk-sim robots/pup.toml --only motors --actuators pty:/tmp/servos    # simulated ones, at tty:/tmp/servos
  rollwalk-sim robots/pup.toml --only motors --actuators pty:/tmp/servos --on ground    # the same, carrying a robot

Then, in another terminal:
  rollwalk flash agilebot.rwl --bus sim
  rollwalk console --bus sim

A virtual CAN interface is made by
  sudo modprobe vcan; sudo ip link add vcan0 type vcan; sudo ip link set vcan0 up")]
struct Cli {
    /// Robot file (TOML).
    #[arg(value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// Bus of the link to the host.
    #[arg(long, value_name = "BUS", required_unless_present = "only")]
    bus: Option<BusName>,
    /// Actuator bus, in the order of bus numbers; once for each bus of the robot.
    #[arg(long, value_name = "BUS")]
    actuators: Vec<BusName>,
    /// Run only this part of the robot.
    #[arg(long, value_name = "PART", requires = "actuators")]
    only: Option<Part>,
    /// Support of the robot [default: ground; with --actuators: stand].
    #[arg(long, value_name = "SUPPORT", value_enum)]
    on: Option<Support>,
    #[command(flatten)]
    ground: GroundArgs,
    /// File that stores the controller's library.
    #[arg(long, value_name = "LIB.rwl")]
    library: Option<PathBuf>,
    /// Write every frame of every simulated bus to this file, in the format of candump.
    #[arg(long, value_name = "FILE", conflicts_with = "actuators")]
    log: Option<PathBuf>,
    #[command(flatten)]
    world_log: WorldLogArgs,
    #[command(flatten)]
    rotation: RotationArgs,
    #[command(flatten)]
    live: LiveArgs,
    /// File with a link key (`rollwalk keys new`): the controller accepts only hosts that have it. Its boots are counted in the
    /// user's state folder, so that a recorded session is not accepted again.
    #[arg(long, value_name = "FILE")]
    link_key: Option<PathBuf>,
    /// File with a public key (`rollwalk keys new-pair`): the controller plays only libraries that were signed with the private
    /// key of the pair.
    #[arg(long, value_name = "KEY.pub.pem")]
    library_key: Option<PathBuf>,
}

/// Keys that the controller requires.
struct Keys {
    /// Link key, and the number of earlier boots of controllers with this key.
    link: Option<(LinkKey, u32)>,
    library: Option<VerifyingKey>,
}

impl Keys {
    fn read(cli: &Cli) -> miette::Result<Self> {
        let link = cli.link_key.as_deref().map(keys::link_key).transpose()?;
        let library = cli.library_key.as_deref().map(signing::public_key).transpose()?;
        let Some(key) = link else { return Ok(Self { link: None, library }) };
        let before = match boots::count(&key)? {
            // Boots of this process begin with 1.
            Some(boot) => boot - 1,
            None if cli.only == Some(Part::Controller) => {
                return Err(miette!(
                    help = "set HOME or XDG_STATE_HOME to a persistent folder",
                    "there is no folder for the boot count, and without this count the controller \
                     would accept a recorded session after a restart"
                ));
            }
            None => {
                output::print_line(
                    "warning: there is no folder for the boot count, so the simulated robot \
                     accepts a recorded session after a restart",
                );
                0
            }
        };
        Ok(Self { link: Some((key, before)), library })
    }
}

/// Part of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// Firmware, on link and actuator buses.
    Controller,
    /// Motors, on actuator buses.
    Motors,
}

/// Command line; its long help ends with the exit codes.
pub fn command_line() -> clap::Command {
    with_common_help(Cli::command(), &|_| &[])
}

/// Parses the command line and runs the robot.
pub fn main() -> ExitCode {
    let cli = Cli::from_arg_matches(&command_line().get_matches());
    end(run(&cli.unwrap_or_else(|error| error.exit())))
}

fn run(cli: &Cli) -> miette::Result<Exit> {
    let (robot, parts) = Source::Disk.robot_and_parts(&cli.robot)?;
    let loads = BusLoads::new(&robot).into_diagnostic()?;
    loads.check(&cli.robot)?;
    // Drives on buses of this computer may be real ones.
    if !cli.actuators.is_empty() && cli.only != Some(Part::Motors) {
        output::print_warnings(&loads.warnings());
    }
    let buses = Body::new(&robot).addresses().iter().map(|&(bus, _)| usize::from(bus) + 1).max();
    let buses = buses.unwrap_or(0);
    if !cli.actuators.is_empty() && cli.actuators.len() != buses {
        return Err(miette!(
            help = "give --actuators once for each bus, in the order of the bus numbers",
            "{} has {buses} actuator buses, but --actuators is given for {}",
            robot.name,
            cli.actuators.len()
        ));
    }
    check_kinds(&robot, &cli.actuators)?;
    let support = match cli.on {
        Some(Support::Ground) if cli.only == Some(Part::Controller) => {
            return Err(miette!(
                help = "give --on ground to the program that simulates the motors",
                "--only controller simulates no motors that could stand on the ground"
            ));
        }
        Some(support) => support,
        None if cli.actuators.is_empty() => Support::Ground,
        None => Support::Stand,
    };
    let ground = cli.ground.under(support, &robot)?;
    if ground.is_none() && cli.world_log.path().is_some() {
        let help = match (cli.only, cli.actuators.is_empty()) {
            (Some(Part::Controller), _) => {
                "leave out --world-log: --only controller does not simulate a world"
            }
            (_, true) => "leave out one of --world-log and --on stand",
            (_, false) => "leave out --world-log, or add --on ground",
        };
        return Err(miette!(
            help = help,
            "--world-log is for a robot on the ground, but this robot is on a stand"
        ));
    }
    if cli.live.is_asked_for() && (ground.is_none() || !cli.actuators.is_empty()) {
        return Err(miette!(
            help = "leave out --foxglove; to show the joints of a robot on a bus, use `rollwalk \
                monitor --foxglove`",
            "--foxglove requires a complete simulated robot on the ground"
        ));
    }
    if let Some(world_log) = cli.world_log.path() {
        if let Some(log) = &cli.log {
            Output::at(world_log)?.apart_from(&Output::at(log)?)?;
        }
        if cli.library.as_deref() == Some(world_log) {
            return Err(miette!(
                help = "give two different files",
                "--world-log and --library are both {}",
                world_log.display()
            ));
        }
    }
    let actuators = at_rates(&robot, &cli.actuators);
    let keys = Keys::read(cli)?;
    let open = |path| Memory::open(path, &cli.robot, keys.library.as_ref());
    let memory = cli.library.as_deref().map(open).transpose()?;
    let memory = memory.map(|memory| Arc::new(Mutex::new(memory)));
    interrupt::install_handler();
    match (cli.only, &cli.bus) {
        (Some(Part::Motors), _) if memory.is_some() => {
            return Err(miette!(
                "leave out --library: --only motors does not simulate a controller"
            ));
        }
        (Some(Part::Motors), _) => {
            let world_log = cli.world_log.begin(&robot, cli.rotation.rotate)?;
            run_motors(&robot, &actuators, motors_of(&robot, cli, ground.as_ref()), world_log)?;
        }
        (_, None) => {
            return Err(miette!(help = "add --bus BUS", "the controller requires a link"));
        }
        (Some(Part::Controller), Some(bus)) => {
            run_controller(&robot, keys, bus, &actuators, memory)?;
        }
        (None, Some(bus)) if actuators.is_empty() => {
            let view = cli.live.begin(&robot, &parts)?;
            run_whole(&robot, keys, bus, cli, ground.as_ref(), memory, view)?;
        }
        (None, Some(_)) if actuators.iter().any(BusName::carries_bytes) => {
            return Err(miette!(
                help = "run rollwalk-sim twice: with --only motors --actuators pty:/tmp/servos, \
                        then with --only controller --actuators tty:/tmp/servos",
                "controller and motors of one program cannot share a serial line, because each end \
                 of the line belongs to one program"
            ));
        }
        (None, Some(bus)) => {
            // Two members of every bus, as the real ones are.
            let ports = ports(&actuators)?;
            let names = actuators.clone();
            let mut body = motors_of(&robot, cli, ground.as_ref());
            let world_log = cli.world_log.begin(&robot, cli.rotation.rotate)?;
            let motors = std::thread::spawn(move || {
                let mut lost = LostBuses { link: None, actuators: &names, says: false };
                let ended = simulate_motors(&mut body, ports, &mut lost, world_log);
                // A controller without motors has nothing to do.
                interrupt::request();
                ended
            });
            run_controller(&robot, keys, bus, &actuators, memory)?;
            interrupt::request();
            motors.join().map_err(|_| miette!("the motors have ended unexpectedly"))??;
        }
    }
    Ok(Exit::Ok)
}

/// Memory that the controller writes while the main loop watches it.
type SharedMemory = Arc<Mutex<Memory>>;

fn lock(memory: &SharedMemory) -> MutexGuard<'_, Memory> {
    memory.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Firmware with the library of its memory, and with the keys that it requires.
fn core(
    robot: &Robot,
    keys: Keys,
    memory: Option<&SharedMemory>,
) -> miette::Result<LocalController> {
    let config = robot.controller_config().into_diagnostic()?;
    let (buses, settings) = (robot.controller_buses(), Settings::default());
    let library = memory.and_then(|memory| lock(memory).library().map(<[u8]>::to_vec));
    let mut core = match &library {
        Some(library) => LocalController::with_library(config, buses, settings, library),
        None => LocalController::new(config, buses, settings),
    };
    if let Some(key) = keys.library {
        core = core.with_library_key(key);
    }
    if let Some((key, boots_before)) = keys.link {
        core.require_key(key, boots_before);
    }
    if let Some(memory) = memory.cloned() {
        core.keep_libraries(Box::new(move |library| lock(&memory).keep_first(library)));
    }
    Ok(core)
}

fn run_whole(
    robot: &Robot,
    keys: Keys,
    bus: &BusName,
    cli: &Cli,
    ground: Option<&Arc<dyn Ground>>,
    memory: Option<SharedMemory>,
    mut view: Option<live::View<'_>>,
) -> miette::Result<()> {
    let log = cli.log.as_deref().map(Output::at).transpose()?;
    let log = log.map(|output| Lines::create(&output, cli.rotation.rotate));
    let mut log = log.transpose()?;
    let core = core(robot, keys, memory.as_ref())?;
    let mut rig = Rig::with_core(robot, core).into_diagnostic()?;
    if let Some(ground) = ground {
        rig = rig.onto_ground(robot, ground, cli.ground.shoves());
    }
    let world_log = cli.world_log.begin(robot, cli.rotation.rotate)?;
    let world_log = world_log.map(|log| SharedLog::attach(log, &mut rig));
    let port = port(bus)?;
    ready(robot, bus);
    let (mut printer, mut world) = (StatusPrinter::new(robot), ground::Printer::default());
    let mut lag = LagWatch::new(Instant::now(), rig.now().as_s());
    let mut failed = None;
    let outcome = whole::run(
        &mut rig,
        port,
        &mut LostBuses { link: Some(bus), actuators: &[], says: true },
        |rig, entries| {
            // Not from the frames on the link: anyone may send a status there.
            let controller = rig.core().controller();
            printer.print(rig.now().as_s(), controller.state(), controller.faults());
            world.print(rig);
            if let (Some(view), Some(ground)) = (&mut view, rig.body().ground()) {
                view.show_world(ground.world());
            }
            if let Some(share) = lag.measure(Instant::now(), rig.now().as_s()) {
                output::print_line(format_args!(
                    "this computer is too slow for the simulated robot: simulated time runs at \
                     {:.0} % of real time",
                    100.0 * share
                ));
            }
            if let Some(Err(error)) = world_log.as_ref().map(|log| log.on_time(rig)) {
                failed = Some(error);
            }
            if let Some(log) = &mut log
                && let Err(error) = entries.iter().try_for_each(|entry| log.push(entry))
            {
                failed = Some(error);
            }
            if let Some(memory) = &memory
                && let Err(error) = lock(memory).watch(rig.core().library_file())
            {
                failed = Some(error);
            }
            failed.is_none() && !interrupt::requested()
        },
    );
    outcome.map_err(|error| miette!("{error}"))?;
    failed.map_or(Ok(()), Err)?;
    memory.map_or(Ok(()), |memory| lock(&memory).keep(rig.core().library_file()))?;
    world_log.map_or(Ok(()), |log| log.end())?;
    log.map_or(Ok(()), |mut log| log.flush())
}

fn run_controller(
    robot: &Robot,
    keys: Keys,
    bus: &BusName,
    actuators: &[BusName],
    memory: Option<SharedMemory>,
) -> miette::Result<()> {
    // Motors that wait for their setpoints do so for a busy computer, too.
    priority::raise();
    let mut core = core(robot, keys, memory.as_ref())?;
    let period = Duration::from_secs(1) / u32::from(Settings::default().control_hz);
    let (port, ports) = (port(bus)?, ports(actuators)?);
    output::print_line(format_args!(
        "{} is on {bus}; Ctrl-C switches torque off and ends the program",
        robot.name
    ));
    let (mut printer, start) = (StatusPrinter::new(robot), Instant::now());
    let mut lost = LostBuses { link: Some(bus), actuators, says: true };
    let mut failed = None;
    let outcome = controller::run(&mut core, period, port, &mut lost, ports, |core| {
        let controller = core.controller_mut();
        let at_s = start.elapsed().as_secs_f64();
        printer.print(at_s, controller.state(), controller.faults());
        if let Some(memory) = &memory
            && let Err(error) = lock(memory).watch(core.library_file())
        {
            failed = Some(error);
        }
        failed.is_none() && !interrupt::requested()
    });
    outcome.map_err(|error| miette!("{error}"))?;
    failed.map_or(Ok(()), Err)?;
    memory.map_or(Ok(()), |memory| lock(&memory).keep(core.library_file()))
}

/// Motors for a controller on their buses.
fn motors_of(robot: &Robot, cli: &Cli, ground: Option<&Arc<dyn Ground>>) -> Body {
    match ground {
        Some(ground) => Body::motors_on_ground(robot, ground, cli.ground.shoves()),
        None => Body::new(robot),
    }
}

fn run_motors(
    robot: &Robot,
    actuators: &[BusName],
    mut body: Body,
    world_log: Option<WorldLog>,
) -> miette::Result<()> {
    let ports = ports(actuators)?;
    let names: Vec<_> = actuators.iter().map(ToString::to_string).collect();
    output::print_line(format_args!(
        "the motors of {} are on {}; Ctrl-C ends the program",
        robot.name,
        names.join(", ")
    ));
    let mut lost = LostBuses { link: None, actuators, says: true };
    simulate_motors(&mut body, ports, &mut lost, world_log)
}

/// Runs motors until Ctrl-C.
fn simulate_motors(
    body: &mut Body,
    ports: Vec<Port>,
    lost: &mut LostBuses<'_>,
    world_log: Option<WorldLog>,
) -> miette::Result<()> {
    let mut printer = ground::Printer::default();
    let mut goes_on = |body: &Body| {
        if let Some(ground) = body.ground() {
            printer.print_ground(ground);
        }
        !interrupt::requested()
    };
    let Some(log) = world_log else {
        return motors::run(body, ports, lost, &mut (), goes_on).into_diagnostic();
    };
    let log = SharedLog::new(log);
    let mut observer = log.clone();
    motors::run(body, ports, lost, &mut observer, |body| log.is_sound() && goes_on(body))
        .into_diagnostic()?;
    log.end()
}

fn ready(robot: &Robot, bus: &BusName) {
    output::print_line(format_args!("{} is on {bus}; Ctrl-C ends the program", robot.name));
}

/// Opens the robot's end of the link.
fn port(bus: &BusName) -> miette::Result<Port> {
    open_link(bus).map_err(cannot_open)
}

fn open_link(bus: &BusName) -> Result<Port, OpenError> {
    match bus {
        BusName::Sim { socket } => sim::serve(socket.as_deref()),
        _ => open::open(bus, LINK_DEPTH),
    }
}

/// Buses that are reopened when they are lost.
struct LostBuses<'a> {
    link: Option<&'a BusName>,
    actuators: &'a [BusName],
    /// True if lost buses are reported. If controller and motors share a process, only one of them reports.
    says: bool,
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

/// Refuses a CAN bus where the robot has a serial line of servos, and the reverse.
fn check_kinds(robot: &Robot, names: &[BusName]) -> miette::Result<()> {
    for (number, name) in (0..).zip(names) {
        let bus = robot.buses.get(&number).copied().unwrap_or_default();
        let speaks = bus.protocol.name();
        if bus.protocol.is_serial() != name.carries_bytes() {
            let (is, right) = match bus.protocol.is_serial() {
                true => {
                    ("a serial line", "tty:/dev/ttyUSB0, or pty:/tmp/servos for simulated motors")
                }
                false => ("a CAN bus", "can:can0"),
            };
            return Err(miette!(
                help = format!("give a bus such as {right}"),
                "bus {number} of {} is {is} ({speaks}), but {name} is not",
                robot.name
            ));
        }
    }
    Ok(())
}

/// Actuator buses with the bit rate of the robot file, unless their name contains one. A CAN interface with another rate is
/// refused; a serial line is opened at this rate.
fn at_rates(robot: &Robot, names: &[BusName]) -> Vec<BusName> {
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

fn ports(names: &[BusName]) -> miette::Result<Vec<Port>> {
    let open = |name| {
        let port = open::actuators(name, ACTUATOR_DEPTH).map_err(cannot_open)?;
        if let Some(complaint) = port.outlet.fault_and_remedy() {
            output::print_line(format_args!("{name}: {complaint}"));
        }
        Ok(port)
    };
    names.iter().map(open).collect()
}

/// Prints changes of the controller's state and faults to stderr.
struct StatusPrinter {
    last: Option<(State, FaultBits)>,
    actuators: Actuators,
}

impl StatusPrinter {
    fn new(robot: &Robot) -> Self {
        Self { last: None, actuators: actuators(robot) }
    }

    /// Prints a status if it has changed. `at_s` is the robot's time; on the ground it is the time of the world, which may lag
    /// behind.
    fn print(&mut self, at_s: f64, state: State, faults: FaultBits) {
        if self.last.replace((state, faults)) == Some((state, faults)) {
            return;
        }
        let severity = state.severity(faults);
        let status =
            Status { state, severity, faults, clip: None, frame: 0, counter: 0, library: 0 };
        output::print_line(format_args!("{at_s:9.3} s  {}", condition(&status, &self.actuators)));
    }
}
