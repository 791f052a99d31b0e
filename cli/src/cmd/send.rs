//! `rollwalk send`: motions by code or name, one after the other.

use crate::link::names::NamesArgs;
use crate::link::{LinkArgs, LiveSession, ended};
use crate::{Exit, interrupt, output};
use miette::miette;
use rollwalk_host::catalog::{Catalog, Motion};
use rollwalk_host::refusal::state_name;
use rollwalk_host::session::SessionError;
use rollwalk_protocol::library::RATE_HZ;
use rollwalk_protocol::wire::State;
use std::str::FromStr;

/// Longest wait for a motion to begin, beyond what the controller says, µs.
const SLACK_US: u64 = 5_000_000;
/// Time is given to a running motion in such portions, between which Ctrl-C is looked for, µs.
const PORTION_US: u64 = 100_000;

/// Play motions by command code or name.
///
/// With --arm the robot is armed first, plays every motion in turn, returns to SAFE and is disarmed; until
/// then this program is the host whose heartbeat the robot waits for, and Ctrl-C brings the robot home. Without
/// it the robot must be armed already and kept so by another program, such as `rollwalk console`: each motion
/// is sent, and this program ends when it is acknowledged.
///
/// A motion that loops is played for one round, or for the seconds after its colon.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk send --arm drive_1m walk:10 turn_in_place --bus can:can0
  rollwalk send --arm 2 3:4.5 --speed 0.5 --bus serial:/dev/ttyUSB0
  rollwalk send walk --bus sim           # while `rollwalk console --bus sim` holds the robot

Names are those of the library that was built or flashed on this computer; for another, add --library.")]
pub struct Args {
    /// Motions: command codes or names, loops with seconds (walk:10).
    #[arg(value_name = "MOTION", required = true)]
    motions: Vec<Wanted>,
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    names: NamesArgs,
    /// Arm first; at the end return to SAFE and disarm.
    #[arg(long)]
    arm: bool,
    /// Part of the planned speed, 1/64 to 1.
    #[arg(long, value_name = "PART", default_value = "1", value_parser = speed)]
    speed: i8,
}

/// A motion that is asked for.
#[derive(Clone, Debug, PartialEq)]
struct Wanted {
    motion: String,
    seconds: Option<f64>,
}

impl FromStr for Wanted {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let (motion, seconds) = match text.rsplit_once(':') {
            None => (text, None),
            Some((motion, seconds)) => {
                let parsed = seconds.parse().ok().filter(|s: &f64| s.is_finite() && *s > 0.0);
                let wrong = || format!("`{seconds}` is no number of seconds, as in walk:10");
                (motion, Some(parsed.ok_or_else(wrong)?))
            }
        };
        if motion.is_empty() {
            return Err("which motion? A code or a name, as in walk:10".into());
        }
        Ok(Self { motion: motion.into(), seconds })
    }
}

/// 64ths of the planned speed.
fn speed(text: &str) -> Result<i8, String> {
    let part = text.parse().ok().filter(|part: &f64| (1.0 / 64.0..=1.0).contains(part));
    let part = part.ok_or("a part of the planned speed is a number from 0.016 (1/64) to 1")?;
    Ok((part * 64.0).round() as i8)
}

/// A motion to be played.
struct Chosen<'a> {
    code: u8,
    seconds: Option<f64>,
    /// What is known of it.
    motion: Option<(usize, &'a Motion)>,
}

impl Chosen<'_> {
    fn name(&self) -> String {
        self.motion.map_or_else(|| format!("code {}", self.code), |(_, motion)| motion.name.clone())
    }
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let mut session = args.link.connect()?;
    let library = session.hello().library.ok_or_else(|| {
        miette!(help = "rollwalk flash LIB.rwl --bus BUS", "the controller has no motion library")
    })?;
    let catalog = args.names.find(library)?;
    let chosen = args.motions.iter().map(|wanted| choose(wanted, catalog.as_ref()));
    let chosen: Vec<_> = chosen.collect::<miette::Result<_>>()?;
    if !args.arm {
        return match send_only(&mut session, args, &chosen) {
            Ok(()) => Ok(Exit::Ok),
            Err(error) => ended(&args.link, &error),
        };
    }
    if let Some(catalog) = &catalog {
        session.expect_robot(catalog.config_hash);
    }
    let outcome = session.arm().and_then(|()| {
        output::say("armed");
        play(&mut session, args, &chosen)
    });
    session.bus_mut().ignore_interrupts();
    let home = match &outcome {
        Ok(()) | Err(SessionError::Link(_)) => go_home(&mut session),
        // Something stopped it, or it does not answer: what it does now is its own business.
        Err(_) => Ok(()),
    };
    match outcome.and(home) {
        Ok(()) => Ok(if interrupt::requested() { Exit::Interrupted } else { Exit::Ok }),
        Err(error) => ended(&args.link, &error),
    }
}

/// The motion that is meant.
fn choose<'a>(wanted: &Wanted, catalog: Option<&'a Catalog>) -> miette::Result<Chosen<'a>> {
    let Wanted { motion: text, seconds } = wanted;
    let motions = || catalog.into_iter().flat_map(|catalog| catalog.motions.iter().enumerate());
    if let Ok(code) = text.parse::<u8>() {
        let motion = motions().find(|(_, motion)| motion.code == Some(code));
        return Ok(Chosen { code, seconds: *seconds, motion });
    }
    let Some(catalog) = catalog else {
        return Err(miette!(
            help = "name the library, --library LIB.rwl, or give the motion's code",
            "`{text}`: the names of the controller's library are not known on this computer"
        ));
    };
    let found = motions().find(|(_, motion)| motion.name == *text);
    match found.map(|found| (found, found.1.code)) {
        Some((motion, Some(code))) => Ok(Chosen { code, seconds: *seconds, motion: Some(motion) }),
        Some((_, None)) => {
            Err(miette!("`{text}` has no command code: it is played on the way only"))
        }
        None => {
            let names: Vec<_> = catalog.motions.iter().map(|motion| motion.name.as_str()).collect();
            Err(miette!(
                help = format!("it has {}", names.join(", ")),
                "the library of {} has no motion `{text}`",
                catalog.robot
            ))
        }
    }
}

