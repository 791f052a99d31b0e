//! The gate for commands: each one at most once, in order, in time, and the dangerous ones in two
//! steps.

use rollwalk_protocol::wire::{Action, Command, CommandAck, CommandResult};

/// How long a nonce can be confirmed, µs.
const NONCE_LIFE_US: u64 = 2_000_000;

/// What is to be done with a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Execute it, then [`Gate::executed`].
    Execute,
    /// Answer with this again: it was executed before.
    Repeat(CommandAck),
    /// Answer with this result and do nothing.
    Refuse(CommandResult),
}

/// What a nonce is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Permit {
    /// Torque on.
    Arm,
    /// Out of a latched state.
    Clear,
}

#[derive(Clone, Copy, Debug)]
struct Nonce {
    permit: Permit,
    value: u16,
    until_us: u64,
}

/// Remembers the last command and the nonce that is out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gate {
    last: Option<(Command, CommandAck)>,
    nonce: Option<Nonce>,
    drawn: u32,
}

impl Gate {
    /// Judges a command that came in.
    pub fn judge(&self, now_us: u64, command: Command) -> Verdict {
        if let Some((last, ack)) = self.last {
            // Ahead by 1 to 8 is newer; sequence numbers go round at 16.
            match command.seq.wrapping_sub(last.seq) & 0xF {
                0 if command == last => return Verdict::Repeat(ack),
                1..=8 => {}
                _ => return Verdict::Refuse(CommandResult::OutOfOrder),
            }
        }
        if matches!(command.action, Action::Unknown { .. }) {
            return Verdict::Refuse(CommandResult::UnknownKind);
        }
        if command.expired(now_us) {
            return Verdict::Refuse(CommandResult::Expired);
        }
        Verdict::Execute
    }

    /// Remembers a command and its answer, executed or refused for its content.
    pub fn executed(&mut self, command: Command, ack: CommandAck) {
        if ack.result != CommandResult::OutOfOrder {
            self.last = Some((command, ack));
        }
    }

    /// A new nonce; the one before is void. Not a secret: it proves that whoever confirms has heard
    /// the answer to a request made just now.
    pub fn draw(&mut self, now_us: u64, permit: Permit) -> u16 {
        self.drawn = self.drawn.wrapping_add(1);
        // Multiplicative hashing (Knuth): consecutive draws and times give unlike numbers.
        let mixed = (now_us as u32 ^ self.drawn.rotate_left(16)).wrapping_mul(0x9E37_79B1);
        let value = (mixed >> 16) as u16;
        self.nonce = Some(Nonce { permit, value, until_us: now_us.saturating_add(NONCE_LIFE_US) });
        value
    }

    /// Whether the nonce is the one that is out. It is void afterwards, right or wrong.
    pub fn redeem(&mut self, now_us: u64, permit: Permit, value: u16) -> bool {
        self.nonce.take().is_some_and(|nonce| {
            nonce.permit == permit && nonce.value == value && now_us <= nonce.until_us
        })
    }

    /// Makes the nonce void: what it was asked for no longer holds.
    pub fn void(&mut self) {
        self.nonce = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::wire::State;

    fn play(seq: u8, code: u8) -> Command {
        Command { seq, action: Action::Play { code, speed_64ths: 64 }, valid_until_ms: 500 }
    }

    fn ack(command: Command, result: CommandResult) -> CommandAck {
        CommandAck {
            seq: command.seq,
            kind: command.action.kind(),
            result,
            state: State::Ready,
            motion: None,
            value: 0,
        }
    }

    #[test]
    fn each_command_passes_once() {
        let mut gate = Gate::default();
        let first = play(15, 1);
        assert_eq!(gate.judge(0, first), Verdict::Execute);
        let answer = ack(first, CommandResult::Ok);
        gate.executed(first, answer);
        for _ in 0..3 {
            assert_eq!(gate.judge(0, first), Verdict::Repeat(answer));
        }
        // The number alone is no proof: another command under it is refused, not taken for done.
        assert_eq!(gate.judge(0, play(15, 2)), Verdict::Refuse(CommandResult::OutOfOrder));
        assert_eq!(gate.judge(0, play(0, 2)), Verdict::Execute);
        assert_eq!(gate.judge(0, play(7, 2)), Verdict::Execute);
        assert_eq!(gate.judge(0, play(8, 2)), Verdict::Refuse(CommandResult::OutOfOrder));
        assert_eq!(gate.judge(0, play(14, 2)), Verdict::Refuse(CommandResult::OutOfOrder));
    }

    #[test]
    fn a_refusal_for_its_order_does_not_move_the_order() {
        let mut gate = Gate::default();
        gate.executed(play(3, 1), ack(play(3, 1), CommandResult::Ok));
        gate.executed(play(2, 1), ack(play(2, 1), CommandResult::OutOfOrder));
        assert_eq!(gate.judge(0, play(4, 1)), Verdict::Execute);
    }

    #[test]
    fn late_or_unknown_commands_do_not_pass() {
        let gate = Gate::default();
        assert_eq!(gate.judge(500_999, play(0, 1)), Verdict::Execute);
        assert_eq!(gate.judge(501_000, play(0, 1)), Verdict::Refuse(CommandResult::Expired));
        let unknown = Command { action: Action::Unknown { kind: 12 }, ..play(0, 1) };
        assert_eq!(gate.judge(0, unknown), Verdict::Refuse(CommandResult::UnknownKind));
    }

    #[test]
    fn a_nonce_is_good_once_for_its_purpose_and_for_a_while() {
        let mut gate = Gate::default();
        assert!(!gate.redeem(0, Permit::Arm, 0));
        let nonce = gate.draw(10, Permit::Arm);
        assert!(gate.redeem(20, Permit::Arm, nonce));
        assert!(!gate.redeem(20, Permit::Arm, nonce));
        let nonce = gate.draw(10, Permit::Arm);
        assert!(!gate.redeem(20, Permit::Clear, nonce));
        let nonce = gate.draw(10, Permit::Clear);
        assert!(!gate.redeem(20, Permit::Clear, nonce ^ 1));
        assert!(!gate.redeem(20, Permit::Clear, nonce));
        let nonce = gate.draw(10, Permit::Arm);
        assert!(!gate.redeem(11 + NONCE_LIFE_US, Permit::Arm, nonce));
        let nonce = gate.draw(10, Permit::Arm);
        gate.void();
        assert!(!gate.redeem(11, Permit::Arm, nonce));
        assert_ne!(gate.draw(10, Permit::Arm), gate.draw(10, Permit::Arm));
    }
}
