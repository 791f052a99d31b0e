//! `rollwalk drive`: steer a robot continuously; its motion is planned as it goes.

mod app;
mod controls;
mod pilot;
mod plans;
mod screen;
mod steps;
#[cfg(test)]
mod tests;

use crate::cmd::console::app::{terminal_gone, watch};
use crate::gamepad::reader::Gamepad;
use crate::inputs::number_within;
use crate::link::{LinkArgs, cannot_open, ended};
use crate::packed::Packed;
use crate::{Exit, inputs, interrupt, output};
use app::{App, Ending};
use controls::{Controls, Fastest};
use miette::{IntoDiagnostic, Report, miette};
use plans::{Planner, Route};
use ratatui::{TerminalOptions, Viewport};
use rollwalk_host::listener;
use rollwalk_host::operator::Operator;
use rollwalk_host::session::SessionError;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::receding::Gait;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_robot::Robot;
use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::time::Duration;

/// Fastest speed of a robot whose gait says nothing, m/s.
const SPEED_M_S: f64 = 0.2;

/// Steer the robot continuously, by keys or a gamepad: forward, sideways, turning, to a halt, and from driving to walking.
///
/// The motion of the next second or two is planned again and again, several times a second, and streamed to the controller. The robot begins and ends in
/// the SAFE pose of its motion library. It walks in the gait of a periodic plan, if one is given, while it is steered, and stands or
/// drives on all its wheels otherwise. Nothing is measured: plans are played as those of a library are, so that a gait must be one that
/// the robot walks well from a library.
///
/// Arrow keys steer forward, back and turns, `,` and `.` sideways, each in five steps; `x` stops. SPACE or Esc is the emergency stop; `a` arms, `r` goes
/// to SAFE, `q` goes to SAFE, disarms and quits; a second `q` disarms at once, also in the middle of a step. With --steer it needs no terminal: it arms the robot, steers it by the list, and disarms it.
///
/// This program is the robot's host: it sends the heartbeat that keeps an armed robot armed. If setpoints do not come for a quarter of a second the
/// robot holds still where it is, and is then let down.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk drive agilebot.rwl --gait walk.plan.json --bus can:can0
  rollwalk drive agilebot.rwl --bus sim                     # on its wheels
  rollwalk drive agilebot.rwl --gait walk.plan.json --gamepad auto --bus serial:/dev/ttyACM0
  rollwalk drive agilebot.rwl --gait walk.plan.json --bus sim \\
      --steer 1:0.15,0,0 --steer 10:0.15,0,0.3 --steer 20:0,0,0 --until 25")]
pub struct Args {
    /// Motion library of the controller (.rwl): its SAFE pose is where the robot begins and ends.
    #[arg(value_name = "LIB.rwl")]
    library: PathBuf,
    /// Robot file (TOML), if the robot does not ship with rollwalk.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    #[command(flatten)]
    link: LinkArgs,
    /// Periodic plan (JSON) in whose gait the robot walks.
    #[arg(long, value_name = "PLAN.json")]
    gait: Option<PathBuf>,
    /// Steer with a gamepad, too: auto, or a device such as /dev/input/event7.
    #[arg(long, value_name = "DEVICE")]
    gamepad: Option<String>,
    /// Button mapping (TOML, docs/gamepad.md), for a gamepad without a shipped one.
    #[arg(long, value_name = "FILE", requires = "gamepad")]
    mapping: Option<PathBuf>,
    /// Fastest speed of keys and sticks, m/s [default: that of the gait, or 0.2].
    #[arg(long, value_name = "M/S", value_parser = fast)]
    speed: Option<f64>,
    /// Fastest turn of keys and sticks, rad/s.
    #[arg(long, value_name = "RAD/S", default_value_t = 0.4, value_parser = fast)]
    turn: f64,
    /// Longest time to plan, in milliseconds; the best plan so far counts then, if it meets the constraints.
    #[arg(long, value_name = "MS", default_value_t = 90, value_parser = clap::value_parser!(u64).range(10..=200))]
    budget_ms: u64,
    /// Steer without a terminal: velocity from a time on, forward and to the left in m/s, turning to the left in rad/s.
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
}

