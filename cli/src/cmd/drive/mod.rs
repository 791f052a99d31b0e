//! `rollwalk drive`: steers a robot continuously while its motion is being planned.

mod app;
mod controls;
mod screen;
mod simulated;
mod steps;
#[cfg(test)]
mod tests;

use crate::cmd::console::app::{terminal_gone, watch};
use crate::gamepad::reader::Gamepad;
use app::{App, DriveResult};
use controls::Controls;
use miette::miette;
use ratatui::{TerminalOptions, Viewport};
use rollwalk_host::listener;
use rollwalk_host::operator::Operator;
use rollwalk_host::session::SessionError;
use rollwalk_pilot::{Pilot, SteeredRobot};
use rollwalk_simulate::elevation::Sensing;
use rollwalk_terminal::inputs::number_within;
use rollwalk_terminal::link::steering::{GIVE_GAIT, SteeringArgs, SteeringInputs};
use rollwalk_terminal::link::{BUS_ENV, MaybeLinkArgs, cannot_open, report_failure};
use rollwalk_terminal::{Exit, interrupt, output};
use std::io::{self, IsTerminal};
use std::path::PathBuf;

/// Steer the robot continuously, by keys or a gamepad: forward, sideways, turning, to a halt, and from driving to walking.
///
/// The motion of the next one or two seconds is planned several times a second, and streamed to the controller. The robot
/// begins and ends in the SAFE pose of its motion library. If a periodic plan is given, the robot walks in its gait while it is
/// steered; otherwise it stands or drives on all its wheels. Nothing is measured: plans are played in open loop as from a
/// library, so the gait must be one that the robot walks well from a library.
///
/// Arrow keys steer forward, back and turns, `,` and `.` sideways, each in five steps; `x` stops; `g` changes between gait and
/// wheels. SPACE or Esc is the emergency stop, and `c` clears it; `a` arms, `r` goes to SAFE, `d` goes to SAFE and disarms, `q`
/// goes to SAFE, disarms and quits; a second `q` disarms at once, even in the middle of a step. With --steer no terminal is
/// needed: the program arms the robot, steers it by the list, and disarms it.
///
/// With --terrain, a simulated robot is steered over a terrain, without a bus. The robot is measured: each horizon begins in its
/// present state, and a tracker follows the plans with the measured contacts.
///
/// This program is the robot's host: it sends the heartbeat that keeps an armed robot armed. After a quarter of a second
/// without set-points the robot holds its pose, and then sinks with damped joints.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk drive agilebot.rwl --gait walk.plan.json --bus can:can0
  rollwalk drive agilebot.rwl --bus sim                     # on its wheels
  rollwalk drive agilebot.rwl --gait walk.plan.json --gamepad auto --bus serial:/dev/ttyACM0
  rollwalk drive agilebot.rwl --gait walk.plan.json --bus sim \\
      --steer 1:0.15,0,0 --steer 10:0.15,0,0.3 --steer 20:0,0,0 --until 25
  rollwalk drive agilebot.rwl --terrain stairs.toml --sensed --steer 1:0.15,0,0 --until 60")]
pub struct Args {
    /// Motion library of the controller (.rwl). The robot begins and ends in its SAFE pose.
    #[arg(value_name = "LIB.rwl")]
    library: PathBuf,
    /// Robot file (TOML), if the robot does not ship with rollwalk.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    #[command(flatten)]
    link: MaybeLinkArgs,
    #[command(flatten)]
    steering: SteeringArgs,
    /// Gamepad that also steers: auto, or a device such as /dev/input/event7.
    #[arg(long, value_name = "DEVICE")]
    gamepad: Option<String>,
    /// Button mapping (TOML, docs/gamepad.md) of a gamepad without a shipped mapping.
    #[arg(long, value_name = "FILE", requires = "gamepad")]
    mapping: Option<PathBuf>,
    /// Velocity from the time AT on: FORWARD and LEFT in m/s, TURN to the left in rad/s, for steering without a terminal.
    /// --speed and --turn do not limit this velocity. The robot halts if no horizon can be planned.
    #[arg(
        long,
        value_name = "AT:FORWARD,LEFT,TURN",
        requires = "until",
        conflicts_with = "gamepad"
    )]
    steer: Vec<steps::Step>,
    /// End of the drive with --steer, seconds.
    #[arg(long, value_name = "S", requires = "steer", value_parser = duration)]
    until: Option<f64>,
    /// Terrain file (docs/terrain-files.md) of a simulated drive. The planner uses it as its map.
    #[arg(long, value_name = "TERRAIN.toml", requires = "steer")]
    terrain: Option<PathBuf>,
    /// Plan a simulated drive on a map that is sensed around the robot: standard deviation of its heights in mm, unknown part in
    /// %, delay in ms.
    #[arg(
        long,
        value_name = "NOISE,HOLES,DELAY",
        requires = "terrain",
        num_args = 0..=1,
        default_missing_value = simulated::SENSING,
        value_parser = simulated::sensing
    )]
    sensed: Option<Sensing>,
}

