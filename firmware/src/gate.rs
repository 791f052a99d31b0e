//! Admission of commands: at most once, in order and unexpired. ARM and CLEAR require two steps, with a nonce.

use rollwalk_protocol::wire::{Action, Command, CommandAck, CommandResult};

/// Increment between nonces. It is odd, so that the sequence has the full period. It is large, so that successive nonces differ
/// in many bits.
const NONCE_STEP: u16 = 0x9E37;
/// Lifetime of a nonce, µs.
const NONCE_LIFE_US: u64 = 2_000_000;

/// Decision on a received command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Execute the command, then call [`Gate::answered`].
    Execute,
    /// Repeat the given answer, because the command was answered before.
    Repeat(CommandAck),
    /// Refuse the command with the given result.
    Refuse(CommandResult),
}

/// Command that a nonce confirms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Permit {
    /// Arming, which switches torque on.
    Arm,
    /// Clearing of a latched state.
    Clear,
}

#[derive(Clone, Copy, Debug)]
struct Nonce {
    permit: Permit,
    value: u16,
    until_us: u64,
}

/// Number of sequence numbers.
const NUMBERS: usize = 16;

/// Recent commands, the answer to the latest one, and the pending nonce.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gate {
    last: Option<(Command, CommandAck)>,
    /// Latest command of each sequence number. A host reuses a number only after the earlier command has expired, so older
    /// commands with that number are refused as expired.
    known: [Option<Command>; NUMBERS],
    nonce: Option<Nonce>,
    /// Latest nonce that was drawn.
    drawn: Option<u16>,
}

