//! Transfer of a library beside the operator's other work: one request in flight, the next one with its answer.

use super::log::Weight;
use super::{Operator, has_torque};
use crate::client::Client;
use crate::refusal::transfer_refusal;
use crate::transfer::{Transfer, TransferError};
use rollwalk_protocol::library::identity;
use rollwalk_protocol::wire::transport::Response;

/// A library on its way.
#[derive(Clone, Debug)]
pub(super) struct Flashing {
    transfer: Transfer<Vec<u8>>,
    /// Instant at which the request in flight or its answer counts as lost, µs.
    deadline_us: Option<u64>,
}

impl Flashing {
    /// The transfer.
    pub fn transfer(&self) -> &Transfer<Vec<u8>> {
        &self.transfer
    }

    /// Sends the request that is due. Returns why there is none any more, if the transfer has ended.
    fn poll(&mut self, now_us: u64, client: &mut Client) -> Option<Result<(), TransferError>> {
        if self.deadline_us.is_some_and(|deadline_us| now_us >= deadline_us)
            && let Err(why) = self.lost()
        {
            return Some(Err(why));
        }
        if self.deadline_us.is_some() || client.needs_session() {
            return None;
        }
        let Some(request) = self.transfer.request() else { return Some(Ok(())) };
        client.reset_transport();
        // Requests fit, and nothing else is on its way.
        let _ = client.request(&request);
        self.deadline_us = Some(now_us + self.transfer.timeout_us());
        None
    }

    fn lost(&mut self) -> Result<(), TransferError> {
        self.deadline_us = None;
        self.transfer.answered(None)
    }
}

impl Operator {
    /// Transfers a library to the controller and activates it, if the robot is disarmed. A transfer that is under way is
    /// replaced; one that was interrupted resumes where it stopped.
    pub fn flash(&mut self, now_us: u64, library: Vec<u8>) {
        match self.may_flash() {
            Ok(max_block) => {
                let transfer = Transfer::new(library, max_block);
                self.flashing = Some(Flashing { transfer, deadline_us: None });
                self.log.say(now_us, Weight::Note, "transferring the library");
            }
            Err(why) => {
                let text = format!("the library was not sent: {why}");
                self.log.say(now_us, Weight::Refused, text);
            }
        }
    }

    /// The longest block that the controller takes.
    fn may_flash(&self) -> Result<u16, String> {
        if let Some(why) = &self.bus_lost {
            return Err(format!("the bus is lost, {why}"));
        }
        if let Some(why) = self.mismatch() {
            return Err(why);
        }
        if self.link.state().is_none_or(has_torque) {
            return Err("the robot is not disarmed".into());
        }
        let hello = self.hello.ok_or("the controller has not said yet which robot it is")?;
        Ok(hello.max_block)
    }

    /// Sends what the transfer under way has to send.
    pub(super) fn poll_flashing(&mut self, now_us: u64) {
        let Some(flashing) = &mut self.flashing else { return };
        if let Some(ended) = flashing.poll(now_us, &mut self.client) {
            self.end_flashing(now_us, ended);
        }
    }

    /// Takes the answer of the transfer under way.
    pub(super) fn on_transfer_answer(&mut self, now_us: u64, response: Response) {
        let Some(flashing) = &mut self.flashing else { return };
        if let Some(reply) = flashing.transfer.answer(response) {
            flashing.deadline_us = None;
            if let Err(why) = flashing.transfer.answered(Some(reply)) {
                self.end_flashing(now_us, Err(why));
            }
        }
    }

    /// The message in flight, or its answer, is lost.
    pub(super) fn on_transfer_lost(&mut self, now_us: u64) {
        let Some(flashing) = &mut self.flashing else { return };
        if flashing.deadline_us.is_some()
            && let Err(why) = flashing.lost()
        {
            self.end_flashing(now_us, Err(why));
        }
    }

    /// Gives up a transfer, because the controller or the bus is not what it was.
    pub(super) fn break_off_flashing(&mut self, now_us: u64) {
        if self.flashing.take().is_some() {
            let text = "the transfer of the library is broken off; the next one resumes it";
            self.log.say(now_us, Weight::Warning, text);
        }
    }

    /// Compares the library that the controller has after a transfer with the one that was sent.
    pub(super) fn check_flashed(&mut self, now_us: u64, found: Option<u32>) {
        let Some(sent) = self.awaited.take() else { return };
        let (weight, text) = if found == Some(sent) {
            (Weight::Note, "the controller has it in use")
        } else {
            (Weight::Warning, "the controller has another library in use than the one sent")
        };
        self.log.say(now_us, weight, text);
    }

    fn end_flashing(&mut self, now_us: u64, ended: Result<(), TransferError>) {
        let Some(flashing) = self.flashing.take() else { return };
        let (weight, text) = match ended {
            Ok(()) => {
                self.awaited = identity(flashing.transfer.library());
                (Weight::Note, "the library is transferred".to_owned())
            }
            Err(TransferError::Silent) => {
                (Weight::Warning, "no answer to the transfer of the library: try again".to_owned())
            }
            Err(TransferError::Refused(reply)) => {
                let why = transfer_refusal(&reply);
                (Weight::Refused, format!("the controller refused the library: {why}"))
            }
        };
        self.log.say(now_us, weight, text);
        // Which library is in use has to be asked for in any case.
        (self.hello, self.ask_hello_us) = (None, now_us);
    }
}
