//! Checks of commands: the controller executes each command at most once, in order, and never after its expiry.

use super::Rule;
use rollwalk_protocol::wire::{Action, Command, CommandAck, CommandResult};
use rollwalk_sim_host::clock::SimTime;
use std::collections::VecDeque;

/// Command with its full expiry time, ms. The frame contains only the lower 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct TimedCommand {
    command: Command,
    expires_ms: u64,
}

impl TimedCommand {
    /// Extends the 16-bit expiry to the full time nearest to `at`.
    fn at(at: SimTime, command: Command) -> Self {
        let now_ms = at.as_us() / 1000;
        let ahead_ms = command.valid_until_ms.wrapping_sub(now_ms as u16) as i16;
        Self { command, expires_ms: now_ms.saturating_add_signed(ahead_ms.into()) }
    }
}

/// Command that the controller received, once or several times.
#[derive(Clone, Copy, Debug)]
struct ReceivedCommand {
    timed: TimedCommand,
    /// True if at least one copy arrived before the expiry.
    in_time: bool,
    /// First acknowledgement with "ok".
    executed: Option<CommandAck>,
    goal: PlayProgress,
}

/// Progress of a PLAY command towards the start of its motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PlayProgress {
    /// The motion may start.
    Pending,
    /// Another command has superseded the goal, after the robot had started `starts` motions. The motion may still start once,
    /// because a running transition completes first.
    Superseded { starts: usize },
    /// The motion has started, or torque went off.
    Over,
}

/// Received command that has not been acknowledged yet.
#[derive(Clone, Copy, Debug)]
struct PendingCommand {
    /// Index into [`Commands::received`].
    index: usize,
    in_time: bool,
}

/// History of received commands, acknowledgements and motion starts.
#[derive(Clone, Debug)]
pub struct Commands {
    /// Command codes of the library's motions, in the order of the library.
    codes: Vec<u8>,
    /// Pairs of goal and intermediate motion.
    on_the_way: Vec<(u8, u8)>,
    /// Number of motion starts so far, without transitions.
    starts: usize,
    /// Commands sent by the host.
    sent: Vec<TimedCommand>,
    received: Vec<ReceivedCommand>,
    /// Received commands in the order in which they will be acknowledged. A full queue drops some acknowledgements.
    unanswered: VecDeque<PendingCommand>,
    /// Index of the command that was executed most recently.
    last_executed: Option<usize>,
}

impl Commands {
    pub fn new(codes: Vec<u8>, on_the_way: Vec<(u8, u8)>) -> Self {
        Self {
            codes,
            on_the_way,
            starts: 0,
            sent: Vec::new(),
            received: Vec::new(),
            unanswered: VecDeque::new(),
            last_executed: None,
        }
    }

    /// Records a command that the host sends or resends.
    pub fn on_sent(&mut self, at: SimTime, command: Command) {
        let timed = TimedCommand::at(at, command);
        if !self.sent.contains(&timed) {
            self.sent.push(timed);
        }
    }

    /// Records a command that the controller receives. Returns true if it is the first copy.
    pub fn on_received(&mut self, at: SimTime, command: Command) -> bool {
        // A bridge may delay a command for any time. A command that the host has not sent counts as sent at this instant.
        let sent = self.sent.iter().rev().find(|sent| sent.command == command);
        let timed = sent.copied().unwrap_or(TimedCommand::at(at, command));
        let in_time = at.as_us() / 1000 <= timed.expires_ms;
        let copy_of = self.received.iter().position(|received| received.timed == timed);
        let index = copy_of.unwrap_or(self.received.len());
        match copy_of {
            Some(index) => self.received[index].in_time |= in_time,
            None => {
                let goal = PlayProgress::Pending;
                self.received.push(ReceivedCommand { timed, in_time, executed: None, goal });
            }
        }
        self.unanswered.push_back(PendingCommand { index, in_time });
        copy_of.is_none()
    }

    /// True if the robot may pass through a motion on its way to SAFE, which needs no command, or to the motion of a pending
    /// command.
    fn is_on_the_way(&self, clip: usize) -> bool {
        let pending = |goal: usize| {
            let plays = |received: &ReceivedCommand| {
                let code = self.codes.get(goal);
                let play = matches!(received.timed.command.action, Action::Play { code: of, .. } if Some(&of) == code);
                play && received.in_time && received.goal != PlayProgress::Over
            };
            goal == 0 || self.received.iter().any(plays)
        };
        let mut ways = self.on_the_way.iter();
        ways.any(|&(goal, station)| usize::from(station) == clip && pending(goal.into()))
    }

