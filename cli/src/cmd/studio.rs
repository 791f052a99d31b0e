//! `rollwalk studio`: opens the studio in a browser, with this program as its planner.

use crate::studio::Server;
use crate::studio::desk::{self, Desk};
use crate::studio::relay::Relay;
use rollwalk_bus::name::BusName;
use rollwalk_terminal::{Exit, interrupt, output};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

/// Period of checks for Ctrl-C.
const POLL: Duration = Duration::from_millis(50);

/// Open the studio in a browser: watch a robot move, edit its motions and dimensions.
///
/// This program serves the page and plans for it; nothing leaves this computer. The printed address contains a token that page
/// and engine require: keep it to yourself. Files are changed only when you save in the page, and only those that were opened
/// here. With --bus the page can play a robot on that bus, after you press Connect there. Ctrl-C ends the studio.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk studio                                  the robots and motions that ship
  rollwalk studio motions/walk.toml                a motion, with the robot that it names
  rollwalk studio robots/pup.toml                  a robot, with a first motion
  rollwalk studio my_robot.urdf                    a URDF, with a first motion
  rollwalk studio my_library.toml --port 8080 --no-open
  rollwalk studio motions/agilebot_library.toml --bus can:can0    # a robot on a bus of this computer

docs/studio.md describes the studio and who can reach it.")]
pub struct Args {
    /// Motion, library, robot and design files (TOML), URDFs and plans (JSON) to open, with the files that they name.
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Port on 127.0.0.1 [default: any free port].
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Bus of a robot's link that the page may use: sim, can:can0, serial:/dev/ttyUSB0 or slcan:/dev/ttyACM0.
    #[arg(long, value_name = "BUS")]
    bus: Option<BusName>,
    /// Print the address, and do not open a browser.
    #[arg(long)]
    no_open: bool,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let relay = args.bus.clone().map(Relay::new).transpose()?;
    let desk = Desk::open(&args.files, desk::folder())?;
    let server = Server::bind(args.port, desk, relay)?;
    let address = server.address();
    interrupt::install_handler();
    output::print(&format!("the studio is at {address}"))?;
    if !args.no_open && !browse(&address) {
        output::print_line("no browser could be started: open this address in a browser");
    }
    server.start();
    while !interrupt::requested() {
        thread::sleep(POLL);
    }
    Ok(Exit::Ok)
}

/// Opens an address in the user's browser. Returns true if the program that opens browsers was started.
fn browse(address: &str) -> bool {
    let program = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };
    let mut browser = Command::new(program);
    browser.arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    browser.spawn().is_ok()
}
