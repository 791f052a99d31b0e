//! Transfer of a library during the operator's other work: one request at a time, the next one after its answer.

use super::log::Weight;
use super::{Operator, has_torque};
use crate::client::Client;
use crate::refusal::transfer_refusal;
use crate::transfer::{Transfer, TransferError};
use rollwalk_protocol::library::identity;
use rollwalk_protocol::wire::transport::Response;

/// Transfer of a library in progress.
#[derive(Clone, Debug)]
pub(super) struct Flashing {
    transfer: Transfer<Vec<u8>>,
    /// Time at which the request in flight or its answer counts as lost, µs.
    deadline_us: Option<u64>,
}

impl Flashing {
    /// Transfer in progress.
    pub fn transfer(&self) -> &Transfer<Vec<u8>> {
        &self.transfer
    }

    /// Sends the request that is due. Returns the result of the transfer if it has ended.
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
        // Requests fit, and no other message is in transmission.
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
    /// Transfers a library to the controller and activates it, if the robot is disarmed.
    ///
    /// Replaces a transfer in progress. Resumes an interrupted transfer of the same library.
    pub fn flash(&mut self, now_us: u64, library: Vec<u8>) {
        match self.may_flash() {
            Ok(max_block) => {
                let transfer = Transfer::new(library, max_block);
                self.flashing = Some(Flashing { transfer, deadline_us: None });
                self.log.notify(now_us, Weight::Note, "transferring the library");
            }
            Err(why) => {
                let text = format!("the library was not sent: {why}");
                self.log.notify(now_us, Weight::Refused, text);
            }
        }
    }

    /// Largest block that the controller accepts.
    ///
    /// # Errors
    /// Returns the reason why a transfer is impossible now.
    fn may_flash(&self) -> Result<u16, String> {
        if let Some(why) = &self.bus_lost {
            return Err(format!("the bus is lost ({why})"));
        }
        if let Some(why) = self.mismatch() {
            return Err(why);
        }
        if self.link.state().is_none_or(has_torque) {
            return Err("the robot is not disarmed; disarm it first".into());
        }
        let hello = self.hello.ok_or("the controller has not reported its identity yet")?;
        Ok(hello.max_block)
    }

    /// Sends the request of the transfer that is due.
    pub(super) fn poll_flashing(&mut self, now_us: u64) {
        let Some(flashing) = &mut self.flashing else { return };
        if let Some(ended) = flashing.poll(now_us, &mut self.client) {
            self.end_flashing(now_us, ended);
        }
    }

    /// Processes an answer to the transfer's request.
    pub(super) fn on_transfer_answer(&mut self, now_us: u64, response: Response) {
        let Some(flashing) = &mut self.flashing else { return };
        if let Some(reply) = flashing.transfer.answer(response) {
            flashing.deadline_us = None;
            if let Err(why) = flashing.transfer.answered(Some(reply)) {
                self.end_flashing(now_us, Err(why));
            }
        }
    }

    /// Handles the loss of a transfer message in either direction.
    pub(super) fn on_transfer_lost(&mut self, now_us: u64) {
        let Some(flashing) = &mut self.flashing else { return };
        if flashing.deadline_us.is_some()
            && let Err(why) = flashing.lost()
        {
            self.end_flashing(now_us, Err(why));
        }
    }

    /// Aborts a transfer, because the controller or the bus has changed.
    pub(super) fn break_off_flashing(&mut self, now_us: u64) {
        if self.flashing.take().is_some() {
            let text = "the transfer of the library was interrupted; the next transfer resumes it";
            self.log.notify(now_us, Weight::Warning, text);
        }
    }

    /// Checks that the controller uses the transferred library. `found` identifies its library.
    pub(super) fn check_flashed(&mut self, now_us: u64, found: Option<u32>) {
        let Some(sent) = self.awaited.take() else { return };
        let (weight, text) = if found == Some(sent) {
            (Weight::Note, "the controller uses the transferred library")
        } else {
            let text = "the controller uses another library than the transferred one; transfer the \
                library again";
            (Weight::Warning, text)
        };
        self.log.notify(now_us, weight, text);
    }

    fn end_flashing(&mut self, now_us: u64, ended: Result<(), TransferError>) {
        let Some(flashing) = self.flashing.take() else { return };
        let (weight, text) = match ended {
            Ok(()) => {
                self.awaited = identity(flashing.transfer.library());
                (Weight::Note, "the library is transferred".to_owned())
            }
            Err(TransferError::Silent) => {
                (Weight::Warning, "no answer to the transfer of the library; try again".to_owned())
            }
            Err(TransferError::Refused(reply)) => {
                let why = transfer_refusal(&reply);
                (Weight::Refused, format!("the controller refused the library: {why}"))
            }
        };
        self.log.notify(now_us, weight, text);
        // The library in use must be requested in any case.
        (self.hello, self.ask_hello_us) = (None, now_us);
    }
}
