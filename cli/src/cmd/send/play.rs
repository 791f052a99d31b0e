//! Plays motions one after the other and waits for each.

use super::wanted::Chosen;
use crate::link::LiveSession;
use crate::{interrupt, output};
use rollwalk_host::catalog::Motion;
use rollwalk_host::session::SessionError;
use rollwalk_protocol::library::RATE_HZ;
use rollwalk_protocol::wire::{State, Status};

/// Maximum wait for a motion to start, beyond the controller's estimate, µs.
const SLACK_US: u64 = 5_000_000;
/// Interval between checks for Ctrl-C while a motion plays, µs.
const PORTION_US: u64 = 100_000;
/// How long before the end of a loop what follows is asked for, s: longer than a status and a command take.
const LEAD_S: f64 = 0.25;

/// Plays all motions, one after the other, and waits for the end of each. If another program is the host, the last one
/// continues after this program has ended.
///
/// # Errors
/// Errors of the session, or the robot has stopped.
pub fn play(
    session: &mut LiveSession,
    speed_64ths: i8,
    holds: bool,
    all: &[Chosen<'_>],
) -> Result<(), SessionError> {
    for (chosen, left) in all.iter().zip((0..all.len()).rev()) {
        if interrupt::requested() {
            break;
        }
        let ack = session.select_at(chosen.code, speed_64ths)?;
        let begins_us = u64::from(ack.value) * 1_000_000 / u64::from(RATE_HZ);
        if left == 0 && !holds {
            let begins_s = begins_us as f64 * 1e-6;
            output::say(format_args!("{} begins in {begins_s:.2} s", chosen.name()));
            break;
        }
        match chosen.motion {
            Some((node, motion)) => {
                wait_for(session, chosen, node, ack.value)?;
                output::say(format_args!("playing {}", motion.name));
                finish(session, chosen, motion)?;
            }
            // Its duration is unknown without a catalog.
            None => {
                output::say(format_args!("playing {}", chosen.name()));
                run_for(session, begins_us + micros(chosen.seconds.unwrap_or(5.0)), None)?;
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
    wait_also_while_paused(session, &format!("motion {}", chosen.name()), longest_us, |status| {
        match status.state {
            State::Playing | State::Ready | State::Paused | State::Aligning | State::Returning => {
                (status.clip.map(usize::from) == Some(node)).then_some(true)
            }
            _ => Some(false),
        }
    })
}

/// Waits until a motion that ends has ended; gives a loop its time, to the end of the round in which it is over.
fn finish(session: &mut LiveSession, chosen: &Chosen, motion: &Motion) -> Result<(), SessionError> {
    let round = f64::from(motion.frames) / f64::from(RATE_HZ);
    let node = chosen.motion.map(|(node, _)| node);
    if motion.looping {
        let frame = session.status().map_or(0, |status| status.frame);
        let duration = loop_s(chosen.seconds.unwrap_or(round), frame);
        return run_for(session, micros(duration), node);
    }
    if let Some(seconds) = chosen.seconds {
        return run_for(session, micros(seconds), None);
    }
    let last = motion.frames.saturating_sub(1);
    wait_also_while_paused(
        session,
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

/// How long to wait in a loop that is to play for `seconds` and is at `frame`. It is left at the end of a round; what follows is asked for before
/// that, or the loop would go round once more.
fn loop_s(seconds: f64, frame: u16) -> f64 {
    (seconds - f64::from(frame) / f64::from(RATE_HZ) - LEAD_S).max(0.0)
}

/// Pauses by other programs.
#[derive(Default)]
struct Pauses(bool);

impl Pauses {
    /// Whether the robot is paused; reports the start of a pause.
    fn check(&mut self, status: Option<&Status>) -> bool {
        let is_paused = status.is_some_and(|status| status.state == State::Paused);
        if is_paused && !self.0 {
            output::say(
                "paused by another program; `rollwalk resume` lets it go on, `rollwalk return` brings it home",
            );
        }
        self.0 = is_paused;
        is_paused
    }
}

/// Waits for a status. Time spent paused does not count towards the timeout: a paused robot must not move because of
/// one.
fn wait_also_while_paused(
    session: &mut LiveSession,
    what: &str,
    longest_us: u64,
    mut reached: impl FnMut(&Status) -> Option<bool>,
) -> Result<(), SessionError> {
    let mut pauses = Pauses::default();
    loop {
        let waited = session.wait_until(what, longest_us, |status| {
            pauses.check(Some(status));
            reached(status)
        });
        let paused = session.status().is_some_and(|status| status.state == State::Paused);
        match waited {
            Err(SessionError::TookTooLong { .. }) if paused => {}
            waited => return waited,
        }
    }
}

/// Lets the robot play for a duration without pauses; ends early on Ctrl-C, and when the robot stops by itself. A motion that
/// `repeats`, by its node, does not end by itself: a robot that leaves it was sent home, or elsewhere, by another program.
fn run_for(
    session: &mut LiveSession,
    duration_us: u64,
    repeats: Option<usize>,
) -> Result<(), SessionError> {
    let (mut left_us, mut pauses) = (duration_us, Pauses::default());
    while left_us > 0 && !interrupt::requested() {
        let portion_us = left_us.min(PORTION_US);
        session.run_for(portion_us)?;
        if !pauses.check(session.status().as_ref()) {
            left_us -= portion_us;
        }
        if let (Some(node), Some(status)) = (repeats, session.status())
            && matches!(status.state, State::Playing | State::Ready | State::Returning)
            && status.clip.map(usize::from) != Some(node)
        {
            output::say("another program has ended the motion: nothing more is played");
            let waited_for = "the end of the motion".into();
            return Err(SessionError::WentElsewhere { waited_for, status });
        }
        if let Some(status) = session.status()
            && matches!(status.state, State::Damped | State::TorqueOff | State::EStopped)
        {
            let waited_for = "the end of the motion".into();
            return Err(SessionError::WentElsewhere { waited_for, status });
        }
    }
    Ok(())
}

fn micros(seconds: f64) -> u64 {
    (seconds * 1e6) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_follows_a_loop_is_asked_for_within_its_last_round() {
        // 96 frames a round: 1.6 s.
        for (seconds, rounds) in [(1.6, 1.0), (1.7, 1.0), (3.2, 2.0), (4.0, 3.0)] {
            for frame in [0, 3, 12] {
                let asked_s = f64::from(frame) / 60.0 + loop_s(seconds, frame);
                assert_eq!((asked_s / 1.6).ceil(), rounds, "{seconds} s from frame {frame}");
            }
        }
        assert_eq!(loop_s(0.1, 12), 0.0);
    }
}
