//! `rollwalk send`: plays motions by code or name, one after the other.

mod motion_request;
mod play;

use miette::{IntoDiagnostic, miette};
use motion_request::{MotionRequest, SelectedMotion, check_place, choose};
use play::{PlayEnd, Playing, play};
use rollwalk_host::catalog::Catalog;
use rollwalk_host::describe::alone;
use rollwalk_host::session::SessionError;
use rollwalk_protocol::library::PlaceCode;
use rollwalk_protocol::wire::{State, Status};
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::link::names::NamesArgs;
use rollwalk_terminal::link::{LinkArgs, LiveSession, report_failure_on, report_refusal};
use rollwalk_terminal::{Exit, interrupt, output};

/// Maximum time of a return to SAFE, µs. A return at a small fraction of the planned speed is slow.
const HOME_US: u64 = 30_000_000;
/// Time in SAFE after another program has returned the robot, µs, in which that program detects the end of its command.
const SEEN_US: u64 = 500_000;

/// Play motions by command code or name.
///
/// With --arm this program arms the robot, plays every motion in turn, returns the robot to SAFE and disarms it; Ctrl-C also
/// returns it to SAFE. Meanwhile this program is the robot's host and sends the heartbeat, so it is refused while another
/// program is the host.
///
/// Without --arm another program, such as `rollwalk console`, must have armed the robot and must keep it armed. This program
/// then waits for the end of every motion but the last, and exits when the final one has begun.
///
/// A motion is played once, or for the number of seconds after its colon: a loop repeats for that time and completes its cycle;
/// a finite motion then rests until the time is over. Without --arm the last motion loops until another one is commanded.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk send --arm drive_1m walk:10 turn_in_place --bus can:can0
  rollwalk send --arm 2 3:4.5 --speed 0.5 --bus serial:/dev/ttyUSB0
  rollwalk send turn_in_place walk --bus sim      # while `rollwalk console --bus sim` holds the robot
  rollwalk send --arm climb@stairs --at stairs --bus can:can0

Names are those of the library that was built or flashed on this computer; for another, add --library.")]
pub struct Args {
    /// Motions: command codes or names, with the seconds until the next one (walk:10, stand:2).
    #[arg(value_name = "MOTION", required = true)]
    motions: Vec<MotionRequest>,
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    names: NamesArgs,
    /// Arm first; return to SAFE and disarm at the end.
    #[arg(long)]
    arm: bool,
    /// Fraction of the planned speed, 1/64 to 1.
    #[arg(long, value_name = "PART", default_value = "1", value_parser = speed)]
    speed: i8,
    /// Place at which the robot stands: permits one motion with this place in its name, such as climb@stairs.
    #[arg(long, value_name = "PLACE")]
    at: Option<String>,
}

/// Parses a fraction of the planned speed, as 64ths.
fn speed(text: &str) -> Result<i8, String> {
    let part = text.parse().ok().filter(|part: &f64| (1.0 / 64.0..=1.0).contains(part));
    let part = part.ok_or("give a fraction of the planned speed from 0.016 (1/64) to 1")?;
    Ok((part * 64.0).round() as i8)
}

impl Args {
    fn playing(&self, holds: bool) -> Playing {
        Playing { speed_64ths: self.speed, place: self.at.as_deref().map(PlaceCode::named), holds }
    }
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    if let (false, Some(last)) = (args.arm, args.motions.last().filter(|last| last.has_seconds())) {
        return Err(miette!(
            help = "leave out the seconds of the last motion, or add a motion after it",
            "`{last}`: without --arm this program ends when the last motion begins"
        ));
    }
    let mut session = if args.arm { args.link.connect()? } else { args.link.join()? };
    let library = session.hello().library.ok_or_else(|| {
        let bus = &args.link.bus;
        let help =
            format!("flash a library: rollwalk flash LIB.rwl --robot ROBOT.toml --bus {bus}");
        report_refusal(&miette!(help = help, "the controller has no motion library"))
    })?;
    let robot = args.names.look_up(Some(session.hello()))?;
    // A catalog of a robot with an unknown library has no motions.
    let catalog = robot.as_ref().filter(|catalog| !catalog.motions.is_empty());
    // Names of another library may be right, but its codes do not fit this robot.
    let is_its_own = catalog.is_some_and(|catalog| catalog.library == library);
    let chosen = args.motions.iter().map(|wanted| choose(wanted, catalog, is_its_own));
    let chosen: Vec<_> = chosen.collect::<miette::Result<_>>()?;
    if is_its_own {
        check_place(&chosen, args.at.as_deref())?;
    }
    if !args.arm {
        return match play(&mut session, args.playing(false), &chosen) {
            Ok(_) if interrupt::requested() => Ok(Exit::Interrupted),
            Ok(PlayEnd::Whole) => Ok(Exit::Ok),
            Ok(PlayEnd::Returned | PlayEnd::Replaced) => Ok(Exit::NotDone),
            Err(error) => Ok(report_failure_on(&args.link, &error, robot.as_ref())),
        };
    }
    if let (Some(path), None) = (&args.names.robot, &args.names.library) {
        let robot = Source::Disk.robot(path)?;
        session.expect_robot(robot.controller_config().into_diagnostic()?.hash());
    } else if let Some(catalog) = catalog {
        session.expect_robot(catalog.config_hash);
    }
    match session.arm_request() {
        Ok(nonce) => arm_and_play(&mut session, args, nonce, &chosen, robot.as_ref()),
        Err(error) => Ok(report_failure_on(&args.link, &error, robot.as_ref())),
    }
}

