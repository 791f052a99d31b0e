//! Transfer of a motion library by a session, which waits for every answer.

use super::{Session, SessionError, ask_hello};
use crate::transfer::{Progress, Transfer, TransferError};
use rollwalk_bus::link::LinkBus;
use rollwalk_protocol::library::identity;

impl<B: LinkBus> Session<B> {
    /// Transfers, checks and activates a library. The controller must be disarmed.
    ///
    /// Calls `progress` after every block. Resumes an interrupted transfer of the same library.
    pub fn flash(
        &mut self,
        library: &[u8],
        mut progress: impl FnMut(Progress),
    ) -> Result<(), SessionError> {
        let mut transfer = Transfer::new(library, self.hello.max_block);
        while let Some(request) = transfer.request() {
            let wanted = |response| transfer.answer(response);
            let reply = self.exchange.respond_once(&request, transfer.timeout_us(), wanted)?;
            transfer.answered(reply).map_err(|error| match error {
                TransferError::Silent => self.exchange.silent("transfer"),
                TransferError::Refused(reply) => SessionError::LibraryRefused { reply },
            })?;
            progress(transfer.progress());
        }
        self.hello = ask_hello(&mut self.exchange)?;
        let found = self.hello.library;
        if found == identity(library) { Ok(()) } else { Err(SessionError::NotInUse { found }) }
    }
}
