//! `rollwalk-sim`: simulates a robot on a bus of this computer, in real time.

mod boots;
mod buses;
mod gains;
mod ground;
mod keys;
mod lag;
mod memory;
mod status;

use crate::buses::BusLoads;
use crate::live::{self, LiveArgs};
use crate::terrain::{GroundArgs, Support};
use crate::words;
use crate::world_log::{SharedLog, WorldLog, WorldLogArgs};
use buses::{LostBuses, at_rates, check_kinds, port, ports};
use clap::{CommandFactory, Parser, ValueEnum};
use gains::Gains;
use keys::Keys;
use lag::LagWatch;
use memory::Memory;
use miette::{IntoDiagnostic, miette};
use rollwalk_bus::name::{BusName, InvalidBusName};
use rollwalk_bus::port::Port;
use rollwalk_bus::priority;
use rollwalk_firmware::Settings;
use rollwalk_multibody::ground::Ground;
use rollwalk_robot::Robot;
use rollwalk_sim_host::body::Body;
use rollwalk_sim_host::core::LocalController;
use rollwalk_sim_host::live::{controller, motors, whole};
use rollwalk_sim_host::rig::Rig;
use rollwalk_sim_host::store::KeepParameters;
use rollwalk_terminal::files::{Lines, Output, RotationArgs};
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::{Exit, arguments, end, interrupt, output, with_common_help};
use status::StatusPrinter;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Simulated robot: the controller's firmware, and motors with inertia and limits.
///
/// The default is a whole robot whose link is on a bus of this computer, where the rollwalk tools find it like a real one.
/// With --actuators its motors are also on buses of this computer, one for each actuator bus of the robot file. With --only the
/// motors or the controller are left out, so that real ones can replace them. Motors use the protocol in the file's [[bus]].
///
/// The whole robot is on the ground: a hoist holds it until it plays, and lifts it again after 3 s without torque. The
/// simulator prints the displacement of each motion, the net displacement from SAFE to SAFE, and falls. With --on stand the
/// robot hangs on a stand instead, its body fixed and its wheels in the air. With --actuators, the default is the stand. With
/// --actuators and --on ground, the hoist releases the robot when all motors have torque and hold their targets still.
///
/// With --library FILE the simulated flash survives a restart: the simulator reads FILE at start, if it exists, and writes each
/// library that a host flashes to FILE. Before it overwrites a library for the first time, it copies that library to another
/// file (pup.2.rwl for pup.rwl). It stores saved gains beside FILE (pup.gains.json); without --library it refuses to save gains.
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
    #[arg(long, value_name = "BUS", value_parser = actuator_bus)]
    actuators: Vec<BusName>,
    /// Run only the given part of the robot.
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
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    #[command(flatten)]
    world_log: WorldLogArgs,
    #[command(flatten)]
    rotation: RotationArgs,
    #[command(flatten)]
    live: LiveArgs,
    /// File with a link key (`rollwalk keys new`): the controller accepts only hosts that have it. A file in
    /// the user's state folder counts its boots, so that the controller does not accept a recorded session again.
    #[arg(long, value_name = "FILE")]
    link_key: Option<PathBuf>,
    /// File with a public key (`rollwalk keys new-pair`): the controller plays only libraries that were signed with the private
    /// key of the pair.
    #[arg(long, value_name = "KEY.pub.pem")]
    library_key: Option<PathBuf>,
}

/// Part of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// Firmware, on link and actuator buses.
    Controller,
    /// Motors, on actuator buses.
    Motors,
}

/// Parses the name of an actuator bus.
fn actuator_bus(name: &str) -> Result<BusName, String> {
    if name.starts_with("/dev/") {
        return Err(format!(
            "the kind of bus is missing before the device: give tty:{name} for servos on a serial \
             line, or slcan:{name} for a CAN adapter"
        ));
    }
    name.parse().map_err(|error: InvalidBusName| error.to_string())
}

/// Command line; its long help ends with the exit codes.
pub fn command_line() -> clap::Command {
    with_common_help(Cli::command(), &|_| &[Exit::Ok])
}

/// Parses the command line and runs the robot.
pub fn main() -> ExitCode {
    let words: Vec<_> = std::env::args_os().collect();
    let explain = |error| words::explain(error, &command_line());
    let cli = arguments::parse(command_line(), &words, explain);
    end(cli.and_then(|cli| run(&cli)))
}

