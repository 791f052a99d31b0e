//! Short orders to a controller: `estop`, `clear`, `disarm`, `pause`, `resume`, `return`.

use rollwalk_host::actuators::Actuators;
use rollwalk_host::describe::condition;
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::wire::{CommandResult, State};
use rollwalk_terminal::link::{LinkArgs, LiveSession, ended};
use rollwalk_terminal::{Exit, interrupt, output};
use std::thread;
use std::time::Duration;

/// Longest wait for a STATUS, µs.
const STATUS_US: u64 = 200_000;
/// Longest wait for a robot that is let down with damped joints, µs: twice what that takes.
const LET_DOWN_US: u64 = 3_000_000;
/// Interval between attempts to open a bus that was lost during a stop.
const REOPEN: Duration = Duration::from_millis(200);

/// Order to a controller; [`stop`] handles the emergency stop.
#[derive(Clone, Copy, Debug)]
pub enum Order {
    /// Leave a latched stop.
    Clear,
    /// Back to SAFE, then torque off.
    Disarm,
    /// Hold where the motion is.
    Pause,
    /// Go on.
    Resume,
    /// Back to SAFE.
    Return,
}

/// Arguments of every order.
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
    if let Err(error) = outcome {
        return Ok(ended(&args.link, &error));
    }
    // The last status may be older than the order; it is printed even without a newer one.
    let _ = session.wait_until("its status", STATUS_US, |_| Some(true));
    if let Some(status) = session.status() {
        output::print(&format!("the robot is {}", condition(&status, &Actuators::default())))?;
    }
    Ok(Exit::Ok)
}

/// Clears a latched stop; a robot with nothing to clear is no error, and one that is still let down is waited for.
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
                output::say("there is nothing to clear");
                return Ok(());
            }
            Some(State::Damped) if waited_us < LET_DOWN_US && !interrupt::requested() => {}
            _ => return outcome,
        }
    }
}

/// Runs `estop`. The frame is sent at once, without any request before it, and again until it is acknowledged or
/// Ctrl-C ends it.
pub fn stop(args: &Args) -> miette::Result<Exit> {
    let link = &args.link;
    let mut bus = link.open()?;
    loop {
        let unanswered = |error| {
            output::say(format_args!("{error}\nThe stop goes on being sent; Ctrl-C ends that."))
        };
        match Session::estop_at(bus, link.node, unanswered) {
            Ok(()) => {
                return output::print("emergency stop: torque is off").map(|()| Exit::Ok);
            }
            Err(SessionError::Link(error)) if !interrupt::requested() => {
                output::say(format_args!("{error}; it is opened again, Ctrl-C ends that"));
            }
            Err(error) => return Ok(ended(link, &error)),
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
