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
/// Tolerance on the requested number of rounds: with rounds of 1.6 s, 3.21 s is two rounds and not three.
const ROUNDS_TOLERANCE: f64 = 0.01;

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
                // The controller acknowledges a loop that already plays with a delay of 0.
                finish(session, chosen, motion, speed_64ths, ack.value == 0)?;
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
fn finish(
    session: &mut LiveSession,
    chosen: &Chosen,
    motion: &Motion,
    speed_64ths: i8,
    played_before: bool,
) -> Result<(), SessionError> {
    let round = f64::from(motion.frames) / f64::from(RATE_HZ);
    let node = chosen.motion.map(|(node, _)| node);
    if motion.looping {
        let frame = session.status().map_or(0, |status| status.frame);
        let frame_s = 64.0 / (f64::from(RATE_HZ) * f64::from(speed_64ths));
        let round_s = f64::from(motion.frames) * frame_s;
        let playing = Loop { round_s, at_s: f64::from(frame) * frame_s, played_before };
        let duration = playing.wait_s(chosen.seconds.unwrap_or(round_s));
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

/// Playback of a loop, in seconds at the speed at which it is played.
struct Loop {
    /// Duration of a round.
    round_s: f64,
    /// Position within the present round.
    at_s: f64,
    /// Whether it played before it was asked for.
    played_before: bool,
}

impl Loop {
    /// How long to wait before what follows is asked for: shortly before the end of the round in which `wanted_s` are over, or the loop would go
    /// round once more.
    fn wait_s(&self, wanted_s: f64) -> f64 {
        let begun_s = if self.played_before { self.at_s } else { 0.0 };
        let rounds = ((begun_s + wanted_s) / self.round_s - ROUNDS_TOLERANCE).ceil();
        (rounds * self.round_s - self.at_s - LEAD_S).max(0.0)
    }
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
    fn what_follows_a_loop_is_asked_for_in_the_last_round_that_was_wanted() {
        let round_s = 1.6;
        for (wanted_s, rounds) in [(1.6, 1.0), (1.7, 2.0), (3.2, 2.0), (4.0, 3.0)] {
            for at_s in [0.0, 0.05, 0.2] {
                let new = Loop { round_s, at_s, played_before: false };
                let asked_s = at_s + new.wait_s(wanted_s);
                assert_eq!((asked_s / round_s).ceil(), rounds, "{wanted_s} s from {at_s} s");
            }
        }
        // One that plays already goes on for so long from now: from 1.15 s to the end of the second round.
        let old = Loop { round_s, at_s: 1.15, played_before: true };
        assert!((old.wait_s(round_s) - (3.2 - 1.15 - LEAD_S)).abs() < 1e-9);
        let short = Loop { round_s: 0.2, at_s: 0.1, played_before: false };
        assert_eq!(short.wait_s(0.2), 0.0);
    }
}