fn run(cli: &Cli) -> miette::Result<Exit> {
    let (robot, parts) = Source::Disk.robot_and_parts(&cli.robot)?;
    let loads = BusLoads::new(&robot).into_diagnostic()?;
    loads.check(&cli.robot)?;
    // Drives on buses of this computer may be real drives.
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
    if let (false, Some(log)) = (cli.actuators.is_empty(), &cli.log) {
        let bus = cli.bus.as_ref().map_or("BUS".to_owned(), ToString::to_string);
        return Err(miette!(
            help = format!(
                "log the link with `rollwalk monitor --bus {bus} --log {}`, and CAN buses of \
                 actuators with `candump -L`",
                log.display()
            ),
            "--log is for simulated buses, but --actuators names buses of this computer"
        ));
    }
    let support = match cli.on {
        Some(Support::Ground) if cli.only == Some(Part::Controller) => {
            return Err(miette!(
                help = "give --on ground to the program that simulates the motors",
                "--on ground requires simulated motors, but --only controller simulates none"
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
    let gains = cli.library.as_deref().map(Gains::beside).transpose()?;
    let kept = StoredFlash { memory: memory.map(|memory| Arc::new(Mutex::new(memory))), gains };
    interrupt::install_handler();
    match (cli.only, &cli.bus) {
        (Some(Part::Motors), _) if kept.memory.is_some() => {
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
            run_controller(&robot, keys, bus, &actuators, kept)?;
        }
        (None, Some(bus)) if actuators.is_empty() => {
            let view = cli.live.begin(&robot, &parts)?;
            run_whole(&robot, keys, bus, cli, ground.as_ref(), kept, view)?;
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
            // Two nodes on every bus, as on a real bus.
            let ports = ports(&actuators)?;
            let names = actuators.clone();
            let mut body = motors_of(&robot, cli, ground.as_ref());
            let world_log = cli.world_log.begin(&robot, cli.rotation.rotate)?;
            let motors = std::thread::spawn(move || {
                let mut lost = LostBuses { link: None, actuators: &names, says: false };
                let ended = simulate_motors(&mut body, ports, &mut lost, world_log);
                // Without motors, the controller has nothing to do.
                interrupt::request();
                ended
            });
            run_controller(&robot, keys, bus, &actuators, kept)?;
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

/// Content of the controller's flash that outlives this program.
struct StoredFlash {
    memory: Option<SharedMemory>,
    gains: Option<Gains>,
}

/// Returns the firmware with the keys that it requires and with the library and gains of its flash, and the memory of the
/// library.
fn core(
    robot: &Robot,
    keys: Keys,
    kept: StoredFlash,
) -> miette::Result<(LocalController, Option<SharedMemory>)> {
    let config = robot.controller_config().into_diagnostic()?;
    let (buses, settings) = (robot.controller_buses(), Settings::default());
    let StoredFlash { memory, gains } = kept;
    let library = memory.as_ref().and_then(|memory| lock(memory).library().map(<[u8]>::to_vec));
    let core = match &library {
        Some(library) => LocalController::with_library(config, buses, settings, library),
        None => LocalController::new(config, buses, settings),
    };
    let saved = gains.as_ref().and_then(|gains| gains.saved.clone());
    let keep: KeepParameters = gains.map_or_else(gains::no_file, Gains::keeper);
    let mut core = core.keeping_parameters(saved.as_ref(), keep);
    if let Some(key) = keys.library {
        core = core.with_library_key(key);
    }
    if let Some((key, boots_before)) = keys.link {
        core.require_key(key, boots_before);
    }
    if let Some(memory) = memory.clone() {
        core.keep_libraries(Box::new(move |library| lock(&memory).keep_first(library)));
    }
    Ok((core, memory))
}

fn run_whole(
    robot: &Robot,
    keys: Keys,
    bus: &BusName,
    cli: &Cli,
    ground: Option<&Arc<dyn Ground>>,
    kept: StoredFlash,
    mut view: Option<live::View<'_>>,
) -> miette::Result<()> {
    let log = cli.log.as_deref().map(Output::at).transpose()?;
    let log = log.map(|output| Lines::create(&output, cli.rotation.rotate));
    let mut log = log.transpose()?;
    let (core, memory) = core(robot, keys, kept)?;
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
            // The world is printed first, because changes of the state are printed with the present time.
            world.print(rig);
            // State and faults are those of the controller, because any node may send a status on the link.
            let controller = rig.core().controller();
            printer.print(rig.now().as_s(), controller.state(), controller.faults());
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
    kept: StoredFlash,
) -> miette::Result<()> {
    // The drives' watchdogs stop motors whose set-points are late.
    priority::raise();
    let (mut core, memory) = core(robot, keys, kept)?;
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
    // The controller has this priority, and treats a drive that answers 0.1 s late as silent.
    priority::raise();
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