/// Help for a speed that the robot cannot reach.
const UNITS: &str = "FORWARD and LEFT are in m/s and TURN in rad/s: 10 cm/s is 0.1";

fn duration(text: &str) -> Result<f64, String> {
    number_within(text, 0.1..=86_400.0)
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    steps::check(&args.steer, args.until.unwrap_or(f64::INFINITY))
        .map_err(|why| miette!("{why}"))?;
    let needs_terminal = args.steer.is_empty();
    if needs_terminal && (!io::stderr().is_terminal() || !io::stdin().is_terminal()) {
        return Err(miette!(
            help = "to steer without a terminal, give --steer AT:FORWARD,LEFT,TURN",
            "driving by keys requires a terminal, but standard input or error is not a terminal"
        ));
    }
    if args.terrain.is_some() && args.link.link().is_some() && std::env::var_os(BUS_ENV).is_none() {
        return Err(miette!(
            help = "give --bus to drive a robot, or --terrain to simulate one",
            "--terrain simulates the robot without a bus, but --bus is given, too"
        ));
    }
    let prepared = args.steering.prepare(&args.library, args.robot.as_deref())?;
    prepared.check_goes().map_err(|why| miette!(help = GIVE_GAIT, "{why}"))?;
    if let Some(reach) = &prepared.reach {
        for step in &args.steer {
            let text = format!("--steer {step}");
            reach.check(&text, step.steering).map_err(|why| miette!(help = UNITS, "{why}"))?;
        }
    }
    if prepared.route.gait.is_none() && args.steer.iter().any(|step| step.steering.left_m_s != 0.0)
    {
        output::print_line(
            "warning: without a gait the robot does not move sideways, so LEFT has no effect; give a \
             gait with --gait PLAN.json",
        );
    }
    if let Some(terrain) = &args.terrain {
        return simulated::run(args, &prepared.route, terrain);
    }
    let link = args.link.link().ok_or_else(|| {
        miette!(
            help = "name a bus with --bus, or simulate the drive with --terrain TERRAIN.toml",
            "there is no bus to the robot"
        )
    })?;
    let SteeringInputs { route, fastest, catalog, .. } = prepared;
    let gamepad =
        args.gamepad.as_deref().map(|device| Gamepad::open(device, args.mapping.as_deref()));
    let gamepad = gamepad.transpose()?;
    let peer = link.streaming_peer()?;
    let mut bus = link.live().map_err(cannot_open)?;
    let node = link.node;
    if listener::find_host(&mut bus, node).is_ok_and(|listener| listener.has_host()) {
        return Ok(report_failure(&link, &SessionError::HasHost { node: node.number() }));
    }
    let mut operator = Operator::new(peer, Some(catalog.config_hash));
    if !needs_terminal {
        operator = operator.scripted();
    }
    operator.set_catalog(Some(catalog.clone()));
    let controls = Controls::new(fastest, route.gait.is_some());
    let steered = SteeredRobot::new(Pilot::new(false), route, args.steering.budget());
    let mut app = App::new(&link, bus, operator, steered, controls, catalog);
    if let Some(until_s) = args.until.filter(|_| !needs_terminal) {
        interrupt::install_handler();
        return Ok(exit(app.steer(&args.steer, until_s)));
    }
    app.gamepad = gamepad;
    watch(app.rounds());
    let viewport = Viewport::Inline(screen::HEIGHT);
    let terminal = ratatui::try_init_with_options(TerminalOptions { viewport })
        .map_err(|error| miette!("the terminal cannot be used: {error}"))?;
    let mut terminal = RestoredTerminal(terminal);
    let outcome = app.run(&mut terminal.0);
    drop(terminal);
    Ok(match outcome {
        Ok(ending) => exit(ending),
        Err(error) => terminal_gone(&error.to_string()),
    })
}

/// Terminal that is restored on drop.
struct RestoredTerminal(ratatui::DefaultTerminal);

impl Drop for RestoredTerminal {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

fn exit(ending: DriveResult) -> Exit {
    output::print_line(&ending.words);
    ending.exit
}
