//! Whether a second step of arming repeats what the controller has told, in time, and nothing has made it void.
//!
//! Only what is certain outside counts: a nonce is younger than its acknowledgement makes it, and what is void here
//! is void there. Parameters make a nonce void as well; that is left to the firmware's own tests.

use rollwalk_protocol::wire::transport::Request;
use rollwalk_protocol::wire::{Action, CommandAck, CommandResult};
use rollwalk_sim_host::clock::SimTime;

/// A nonce can be confirmed for so long.
const LIFE: SimTime = SimTime::from_ms(2000);

/// The nonces that the controller has told.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nonces {
    /// The one that can be confirmed, and when it was told.
    good: Option<(u16, SimTime)>,
    /// The last that was told, which a repeated answer tells again.
    last: Option<u16>,
}

impl Nonces {
    /// Something has made the nonce void.
    pub fn void(&mut self) {
        self.good = None;
    }

    /// A second step of arming comes to the controller: whether torque may go on. A nonce is good once.
    pub fn confirms(&mut self, at: SimTime, nonce: u16) -> bool {
        let good = self.good.is_some_and(|(value, told)| value == nonce && at - told <= LIFE);
        if good {
            self.void();
        }
        good
    }

    /// The controller answers a command. Answers leave in the order in which commands were executed.
    pub fn on_ack(&mut self, at: SimTime, ack: CommandAck) {
        let is = |action: Action, result| ack.kind == action.kind() && ack.result == result;
        if is(Action::ArmRequest, CommandResult::Ok) {
            if self.last.replace(ack.value) != Some(ack.value) {
                self.good = Some((ack.value, at));
            }
        } else if is(Action::Disarm, CommandResult::Ok)
            || is(Action::ClearRequest, CommandResult::Ok)
            || is(Action::ArmConfirm { nonce: 0 }, CommandResult::WrongNonce)
        {
            self.void();
        }
    }

    /// A frame of the transport comes to the controller. Requests of a single frame are sure to be taken.
    pub fn on_transport(&mut self, data: &[u8]) {
        let Some((&[length], message)) = data.split_first_chunk() else { return };
        let single = (1..=7).contains(&length).then(|| message.get(..usize::from(length)));
        if let Some(Ok(Request::Finish | Request::Activate { .. })) =
            single.flatten().map(Request::decode)
        {
            self.void();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::wire::State;

    fn ack(action: Action, result: CommandResult, value: u16) -> CommandAck {
        let (seq, state, motion) = (1, State::Disarmed, None);
        CommandAck { seq, kind: action.kind(), result, state, motion, value }
    }

    fn told(nonce: u16) -> Nonces {
        let mut nonces = Nonces::default();
        nonces.on_ack(SimTime::ZERO, ack(Action::ArmRequest, CommandResult::Ok, nonce));
        nonces
    }

    #[test]
    fn a_nonce_is_good_once_and_for_two_seconds() {
        let mut nonces = told(7);
        assert!(!nonces.confirms(SimTime::ZERO, 8));
        assert!(nonces.confirms(SimTime::from_ms(2000), 7));
        assert!(!nonces.confirms(SimTime::from_ms(2000), 7));
        assert!(!told(7).confirms(SimTime::from_ms(2001), 7));
        // The same answer again makes it no younger.
        let mut nonces = told(7);
        nonces.on_ack(SimTime::from_ms(500), ack(Action::ArmRequest, CommandResult::Ok, 7));
        assert!(!nonces.confirms(SimTime::from_ms(2001), 7));
    }

    #[test]
    fn what_makes_it_void() {
        type Happens = fn(&mut Nonces);
        let all: [Happens; 7] = [
            Nonces::void,
            |nonces| nonces.on_ack(SimTime::ZERO, ack(Action::Disarm, CommandResult::Ok, 0)),
            |nonces| nonces.on_ack(SimTime::ZERO, ack(Action::ClearRequest, CommandResult::Ok, 9)),
            |nonces| nonces.on_ack(SimTime::ZERO, ack(Action::ArmRequest, CommandResult::Ok, 9)),
            |nonces| {
                let action = Action::ArmConfirm { nonce: 8 };
                nonces.on_ack(SimTime::ZERO, ack(action, CommandResult::WrongNonce, 0));
            },
            |nonces| nonces.on_transport(&[1, 0x12]),
            |nonces| nonces.on_transport(&[5, 0x13, 1, 2, 3, 4, 0xAA, 0xAA]),
        ];
        for (number, happens) in all.into_iter().enumerate() {
            let mut nonces = told(7);
            happens(&mut nonces);
            assert!(!nonces.confirms(SimTime::ZERO, 7), "{number}");
        }
        let harmless: [&[u8]; 4] =
            [&[], &[3, 1, 1, 1], &[0x10, 9, 0x10, 0, 0, 0, 0, 0], &[7, 0x12]];
        for data in harmless {
            let mut nonces = told(7);
            nonces.on_transport(data);
            assert!(nonces.confirms(SimTime::ZERO, 7), "{data:?}");
        }
    }
}
