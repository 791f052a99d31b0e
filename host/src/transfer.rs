//! Transfer of a motion library without bus or clock: BEGIN, blocks, FINISH, ACTIVATE. The caller sends the requests and passes
//! the answers.
//!
//! A block that is lost or damaged is repeated at half the size. A lost frame of a long message loses the whole message, so on
//! a bad link short messages are more likely to arrive. Blocks grow again with every block that arrives. [`crate::session`]
//! waits for the answers, while [`crate::operator`] continues with other work.

use rollwalk_protocol::crc::file_digest;
use rollwalk_protocol::wire::transport::{MAX_BLOCK, Reply, Request, Response, TransferResult};

/// Timeout of a block, µs.
const BLOCK_TIMEOUT_US: u64 = 250_000;
/// Timeout of requests that erase or read memory, µs.
const MEMORY_TIMEOUT_US: u64 = 5_000_000;
/// Maximum number of transmissions of a request other than a block.
const REQUEST_SENDS: u32 = 5;
/// Smallest size of a block and step of its growth, bytes.
const SMALLEST_BLOCK: usize = 32;
/// Number of consecutive blocks without progress after which the transfer fails.
const LOST_BLOCKS: u32 = 16;

/// Progress of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of bytes that the controller has received.
    pub done: usize,
    /// Size of the library, bytes.
    pub total: usize,
}

/// Reason why a transfer ended early. The next transfer resumes at the same offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransferError {
    /// Missing answers of the controller.
    Silent,
    /// Refusal of the library or of a step of the transfer.
    Refused(Reply),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Begin,
    Blocks,
    Finish,
    Activate,
    Complete,
}

/// Transfer of a library to a controller, which must be disarmed.
#[derive(Clone, Debug)]
pub struct Transfer<L> {
    library: L,
    digest: u32,
    stage: Stage,
    /// Number of bytes that the controller has received.
    done: usize,
    /// Size of the next block, bytes.
    size: usize,
    /// Largest size of a block, bytes.
    largest: usize,
    /// Number of consecutive requests without progress.
    lost: u32,
}

impl<L: AsRef<[u8]>> Transfer<L> {
    /// Creates a transfer that has not begun, with blocks of at most `max_block` bytes, the limit in the controller's HELLO.
    pub fn new(library: L, max_block: u16) -> Self {
        let digest = file_digest(library.as_ref());
        let largest = usize::from(max_block).clamp(1, MAX_BLOCK);
        Self { library, digest, stage: Stage::Begin, done: 0, size: largest, largest, lost: 0 }
    }

    /// Library to transfer.
    pub fn library(&self) -> &[u8] {
        self.library.as_ref()
    }

    /// Progress of the transfer.
    pub fn progress(&self) -> Progress {
        Progress { done: self.done, total: self.library().len() }
    }

    /// Request to send; `None` once the library is active.
    pub fn request(&self) -> Option<Request<'_>> {
        let library = self.library();
        let Self { digest, .. } = *self;
        Some(match self.stage {
            Stage::Begin => Request::Begin { len: self.len(), digest },
            Stage::Blocks => {
                let bytes = &library[self.done..library.len().min(self.done + self.size)];
                Request::Block { offset: self.done as u32, bytes }
            }
            Stage::Finish => Request::Finish,
            Stage::Activate => Request::Activate { digest },
            Stage::Complete => return None,
        })
    }

    /// Time after which the request or its answer counts as lost, µs.
    pub fn timeout_us(&self) -> u64 {
        if self.stage == Stage::Blocks { BLOCK_TIMEOUT_US } else { MEMORY_TIMEOUT_US }
    }

    /// Returns the answer to the current request; `None` if the message is another one.
    ///
    /// An answer with `next` beyond the end of the library is damaged or belongs to another file, and counts as lost.
    pub fn answer(&self, response: Response) -> Option<Reply> {
        let Response::Reply(reply) = response else { return None };
        let kind = self.request()?.kind();
        let is_valid = !goes_on(reply.result) || reply.next <= self.len();
        (reply.request == kind && is_valid).then_some(reply)
    }

    /// Continues with the answer to the request; `None` means that the request or its answer was lost.
    ///
    /// # Errors
    /// Returns an error if the controller refuses, or if too many repetitions are unanswered.
    pub fn answered(&mut self, reply: Option<Reply>) -> Result<(), TransferError> {
        if self.stage == Stage::Blocks {
            return self.block_answered(reply);
        }
        let Some(reply) = reply else { return self.lose(REQUEST_SENDS) };
        if reply.result != TransferResult::Ok {
            return Err(TransferError::Refused(reply));
        }
        self.lost = 0;
        match self.stage {
            Stage::Begin => self.go_on_from(reply.next as usize),
            Stage::Finish => self.stage = Stage::Activate,
            _ => self.stage = Stage::Complete,
        }
        Ok(())
    }

    fn block_answered(&mut self, reply: Option<Reply>) -> Result<(), TransferError> {
        let next = match reply {
            None => self.done,
            Some(reply) if goes_on(reply.result) => reply.next as usize,
            Some(reply) => return Err(TransferError::Refused(reply)),
        };
        if next > self.done {
            self.lost = 0;
            self.size = self.largest.min(self.size + SMALLEST_BLOCK);
        } else {
            self.size = SMALLEST_BLOCK.min(self.largest).max(self.size / 2);
            self.lose(LOST_BLOCKS)?;
        }
        self.go_on_from(next);
        Ok(())
    }

    fn go_on_from(&mut self, next: usize) {
        self.done = next;
        self.stage = if next < self.library().len() { Stage::Blocks } else { Stage::Finish };
    }

    fn lose(&mut self, most: u32) -> Result<(), TransferError> {
        self.lost += 1;
        if self.lost == most { Err(TransferError::Silent) } else { Ok(()) }
    }

    fn len(&self) -> u32 {
        u32::try_from(self.library().len()).unwrap_or(u32::MAX)
    }
}

