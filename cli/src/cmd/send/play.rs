//! Playing of motions one after the other, each until its end.

use super::motion_request::SelectedMotion;
use rollwalk_bus::link::LinkBus;
use rollwalk_host::catalog::CatalogMotion;
use rollwalk_host::session::SessionError;
use rollwalk_protocol::library::{PlaceCode, RATE_HZ, place_of};
use rollwalk_protocol::wire::{STATUS_PERIOD_MS, State, Status};
use rollwalk_terminal::link::LiveSession;
use rollwalk_terminal::{interrupt, output};

/// Maximum wait for a motion to start, beyond the controller's estimate, µs.
const SLACK_US: u64 = 5_000_000;
/// Maximum interval between checks for Ctrl-C while a motion plays, s.
const PORTION_S: f64 = 0.1;
/// Time without a status after which the controller counts as silent, s. Many times `STATUS_PERIOD_MS`, because a busy computer
/// reads late.
const SILENT_S: f64 = 2.0;
/// Number of statuses of a robot at rest in another motion (2 s) after which a selected motion is given up.
const RESTING: u32 = 2000 / STATUS_PERIOD_MS;
/// Lead time before the end of a loop at which the next motion is requested, s. Longer than a status and a command take.
const LEAD_S: f64 = 0.25;
/// Lead time in frames. The request must arrive before the controller looks ahead to the first frame of another cycle.
const LEAD_FRAMES: f64 = 4.0;
/// Tolerance on the requested number of cycles: with cycles of 1.6 s, 3.21 s is two cycles, not three.
const ROUNDS_TOLERANCE: f64 = 0.01;

/// Options for playing motions.
pub struct Playing {
    /// Playback speed, in 64ths of the planned speed.
    pub speed_64ths: i8,
    /// Place at which the first motion for a place begins.
    pub place: Option<PlaceCode>,
    /// True if this program is the robot's host.
    pub holds: bool,
}

/// End of playing without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlayEnd {
    /// End of the last motion, or Ctrl-C.
    Whole,
    /// Return to SAFE by another program.
    Returned,
    /// Other motion, commanded by another program.
    Replaced,
}

