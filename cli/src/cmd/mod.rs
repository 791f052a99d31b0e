//! Subcommands, one file each.

mod bench;
mod completions;
mod console;
mod control;
mod dbc;
mod demo;
mod description;
mod design;
mod discover;
mod doctor;
mod draw;
mod drive;
mod export;
mod flash;
mod gains;
mod identify;
mod import;
mod keys;
mod library;
mod man;
mod monitor;
mod orders;
mod plan;
mod plot;
mod report;
mod retarget;
mod robot;
mod robot_export;
mod send;
mod simulate;
pub(crate) mod standing;
mod studio;

use orders::Order;
use rollwalk_terminal::Exit;

/// Commands of `rollwalk`.
#[derive(clap::Subcommand)]
pub enum Command {
    Demo(demo::Args),
    #[command(subcommand)]
    Robot(robot::Action),
    Studio(studio::Args),
    Plan(plan::Args),
    Report(report::Args),
    Plot(plot::Args),
    Export(export::Args),
    Simulate(simulate::Args),
    Control(control::Args),
    Retarget(retarget::Args),
    Identify(identify::Args),
    #[command(subcommand)]
    Design(design::Action),
    #[command(subcommand)]
    Library(library::Action),
    Discover(discover::Args),
    Flash(flash::Args),
    Send(send::Args),
    Monitor(monitor::Args),
    Gains(gains::Args),
    Doctor(doctor::Args),
    Console(console::Args),
    Drive(drive::Args),
    #[command(subcommand)]
    Keys(keys::Action),
    /// Emergency stop: turn torque off at once. Sent until the controller acknowledges it, or until Ctrl-C; `clear` ends the
    /// stop.
    #[command(after_long_help = "Examples:\n  rollwalk estop --bus can:can0")]
    Estop(orders::Args),
    /// Clear an emergency stop, or a fault whose cause is gone; the robot can then be armed again.
    #[command(after_long_help = "Examples:\n  rollwalk clear --bus can:can0")]
    Clear(orders::Args),
    /// Return to SAFE and turn torque off.
    #[command(after_long_help = "Examples:\n  rollwalk disarm --bus can:can0")]
    Disarm(orders::Args),
    /// Pause the motion: the robot holds its pose.
    #[command(after_long_help = "Examples:\n  rollwalk pause --bus can:can0")]
    Pause(orders::Args),
    /// Resume a paused motion.
    #[command(after_long_help = "Examples:\n  rollwalk resume --bus can:can0")]
    Resume(orders::Args),
    /// Return to the safe motion and stay there.
    #[command(after_long_help = "Examples:\n  rollwalk return --bus can:can0")]
    Return(orders::Args),
    Dbc(dbc::Args),
    Bench(bench::Args),
    Completions(completions::Args),
    Man(man::Args),
}

impl Command {
    /// Runs the subcommand; `root` is the whole command line, for completion scripts and manual pages.
    ///
    /// # Errors
    /// Returns a report for the terminal if an input is bad, or if a file cannot be read or written.
    pub fn run(&self, root: &mut clap::Command) -> miette::Result<Exit> {
        match self {
            Command::Demo(args) => demo::run(args),
            Command::Robot(action) => robot::run(action),
            Command::Studio(args) => studio::run(args),
            Command::Plan(args) => plan::run(args),
            Command::Report(args) => report::run(args),
            Command::Plot(args) => plot::run(args),
            Command::Export(args) => export::run(args),
            Command::Simulate(args) => simulate::run(args),
            Command::Control(args) => control::run(args),
            Command::Retarget(args) => retarget::run(args),
            Command::Identify(args) => identify::run(args),
            Command::Design(action) => design::run(action),
            Command::Library(action) => library::run(action),
            Command::Discover(args) => discover::run(args),
            Command::Flash(args) => flash::run(args),
            Command::Send(args) => send::run(args),
            Command::Monitor(args) => monitor::run(args),
            Command::Doctor(args) => doctor::run(args),
            Command::Gains(args) => gains::run(args),
            Command::Console(args) => console::run(args),
            Command::Drive(args) => drive::run(args),
            Command::Keys(action) => keys::run(action),
            Command::Estop(args) => orders::stop(args),
            Command::Clear(args) => orders::run(Order::Clear, args),
            Command::Disarm(args) => orders::run(Order::Disarm, args),
            Command::Pause(args) => orders::run(Order::Pause, args),
            Command::Resume(args) => orders::run(Order::Resume, args),
            Command::Return(args) => orders::run(Order::Return, args),
            Command::Dbc(args) => dbc::run(args),
            Command::Bench(args) => bench::run(args),
            Command::Completions(args) => completions::run(args, root),
            Command::Man(args) => man::run(args, root),
        }
    }
}