/// True if the transfer continues after this result, at the offset in the answer.
fn goes_on(result: TransferResult) -> bool {
    matches!(result, TransferResult::Ok | TransferResult::OutOfOrder | TransferResult::BadCrc)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIBRARY: [u8; 1000] = [7; 1000];

    fn reply(transfer: &Transfer<&[u8]>, result: TransferResult, next: u32) -> Option<Reply> {
        let request = transfer.request().expect("a request").kind();
        Some(Reply::new(request, result, next))
    }

    fn begun(from: u32) -> Transfer<&'static [u8]> {
        let mut transfer = Transfer::new(&LIBRARY[..], 200);
        let begun = reply(&transfer, TransferResult::Ok, from);
        transfer.answered(begun).expect("begun");
        transfer
    }

    fn block(transfer: &Transfer<&[u8]>) -> (u32, usize) {
        match transfer.request() {
            Some(Request::Block { offset, bytes }) => (offset, bytes.len()),
            other => panic!("no block: {other:?}"),
        }
    }

    #[test]
    fn a_transfer_resumes_where_the_controller_says_and_ends_with_activation() {
        let mut transfer = begun(900);
        assert_eq!(block(&transfer), (900, 100));
        for (next, kind) in [
            (1000, Request::Finish.kind()),
            (1000, Request::Activate { digest: transfer.digest }.kind()),
        ] {
            let answer = reply(&transfer, TransferResult::Ok, next);
            transfer.answered(answer).expect("goes on");
            assert_eq!(transfer.request().map(|request| request.kind()), Some(kind));
        }
        let answer = reply(&transfer, TransferResult::Ok, 1000);
        transfer.answered(answer).expect("complete");
        assert!(transfer.request().is_none());
        assert_eq!(transfer.progress(), Progress { done: 1000, total: 1000 });
    }

    #[test]
    fn lost_blocks_are_repeated_shorter_and_grow_again() {
        let mut transfer = begun(0);
        for size in [200, 100, 50, 32, 32] {
            assert_eq!(block(&transfer), (0, size));
            transfer.answered(None).expect("repeated");
        }
        let answer = reply(&transfer, TransferResult::Ok, 32);
        transfer.answered(answer).expect("arrived");
        assert_eq!(block(&transfer), (32, 64));
        let lost = (0..LOST_BLOCKS).map(|_| transfer.answered(None)).find(Result::is_err);
        assert_eq!(lost, Some(Err(TransferError::Silent)));
    }

    #[test]
    fn a_refusal_ends_it_and_what_belongs_to_another_file_is_no_answer() {
        let mut transfer = begun(0);
        let foreign = reply(&transfer, TransferResult::Ok, 1001).map(Response::Reply);
        assert_eq!(foreign.and_then(|response| transfer.answer(response)), None);
        let refused = reply(&transfer, TransferResult::WrongState, 0).expect("a reply");
        assert_eq!(transfer.answer(Response::Reply(refused)), Some(refused));
        assert_eq!(transfer.answered(Some(refused)), Err(TransferError::Refused(refused)));
    }
}
