//! Commands against what came of them: each at most once, in order, and none after its time.

use super::Rule;
use rollwalk_protocol::wire::{Action, Command, CommandAck, CommandResult};
use rollwalk_sim_host::clock::SimTime;
use std::collections::VecDeque;

/// A command, and when it expires, ms: not only the 16 bits of it that are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Dated {
    command: Command,
    expires_ms: u64,
}

impl Dated {
    /// One that is made at an instant expires soon before or after it.
    fn at(at: SimTime, command: Command) -> Self {
        let now_ms = at.as_us() / 1000;
        let ahead_ms = command.valid_until_ms.wrapping_sub(now_ms as u16) as i16;
        Self { command, expires_ms: now_ms.saturating_add_signed(ahead_ms.into()) }
    }
}

/// A command that came to the controller, once or several times.
#[derive(Clone, Copy, Debug)]
struct Known {
    dated: Dated,
    /// It came within its time at least once.
    in_time: bool,
    /// The first "ok" that it was answered with.
    done: Option<CommandAck>,
    goal: Goal,
}

/// What a command to play a motion may still bring about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Goal {
    /// The motion may begin.
    Open,
    /// Another goal took its place when so many motions had begun. The motion may be the next to begin, for the
    /// transition to it is finished first, and none after that.
    Replaced { begun: usize },
    /// The motion has begun, or torque went off.
    Over,
}

/// A command that came and is not answered yet.
#[derive(Clone, Copy, Debug)]
struct Open {
    /// Its place in the list of the known.
    known: usize,
    in_time: bool,
}

/// What came to the controller, what it answered, and what was played.
#[derive(Clone, Debug)]
pub struct Commands {
    /// Codes of the library's motions, in its order.
    codes: Vec<u8>,
    /// How many motions have begun.
    begun: usize,
    /// What the host has sent.
    sent: Vec<Dated>,
    known: Vec<Known>,
    /// Answers come in this order; some are dropped when many wait.
    open: VecDeque<Open>,
    /// The last that was done for the first time.
    last_done: Option<usize>,
}

impl Commands {
    /// None yet.
    pub fn new(codes: Vec<u8>) -> Self {
        let (sent, known) = (Vec::new(), Vec::new());
        Self { begun: 0, codes, sent, known, open: VecDeque::new(), last_done: None }
    }

    /// The host sends a command, for the first time or again.
    pub fn is_sent(&mut self, at: SimTime, command: Command) {
        let dated = Dated::at(at, command);
        if !self.sent.contains(&dated) {
            self.sent.push(dated);
        }
    }

    /// A command comes to the controller. Whether it is another than all before.
    pub fn arrives(&mut self, at: SimTime, command: Command) -> bool {
        // However long it was under way. What the host has not sent is taken for new.
        let sent = self.sent.iter().rev().find(|sent| sent.command == command);
        let dated = sent.copied().unwrap_or(Dated::at(at, command));
        let in_time = at.as_us() / 1000 <= dated.expires_ms;
        let known = self.known.iter().position(|known| known.dated == dated);
        let place = known.unwrap_or(self.known.len());
        match known {
            Some(place) => self.known[place].in_time |= in_time,
            None => self.known.push(Known { dated, in_time, done: None, goal: Goal::Open }),
        }
        self.open.push_back(Open { known: place, in_time });
        known.is_none()
    }