    /// Checks an acknowledgement of the controller.
    ///
    /// # Errors
    /// Returns the broken rule and a description if the acknowledgement breaks a rule.
    pub fn on_ack(&mut self, ack: CommandAck) -> Result<(), (Rule, String)> {
        let fits = |unanswered: &PendingCommand| {
            let Command { seq, action, .. } = self.received[unanswered.index].timed.command;
            (seq, action.kind()) == (ack.seq, ack.kind)
        };
        let Some(place) = self.unanswered.iter().position(fits) else {
            return Err((
                Rule::ExecutedOnce,
                format!("acknowledgement without a command: {ack:?}"),
            ));
        };
        let PendingCommand { index, in_time } = self.unanswered[place];
        self.unanswered.drain(..=place);
        let ReceivedCommand { timed: TimedCommand { command, .. }, executed, goal, .. } =
            &mut self.received[index];
        if ack.result != CommandResult::Ok {
            // Both results may answer a copy of an executed command, even of a command that arrives in time later.
            let of_a_copy =
                matches!(ack.result, CommandResult::OutOfOrder | CommandResult::Expired);
            if executed.is_none() && !of_a_copy {
                *goal = PlayProgress::Over;
            }
            return Ok(());
        }
        let last = self.last_executed == Some(index);
        match *executed {
            // A copy of the last command gets the same acknowledgement and is not executed again.
            Some(first) if last && first == ack => Ok(()),
            Some(first) if last => {
                let what = format!("{command:?} acknowledged by {first:?}, then by {ack:?}");
                Err((Rule::ExecutedOnce, what))
            }
            Some(_) => {
                let what = format!("{command:?} executed again after another command");
                Err((Rule::ExecutedOnce, what))
            }
            None if !in_time => {
                Err((Rule::NotExpired, format!("{command:?} executed after its expiry")))
            }
            None => {
                *executed = Some(ack);
                self.last_executed = Some(index);
                if matches!(command.action, Action::Play { .. } | Action::Return) {
                    self.supersede_goals_before(index);
                }
                Ok(())
            }
        }
    }

    /// Supersedes the pending goals of all commands received before the one at `index`.
    fn supersede_goals_before(&mut self, index: usize) {
        let starts = self.starts;
        for received in &mut self.received[..index] {
            if received.goal == PlayProgress::Pending {
                received.goal = PlayProgress::Superseded { starts };
            }
        }
    }

    /// Ends all goals, because no motion starts without torque.
    pub fn on_torque_off(&mut self) {
        self.received.iter_mut().for_each(|received| received.goal = PlayProgress::Over);
    }

