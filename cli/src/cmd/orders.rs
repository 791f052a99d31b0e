//! Short commands to a controller: `estop`, `clear`, `disarm`, `pause`, `resume`, `return`.

use rollwalk_host::actuators::Actuators;
use rollwalk_host::describe::{condition, has_to_be_cleared};
use rollwalk_host::operator::NOT_STOPPED;
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::wire::{CommandResult, State};
use rollwalk_terminal::link::names::NamesArgs;
use rollwalk_terminal::link::{LinkArgs, LiveSession, report_failure, report_failure_on};
use rollwalk_terminal::{Exit, interrupt, output};
use std::thread;
use std::time::Duration;

/// Maximum wait for a STATUS, µs.
const STATUS_US: u64 = 200_000;
/// Maximum wait while a robot sinks with damped joints, µs: twice the usual time.
const LET_DOWN_US: u64 = 3_000_000;
/// Interval between attempts to open a bus that was lost during a stop.
const REOPEN: Duration = Duration::from_millis(200);

/// Command to a controller; [`stop`] handles the emergency stop.
#[derive(Clone, Copy, Debug)]
pub enum Order {
    /// Clear a latched stop.
    Clear,
    /// Return to SAFE, then turn torque off.
    Disarm,
    /// Hold the current pose of the motion.
    Pause,
    /// Resume a paused motion.
    Resume,
    /// Return to SAFE.
    Return,
}

/// Arguments of every command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    link: LinkArgs,
}

/// Runs the subcommand.
pub fn run(order: Order, args: &Args) -> miette::Result<Exit> {
    let mut session = args.link.join()?;
    let outcome = match order {
        Order::Clear => clear(&mut session),
        Order::Disarm => session.disarm(),
        Order::Pause => session.pause(),
        Order::Resume => session.resume(),
        Order::Return => session.return_to_safe(),
    };
    // The names are looked up after the command, because the command should not wait.
    let robot = NamesArgs::default().look_up(Some(session.hello()))?;
    if let Err(error) = outcome {
        return Ok(report_failure_on(&args.link, &error, robot.as_ref()));
    }
    // The last status may be older than the command. It is printed even if no newer one arrives.
    let _ = session.wait_until("its status", STATUS_US, |_| Some(true));
    if let Some(status) = session.status() {
        let actuators = robot.map_or_else(Actuators::default, |robot| robot.actuators);
        output::print(&format!("the robot is {}", condition(&status, &actuators)))?;
        // The robot stopped after it had accepted the command.
        if has_to_be_cleared(&status) {
            return Ok(Exit::NotDone);
        }
    }
    Ok(Exit::Ok)
}

/// Clears a latched stop. Waits while the robot still sinks. A robot without a stop is not an error.
fn clear(session: &mut LiveSession) -> Result<(), SessionError> {
    let mut waited_us = 0;
    loop {
        let outcome = session.clear();
        let Err(SessionError::Refused { result: CommandResult::WrongState, .. }) = outcome else {
            return outcome;
        };
        session.run_for(STATUS_US)?;
        waited_us += STATUS_US;
        match session.status().map(|status| status.state) {
            Some(State::Disarmed) => {
                output::print_line("there is nothing to clear");
                return Ok(());
            }
            Some(State::Damped) if waited_us < LET_DOWN_US && !interrupt::requested() => {}
            _ => return outcome,
        }
    }
}

/// Runs `estop`. Sends the frame at once, without a preceding request, and repeats it until it is acknowledged or Ctrl-C is
/// pressed.
pub fn stop(args: &Args) -> miette::Result<Exit> {
    let link = &args.link;
    let mut bus = link.open()?;
    loop {
        let unanswered = |error| {
            output::print_line(format_args!(
                "{NOT_STOPPED}\n{error}\nThe stop is sent until it is acknowledged; Ctrl-C ends the \
                 program."
            ))
        };
        match Session::estop_at(bus, link.node, unanswered) {
            Ok(()) => {
                return output::print("emergency stop: torque is off").map(|()| Exit::Ok);
            }
            Err(SessionError::Link(error)) if !interrupt::requested() => {
                output::print_line(format_args!(
                    "{NOT_STOPPED}\n{error}; reopening the bus, Ctrl-C ends the program"
                ));
            }
            Err(error) => return Ok(report_failure(link, &error)),
        }
        bus = loop {
            thread::sleep(REOPEN);
            if interrupt::requested() {
                return Ok(Exit::Interrupted);
            }
            if let Ok(bus) = link.open() {
                break bus;
            }
        };
    }
}