/// Arms the robot, plays, and always returns it to SAFE, because the robot may have torque after the second step of arming.
fn arm_and_play(
    session: &mut LiveSession,
    args: &Args,
    nonce: u16,
    chosen: &[SelectedMotion<'_>],
    robot: Option<&Catalog>,
) -> miette::Result<Exit> {
    let outcome = match session.arm_confirm(nonce) {
        // The robot is not armed, or another program has armed it.
        Err(error @ SessionError::Refused { .. }) => {
            return Ok(report_failure_on(&args.link, &error, robot));
        }
        Err(error) => Err(error),
        Ok(()) => {
            output::print_line("armed");
            play(session, args.playing(true), chosen)
        }
    };
    session.bus_mut().ignore_interrupts();
    if let Ok(PlayEnd::Returned) = outcome {
        wait_for_safe(session);
    }
    let is_silent = matches!(&outcome, Err(SessionError::Link(_) | SessionError::Silent { .. }));
    let home = match outcome.as_ref().err().and_then(elsewhere) {
        Some(State::EStopped | State::TorqueOff | State::Damped) => {
            wait_until_disarmed(session);
            Ok(())
        }
        // The robot has restarted, or another program has disarmed it.
        Some(State::Disarmed | State::Boot | State::SelfTest) => Ok(()),
        _ => return_and_disarm(session, !is_silent),
    };
    let exit = match outcome {
        Ok(_) if interrupt::requested() => Exit::Interrupted,
        Ok(PlayEnd::Whole) => Exit::Ok,
        Ok(PlayEnd::Returned | PlayEnd::Replaced) => Exit::NotDone,
        Err(error) => report_failure_on(&args.link, &error, robot),
    };
    match home {
        Ok(()) => Ok(exit),
        // The report of the lost contact was printed already.
        Err(SessionError::Link(_) | SessionError::Silent { .. }) if is_silent => Ok(exit),
        Err(error) => {
            let report = args.link.explain(&error, robot);
            let report = report.wrap_err("the robot did not return to SAFE and disarm");
            output::print_report(&report);
            Ok(Exit::NotDone)
        }
    }
}

/// State of the robot when a wait ended early because it could no longer succeed.
fn elsewhere(error: &SessionError) -> Option<State> {
    match error {
        SessionError::WentElsewhere { status, .. } => Some(status.state),
        _ => None,
    }
}

/// Stays connected until a stopped robot is disarmed. Leaving earlier would add a lost host to its faults.
fn wait_until_disarmed(session: &mut LiveSession) {
    if session.wait_for_state(State::Disarmed, HOME_US).is_ok() {
        output::print_line("another program has disarmed the robot");
    }
}

/// Waits until a robot that another program returns is in SAFE, and until that program has received a status of SAFE.
fn wait_for_safe(session: &mut LiveSession) {
    // If the robot does not arrive, disarming reports the cause.
    if session.wait_for_state(State::Ready, HOME_US).is_ok() {
        let _ = session.run_for(SEEN_US);
    }
}

/// Returns to SAFE and turns torque off. DISARM does both from every state; RETURN is refused while the robot aligns.
fn return_and_disarm(session: &mut LiveSession, has_contact: bool) -> Result<(), SessionError> {
    output::print_line(way_home(session.status().map(|status| status.state), has_contact));
    let mut home = session.disarm();
    // If the program ended while the robot moves, the robot would latch a lost host.
    while let Err(SessionError::TookTooLong { status, .. }) = &home
        && is_on_its_way(status)
    {
        output::print_line("the robot is still returning to SAFE");
        home = session.wait_for_state(State::Disarmed, HOME_US);
    }
    if home.is_ok() {
        output::print_line("disarmed");
    }
    home
}

/// Last message: the robot returns to SAFE, or, without contact, the behaviour of a live controller.
fn way_home(state: Option<State>, has_contact: bool) -> String {
    match state.and_then(alone) {
        _ if has_contact => "returning to SAFE".into(),
        Some(alone) => format!("no contact: {alone}"),
        None => "no contact".into(),
    }
}

/// True if the robot becomes disarmed without a command: it returns to SAFE, or it has no fault and is damped or without
/// torque.
fn is_on_its_way(status: &Status) -> bool {
    let lets_down = matches!(status.state, State::Damped | State::TorqueOff);
    status.state == State::Returning || lets_down && status.faults.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The robot is not said to return when no command reaches it.
    #[test]
    fn a_robot_without_contact_is_not_said_to_return() {
        assert_eq!(way_home(Some(State::Playing), true), "returning to SAFE");
        for state in [None, Some(State::Disarmed)] {
            assert_eq!(way_home(state, false), "no contact");
        }
        let playing = way_home(Some(State::Playing), false);
        assert!(playing.starts_with("no contact: without heartbeats"), "{playing}");
    }

    #[test]
    fn speeds_are_parts_of_the_planned_one() {
        assert_eq!([speed("1"), speed("0.5"), speed("0.016")], [Ok(64), Ok(32), Ok(1)]);
        for wrong in ["0", "1.01", "-0.5", "NaN", "half"] {
            speed(wrong).expect_err(wrong);
        }
    }
}