impl Gate {
    /// Decides on a received command.
    pub fn judge(&self, now_us: u64, command: Command) -> Verdict {
        if let Some((last, ack)) = self.last {
            // A number 1 to 8 ahead, modulo 16, is newer.
            match command.seq.wrapping_sub(last.seq) & 0xF {
                0 if command == last => return Verdict::Repeat(ack),
                // The number of a copy that was delayed for long may be ahead although the command has been answered.
                1..=8 if !self.is_known(command) => {}
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

    fn is_known(&self, command: Command) -> bool {
        self.known.get(usize::from(command.seq)).is_some_and(|known| *known == Some(command))
    }

    /// Records a command and its answer. Expired and out-of-order commands do not advance the sequence.
    pub fn answered(&mut self, now_us: u64, command: Command, ack: CommandAck) {
        if command.expired(now_us) {
            return;
        }
        if ack.result != CommandResult::OutOfOrder {
            self.last = Some((command, ack));
        }
        // An out-of-order command is remembered too, so that a later copy of it is not executed.
        if let Some(known) = self.known.get_mut(usize::from(command.seq)) {
            *known = Some(command);
        }
    }

    /// Draws a new nonce and voids the previous one.
    ///
    /// A nonce is not a secret: it proves that the confirming host received the answer to a recent request. The sequence
    /// repeats only after all 65,536 values.
    pub fn draw(&mut self, now_us: u64, permit: Permit) -> u16 {
        // The first nonce is a multiplicative hash (Knuth) of the time, so that it differs from start to start.
        let first = || ((now_us as u32).wrapping_mul(0x9E37_79B1) >> 16) as u16;
        let value = self.drawn.map_or_else(first, |last| last.wrapping_add(NONCE_STEP));
        self.drawn = Some(value);
        self.nonce = Some(Nonce { permit, value, until_us: now_us.saturating_add(NONCE_LIFE_US) });
        value
    }

    /// Returns true if `value` is the pending nonce for `permit`, and voids the nonce in any case.
    pub fn redeem(&mut self, now_us: u64, permit: Permit, value: u16) -> bool {
        self.nonce.take().is_some_and(|nonce| {
            nonce.permit == permit && nonce.value == value && now_us <= nonce.until_us
        })
    }

    /// Voids the nonce because its preconditions changed.
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
        gate.answered(0, first, answer);
        for _ in 0..3 {
            assert_eq!(gate.judge(0, first), Verdict::Repeat(answer));
        }
        // Another command with the same number is refused, not answered as a repetition.
        assert_eq!(gate.judge(0, play(15, 2)), Verdict::Refuse(CommandResult::OutOfOrder));
        assert_eq!(gate.judge(0, play(0, 2)), Verdict::Execute);
        assert_eq!(gate.judge(0, play(7, 2)), Verdict::Execute);
        assert_eq!(gate.judge(0, play(8, 2)), Verdict::Refuse(CommandResult::OutOfOrder));
        assert_eq!(gate.judge(0, play(14, 2)), Verdict::Refuse(CommandResult::OutOfOrder));
    }

    #[test]
    fn a_refusal_for_its_order_does_not_move_the_order() {
        let mut gate = Gate::default();
        gate.answered(0, play(3, 1), ack(play(3, 1), CommandResult::Ok));
        gate.answered(0, play(2, 1), ack(play(2, 1), CommandResult::OutOfOrder));
        assert_eq!(gate.judge(0, play(4, 1)), Verdict::Execute);
    }

    #[test]
    fn what_comes_too_late_does_not_move_the_order_either() {
        let mut gate = Gate::default();
        let last = Command { valid_until_ms: 900, ..play(3, 1) };
        gate.answered(600_000, last, ack(last, CommandResult::Ok));
        // A copy of an old command, whose number would be ahead.
        assert_eq!(gate.judge(600_000, play(9, 1)), Verdict::Refuse(CommandResult::Expired));
        gate.answered(600_000, play(9, 1), ack(play(9, 1), CommandResult::Expired));
        let next = Command { valid_until_ms: 900, ..play(4, 1) };
        assert_eq!(gate.judge(600_000, next), Verdict::Execute);
    }

    /// Refuses a copy of any earlier command. The fault campaign found that a copy from nine or more commands before counted as
    /// new, because its sequence number, modulo 16, was ahead.
    #[test]
    fn a_copy_is_refused_from_however_far_back() {
        for back in 1..16 {
            let mut gate = Gate::default();
            let command = |n: u16| Command { valid_until_ms: 500 + n, ..play((n & 0xF) as u8, 1) };
            // Two commands with each number, the first of which has expired by the time of the second.
            for n in 0..32 {
                let now_us = if n < 16 { 0 } else { 516_000 };
                let command = Command {
                    valid_until_ms: if n < 16 { 500 + n } else { 1000 + n },
                    ..command(n)
                };
                assert_eq!(gate.judge(now_us, command), Verdict::Execute, "{n}");
                gate.answered(now_us, command, ack(command, CommandResult::Ok));
            }
            let n = 31 - back;
            let valid_until_ms = if n < 16 { 500 + n } else { 1000 + n };
            let copy = Command { valid_until_ms, ..command(n) };
            let refused = Verdict::Refuse(CommandResult::OutOfOrder);
            assert_eq!(gate.judge(516_000, copy), refused, "{back} back");
        }
    }

    #[test]
    fn what_was_overtaken_stays_refused() {
        let mut gate = Gate::default();
        gate.answered(0, play(1, 1), ack(play(1, 1), CommandResult::Ok));
        let late = play(0, 1);
        assert_eq!(gate.judge(0, late), Verdict::Refuse(CommandResult::OutOfOrder));
        gate.answered(0, late, ack(late, CommandResult::OutOfOrder));
        for seq in 2..11 {
            gate.answered(0, play(seq, 2), ack(play(seq, 2), CommandResult::Ok));
        }
        // The number of the late command is now 6 ahead of the latest.
        assert_eq!(gate.judge(0, late), Verdict::Refuse(CommandResult::OutOfOrder));
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
    }

    /// A repeated nonce would make a copy of an old confirmation valid again.
    #[test]
    fn no_nonce_comes_again_before_all_others() {
        let mut gate = Gate::default();
        let mut seen = [false; 1 << 16];
        for draw in 0..1 << 16 {
            // The first 40,000 times differ, later ones repeat.
            let now_us = draw % 40_000 * 58_123;
            let nonce = gate.draw(now_us, Permit::Arm);
            assert!(!core::mem::replace(&mut seen[usize::from(nonce)], true), "{draw}: {nonce}");
        }
    }
}