/// Plays all motions in order and waits for the end of each. If another program is the host, returns when the last motion has
/// begun.
///
/// # Errors
/// Returns an error of the session, or an error if the robot has stopped.
pub fn play(
    session: &mut LiveSession,
    Playing { speed_64ths, mut place, holds }: Playing,
    all: &[SelectedMotion<'_>],
) -> Result<PlayEnd, SessionError> {
    for (chosen, left) in all.iter().zip((0..all.len()).rev()) {
        if interrupt::requested() {
            break;
        }
        // Without a catalog, any motion may begin at the place, and leaves it.
        let may_begin_there = chosen.motion.is_none_or(|(_, of)| place_of(&of.name).is_some());
        let at = place.take_if(|_| may_begin_there);
        let ack = session.select_from(at, chosen.code, speed_64ths)?;
        let begins_s = f64::from(ack.value) / f64::from(RATE_HZ);
        if left == 0 && !holds {
            output::print_line(format_args!("{} begins in {begins_s:.2} s", chosen.name()));
            // The program that holds the robot may meanwhile select another motion. Without a catalog, the end of the motion is
            // unknown.
            match chosen.motion {
                Some((node, motion)) => {
                    wait_for(session, chosen, node, ack.value)?;
                    if session.was_returned() {
                        return Ok(returned());
                    }
                    output::print_line(format_args!("playing {}", motion.name));
                }
                None => run_for(session, begins_s)?,
            }
            break;
        }
        match chosen.motion {
            Some((node, motion)) => {
                wait_for(session, chosen, node, ack.value)?;
                if session.was_returned() {
                    return Ok(returned());
                }
                output::print_line(format_args!("playing {}", motion.name));
                // The controller acknowledges a loop that already plays with a delay of 0.
                if !finish(session, chosen, motion, speed_64ths, ack.value == 0)? {
                    output::print_line(
                        "another program has ended the motion: nothing more is played",
                    );
                    return Ok(PlayEnd::Replaced);
                }
            }
            // Without a catalog, the duration is unknown.
            None => {
                output::print_line(format_args!("playing {}", chosen.name()));
                run_for(session, begins_s + chosen.seconds.unwrap_or(5.0))?;
            }
        }
        if session.was_returned() {
            return Ok(returned());
        }
    }
    Ok(PlayEnd::Whole)
}

/// Reports that another program returns the robot.
fn returned() -> PlayEnd {
    output::print_line("another program returns the robot to SAFE: nothing more is played");
    PlayEnd::Returned
}

/// Waits until the motion has begun, or another program returns the robot.
fn wait_for(
    session: &mut LiveSession,
    chosen: &SelectedMotion,
    node: usize,
    frames: u16,
) -> Result<(), SessionError> {
    // At 1/64 of the speed, frames take 64 times as long. The present motion may have to end first.
    let longest_us = u64::from(frames) * 64 * 1_000_000 / u64::from(RATE_HZ) + SLACK_US;
    let mut resting = 0;
    wait_also_while_paused(session, &format!("motion {}", chosen.name()), longest_us, |status| {
        let is_it = status.clip.map(usize::from) == Some(node);
        resting = if status.state == State::Ready { resting + 1 } else { 0 };
        match status.state {
            State::Playing | State::Ready | State::Paused if is_it => Some(true),
            // In a robot that rests, a selected motion begins at once.
            State::Ready if resting > RESTING => Some(false),
            State::Playing | State::Ready | State::Paused | State::Aligning => None,
            _ => Some(false),
        }
    })
}

/// Waits for the end of a finite motion. A loop plays for its requested time and then to the end of its cycle. Returns false if
/// another program has ended the loop by another motion.
fn finish(
    session: &mut LiveSession,
    chosen: &SelectedMotion,
    motion: &CatalogMotion,
    speed_64ths: i8,
    played_before: bool,
) -> Result<bool, SessionError> {
    let round = f64::from(motion.frames) / f64::from(RATE_HZ);
    let node = chosen.motion.map(|(node, _)| node);
    let is_it = |status: &&Status| status.clip.map(usize::from) == node;
    if motion.looping {
        let frame_s = 64.0 / (f64::from(RATE_HZ) * f64::from(speed_64ths));
        let at_s = |status: &Status| f64::from(status.frame) * frame_s;
        let begun_s = session.status().as_ref().filter(is_it).map_or(0.0, at_s);
        let round_s = f64::from(motion.frames) * frame_s;
        let wanted_s = chosen.seconds.unwrap_or(round_s);
        let mut playing = Loop::new(round_s, begun_s, wanted_s, played_before);
        let lead_s = LEAD_S.max(LEAD_FRAMES * frame_s);
        return run_while(session, node, |status, passed_s| {
            playing.pass(passed_s, status.filter(is_it).map(at_s));
            playing.left_s() - lead_s
        });
    }
    if let Some(seconds) = chosen.seconds {
        return run_for(session, seconds).map(|()| true);
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
    .map(|()| true)
}

/// Playback of a loop, in seconds at the actual playback speed.
struct Loop {
    /// Duration of a cycle, s.
    round_s: f64,
    /// Time within the motion, s, counted over all cycles since the first that was observed.
    position_s: f64,
    /// Time of the end of the cycle in which the requested time is over, s.
    end_s: f64,
}

impl Loop {
    /// Creates a loop that is at `at_s` within a cycle. If the loop `played_before`, the requested time starts there; otherwise
    /// it starts at the beginning of the cycle.
    fn new(round_s: f64, at_s: f64, wanted_s: f64, played_before: bool) -> Self {
        let begun_s = if played_before { at_s } else { 0.0 };
        let rounds = ((begun_s + wanted_s) / round_s - ROUNDS_TOLERANCE).ceil();
        Self { round_s, position_s: at_s, end_s: rounds * round_s }
    }

    /// Advances by the time on this computer's clock, and corrects to the position that the controller reports. The two clocks
    /// differ by less than half a cycle between calls.
    fn pass(&mut self, passed_s: f64, at_s: Option<f64>) {
        self.position_s += passed_s;
        if let Some(at_s) = at_s {
            let rounds = ((self.position_s - at_s) / self.round_s).round();
            self.position_s = rounds * self.round_s + at_s;
        }
    }

    fn left_s(&self) -> f64 {
        self.end_s - self.position_s
    }
}

/// Pauses by other programs.
#[derive(Default)]
struct Pauses(bool);

impl Pauses {
    /// True if the robot is paused; reports the start of a pause.
    fn check(&mut self, status: Option<&Status>) -> bool {
        let is_paused = status.is_some_and(|status| status.state == State::Paused);
        if is_paused && !self.0 {
            output::print_line(
                "paused by another program; type `rollwalk resume` to continue, or `rollwalk \
                 return` to return to SAFE",
            );
        }
        self.0 = is_paused;
        is_paused
    }
}

/// Reader of the controller's statuses that detects pauses and silence.
#[derive(Default)]
struct StatusReader {
    pauses: Pauses,
    /// Time since the previous status, s.
    silent_s: f64,
}

impl StatusReader {
    /// Waits for the next status. Also returns the playing time during the wait, s; pauses are not counted.
    ///
    /// # Errors
    /// Returns an error of the session, or an error if the controller is silent.
    fn next(
        &mut self,
        session: &mut LiveSession,
        longest_s: f64,
    ) -> Result<(Option<Status>, f64), SessionError> {
        let before_us = session.bus().now_us();
        let status = session.next_status(micros(longest_s))?;
        // A wait may last longer than requested.
        let waited_s = session.bus().now_us().saturating_sub(before_us) as f64 * 1e-6;
        self.silent_s = if status.is_some() { 0.0 } else { self.silent_s + waited_s };
        if self.silent_s > SILENT_S {
            return Err(session.silent());
        }
        let is_paused = self.pauses.check(session.status().as_ref());
        Ok((status, if is_paused { 0.0 } else { waited_s }))
    }
}

/// Waits for a status. Paused time does not count towards the timeout, because a timeout would make a paused robot move.
fn wait_also_while_paused(
    session: &mut LiveSession,
    what: &str,
    longest_us: u64,
    mut reached: impl FnMut(&Status) -> Option<bool>,
) -> Result<(), SessionError> {
    let (waited_s, mut played_s, mut hearing) =
        (longest_us as f64 * 1e-6, 0.0, StatusReader::default());
    loop {
        let (status, passed_s) = hearing.next(session, PORTION_S)?;
        played_s += passed_s;
        let Some(status) = status else { continue };
        if session.was_returned() {
            return Ok(());
        }
        let waited_for = what.into();
        match reached(&status) {
            Some(true) => return Ok(()),
            Some(false) => return Err(SessionError::WentElsewhere { waited_for, status }),
            None if played_s > waited_s => {
                return Err(SessionError::TookTooLong { waited_for, waited_s, status });
            }
            None => {}
        }
    }
}

/// Waits while the robot plays for a duration; pauses are not counted.
fn run_for(session: &mut LiveSession, duration_s: f64) -> Result<(), SessionError> {
    let mut left_s = duration_s;
    run_while(session, None, |_, passed_s| {
        left_s -= passed_s;
        left_s
    })
    .map(|_| ())
}

/// Waits while the robot plays, until `left_s` returns 0 or less.
///
/// `left_s` receives the new status, if any, and the playing time since its previous call, without pauses. The wait ends early
/// on Ctrl-C, if another program returns the robot, if the robot stops by itself, and if the controller is silent. `repeats` is
/// the node of a loop, which does not end by itself: a robot that leaves it was commanded by another program, and the function
/// returns false.
fn run_while(
    session: &mut LiveSession,
    repeats: Option<usize>,
    mut left_s: impl FnMut(Option<&Status>, f64) -> f64,
) -> Result<bool, SessionError> {
    let (mut passed_s, mut hearing) = (0.0, StatusReader::default());
    let mut status = session.status();
    while !interrupt::requested() && !session.was_returned() {
        let left_s = left_s(status.as_ref(), passed_s);
        if left_s <= 0.0 {
            break;
        }
        (status, passed_s) = hearing.next(session, left_s.min(PORTION_S))?;
        // After a stall of this program, the elapsed time is that of the newest status.
        while let Some(newer) = session.next_status(0)? {
            status = Some(newer);
        }
        let Some(status) = status else { continue };
        let waited_for = "the end of the motion".into();
        match status.state {
            State::Playing | State::Ready | State::Returning
                if repeats.is_some() && status.clip.map(usize::from) != repeats =>
            {
                return Ok(session.was_returned());
            }
            State::Playing | State::Ready | State::Returning | State::Paused | State::Aligning => {}
            _ => return Err(SessionError::WentElsewhere { waited_for, status }),
        }
    }
    Ok(true)
}

fn micros(seconds: f64) -> u64 {
    (seconds * 1e6) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the cycle after which the robot leaves a loop. `rate` is the speed of the controller's clock relative to this
    /// clock, and `old_s` the age of its reports, s.
    fn left_in_round(wanted_s: f64, at_s: f64, rate: f64, old_s: f64, lead_s: f64) -> f64 {
        let round_s = 1.6;
        let mut playing = Loop::new(round_s, at_s, wanted_s, false);
        let (mut truth_s, mut passed_s) = (at_s, 0.0);
        loop {
            let said_s = (truth_s - old_s).max(0.0) % round_s;
            playing.pass(passed_s, Some(said_s));
            let left_s = playing.left_s() - lead_s;
            if left_s <= 0.0 {
                return (truth_s / round_s).ceil();
            }
            passed_s = left_s.clamp(0.01, PORTION_S);
            truth_s += rate * passed_s;
        }
    }

    #[test]
    fn what_follows_a_loop_is_asked_for_in_the_last_round_that_was_wanted() {
        for (wanted_s, rounds) in [(1.6, 1.0), (1.7, 2.0), (3.2, 2.0), (4.0, 3.0), (480.0, 300.0)] {
            for (at_s, rate, old_s) in
                [(0.0, 1.0, 0.0), (0.05, 1.0, 0.05), (0.2, 0.5, 0.05), (0.0, 1.02, 0.1)]
            {
                let left = left_in_round(wanted_s, at_s, rate, old_s, LEAD_S);
                assert_eq!(left, rounds, "{wanted_s} s from {at_s} s at {rate}");
            }
        }
    }

    #[test]
    fn a_loop_that_plays_already_goes_on_for_so_long_from_now() {
        // From 1.15 s to the end of the second round.
        let mut old = Loop::new(1.6, 1.15, 1.6, true);
        assert!((old.left_s() - (3.2 - 1.15)).abs() < 1e-9);
        // Without a new status, only time counts; a pause does not.
        old.pass(1.0, None);
        old.pass(0.0, Some(0.55));
        assert!((old.left_s() - (3.2 - 2.15)).abs() < 1e-9);
    }
}