    /// The controller answers a command.
    ///
    /// # Errors
    /// The rule that it breaks, and how.
    pub fn is_answered(&mut self, ack: CommandAck) -> Result<(), (Rule, String)> {
        let fits = |open: &Open| {
            let Command { seq, action, .. } = self.known[open.known].dated.command;
            (seq, action.kind()) == (ack.seq, ack.kind)
        };
        let Some(place) = self.open.iter().position(fits) else {
            return Err((Rule::Once, format!("an answer that nobody has asked for: {ack:?}")));
        };
        let Open { known, in_time } = self.open[place];
        self.open.drain(..=place);
        let Known { dated: Dated { command, .. }, done, goal, .. } = &mut self.known[known];
        if ack.result != CommandResult::Ok {
            // These two may answer a copy of one that was done, or that comes in its time after this.
            let of_a_copy =
                matches!(ack.result, CommandResult::OutOfOrder | CommandResult::Expired);
            if done.is_none() && !of_a_copy {
                *goal = Goal::Over;
            }
            return Ok(());
        }
        match *done {
            // The last command again is answered again, and not executed: with the same answer.
            Some(first) if self.last_done == Some(known) && first == ack => Ok(()),
            Some(first) if self.last_done == Some(known) => {
                Err((Rule::Once, format!("{command:?} was answered by {first:?}, then by {ack:?}")))
            }
            Some(_) => Err((Rule::Once, format!("{command:?} was done before another, and again"))),
            None if !in_time => Err((Rule::NotExpired, format!("{command:?} is done too late"))),
            None => {
                *done = Some(ack);
                self.last_done = Some(known);
                if matches!(command.action, Action::Play { .. } | Action::Return) {
                    self.replace_goals(known);
                }
                Ok(())
            }
        }
    }

    /// The goals of all commands that came before this one have another in their place.
    fn replace_goals(&mut self, by: usize) {
        let begun = self.begun;
        for known in &mut self.known[..by] {
            if known.goal == Goal::Open {
                known.goal = Goal::Replaced { begun };
            }
        }
    }

    /// Torque is off: what was to be played is not played any more.
    pub fn torque_is_off(&mut self) {
        self.known.iter_mut().for_each(|known| known.goal = Goal::Over);
    }