    /// Checks the start of a clip.
    ///
    /// # Errors
    /// Returns the broken rule and a description if the start breaks a rule.
    pub fn on_clip_start(&mut self, clip: u8) -> Result<(), (Rule, String)> {
        let clip = usize::from(clip);
        // Other clips are transitions, which have no code.
        let Some(&code) = self.codes.get(clip) else { return Ok(()) };
        let starts_before = self.starts;
        self.starts += 1;
        // The controller may return to SAFE without a command.
        if clip == 0 {
            return Ok(());
        }
        // The acknowledgement may still wait for a busy link.
        let requests = |received: &&mut ReceivedCommand| {
            let play = matches!(received.timed.command.action, Action::Play { code: of, .. } if of == code);
            let may_start = match received.goal {
                PlayProgress::Pending => true,
                PlayProgress::Superseded { starts } => starts == starts_before,
                PlayProgress::Over => false,
            };
            play && received.in_time && may_start
        };
        let passes = self.is_on_the_way(clip);
        match self.received.iter_mut().find(requests) {
            Some(received) => {
                received.goal = PlayProgress::Over;
                Ok(())
            }
            None if passes => Ok(()),
            None => {
                Err((Rule::ExecutedOnce, format!("code {code} starts without a pending command")))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::wire::State;

    fn play(seq: u8, code: u8) -> Command {
        Command { seq, action: Action::Play { code, speed_64ths: 64 }, valid_until_ms: 500 }
    }

    fn answer(seq: u8, result: CommandResult) -> CommandAck {
        CommandAck { seq, kind: 0, result, state: State::Ready, motion: None, value: 0 }
    }

    /// Rules that the acknowledgements break. Each command has a time of reception, ms, and a result.
    fn verdicts(received: &[(u64, Command, CommandResult)]) -> Vec<Option<Rule>> {
        let mut commands = Commands::new(vec![1, 2, 3], Vec::new());
        let verdict = |&(at_ms, command, result): &(u64, Command, CommandResult)| {
            commands.on_received(SimTime::from_ms(at_ms), command);
            commands.on_ack(answer(command.seq, result)).err().map(|(rule, _)| rule)
        };
        received.iter().map(verdict).collect()
    }

    #[test]
    fn only_the_last_command_is_acknowledged_again() {
        use CommandResult::{Ok as Done, OutOfOrder};
        let rules = verdicts(&[
            (0, play(1, 2), Done),
            (1, play(1, 2), Done),
            (2, play(2, 3), Done),
            (3, play(1, 2), OutOfOrder),
            (4, play(1, 2), Done),
        ]);
        assert_eq!(rules, [None, None, None, None, Some(Rule::ExecutedOnce)]);
    }

    #[test]
    fn an_expired_copy_may_be_acknowledged_but_not_executed() {
        use CommandResult::{Expired, Ok as Done};
        let late = verdicts(&[(501, play(1, 2), Expired), (502, play(1, 2), Done)]);
        assert_eq!(late, [None, Some(Rule::NotExpired)]);
        let again = verdicts(&[(500, play(1, 2), Done), (600, play(1, 2), Done)]);
        assert_eq!(again, [None, None]);
    }

    /// Tests expiry after the 16 bits have wrapped.
    #[test]
    fn a_command_delayed_by_a_minute_has_expired() {
        let mut commands = Commands::new(vec![1, 2, 3], Vec::new());
        commands.on_sent(SimTime::ZERO, play(1, 2));
        commands.on_received(SimTime::from_ms(65_600), play(1, 2));
        let rule = commands.on_ack(answer(1, CommandResult::Ok)).unwrap_err().0;
        assert_eq!(rule, Rule::NotExpired);
        // Another command with the same bits.
        commands.on_sent(SimTime::from_ms(131_072), play(1, 2));
        commands.on_received(SimTime::from_ms(131_100), play(1, 2));
        assert!(commands.on_ack(answer(1, CommandResult::Ok)).is_ok());
    }

    #[test]
    fn a_motion_may_be_passed_on_the_way_to_another() {
        // The robot passes motion 1 on its way to motion 2, but not on its way to SAFE.
        let mut commands = Commands::new(vec![1, 2, 3], vec![(2, 1)]);
        assert_eq!(commands.on_clip_start(1).unwrap_err().0, Rule::ExecutedOnce);
        commands.on_received(SimTime::ZERO, play(1, 3));
        assert!(commands.on_clip_start(1).is_ok() && commands.on_clip_start(2).is_ok());
        assert_eq!(commands.on_clip_start(1).unwrap_err().0, Rule::ExecutedOnce);
        // The robot moves to SAFE without a command.
        let mut commands = Commands::new(vec![1, 2, 3], vec![(0, 2)]);
        assert!(commands.on_clip_start(2).is_ok() && commands.on_clip_start(1).is_err());
    }

    #[test]
    fn a_motion_starts_once_a_command() {
        let mut commands = Commands::new(vec![1, 2, 3], Vec::new());
        commands.on_received(SimTime::ZERO, play(1, 2));
        // A copy requests nothing more.
        commands.on_received(SimTime::ZERO, play(1, 2));
        // Clip 0 is SAFE; clip 7 is a transition.
        assert!(commands.on_clip_start(0).is_ok() && commands.on_clip_start(7).is_ok());
        assert!(commands.on_clip_start(1).is_ok());
        assert_eq!(commands.on_clip_start(1).unwrap_err().0, Rule::ExecutedOnce);
        assert_eq!(commands.on_clip_start(2).unwrap_err().0, Rule::ExecutedOnce);
    }

    #[test]
    fn a_refused_motion_does_not_start_later() {
        use CommandResult::{Expired, OutOfOrder, WrongState};
        let start = |refusal| {
            let mut commands = Commands::new(vec![1, 2, 3], Vec::new());
            commands.on_received(SimTime::ZERO, play(1, 2));
            commands.on_ack(answer(1, refusal)).unwrap();
            commands.on_clip_start(1).err().map(|(rule, _)| rule)
        };
        assert_eq!(start(WrongState), Some(Rule::ExecutedOnce));
        // A copy of an executed command may be refused in these ways.
        assert_eq!([OutOfOrder, Expired].map(start), [None, None]);
    }

    #[test]
    fn a_repeated_acknowledgement_equals_the_first() {
        let mut commands = Commands::new(vec![1, 2, 3], Vec::new());
        let first = answer(1, CommandResult::Ok);
        let mut rule = |ack| {
            commands.on_received(SimTime::ZERO, play(1, 2));
            commands.on_ack(ack).err().map(|(rule, _)| rule)
        };
        assert_eq!([rule(first), rule(first)], [None, None]);
        assert_eq!(rule(CommandAck { value: 3, ..first }), Some(Rule::ExecutedOnce));
    }

    #[test]
    fn a_superseded_motion_starts_next_or_never() {
        // Codes 1, 2, 3 are clips 0, 1, 2.
        let superseded = || {
            let mut commands = Commands::new(vec![1, 2, 3], Vec::new());
            for (seq, code) in [(1, 2), (2, 3)] {
                commands.on_received(SimTime::ZERO, play(seq, code));
                commands.on_ack(answer(seq, CommandResult::Ok)).unwrap();
            }
            commands
        };
        // The transition to the superseded motion was running.
        let mut commands = superseded();
        assert!(commands.on_clip_start(1).is_ok() && commands.on_clip_start(2).is_ok());
        assert_eq!(commands.on_clip_start(1).unwrap_err().0, Rule::ExecutedOnce);
        let mut commands = superseded();
        assert!(commands.on_clip_start(2).is_ok());
        assert_eq!(commands.on_clip_start(1).unwrap_err().0, Rule::ExecutedOnce);
        let mut commands = superseded();
        commands.on_torque_off();
        assert_eq!(commands.on_clip_start(2).unwrap_err().0, Rule::ExecutedOnce);
    }
}
