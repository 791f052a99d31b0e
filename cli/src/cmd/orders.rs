//! Short orders to a controller: `estop`, `clear`, `disarm`, `pause`, `resume`, `return`.

use crate::link::{LinkArgs, ended};
use crate::{Exit, output};
use rollwalk_host::refusal::{fault_names, state_name};
use rollwalk_host::session::Session;

/// What is ordered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Torque off at once.
    Estop,
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

/// Of all orders.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    link: LinkArgs,
}

/// Runs the subcommand.
pub fn run(order: Order, args: &Args) -> miette::Result<Exit> {
    if order == Order::Estop {
        return stop(args);
    }
    let mut session = args.link.connect()?;
    let outcome = match order {
        Order::Estop => unreachable!("stops do not wait for a connection"),
        Order::Clear => session.clear(),
        Order::Disarm => session.disarm(),
        Order::Pause => session.pause(),
        Order::Resume => session.resume(),
        Order::Return => session.return_to_safe(),
    };
    if let Err(error) = outcome {
        return ended(&args.link, &error);
    }
    if let Some(status) = session.status() {
        let (state, faults) = (state_name(status.state), fault_names(status.faults));
        output::print(&format!("the robot is {state} ({faults})"))?;
    }
    Ok(Exit::Ok)
}

/// Nothing is asked first: the frame goes out at once, and again until it is acknowledged.
fn stop(args: &Args) -> miette::Result<Exit> {
    match Session::estop_at(args.link.open()?, args.link.node) {
        Ok(()) => output::print("the robot is stopped, torque off").map(|()| Exit::Ok),
        Err(error) => ended(&args.link, &error),
    }
}