/// Sends the codes to a robot that another program keeps armed.
fn send_only(session: &mut LiveSession, args: &Args, all: &[Chosen]) -> Result<(), SessionError> {
    for chosen in all {
        let ack = session.select_at(chosen.code, args.speed)?;
        let seconds = f64::from(ack.value) / f64::from(RATE_HZ);
        output::say(format_args!("{} begins in {seconds:.2} s", chosen.name()));
        if all.len() > 1 {
            let Some((node, motion)) = chosen.motion else { continue };
            wait_for(session, chosen, node, ack.value)?;
            finish(session, chosen, motion)?;
        }
    }
    Ok(())
}

/// Plays all, one after the other.
fn play(session: &mut LiveSession, args: &Args, all: &[Chosen]) -> Result<(), SessionError> {
    for chosen in all {
        if interrupt::requested() {
            break;
        }
        let ack = session.select_at(chosen.code, args.speed)?;
        match chosen.motion {
            Some((node, motion)) => {
                wait_for(session, chosen, node, ack.value)?;
                output::say(format_args!("playing {}", motion.name));
                finish(session, chosen, motion)?;
            }
            // Without names nobody knows how long it is.
            None => {
                output::say(format_args!("playing {}", chosen.name()));
                let begins_us = u64::from(ack.value) * 1_000_000 / u64::from(RATE_HZ);
                run_for(session, begins_us + micros(chosen.seconds.unwrap_or(5.0)))?;
            }
        }
    }
    Ok(())
}

/// Waits until the motion is played.
fn wait_for(
    session: &mut LiveSession,
    chosen: &Chosen,
    node: usize,
    frames: u16,
) -> Result<(), SessionError> {
    // At 1/64 of the speed frames take 64 times as long; what plays now may have to end first.
    let longest_us = u64::from(frames) * 64 * 1_000_000 / u64::from(RATE_HZ) + SLACK_US;
    session.wait_until(&format!("motion {}", chosen.name()), longest_us, |status| {
        match status.state {
            State::Playing | State::Ready | State::Paused | State::Aligning | State::Returning => {
                (status.clip.map(usize::from) == Some(node)).then_some(true)
            }
            _ => Some(false),
        }
    })
}

/// Waits until a motion that ends has ended; gives a loop its time.
fn finish(session: &mut LiveSession, chosen: &Chosen, motion: &Motion) -> Result<(), SessionError> {
    let round = f64::from(motion.frames) / f64::from(RATE_HZ);
    if motion.looping || chosen.seconds.is_some() {
        return run_for(session, micros(chosen.seconds.unwrap_or(round)));
    }
    let last = motion.frames.saturating_sub(1);
    let node = chosen.motion.map(|(node, _)| node);
    session.wait_until(
        &format!("the end of {}", motion.name),
        micros(64.0 * round) + SLACK_US,
        |status| {
            let elsewhere = status.clip.map(usize::from) != node;
            match status.state {
                State::Ready => Some(true),
                State::Playing | State::Paused => {
                    (status.frame >= last || elsewhere).then_some(true)
                }
                State::Returning => None,
                _ => Some(false),
            }
        },
    )
}

/// Lets the robot go on; ends early with Ctrl-C, and when the robot stops by itself.
fn run_for(session: &mut LiveSession, duration_us: u64) -> Result<(), SessionError> {
    let mut left_us = duration_us;
    while left_us > 0 && !interrupt::requested() {
        let portion_us = left_us.min(PORTION_US);
        session.run_for(portion_us)?;
        left_us -= portion_us;
        if let Some(status) = session.status()
            && matches!(status.state, State::Damped | State::TorqueOff | State::EStopped)
        {
            let waited_for = "the end of the motion".into();
            return Err(SessionError::WentElsewhere { waited_for, status });
        }
    }
    Ok(())
}

/// Back to SAFE, and torque off.
fn go_home(session: &mut LiveSession) -> Result<(), SessionError> {
    if let Some(status) = session.status() {
        output::say(format_args!("the robot is {}: returning to SAFE", state_name(status.state)));
    }
    session.return_to_safe()?;
    session.disarm()?;
    output::say("disarmed");
    Ok(())
}

fn micros(seconds: f64) -> u64 {
    (seconds * 1e6) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_may_have_seconds() {
        let wanted = |motion: &str, seconds| Wanted { motion: motion.into(), seconds };
        assert_eq!("walk".parse(), Ok(wanted("walk", None)));
        assert_eq!("3:4.5".parse(), Ok(wanted("3", Some(4.5))));
        for wrong in ["walk:", "walk:-1", "walk:NaN", "walk:fast", ":3", ""] {
            wrong.parse::<Wanted>().expect_err(wrong);
        }
    }

    #[test]
    fn speeds_are_parts_of_the_planned_one() {
        assert_eq!([speed("1"), speed("0.5"), speed("0.016")], [Ok(64), Ok(32), Ok(1)]);
        for wrong in ["0", "1.01", "-0.5", "NaN", "half"] {
            speed(wrong).expect_err(wrong);
        }
    }
}