    /// A clip begins.
    ///
    /// # Errors
    /// The rule that it breaks, and how.
    pub fn is_played(&mut self, clip: u8) -> Result<(), (Rule, String)> {
        let clip = usize::from(clip);
        // The others are transitions, which have no code.
        let Some(&code) = self.codes.get(clip) else { return Ok(()) };
        let begun = self.begun;
        self.begun += 1;
        // Into SAFE all ways lead, whatever was asked.
        if clip == 0 {
            return Ok(());
        }
        // That the answer has left says nothing: the link may be busy.
        let asks = |known: &&mut Known| {
            let play =
                matches!(known.dated.command.action, Action::Play { code: of, .. } if of == code);
            let may_begin = match known.goal {
                Goal::Open => true,
                Goal::Replaced { begun: then } => then == begun,
                Goal::Over => false,
            };
            play && known.in_time && may_begin
        };
        match self.known.iter_mut().find(asks) {
            Some(known) => {
                known.goal = Goal::Over;
                Ok(())
            }
            None => {
                Err((Rule::Once, format!("code {code} begins, and nobody asks for it any more")))
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

    /// What is wrong when these commands come, each at a time, and are all answered so.
    fn verdicts(come: &[(u64, Command, CommandResult)]) -> Vec<Option<Rule>> {
        let mut commands = Commands::new(vec![1, 2, 3]);
        let verdict = |&(at_ms, command, result): &(u64, Command, CommandResult)| {
            commands.arrives(SimTime::from_ms(at_ms), command);
            commands.is_answered(answer(command.seq, result)).err().map(|(rule, _)| rule)
        };
        come.iter().map(verdict).collect()
    }

    #[test]
    fn only_the_last_command_is_answered_again() {
        use CommandResult::{Ok as Done, OutOfOrder};
        let rules = verdicts(&[
            (0, play(1, 2), Done),
            (1, play(1, 2), Done),
            (2, play(2, 3), Done),
            (3, play(1, 2), OutOfOrder),
            (4, play(1, 2), Done),
        ]);
        assert_eq!(rules, [None, None, None, None, Some(Rule::Once)]);
    }

    #[test]
    fn after_its_time_it_may_be_answered_again_but_not_done() {
        use CommandResult::{Expired, Ok as Done};
        let late = verdicts(&[(501, play(1, 2), Expired), (502, play(1, 2), Done)]);
        assert_eq!(late, [None, Some(Rule::NotExpired)]);
        let again = verdicts(&[(500, play(1, 2), Done), (600, play(1, 2), Done)]);
        assert_eq!(again, [None, None]);
    }

    /// The 16 bits of its time have gone round.
    #[test]
    fn what_was_under_way_for_a_minute_is_late() {
        let mut commands = Commands::new(vec![1, 2, 3]);
        commands.is_sent(SimTime::ZERO, play(1, 2));
        commands.arrives(SimTime::from_ms(65_600), play(1, 2));
        let rule = commands.is_answered(answer(1, CommandResult::Ok)).unwrap_err().0;
        assert_eq!(rule, Rule::NotExpired);
        // The same bits once more, but another command.
        commands.is_sent(SimTime::from_ms(131_072), play(1, 2));
        commands.arrives(SimTime::from_ms(131_100), play(1, 2));
        assert!(commands.is_answered(answer(1, CommandResult::Ok)).is_ok());
    }

    #[test]
    fn nothing_is_begun_more_often_than_it_was_asked_for() {
        let mut commands = Commands::new(vec![1, 2, 3]);
        commands.arrives(SimTime::ZERO, play(1, 2));
        // The same again is no other.
        commands.arrives(SimTime::ZERO, play(1, 2));
        // SAFE, and a transition.
        assert!(commands.is_played(0).is_ok() && commands.is_played(7).is_ok());
        assert!(commands.is_played(1).is_ok());
        assert_eq!(commands.is_played(1).unwrap_err().0, Rule::Once);
        assert_eq!(commands.is_played(2).unwrap_err().0, Rule::Once);
    }

    #[test]
    fn what_was_refused_does_not_begin_later() {
        use CommandResult::{Expired, OutOfOrder, WrongState};
        let begins = |refusal| {
            let mut commands = Commands::new(vec![1, 2, 3]);
            commands.arrives(SimTime::ZERO, play(1, 2));
            commands.is_answered(answer(1, refusal)).unwrap();
            commands.is_played(1).err().map(|(rule, _)| rule)
        };
        assert_eq!(begins(WrongState), Some(Rule::Once));
        // A copy of one that is done may be answered so.
        assert_eq!([OutOfOrder, Expired].map(begins), [None, None]);
    }

    #[test]
    fn a_repeated_answer_is_the_first_once_more() {
        let mut commands = Commands::new(vec![1, 2, 3]);
        let first = answer(1, CommandResult::Ok);
        let mut rule = |ack| {
            commands.arrives(SimTime::ZERO, play(1, 2));
            commands.is_answered(ack).err().map(|(rule, _)| rule)
        };
        assert_eq!([rule(first), rule(first)], [None, None]);
        assert_eq!(rule(CommandAck { value: 3, ..first }), Some(Rule::Once));
    }

    #[test]
    fn what_another_goal_has_replaced_begins_next_or_never() {
        // Codes 1, 2, 3 are clips 0, 1, 2.
        let replaced = || {
            let mut commands = Commands::new(vec![1, 2, 3]);
            for (seq, code) in [(1, 2), (2, 3)] {
                commands.arrives(SimTime::ZERO, play(seq, code));
                commands.is_answered(answer(seq, CommandResult::Ok)).unwrap();
            }
            commands
        };
        // Its transition had begun.
        let mut commands = replaced();
        assert!(commands.is_played(1).is_ok() && commands.is_played(2).is_ok());
        assert_eq!(commands.is_played(1).unwrap_err().0, Rule::Once);
        let mut commands = replaced();
        assert!(commands.is_played(2).is_ok());
        assert_eq!(commands.is_played(1).unwrap_err().0, Rule::Once);
        let mut commands = replaced();
        commands.torque_is_off();
        assert_eq!(commands.is_played(2).unwrap_err().0, Rule::Once);
    }
}
