//! Check of nonces: ARM_CONFIRM is accepted only with the latest unexpired, unrevoked nonce.
//!
//! The monitor is at most as strict as the controller must be. A nonce is valid for the monitor from its acknowledgement on,
//! and each revocation that the monitor observes also applies in the controller. Parameter changes revoke a nonce as well,
//! which the firmware's own tests cover.

use rollwalk_protocol::wire::transport::Request;
use rollwalk_protocol::wire::{Action, CommandAck, CommandResult};
use rollwalk_sim_host::clock::SimTime;

/// Time within which a nonce can be confirmed.
const LIFETIME: SimTime = SimTime::from_ms(2000);

/// Nonces of the controller's acknowledgements of ARM_REQUEST.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nonces {
    /// Nonce that can be confirmed, and the time of its acknowledgement.
    valid: Option<(u16, SimTime)>,
    /// Latest nonce, which repeated acknowledgements contain again.
    last: Option<u16>,
}

impl Nonces {
    pub fn revoke(&mut self) {
        self.valid = None;
    }

    /// True if an ARM_CONFIRM with the given nonce may switch torque on. The nonce is then used up.
    pub fn accept(&mut self, at: SimTime, nonce: u16) -> bool {
        let valid =
            self.valid.is_some_and(|(value, since)| value == nonce && at - since <= LIFETIME);
        if valid {
            self.revoke();
        }
        valid
    }

    /// Records an acknowledgement of the controller. Acknowledgements are sent in the order in which commands are executed.
    pub fn on_ack(&mut self, at: SimTime, ack: CommandAck) {
        let is = |action: Action, result| ack.kind == action.kind() && ack.result == result;
        if is(Action::ArmRequest, CommandResult::Ok) {
            if self.last.replace(ack.value) != Some(ack.value) {
                self.valid = Some((ack.value, at));
            }
        } else if is(Action::Disarm, CommandResult::Ok)
            || is(Action::ClearRequest, CommandResult::Ok)
            || is(Action::ArmConfirm { nonce: 0 }, CommandResult::WrongNonce)
        {
            self.revoke();
        }
    }

    /// Records a transport frame to the controller. Single-frame requests are always accepted and revoke the nonce.
    pub fn on_transport(&mut self, data: &[u8]) {
        let Some((&[length], message)) = data.split_first_chunk() else { return };
        let single = (1..=7).contains(&length).then(|| message.get(..usize::from(length)));
        if let Some(Ok(Request::Finish | Request::Activate { .. })) =
            single.flatten().map(Request::decode)
        {
            self.revoke();
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

    fn issued(nonce: u16) -> Nonces {
        let mut nonces = Nonces::default();
        nonces.on_ack(SimTime::ZERO, ack(Action::ArmRequest, CommandResult::Ok, nonce));
        nonces
    }

    #[test]
    fn a_nonce_is_valid_once_and_for_two_seconds() {
        let mut nonces = issued(7);
        assert!(!nonces.accept(SimTime::ZERO, 8));
        assert!(nonces.accept(SimTime::from_ms(2000), 7));
        assert!(!nonces.accept(SimTime::from_ms(2000), 7));
        assert!(!issued(7).accept(SimTime::from_ms(2001), 7));
        // A repeated acknowledgement does not extend the lifetime of a nonce.
        let mut nonces = issued(7);
        nonces.on_ack(SimTime::from_ms(500), ack(Action::ArmRequest, CommandResult::Ok, 7));
        assert!(!nonces.accept(SimTime::from_ms(2001), 7));
    }

    #[test]
    fn commands_and_transfers_revoke_it() {
        type NonceEvent = fn(&mut Nonces);
        let all: [NonceEvent; 7] = [
            Nonces::revoke,
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
            let mut nonces = issued(7);
            happens(&mut nonces);
            assert!(!nonces.accept(SimTime::ZERO, 7), "{number}");
        }
        let harmless: [&[u8]; 4] =
            [&[], &[3, 1, 1, 1], &[0x10, 9, 0x10, 0, 0, 0, 0, 0], &[7, 0x12]];
        for data in harmless {
            let mut nonces = issued(7);
            nonces.on_transport(data);
            assert!(nonces.accept(SimTime::ZERO, 7), "{data:?}");
        }
    }
}