fn fast(text: &str) -> Result<f64, String> {
    number_within(text, 0.01..=20.0)
}

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
            help = "--steer AT:FORWARD,LEFT,TURN steers without one",
            "driving needs a terminal for keys, and this is none"
        ));
    }
    let packed = Packed::read(&args.library, args.robot.as_deref())?;
    let (route, fastest) = route(args, &packed)?;
    // Whether it can be planned shows before the robot is armed.
    route.course().map_err(Report::msg)?;
    let gamepad =
        args.gamepad.as_deref().map(|device| Gamepad::open(device, args.mapping.as_deref()));
    let gamepad = gamepad.transpose()?;
    let catalog = packed.catalog();
    let peer = args.link.peer()?;
    let mut bus = args.link.live().map_err(cannot_open)?;
    let node = args.link.node;
    if listener::find_host(&mut bus, node).is_ok_and(|listener| listener.has_host()) {
        return Ok(ended(&args.link, &SessionError::HasHost { node: node.number() }));
    }
    let mut operator = Operator::new(peer, Some(catalog.config_hash));
    operator.set_catalog(Some(catalog.clone()));
    let controls = Controls::new(fastest, route.gait.is_some());
    let planner = Planner::start(route, Duration::from_millis(args.budget_ms));
    let mut app = App::new(&args.link, bus, operator, planner, controls, catalog);
    if let Some(until_s) = args.until.filter(|_| !needs_terminal) {
        interrupt::listen();
        return Ok(exit(app.steer(&args.steer, until_s)));
    }
    app.gamepad = gamepad;
    watch(app.rounds());
    let viewport = Viewport::Inline(screen::HEIGHT);
    let terminal = ratatui::try_init_with_options(TerminalOptions { viewport })
        .map_err(|error| miette!("the terminal refuses: {error}"))?;
    let mut terminal = Restored(terminal);
    let outcome = app.run(&mut terminal.0);
    drop(terminal);
    Ok(match outcome {
        Ok(ending) => exit(ending),
        Err(error) => terminal_gone(&error.to_string()),
    })
}

/// A terminal that is put right again when this ends.
struct Restored(ratatui::DefaultTerminal);

impl Drop for Restored {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

fn exit(ending: Ending) -> Exit {
    output::say(&ending.words);
    ending.exit
}

/// Where the robot begins, its gait, and how fast it may be steered.
fn route(args: &Args, packed: &Packed) -> miette::Result<(Route, Fastest)> {
    let robot = packed.robot.clone();
    let mut pose = [0.0; MAX_CHANNELS];
    packed
        .library()
        .safe_pose_into(&mut pose)
        .ok_or_else(|| miette!("{}: its SAFE pose cannot be read", args.library.display()))?;
    let safe_rad = pose.iter().take(robot.joints.len()).map(|&angle| f64::from(angle)).collect();
    let plan = args.gait.as_deref().map(inputs::plan).transpose()?;
    if let Some(plan) = &plan {
        check_gait(args, plan, &robot)?;
    }
    let gait = plan.as_ref().map(Gait::of).transpose().into_diagnostic()?;
    let speed_m_s = args.speed.or(plan.as_ref().and_then(mean_speed_m_s)).unwrap_or(SPEED_M_S);
    let fastest = Fastest { speed_m_s, turn_rad_s: args.turn };
    Ok((Route { robot, safe_rad, gait }, fastest))
}

fn check_gait(args: &Args, plan: &Plan, robot: &Robot) -> miette::Result<()> {
    let name = &plan.motion.name;
    if plan.robot != *robot {
        return Err(miette!(
            help = "plan the gait with the robot file that the library was built from",
            "the gait `{name}` is of robot `{}`, {} is for `{}`, or their files differ",
            plan.robot.name,
            args.library.display(),
            robot.name
        ));
    }
    if let Some(why) = &plan.motion.needs_feedback {
        output::say(format_args!(
            "warning: `{name}` needs feedback of the whole body ({why}), and is played without"
        ));
    }
    Ok(())
}

/// Mean speed of a plan over the ground, if it goes anywhere.
fn mean_speed_m_s(plan: &Plan) -> Option<f64> {
    let [x, y] = plan.end_placement.offset_m;
    let speed_m_s = x.hypot(y) / plan.motion.duration_s;
    (speed_m_s > 0.01).then_some(speed_m_s)
}
