//! `rollwalk console`: shows the robot on a terminal, with keys for its motions.

pub mod app;
mod keys;
mod scene;
mod screen;

use crate::gamepad::reader::Gamepad;
use app::{App, terminal_gone};
use miette::miette;
use ratatui::DefaultTerminal;
use rollwalk_host::listener;
use rollwalk_host::session::SessionError;
use rollwalk_terminal::Exit;
use rollwalk_terminal::link::names::NamesArgs;
use rollwalk_terminal::link::operated_bus::report_exit;
use rollwalk_terminal::link::{LinkArgs, cannot_open, report_failure};
use scene::Lookup;
use std::io::{self, IsTerminal};
use std::path::PathBuf;

/// Steer the robot from a terminal: state, faults, motion graph, joints, and a key for every motion.
///
/// The console is the robot's only host: it sends the heartbeat that keeps an armed robot armed. When the heartbeat ends,
/// the robot returns to SAFE automatically. SPACE or Esc is the emergency stop; `q` returns the robot to SAFE, disarms it and
/// quits; `?` lists all keys.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk console --bus can:can0
  rollwalk console --bus sim                                # a robot of rollwalk-sim
  rollwalk console --bus serial:/dev/ttyUSB0 --library pup.rwl --robot pup.toml
  rollwalk console --bus can:can0 --gamepad auto            # docs/gamepad.md

Names are those of the library that was built or flashed on this computer; for another, add --library.")]
pub struct Args {
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    names: NamesArgs,
    /// Gamepad that also steers: auto, or a device such as /dev/input/event7.
    #[arg(long, value_name = "DEVICE")]
    gamepad: Option<String>,
    /// Button mapping (TOML, docs/gamepad.md) of a gamepad without a shipped mapping.
    #[arg(long, value_name = "FILE", requires = "gamepad")]
    mapping: Option<PathBuf>,
}

/// Terminal that is restored on drop, and after a panic by a hook of ratatui. If restoring would block, `app::watch` restores
/// only its keyboard mode.
struct Terminal(DefaultTerminal);

impl Drop for Terminal {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    if !io::stdout().is_terminal() || !io::stdin().is_terminal() {
        return Err(miette!(
            help = "print the state of the robot with `rollwalk monitor`, or play motions with \
                `rollwalk send`",
            "the console requires a terminal, but standard input or output is not a terminal"
        ));
    }
    let lookup = Lookup::new(&args.names)?;
    let gamepad =
        args.gamepad.as_deref().map(|device| Gamepad::open(device, args.mapping.as_deref()));
    let gamepad = gamepad.transpose()?;
    let peer = args.link.peer()?;
    let mut bus = args.link.live().map_err(cannot_open)?;
    let node = args.link.node;
    // If the bus has been lost by now, the console waits for it.
    if listener::find_host(&mut bus, node).is_ok_and(|listener| listener.has_host()) {
        return Ok(report_failure(&args.link, &SessionError::HasHost { node: node.number() }));
    }
    let mut app = App::new(&args.link, peer, lookup, gamepad, bus);
    let terminal =
        ratatui::try_init().map_err(|error| miette!("the terminal cannot be used: {error}"))?;
    let mut terminal = Terminal(terminal);
    let outcome = app.run(&mut terminal.0);
    drop(terminal);
    Ok(match outcome {
        Ok(view) => report_exit(&view),
        Err(error) => terminal_gone(&error.to_string()),
    })
}
